// Runs a kernel that was compiled as C++: reads what it is given, calls it for every invocation,
// writes the results. Linked to what is generated for the kernel.
//
//     PROGRAM plan inputs results
//
// The plan is words between white space; see `plan` in mod.rs. Anything that is wrong ends the
// program with words on the standard error and a status that is not 0.

#include "runner.h"

#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <ucontext.h>
#include <unistd.h>

namespace {

// ---- memory with nothing around it ----

// A slot's memory: it ends where pages begin that cannot be touched, so that an access beyond it
// faults; before it too.
struct Region {
    unsigned char *mapped;
    size_t mapped_bytes;
    // Pages that can be touched, and where the contents lie in them.
    unsigned char *open;
    size_t open_bytes;
    unsigned char *data;
    size_t bytes;
    const char *name;
};

constexpr size_t page = 4096;
// What a 32-bit index into elements of a few words reaches.
constexpr size_t reserved_after = size_t(64) << 30;
constexpr size_t reserved_before = size_t(1) << 30;
constexpr unsigned char canary = 0xA7;
constexpr unsigned max_regions = 128;
Region regions[max_regions];
unsigned region_count = 0;

const msl_call *current = nullptr;

Region *reserve(const char *name, size_t bytes, size_t align) {
    if (region_count == max_regions)
        msl_fail("too many buffers");
    Region &r = regions[region_count];
    // A plan's names begin with a mark, so that none is empty.
    r.name = name[0] == '_' ? name + 1 : name;
    r.bytes = bytes;
    r.open_bytes = (bytes + align + page - 1) / page * page;
    r.mapped_bytes = reserved_before + r.open_bytes + reserved_after;
    void *p = mmap(nullptr, r.mapped_bytes, PROT_NONE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE,
                   -1, 0);
    if (p == MAP_FAILED)
        msl_fail("no address space for a buffer and what must not be touched around it");
    r.mapped = static_cast<unsigned char *>(p);
    r.open = r.mapped + reserved_before;
    if (mprotect(r.open, r.open_bytes, PROT_READ | PROT_WRITE) != 0)
        msl_fail("no memory for a buffer");
    // As near to the end as the type's alignment lets it.
    size_t start = (r.open_bytes - bytes) / align * align;
    r.data = r.open + start;
    memset(r.open, canary, r.open_bytes);
    region_count++;
    return &r;
}

void make_read_only(const Region &r) {
    if (mprotect(r.open, r.open_bytes, PROT_READ) != 0)
        msl_fail("a buffer cannot be made read-only");
}

// What the pages hold beside the contents must be as it was.
void check_canaries(const Region &r) {
    for (size_t i = 0; i < r.open_bytes; i++) {
        unsigned char *at = r.open + i;
        if ((at < r.data || at >= r.data + r.bytes) && *at != canary) {
            fprintf(stderr, "write out of bounds: `%s` has %zu bytes, byte %td was written\n",
                    r.name, r.bytes, at - r.data);
            exit(1);
        }
    }
}

void release_all() {
    for (unsigned i = 0; i < region_count; i++) {
        check_canaries(regions[i]);
        munmap(regions[i].mapped, regions[i].mapped_bytes);
    }
    region_count = 0;
}

void on_fault(int signal, siginfo_t *info, void *) {
    if (signal == SIGILL || signal == SIGTRAP || signal == SIGFPE) {
        fprintf(stderr, "an operation without a defined result (overflow of a signed integer, "
                        "division by zero, a float beyond the integers, an index beyond an array)");
    } else {
        auto at = static_cast<unsigned char *>(info->si_addr);
        const Region *found = nullptr;
        for (unsigned i = 0; i < region_count; i++)
            if (at >= regions[i].mapped && at < regions[i].mapped + regions[i].mapped_bytes)
                found = &regions[i];
        if (found == nullptr)
            fprintf(stderr, "access to memory that is no buffer's");
        else if (at >= found->data && at < found->data + found->bytes)
            fprintf(stderr, "write to `%s`, which is only read", found->name);
        else
            fprintf(stderr, "access out of bounds: `%s` has %zu bytes, byte %td was touched",
                    found->name, found->bytes, at - found->data);
    }
    if (current != nullptr)
        fprintf(stderr, ", by thread (%u, %u, %u)", current->thread_position_in_grid[0],
                current->thread_position_in_grid[1], current->thread_position_in_grid[2]);
    fprintf(stderr, "\n");
    // Dies by the signal itself, once the instruction is met again.
    struct sigaction plain = {};
    plain.sa_handler = SIG_DFL;
    sigaction(signal, &plain, nullptr);
}

void watch_faults() {
    static unsigned char stack[1 << 16];
    stack_t other = {};
    other.ss_sp = stack;
    other.ss_size = sizeof stack;
    sigaltstack(&other, nullptr);
    struct sigaction action = {};
    action.sa_sigaction = on_fault;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK;
    const int signals[] = {SIGSEGV, SIGBUS, SIGILL, SIGTRAP, SIGFPE};
    for (int signal : signals)
        sigaction(signal, &action, nullptr);
}

} // namespace

extern "C" void msl_fail(const char *why) {
    fprintf(stderr, "%s\n", why);
    exit(1);
}

// ---- textures ----

enum Kind { floats, unorms, snorms, uints, sints };

