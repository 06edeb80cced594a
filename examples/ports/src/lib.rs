//! Shaders that engines have, as kernels: one file each, written from the published algorithms. Take
//! the file that you need. `README.md` shows what each costs beside the same shader in WGSL by hand.
#![no_std]

#[cfg(not(target_arch = "spirv"))]
extern crate std;

pub mod bloom;
pub mod compaction;
pub mod fxaa;
pub mod gbuffer;
pub mod histogram;
pub mod marching_cubes;
pub mod matrix;
pub mod particles;
pub mod path;
pub mod reflection;
pub mod shadow;
pub mod sky;
pub mod sort;
pub mod ssao;

hankel_dsl::kernels![
    matrix::matrix_product,
    sort::scan_blocks,
    sort::scan_add,
    sort::sort_count,
    sort::sort_scatter,
    histogram::histogram,
    compaction::compact_above,
    particles::particles_step,
    marching_cubes::marching_cubes,
    path::path_trace,
    sky::sky_model,
    sky::sky,
    fxaa::fxaa,
    ssao::ssao,
    ssao::ssao_blur,
    bloom::bloom_bright,
    bloom::bloom_down,
    bloom::bloom_up,
    bloom::bloom_composite,
    gbuffer::gbuffer_vertex,
    gbuffer::gbuffer_fragment,
    reflection::reflection_vertex,
    reflection::reflection,
    shadow::shadow_vertex,
    shadow::shadow_lit,
];
