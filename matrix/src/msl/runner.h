// Between the three parts of a program that runs one kernel: the stand-in for Metal's library, what
// is generated for the kernel, and runner.cpp. Nothing here needs another header.
#ifndef MSL_RUNNER
#define MSL_RUNNER

// One invocation: what it is given for each slot, and where it is.
struct msl_call {
    // Of a buffer its memory, of a texture a `msl_texture`, of a sampler its flags, of a vertex's or
    // fragment's own values the array of all of them.
    void *const *slots;
    void *const *workgroup;
    unsigned thread_position_in_grid[3];
    unsigned thread_position_in_threadgroup[3];
    unsigned threadgroup_position_in_grid[3];
    unsigned threads_per_threadgroup[3];
    unsigned threadgroups_per_grid[3];
    unsigned threads_per_grid[3];
    unsigned thread_index_in_threadgroup[3];
    unsigned thread_index_in_simdgroup[3];
    unsigned simdgroup_index_in_threadgroup[3];
    unsigned threads_per_simdgroup[3];
    unsigned simdgroups_per_threadgroup[3];
    // Of a vertex or fragment.
    unsigned invocation[3];
    unsigned zero[3];
    // Of a fragment: its pixel's centre, its depth, and 1 / w.
    float coord[4];
    // It runs only for the derivatives of another one.
    bool helper;
};

// A parameter that is memory: which slot, or which of the workgroup's; its type's size and alignment.
struct msl_memory {
    unsigned slot;
    unsigned long size;
    unsigned long align;
};

// Flags of a sampler. Numbers of filters: 0 nearest, 1 linear; between levels 0 none, 1 nearest,
// 2 linear; of address modes: 0 clamp to edge, 1 repeat, 2 mirrored repeat; of comparisons, 0 for none:
// never, less, equal, less or equal, greater, not equal, greater or equal, always.
enum {
    msl_magnify = 0,
    msl_minify = 1,
    msl_mip = 2,
    msl_address = 4, // Two bits for each of u, v, w.
    msl_compare = 10,
    msl_pixels = 14,
};

// Where a texture is sampled: coordinates in a layer, or a direction in a cube that begins at one.
struct msl_place {
    int dimensions;
    bool cube;
    float at[3];
    unsigned layer;
    int offset[3];
};

// Threads of a SIMD-group: Apple's number.
enum { msl_simd_width = 32 };
// What the threads of a SIMD-group bring to an operation: up to 16 bytes each.
struct msl_simd {
    unsigned char values[msl_simd_width][16];
    // Threads that there are, and which of them this one is.
    unsigned count;
    unsigned lane;
};

struct msl_texture;

extern "C" {
// Generated for the kernel.
extern const msl_memory msl_buffers[];
extern const unsigned msl_buffer_count;
extern const msl_memory msl_workgroup[];
extern const unsigned msl_workgroup_count;
extern const bool msl_has_barriers;
extern const bool msl_has_derivatives;
void msl_invoke(const msl_call *call);

// For the library.
unsigned msl_texture_size(const msl_texture *texture, int axis);
unsigned msl_texture_samples(const msl_texture *texture);
unsigned msl_texture_levels(const msl_texture *texture);
unsigned msl_texture_layers(const msl_texture *texture);
// A texel; zero outside.
void msl_load_float(const msl_texture *texture, const unsigned *at, unsigned layer, unsigned sample,
                    unsigned lod, float *out);
void msl_load_uint(const msl_texture *texture, const unsigned *at, unsigned layer, unsigned sample,
                   unsigned lod, unsigned *out);
// Does nothing outside.
void msl_store_float(msl_texture *texture, const unsigned *at, unsigned layer, unsigned lod,
                     const float *value);
void msl_store_uint(msl_texture *texture, const unsigned *at, unsigned layer, unsigned lod,
                    const unsigned *value);
// At a level of detail; with a reference, its comparison.
void msl_sample_float(const msl_texture *texture, unsigned flags, const msl_place *place,
                      const float *reference, float lod, float *out);
// The four texels that a linear filter reads, in the order in which Metal gathers them.
void msl_gather_float(const msl_texture *texture, unsigned flags, const msl_place *place,
                      const float *reference, unsigned channel, float *out);
void msl_gather_uint(const msl_texture *texture, unsigned flags, const msl_place *place,
                     unsigned channel, unsigned *out);
// The level of detail of derivatives of the coordinates.
float msl_lod(const msl_texture *texture, const msl_place *place, const float *dx, const float *dy);
// Waits for the workgroup's other threads. `line` tells one barrier from another.
__attribute__((convergent)) void msl_barrier(unsigned line);
// Waits for the other threads of the SIMD-group, and gives the values of all of them.
__attribute__((convergent)) void msl_simd_exchange(unsigned line, const void *value, unsigned bytes,
                                                   msl_simd *all);
// Whether it runs in a quad: what samples without a level elsewhere takes level 0.
bool msl_in_quad();
// The value of each fragment of a quad, of up to four components; gives which of them this one is.
unsigned msl_exchange(unsigned line, const float *value, unsigned count, float (*all)[4]);
// What this fragment returns is dropped.
void msl_discard();
[[noreturn]] void msl_fail(const char *why);
}

#endif