namespace {
struct Format {
    Kind kind;
    unsigned channels;
    // Of a channel; 0 where all channels share a word.
    unsigned bytes;
    // Of channels that share a word.
    unsigned bits[4] = {};
};

// By its name in WebGPU: `rg16float`.
Format format_named(const char *name) {
    constexpr struct {
        const char *word;
        Kind kind;
    } kinds[] = {{"float", floats}, {"unorm", unorms}, {"snorm", snorms}, {"uint", uints}, {"sint", sints}};
    if (strcmp(name, "rgb10a2unorm") == 0)
        return {unorms, 4, 0, {10, 10, 10, 2}};
    if (strcmp(name, "rgb10a2uint") == 0)
        return {uints, 4, 0, {10, 10, 10, 2}};
    if (strcmp(name, "rg11b10ufloat") == 0)
        return {floats, 3, 0, {11, 11, 10, 0}};
    char letters[5], word[6];
    unsigned bits = 0;
    int read = 0;
    if (sscanf(name, "%4[rgba]%u%5[a-z]%n", letters, &bits, word, &read) == 3 && name[read] == 0)
        for (auto &k : kinds)
            if (strcmp(k.word, word) == 0)
                return {k.kind, unsigned(strlen(letters)), bits / 8};
    msl_fail("a texture of an unknown format");
    return {};
}
} // namespace

struct msl_texture {
    Format format;
    unsigned texel_bytes;
    // Of level 0.
    unsigned size[3];
    unsigned levels;
    unsigned layers;
    unsigned samples;
    unsigned char *texels;

    bool is_integer() const { return format.kind >= uints; }
    unsigned of_level(unsigned lod, int d) const {
        return lod < 32 && size[d] >> lod > 0 ? size[d] >> lod : 1;
    }
    // Texels of a layer of a level.
    size_t texels_of(unsigned lod) const {
        return size_t(of_level(lod, 0)) * of_level(lod, 1) * of_level(lod, 2);
    }
    bool has(const unsigned *at, unsigned layer, unsigned sample, unsigned lod) const {
        return lod < levels && layer < layers && sample < samples && at[0] < of_level(lod, 0) &&
               at[1] < of_level(lod, 1) && at[2] < of_level(lod, 2);
    }
    unsigned char *texel(const unsigned *at, unsigned layer, unsigned sample, unsigned lod) const {
        size_t before = 0;
        for (unsigned i = 0; i < lod; i++)
            before += texels_of(i) * layers;
        before += texels_of(lod) * layer;
        size_t i = (size_t(at[2]) * of_level(lod, 1) + at[1]) * of_level(lod, 0) + at[0];
        return texels + ((before + i) * samples + sample) * texel_bytes;
    }
};

namespace {
// To the nearest step, ties to even; NaN is 0.
int step(float x, float least, float steps) {
    if (!(x == x))
        return 0;
    return int(rintf((x < least ? least : x < 1 ? x : 1) * steps));
}

// An integer of that many bytes.
unsigned whole_at(const unsigned char *bytes, unsigned size, bool is_signed) {
    unsigned n = 0;
    memcpy(&n, bytes, size);
    unsigned shift = 32 - 8 * size;
    return is_signed ? unsigned(int(n << shift) >> shift) : n;
}

// Bits of a channel in the word of a texel, of which the first channel has the lowest.
unsigned below(const Format &f, unsigned channel) {
    unsigned all = 0;
    for (unsigned i = 0; i < channel; i++)
        all += f.bits[i];
    return all;
}
unsigned packed_at(const unsigned char *texel, const Format &f, unsigned channel) {
    unsigned word;
    memcpy(&word, texel, 4);
    return word >> below(f, channel) & ((1u << f.bits[channel]) - 1);
}
void put_packed(unsigned char *texel, const Format &f, unsigned channel, unsigned n) {
    unsigned word, most = (1u << f.bits[channel]) - 1, from = below(f, channel);
    memcpy(&word, texel, 4);
    word = (word & ~(most << from)) | (n & most) << from;
    memcpy(texel, &word, 4);
}

// A float without a sign, of which five bits are the exponent.
float unsigned_float(unsigned n, unsigned digits) {
    unsigned exponent = n >> digits, mantissa = n & ((1u << digits) - 1);
    float share = float(mantissa) / float(1u << digits);
    if (exponent == 31)
        return mantissa != 0 ? NAN : INFINITY;
    return exponent == 0 ? ldexpf(share, -14) : ldexpf(1 + share, int(exponent) - 15);
}
unsigned to_unsigned_float(float x, unsigned digits) {
    unsigned infinity = 31u << digits;
    if (!(x == x))
        return infinity + 1;
    if (x == INFINITY)
        return infinity;
    if (x <= 0)
        return 0;
    unsigned n;
    if (x < ldexpf(1, -14)) {
        n = unsigned(rintf(ldexpf(x, 14 + int(digits))));
    } else {
        unsigned wide, shift = 23 - digits;
        memcpy(&wide, &x, 4);
        wide -= 112u << 23;
        n = (wide + (1u << (shift - 1)) - 1 + (wide >> shift & 1)) >> shift;
    }
    return n < infinity ? n : infinity - 1;
}

float packed_channel_at(const unsigned char *texel, const Format &f, unsigned channel) {
    unsigned n = packed_at(texel, f, channel);
    if (f.kind == floats)
        return unsigned_float(n, f.bits[channel] - 5);
    return float(n) / float((1u << f.bits[channel]) - 1);
}
void put_packed_channel(unsigned char *texel, const Format &f, unsigned channel, float x) {
    unsigned n = f.kind == floats
                     ? to_unsigned_float(x, f.bits[channel] - 5)
                     : unsigned(step(x, 0, float((1u << f.bits[channel]) - 1)));
    put_packed(texel, f, channel, n);
}

float channel_at(const unsigned char *bytes, const Format &f) {
    switch (f.kind) {
    case floats:
        if (f.bytes == 2) {
            _Float16 h;
            memcpy(&h, bytes, 2);
            return float(h);
        }
        float x;
        memcpy(&x, bytes, 4);
        return x;
    case unorms:
        return float(whole_at(bytes, f.bytes, false)) / (f.bytes == 1 ? 255.0f : 65535.0f);
    case snorms:
        x = float(int(whole_at(bytes, f.bytes, true))) / (f.bytes == 1 ? 127.0f : 32767.0f);
        // The least number stands for -1 as well.
        return x < -1 ? -1 : x;
    default:
        msl_fail("a texture of integers is read as one of floats");
        return 0;
    }
}

void put_channel(unsigned char *bytes, const Format &f, float x) {
    if (f.kind == floats && f.bytes == 2) {
        auto h = static_cast<_Float16>(x);
        memcpy(bytes, &h, 2);
    } else if (f.kind == floats) {
        memcpy(bytes, &x, 4);
    } else {
        int n = f.kind == unorms ? step(x, 0, f.bytes == 1 ? 255.0f : 65535.0f)
                                 : step(x, -1, f.bytes == 1 ? 127.0f : 32767.0f);
        memcpy(bytes, &n, f.bytes);
    }
}

void load(const msl_texture &t, const unsigned *at, unsigned layer, unsigned sample, unsigned lod,
          float *out) {
    const unsigned char *texel = t.texel(at, layer, sample, lod);
    out[0] = out[1] = out[2] = 0;
    out[3] = 1;
    for (unsigned i = 0; i < t.format.channels; i++)
        out[i] = t.format.bytes == 0 ? packed_channel_at(texel, t.format, i)
                                     : channel_at(texel + i * t.format.bytes, t.format);
}
} // namespace

