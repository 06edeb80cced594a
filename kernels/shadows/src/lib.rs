//! Entry points of moment shadow mapping: the passes of a frame, and the single functions from
//! them as maps over rows of data.
//!
//! | pass | kernel |
//! | --- | --- |
//! | depth from the light, 4x multisampled | [`light_depth`](depth::light_depth) |
//! | resolve to four moments, quantised | [`resolve_unit`](resolve::resolve_unit), [`resolve_symmetric`](resolve::resolve_symmetric), [`resolve_plain`](resolve::resolve_plain) |
//! | separable filter, twice | [`blur`](blur::blur) |
//! | geometry from the camera | [`surface`](shade::surface) |
//! | shading | [`shade_hamburger`](shade::shade_hamburger), [`shade_hausdorff`](shade::shade_hausdorff), [`shade_variance`](shade::shade_variance), [`shade_pcf`](shade::shade_pcf), [`shade_pcf_gaussian`](shade::shade_pcf_gaussian) |
#![no_std]

#[cfg(not(target_arch = "spirv"))]
extern crate std;

pub mod blur;
pub mod bounds;
pub mod depth;
mod grid;
#[cfg(not(target_arch = "spirv"))]
pub mod inputs;
pub mod library;
pub mod moment_bounds;
pub mod points;
pub mod quantize;
pub mod resolve;
pub mod shade;
pub mod six;
pub mod trigonometric;

hankel_dsl::kernels![
    depth::light_depth,
    resolve::resolve_unit,
    resolve::resolve_symmetric,
    resolve::resolve_plain,
    blur::blur,
    shade::surface,
    shade::shade_hamburger,
    shade::shade_hausdorff,
    shade::shade_variance,
    shade::shade_pcf,
    shade::shade_pcf_gaussian,
    bounds::hamburger_4msm,
    bounds::hausdorff_4msm,
    bounds::vsm,
    moment_bounds::moment_bound_n1,
    moment_bounds::moment_bound_n2,
    moment_bounds::moment_bound_n3,
    moment_bounds::moment_bound_n4,
    moment_bounds::moment_bound_n5,
    moment_bounds::moment_bound_adjoint_n1,
    moment_bounds::moment_bound_adjoint_n2,
    moment_bounds::moment_bound_adjoint_n3,
    moment_bounds::moment_bound_adjoint_n4,
    moment_bounds::moment_bound_adjoint_n5,
    moment_bounds::moment_bound_compensated_n1,
    moment_bounds::moment_bound_compensated_n2,
    moment_bounds::moment_bound_compensated_n3,
    moment_bounds::moment_bound_compensated_n4,
    moment_bounds::moment_bound_compensated_n5,
    six::hamburger_6msm,
    trigonometric::trigonometric_4msm,
    trigonometric::trigonometric_moments,
    points::sparse_2point,
    points::degenerate_2point,
    points::degenerate_3point,
    quantize::quantize_4_unit,
    quantize::dequantize_4_unit,
    quantize::quantize_4_symmetric,
    quantize::dequantize_4_symmetric,
    quantize::quantize_6_unit,
    quantize::dequantize_6_unit,
    quantize::quantize_6_symmetric,
    quantize::dequantize_6_symmetric,
    quantize::pack_6,
    quantize::unpack_6,
    quantize::to_summed_area_4,
    quantize::from_summed_area_4,
    quantize::to_summed_area_6,
    quantize::from_summed_area_6,
];