extern "C" {
unsigned msl_texture_size(const msl_texture *t, int axis) { return t->size[axis]; }
unsigned msl_texture_samples(const msl_texture *t) { return t->samples; }
unsigned msl_texture_levels(const msl_texture *t) { return t->levels; }
unsigned msl_texture_layers(const msl_texture *t) { return t->layers; }

void msl_load_float(const msl_texture *t, const unsigned *at, unsigned layer, unsigned sample,
                    unsigned lod, float *out) {
    if (t->has(at, layer, sample, lod))
        load(*t, at, layer, sample, lod, out);
    else
        out[0] = out[1] = out[2] = out[3] = 0;
}

void msl_load_uint(const msl_texture *t, const unsigned *at, unsigned layer, unsigned sample,
                   unsigned lod, unsigned *out) {
    if (!t->is_integer())
        msl_fail("a texture of floats is read as one of integers");
    out[0] = out[1] = out[2] = out[3] = 0;
    if (!t->has(at, layer, sample, lod))
        return;
    out[3] = 1;
    const unsigned char *texel = t->texel(at, layer, sample, lod);
    for (unsigned i = 0; i < t->format.channels; i++)
        out[i] = t->format.bytes == 0
                     ? packed_at(texel, t->format, i)
                     : whole_at(texel + i * t->format.bytes, t->format.bytes, t->format.kind == sints);
}

void msl_store_float(msl_texture *t, const unsigned *at, unsigned layer, unsigned lod,
                     const float *value) {
    if (t->is_integer())
        msl_fail("floats are written to a texture of integers");
    if (!t->has(at, layer, 0, lod))
        return;
    unsigned char *texel = t->texel(at, layer, 0, lod);
    for (unsigned i = 0; i < t->format.channels; i++)
        if (t->format.bytes == 0)
            put_packed_channel(texel, t->format, i, value[i]);
        else
            put_channel(texel + i * t->format.bytes, t->format, value[i]);
}

void msl_store_uint(msl_texture *t, const unsigned *at, unsigned layer, unsigned lod,
                    const unsigned *value) {
    if (!t->is_integer())
        msl_fail("integers are written to a texture of floats");
    if (!t->has(at, layer, 0, lod))
        return;
    unsigned char *texel = t->texel(at, layer, 0, lod);
    for (unsigned i = 0; i < t->format.channels; i++)
        if (t->format.bytes == 0)
            put_packed(texel, t->format, i, value[i]);
        else
            memcpy(texel + i * t->format.bytes, &value[i], t->format.bytes);
}
}

// ---- sampling, with weights in full precision, by the formulas of the Vulkan specification ----

namespace {
unsigned bits(unsigned flags, int at, unsigned count) { return flags >> at & ((1u << count) - 1); }

int64_t whole(float x) {
    if (!(x == x))
        return 0;
    constexpr float limit = 4611686018427387904.0f;
    return x >= limit ? int64_t(1) << 62 : x <= -limit ? -(int64_t(1) << 62) : int64_t(x);
}

unsigned wrap(int64_t i, unsigned size, unsigned mode) {
    auto n = int64_t(size);
    if (mode == 1)
        return unsigned(((i % n) + n) % n);
    if (mode == 2) {
        i = ((i % (2 * n)) + 2 * n) % (2 * n);
        return unsigned(i < n ? i : 2 * n - 1 - i);
    }
    return unsigned(i < 0 ? 0 : i >= n ? n - 1 : i);
}

// A face of a cube, and the direction's parts along it and across, by face: s, t, major.
void parts(const float *v, unsigned face, float *out) {
    switch (face) {
    case 0: out[0] = -v[2]; out[1] = -v[1]; out[2] = v[0]; break;
    case 1: out[0] = v[2]; out[1] = -v[1]; out[2] = -v[0]; break;
    case 2: out[0] = v[0]; out[1] = v[2]; out[2] = v[1]; break;
    case 3: out[0] = v[0]; out[1] = -v[2]; out[2] = -v[1]; break;
    case 4: out[0] = v[0]; out[1] = -v[1]; out[2] = v[2]; break;
    default: out[0] = -v[0]; out[1] = -v[1]; out[2] = -v[2];
    }
}

unsigned face_of(const float *v) {
    float x = fabsf(v[0]), y = fabsf(v[1]), z = fabsf(v[2]);
    if (z >= x && z >= y)
        return v[2] >= 0 ? 4 : 5;
    if (y >= x)
        return v[1] >= 0 ? 2 : 3;
    return v[0] >= 0 ? 0 : 1;
}

void direction(unsigned face, float s, float t, float *out) {
    const float all[6][3] = {{1, -t, -s}, {-1, -t, s}, {s, 1, t}, {s, -1, -t}, {s, -t, 1}, {-s, -t, -1}};
    memcpy(out, all[face], sizeof all[face]);
}

// What is made of a texel.
struct Reading {
    const float *reference;
    unsigned compare;
    void operator()(const float *texel, float *out) const {
        if (reference == nullptr) {
            memcpy(out, texel, 4 * sizeof(float));
            return;
        }
        float r = *reference, x = texel[0];
        const bool all[8] = {false, r < x, r == x, r <= x, r > x, r != x, r >= x, true};
        for (int i = 0; i < 4; i++)
            out[i] = all[compare - 1] ? 1 : 0;
    }
};

// The texels of a level around a place, and how much of the second in each direction.
struct Taps {
    const msl_texture &t;
    unsigned flags;
    unsigned lod;
    Reading reading;
    bool cube;
    unsigned face;
    unsigned layer;
    int64_t base[3];
    float weight[3];

    Taps(const msl_texture &texture, unsigned f, const msl_place &place, const float *reference,
         unsigned level, bool linear)
        : t(texture), flags(f), lod(level), reading{reference, bits(f, msl_compare, 4)},
          cube(place.cube), face(0), layer(place.layer) {
        if (t.samples != 1)
            msl_fail("a texture with several samples is sampled");
        if ((reference != nullptr) != (reading.compare != 0))
            msl_fail("a sampler that compares is used without a reference, or the other way round");
        float at[3] = {place.at[0], place.at[1], place.at[2]};
        int dimensions = place.dimensions;
        if (cube) {
            float on[3];
            face = face_of(place.at);
            parts(place.at, face, on);
            at[0] = on[0] / on[2] * 0.5f + 0.5f;
            at[1] = on[1] / on[2] * 0.5f + 0.5f;
            dimensions = 2;
        }
        unsigned layers = cube ? t.layers - 6 : t.layers - 1;
        if (layer > layers)
            layer = layers;
        for (int d = 0; d < 3; d++) {
            base[d] = 0;
            weight[d] = 0;
            unsigned size = t.of_level(lod, d);
            if (d >= dimensions || (d == 2 && size == 1))
                continue;
            float x = bits(flags, msl_pixels, 1) != 0 ? at[d] : at[d] * float(size);
            if (linear)
                x = x - 0.5f;
            float below = floorf(x);
            base[d] = whole(below) + place.offset[d];
            weight[d] = linear ? x - below : 0.0f;
            if (cube && !linear && base[d] >= size)
                base[d] = size - 1;
        }
    }

    // Whether there is such a texel: not beyond a cube's corner.
    bool tap(int dx, int dy, int dz, float *out) const {
        unsigned place[3], where;
        if (!find(dx, dy, dz, place, where))
            return false;
        float texel[4];
        load(t, place, where, 0, lod, texel);
        reading(texel, out);
        return true;
    }

    // Where such a texel is, if there is one, and in which layer.
    bool find(int dx, int dy, int dz, unsigned (&place)[3], unsigned &where) const {
        const int64_t at[3] = {base[0] + dx, base[1] + dy, base[2] + dz};
        place[0] = place[1] = place[2] = 0;
        where = layer;
        if (cube) {
            int64_t n = t.of_level(lod, 0);
            bool x = at[0] < 0 || at[0] >= n, y = at[1] < 0 || at[1] >= n;
            if (x && y)
                return false;
            place[0] = unsigned(at[0]);
            place[1] = unsigned(at[1]);
            unsigned on = face;
            if (x || y) {
                // Its middle lies on this face's plane.
                float to[3], there[3];
                direction(face, float(2 * at[0] + 1) / float(n) - 1, float(2 * at[1] + 1) / float(n) - 1,
                          to);
                on = face_of(to);
                parts(to, on, there);
                for (int d = 0; d < 2; d++) {
                    int64_t i = whole((there[d] / there[2] * 0.5f + 0.5f) * float(n));
                    place[d] = unsigned(i < 0 ? 0 : i >= n ? n - 1 : i);
                }
            }
            where += on;
        } else {
            for (int d = 0; d < 3; d++)
                place[d] = wrap(at[d], t.of_level(lod, d), bits(flags, msl_address + 2 * d, 2));
        }
        return true;
    }

    // Of (0, 0), (1, 0), (0, 1), (1, 1).
    void square(int dz, float (*out)[4]) const {
        float sum[4] = {};
        int missing = -1;
        for (int i = 0; i < 4; i++) {
            if (!tap(i & 1, i >> 1, dz, out[i])) {
                missing = i;
                continue;
            }
            for (int c = 0; c < 4; c++)
                sum[c] += out[i][c];
        }
        for (int c = 0; c < 4 && missing >= 0; c++)
            out[missing][c] = sum[c] / 3;
    }

    void slice(int dz, float *out) const {
        float v[4][4];
        square(dz, v);
        float x = weight[0], y = weight[1];
        for (int i = 0; i < 4; i++) {
            float near = v[0][i] * (1.0f - x) + v[1][i] * x;
            float far = v[2][i] * (1.0f - x) + v[3][i] * x;
            out[i] = near * (1.0f - y) + far * y;
        }
    }
};

void sample_level(const msl_texture &t, unsigned flags, const msl_place &place,
                  const float *reference, unsigned lod, bool linear, float *out) {
    Taps taps(t, flags, place, reference, lod, linear);
    if (!linear) {
        if (!taps.tap(0, 0, 0, out))
            msl_fail("the nearest texel of a cube is on no face");
        return;
    }
    taps.slice(0, out);
    float z = taps.weight[2];
    if (z == 0)
        return;
    float back[4];
    taps.slice(1, back);
    for (int i = 0; i < 4; i++)
        out[i] = out[i] * (1.0f - z) + back[i] * z;
}
} // namespace

extern "C" {
void msl_sample_float(const msl_texture *t, unsigned flags, const msl_place *place,
                      const float *reference, float lod, float *out) {
    bool linear = bits(flags, lod <= 0 ? msl_magnify : msl_minify, 1) != 0;
    unsigned mip = bits(flags, msl_mip, 2);
    auto most = float(t->levels - 1);
    if (mip == 0 || !(lod > 0))
        lod = 0;
    if (lod > most)
        lod = most;
    if (mip != 2) {
        sample_level(*t, flags, *place, reference, unsigned(ceilf(lod + 0.5f) - 1.0f), linear, out);
        return;
    }
    auto fine = unsigned(lod);
    float weight = lod - float(fine);
    sample_level(*t, flags, *place, reference, fine, linear, out);
    if (weight == 0)
        return;
    float coarse[4];
    sample_level(*t, flags, *place, reference, fine + 1, linear, coarse);
    for (int i = 0; i < 4; i++)
        out[i] = out[i] * (1.0f - weight) + coarse[i] * weight;
}

void msl_gather_float(const msl_texture *t, unsigned flags, const msl_place *place,
                      const float *reference, unsigned channel, float *out) {
    Taps around(*t, flags, *place, reference, 0, true);
    float v[4][4];
    around.square(0, v);
    const int order[4] = {2, 3, 1, 0};
    for (int i = 0; i < 4; i++)
        out[i] = v[order[i]][channel];
}

void msl_gather_uint(const msl_texture *t, unsigned flags, const msl_place *place,
                     unsigned channel, unsigned *out) {
    Taps around(*t, flags, *place, nullptr, 0, true);
    const int order[4] = {2, 3, 1, 0};
    for (int i = 0; i < 4; i++) {
        unsigned at[3], layer, texel[4] = {};
        if (around.find(order[i] & 1, order[i] >> 1, 0, at, layer))
            msl_load_uint(t, at, layer, 0, 0, texel);
        out[i] = texel[channel];
    }
}

float msl_lod(const msl_texture *t, const msl_place *place, const float *dx, const float *dy) {
    float longest = 0;
    const float *const both[2] = {dx, dy};
    for (const float *d : both) {
        float along[3] = {d[0], d[1], d[2]};
        if (place->cube) {
            float v[3], dv[3];
            unsigned face = face_of(place->at);
            parts(place->at, face, v);
            parts(d, face, dv);
            for (int i = 0; i < 2; i++)
                along[i] = 0.5f * (v[2] * dv[i] - v[i] * dv[2]) / (v[2] * v[2]);
            along[2] = 0;
        }
        float sum = 0;
        for (int i = 0; i < 3; i++)
            sum += along[i] * float(t->size[i]) * (along[i] * float(t->size[i]));
        longest = sum > longest ? sum : longest;
    }
    return log2f(sqrtf(longest));
}
}

// ---- invocations ----

namespace {
// Where a fragment that runs alone ends.
jmp_buf ends;
// The stage's invocations run in quads.
bool in_quads = false;

struct Fiber {
    ucontext_t context;
    msl_call call;
    // The barrier that it waits at; 0 for none.
    unsigned waits_at;
    // The operation of its SIMD-group that it waits at; 0 for none.
    unsigned waits_in_simd;
    // What it brings to an operation, and to the one before: others may still read that.
    unsigned char simd_values[2][16];
    unsigned simd_turn;
    bool done;
    float value[4];
};
ucontext_t scheduler;
Fiber *fibers = nullptr;
Fiber *running = nullptr;
unsigned char *stacks = nullptr;
constexpr size_t stack_bytes = size_t(1) << 18;
unsigned fiber_capacity = 0;
unsigned threads_of_workgroup = 0;

void fiber_main() {
    msl_invoke(&running->call);
    running->done = true;
    // Ends here: the scheduler never comes back.
    swapcontext(&running->context, &scheduler);
}

void make_fibers(unsigned count) {
    if (count <= fiber_capacity)
        return;
    fibers = static_cast<Fiber *>(calloc(count, sizeof(Fiber)));
    // The lowest page of each stack cannot be touched.
    void *p = mmap(nullptr, count * stack_bytes, PROT_READ | PROT_WRITE,
                   MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    if (fibers == nullptr || p == MAP_FAILED)
        msl_fail("no memory for the threads of a workgroup");
    stacks = static_cast<unsigned char *>(p);
    for (unsigned i = 0; i < count; i++)
        mprotect(stacks + i * stack_bytes, page, PROT_NONE);
    fiber_capacity = count;
}

// The threads of a SIMD-group from operation to operation, until they wait at a barrier or are done.
void run_simdgroup(const unsigned *order, unsigned count, unsigned start) {
    unsigned end = count - start < msl_simd_width ? count : start + msl_simd_width;
    for (;;) {
        for (unsigned i = start; i < end; i++)
            if (fibers[i].waits_in_simd != fibers[start].waits_in_simd) {
                fprintf(stderr,
                        "an operation of a SIMD-group that not all of its threads reach: thread %u "
                        "waits at line %u, thread %u at %u\n",
                        start, fibers[start].waits_in_simd, i, fibers[i].waits_in_simd);
                exit(1);
            }
        if (fibers[start].waits_in_simd == 0)
            return;
        for (unsigned i = 0; i < count; i++) {
            if (order[i] < start || order[i] >= end)
                continue;
            running = &fibers[order[i]];
            running->waits_in_simd = 0;
            current = &running->call;
            swapcontext(&scheduler, &running->context);
        }
    }
}

// The threads of a workgroup up to each barrier in turn, every time in another order: a result that
// needs a barrier that is not there is then a wrong one.
void run_workgroup(unsigned count) {
    static uint64_t state = 0x9E3779B97F4A7C15u;
    static unsigned *order = nullptr;
    static unsigned ordered = 0;
    if (ordered < count) {
        order = static_cast<unsigned *>(realloc(order, count * sizeof(unsigned)));
        if (order == nullptr)
            msl_fail("no memory for the threads of a workgroup");
        ordered = count;
    }
    threads_of_workgroup = count;
    for (unsigned i = 0; i < count; i++) {
        Fiber &f = fibers[i];
        f.done = false;
        f.waits_at = 0;
        f.waits_in_simd = 0;
        f.simd_turn = 0;
        getcontext(&f.context);
        f.context.uc_stack.ss_sp = stacks + i * stack_bytes + page;
        f.context.uc_stack.ss_size = stack_bytes - page;
        f.context.uc_link = &scheduler;
        makecontext(&f.context, fiber_main, 0);
    }
    for (;;) {
        for (unsigned i = 0; i < count; i++) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            unsigned j = unsigned((state >> 33) % (i + 1));
            order[i] = order[j];
            order[j] = i;
        }
        for (unsigned i = 0; i < count; i++) {
            running = &fibers[order[i]];
            running->waits_at = 0;
            current = &running->call;
            swapcontext(&scheduler, &running->context);
        }
        for (unsigned start = 0; start < count; start += msl_simd_width)
            run_simdgroup(order, count, start);
        current = nullptr;
        unsigned done = 0;
        for (unsigned i = 0; i < count; i++) {
            done += fibers[i].done ? 1 : 0;
            if (fibers[i].done != fibers[0].done || fibers[i].waits_at != fibers[0].waits_at) {
                fprintf(stderr,
                        "a barrier that not all threads reach: thread 0 of a workgroup is %s "
                        "(line %u), thread %u %s (line %u)\n",
                        fibers[0].done ? "done" : "at one", fibers[0].waits_at, i,
                        fibers[i].done ? "done" : "at one", fibers[i].waits_at);
                exit(1);
            }
        }
        if (done == count)
            return;
    }
}
} // namespace

extern "C" {
void msl_barrier(unsigned line) {
    if (running == nullptr)
        msl_fail("a barrier outside of a workgroup");
    Fiber *me = running;
    me->waits_at = line;
    swapcontext(&me->context, &scheduler);
}
void msl_simd_exchange(unsigned line, const void *value, unsigned bytes, msl_simd *all) {
    if (running == nullptr)
        msl_fail("an operation of a SIMD-group outside of a workgroup");
    Fiber *me = running;
    auto index = unsigned(me - fibers);
    unsigned start = index / msl_simd_width * msl_simd_width;
    unsigned turn = me->simd_turn++ & 1;
    memcpy(me->simd_values[turn], value, bytes);
    me->waits_in_simd = line;
    swapcontext(&me->context, &scheduler);
    all->lane = index - start;
    all->count = threads_of_workgroup - start < msl_simd_width ? threads_of_workgroup - start
                                                               : msl_simd_width;
    for (unsigned i = 0; i < all->count; i++)
        memcpy(all->values[i], fibers[start + i].simd_values[turn], 16);
}
bool msl_in_quad() { return in_quads; }
unsigned msl_exchange(unsigned line, const float *value, unsigned count, float (*all)[4]) {
    if (running == nullptr)
        msl_fail("a derivative outside of a quad");
    auto me = unsigned(running - fibers);
    memcpy(running->value, value, count * sizeof(float));
    msl_barrier(line);
    for (unsigned i = 0; i < 4; i++)
        memcpy(all[i], fibers[i].value, count * sizeof(float));
    msl_barrier(line);
    return me;
}
// It is a helper from there on, which writes nothing and returns nothing: it ends.
void msl_discard() {
    if (running == nullptr)
        longjmp(ends, 1);
    running->done = true;
    swapcontext(&running->context, &scheduler);
}
}

// ---- the plan ----

namespace {
FILE *plan_file = nullptr;

uint64_t number() {
    unsigned long long n = 0;
    if (fscanf(plan_file, "%llu", &n) != 1)
        msl_fail("the plan is cut off");
    return n;
}

void word(char (&text)[64]) {
    if (fscanf(plan_file, "%63s", text) != 1)
        msl_fail("the plan is cut off");
}

struct Slot {
    char name[64];
    // One of: buffer, sizes, texture, sampler, in, out.
    char kind[64];
    bool written;
    // Of a case.
    unsigned char *data;
    size_t bytes;
    msl_texture texture;
    unsigned sampler;
};

unsigned char *inputs = nullptr;
size_t input_bytes = 0;

const unsigned char *input(uint64_t offset, uint64_t bytes) {
    if (offset > input_bytes || bytes > input_bytes - offset)
        msl_fail("the inputs are shorter than the plan says");
    return inputs + offset;
}

size_t align_of(unsigned slot) {
    for (unsigned i = 0; i < msl_buffer_count; i++)
        if (msl_buffers[i].slot == slot)
            return msl_buffers[i].align;
    return 1;
}

void read_inputs(const char *path) {
    FILE *f = fopen(path, "rb");
    if (f == nullptr)
        msl_fail("the inputs cannot be opened");
    fseek(f, 0, SEEK_END);
    long bytes = ftell(f);
    rewind(f);
    input_bytes = bytes < 0 ? 0 : size_t(bytes);
    inputs = static_cast<unsigned char *>(malloc(input_bytes + 1));
    if (inputs == nullptr || fread(inputs, 1, input_bytes, f) != input_bytes)
        msl_fail("the inputs cannot be read");
    fclose(f);
}

// Reads what a case gives for a slot, and makes it.
void prepare(Slot &s, unsigned index, unsigned invocations) {
    s.bytes = 0;
    if (strcmp(s.kind, "sampler") == 0) {
        s.sampler = unsigned(number());
        return;
    }
    if (strcmp(s.kind, "out") == 0) {
        s.bytes = size_t(number()) * invocations;
        s.data = reserve(s.name, s.bytes, 1)->data;
        memset(s.data, 0, s.bytes);
        return;
    }
    if (strcmp(s.kind, "sizes") == 0) {
        // Bytes of other buffers.
        s.bytes = size_t(number()) * 4;
        Region *r = reserve(s.name, s.bytes, align_of(index));
        for (size_t i = 0; i < s.bytes; i += 4) {
            auto size = static_cast<unsigned>(number());
            memcpy(r->data + i, &size, 4);
        }
        s.data = r->data;
        make_read_only(*r);
        return;
    }
    if (strcmp(s.kind, "texture") == 0) {
        char name[64];
        word(name);
        s.texture.format = format_named(name);
        s.texture.texel_bytes =
            s.texture.format.bytes == 0 ? 4 : s.texture.format.channels * s.texture.format.bytes;
        size_t texels = 1;
        for (unsigned &size : s.texture.size) {
            size = unsigned(number());
            texels *= size;
        }
        s.texture.levels = unsigned(number());
        s.texture.layers = unsigned(number());
        s.texture.samples = unsigned(number());
        if (texels == 0 || s.texture.levels == 0 || s.texture.layers == 0 || s.texture.samples == 0)
            msl_fail("a texture without texels");
        texels = 0;
        for (unsigned level = 0; level < s.texture.levels; level++)
            texels += s.texture.texels_of(level) * s.texture.layers;
        uint64_t offset = number();
        s.bytes = number();
        if (s.bytes != texels * s.texture.samples * s.texture.texel_bytes)
            msl_fail("a texture's bytes are not as many as its texels need");
        Region *r = reserve(s.name, s.bytes, 1);
        memcpy(r->data, input(offset, s.bytes), s.bytes);
        s.data = s.texture.texels = r->data;
        if (!s.written)
            make_read_only(*r);
        return;
    }
    bool stream = strcmp(s.kind, "in") == 0;
    uint64_t stride = stream ? number() : 0;
    uint64_t offset = number();
    s.bytes = number();
    if (stream && s.bytes < stride * invocations)
        msl_fail("fewer values of a vertex or fragment than invocations");
    Region *r = reserve(s.name, s.bytes, align_of(index));
    memcpy(r->data, input(offset, s.bytes), s.bytes);
    s.data = r->data;
    if (!s.written)
        make_read_only(*r);
}

void *argument(Slot &s) {
    if (strcmp(s.kind, "sampler") == 0)
        return &s.sampler;
    if (strcmp(s.kind, "texture") == 0)
        return &s.texture;
    return s.data;
}

void run_compute(msl_call call, const unsigned *threads, const unsigned *groups) {
    unsigned count = threads[0] * threads[1] * threads[2];
    void *shared[64] = {};
    const Region *shared_regions[64] = {};
    if (msl_workgroup_count > 64)
        msl_fail("too many variables of workgroups");
    for (unsigned i = 0; i < msl_workgroup_count; i++) {
        shared_regions[i] =
            reserve("threadgroup memory", msl_workgroup[i].size, msl_workgroup[i].align);
        shared[i] = shared_regions[i]->data;
    }
    call.workgroup = shared;
    for (int d = 0; d < 3; d++) {
        call.threads_per_threadgroup[d] = threads[d];
        call.threadgroups_per_grid[d] = groups[d];
        call.threads_per_grid[d] = threads[d] * groups[d];
    }
    if (msl_has_barriers)
        make_fibers(count);
    unsigned g[3], t[3];
    for (g[2] = 0; g[2] < groups[2]; g[2]++)
        for (g[1] = 0; g[1] < groups[1]; g[1]++)
            for (g[0] = 0; g[0] < groups[0]; g[0]++) {
                // It begins with anything: here with what is unlikely to do.
                for (unsigned i = 0; i < msl_workgroup_count; i++)
                    memset(shared[i], 0xFF, msl_workgroup[i].size);
                unsigned index = 0;
                for (t[2] = 0; t[2] < threads[2]; t[2]++)
                    for (t[1] = 0; t[1] < threads[1]; t[1]++)
                        for (t[0] = 0; t[0] < threads[0]; t[0]++) {
                            for (int d = 0; d < 3; d++) {
                                call.threadgroup_position_in_grid[d] = g[d];
                                call.thread_position_in_threadgroup[d] = t[d];
                                call.thread_position_in_grid[d] = g[d] * threads[d] + t[d];
                            }
                            call.thread_index_in_threadgroup[0] = index;
                            call.thread_index_in_simdgroup[0] = index % msl_simd_width;
                            call.simdgroup_index_in_threadgroup[0] = index / msl_simd_width;
                            call.threads_per_simdgroup[0] = msl_simd_width;
                            call.simdgroups_per_threadgroup[0] =
                                (count + msl_simd_width - 1) / msl_simd_width;
                            if (msl_has_barriers) {
                                fibers[index].call = call;
                            } else {
                                current = &call;
                                msl_invoke(&call);
                            }
                            index++;
                        }
                current = nullptr;
                if (msl_has_barriers)
                    run_workgroup(count);
            }
}

// Fragments lie in rows of so many, as in every column of the matrix.
constexpr unsigned columns = 64;

void place(msl_call &call, unsigned x, unsigned y) {
    call.coord[0] = float(x) + 0.5f;
    call.coord[1] = float(y) + 0.5f;
    call.coord[2] = 0;
    call.coord[3] = 1;
}

// A vertex or a fragment without a quad.
void run_alone(const msl_call &call) {
    current = &call;
    if (setjmp(ends) == 0)
        msl_invoke(&call);
}

// What helpers are given: what is written is a copy, as helpers write nothing.
struct Aside {
    Slot *slots;
    void **arguments;
};

void prepare_aside(Aside &aside, const Slot *slots, unsigned count) {
    for (unsigned i = 0; i < count; i++) {
        Slot &s = aside.slots[i] = slots[i];
        if (s.written && strcmp(s.kind, "out") != 0)
            s.data = s.texture.texels = reserve(s.name, s.bytes, align_of(i))->data;
        aside.arguments[i] = argument(s);
    }
}

// A fragment and its three neighbours, which have its varyings, return nothing and write nothing.
void run_quad(msl_call call, unsigned i, const Slot *slots, unsigned count, const Aside &aside) {
    unsigned x = i % columns, y = i / columns;
    unsigned own = (x & 1) | (y & 1) << 1;
    for (unsigned s = 0; s < count; s++)
        if (aside.slots[s].data != slots[s].data)
            memcpy(aside.slots[s].data, slots[s].data, slots[s].bytes);
    void *const *arguments = call.slots;
    make_fibers(4);
    for (unsigned lane = 0; lane < 4; lane++) {
        place(call, (x & ~1u) | (lane & 1), (y & ~1u) | lane >> 1);
        call.helper = lane != own;
        call.slots = call.helper ? aside.arguments : arguments;
        fibers[lane].call = call;
    }
    run_workgroup(4);
    running = nullptr;
}
} // namespace

int main(int argc, char **argv) {
    if (argc != 4)
        msl_fail("arguments: plan inputs results");
    watch_faults();
    read_inputs(argv[2]);
    plan_file = fopen(argv[1], "r");
    FILE *results = fopen(argv[3], "wb");
    if (plan_file == nullptr || results == nullptr)
        msl_fail("the plan or the results cannot be opened");
    char stage[64];
    word(stage);
    unsigned threads[3];
    for (unsigned &n : threads)
        n = unsigned(number());
    auto slot_count = unsigned(number());
    auto cases = number();
    auto slots = static_cast<Slot *>(calloc(slot_count + 1, sizeof(Slot)));
    auto arguments = static_cast<void **>(calloc(slot_count + 1, sizeof(void *)));
    Aside aside = {static_cast<Slot *>(calloc(slot_count + 1, sizeof(Slot))),
                   static_cast<void **>(calloc(slot_count + 1, sizeof(void *)))};
    if (slots == nullptr || arguments == nullptr || aside.slots == nullptr ||
        aside.arguments == nullptr)
        msl_fail("no memory for the plan");
    for (unsigned i = 0; i < slot_count; i++) {
        word(slots[i].name);
        word(slots[i].kind);
        slots[i].written = number() != 0;
    }
    for (uint64_t c = 0; c < cases; c++) {
        auto invocations = unsigned(number());
        unsigned groups[3];
        for (unsigned &n : groups)
            n = unsigned(number());
        for (unsigned i = 0; i < slot_count; i++) {
            prepare(slots[i], i, invocations);
            arguments[i] = argument(slots[i]);
        }
        msl_call call = {};
        call.slots = arguments;
        if (strcmp(stage, "compute") == 0) {
            run_compute(call, threads, groups);
        } else {
            bool quads = strcmp(stage, "fragment") == 0 && msl_has_derivatives;
            in_quads = quads;
            if (quads)
                prepare_aside(aside, slots, slot_count);
            for (unsigned i = 0; i < invocations; i++) {
                call.invocation[0] = i;
                // For the words of a fault.
                call.thread_position_in_grid[0] = i;
                if (quads) {
                    run_quad(call, i, slots, slot_count, aside);
                    continue;
                }
                place(call, i % columns, i / columns);
                run_alone(call);
            }
            current = nullptr;
        }
        for (unsigned i = 0; i < slot_count; i++)
            if (slots[i].written && fwrite(slots[i].data, 1, slots[i].bytes, results) !=
                                        slots[i].bytes)
                msl_fail("the results cannot be written");
        release_all();
    }
    if (fclose(results) != 0)
        msl_fail("the results cannot be written");
    return 0;
}
