//! Entry points of moment shadow mapping: the passes of a frame, and the single functions from
//! them as maps over rows of data.
//!
//! | pass | kernel |
//! | --- | --- |
//! | depth from the light | [`light_depth`](depth::light_depth) |
//! | for image passes that are drawn: a triangle over all pixels | [`full_screen`](depth::full_screen) |
//! | resolve to four moments, quantised | [`resolve_unit`](resolve::resolve_unit), [`resolve_symmetric`](resolve::resolve_symmetric), [`resolve_plain`](resolve::resolve_plain) |
//! | to six | [`resolve_symmetric_6`](six::resolve_symmetric_6), [`resolve_plain_6`](six::resolve_plain_6) |
//! | to six in words | [`resolve_packed_10`](packed::resolve_packed_10), [`resolve_packed_16`](packed::resolve_packed_16) |
//! | to trigonometric ones | [`resolve_trigonometric_unorm`](trigonometric::resolve_trigonometric_unorm), [`resolve_trigonometric_plain`](trigonometric::resolve_trigonometric_plain) |
//! | to eight and ten | [`resolve_plain_8`](moment_maps::resolve_plain_8), [`resolve_plain_10`](moment_maps::resolve_plain_10) |
//! | to terms of Fourier series | [`resolve_convolution_rgba8unorm`](convolution::resolve_convolution_rgba8unorm), [`resolve_convolution_rgba16unorm`](convolution::resolve_convolution_rgba16unorm), [`resolve_convolution_8_rgba8unorm`](convolution::resolve_convolution_8_rgba8unorm), [`resolve_convolution_8_rgba16unorm`](convolution::resolve_convolution_8_rgba16unorm) |
//! | to mean and mean square | [`resolve_variance`](variance::resolve_variance) |
//! | to exponentials | [`resolve_esm`](exponential::resolve_esm), [`resolve_evsm`](exponential::resolve_evsm), [`resolve_positive_evsm`](exponential::resolve_positive_evsm) |
//! | translucent casters, blended | [`translucent`](translucent::translucent), [`translucent_moments`](translucent::translucent_moments) twice, [`resolve_translucent_unit`](translucent::resolve_translucent_unit), [`resolve_translucent_symmetric`](translucent::resolve_translucent_symmetric), [`resolve_translucent_plain`](translucent::resolve_translucent_plain) |
//! | and six moments of them | [`translucent_moments_6`](translucent::translucent_moments_6) twice, [`resolve_translucent_symmetric_6`](translucent::resolve_translucent_symmetric_6), [`resolve_translucent_plain_6`](translucent::resolve_translucent_plain_6), [`resolve_translucent_packed_10`](translucent::resolve_translucent_packed_10), [`resolve_translucent_packed_16`](translucent::resolve_translucent_packed_16) |
//! | and two | [`translucent_variance`](variance::translucent_variance), [`resolve_translucent_variance`](variance::resolve_translucent_variance) |
//! | or hashed | [`stochastic_depths`](translucent::stochastic_depths) |
//! | and what is seen through them | [`tint`](translucent::tint), [`tinted`](translucent::tinted) |
//! | separable filter, twice | [`blur`](blur::blur), [`blur_rgba8unorm`](blur::blur_rgba8unorm), [`blur_rgba16float`](blur::blur_rgba16float), [`blur_rg16unorm`](blur::blur_rg16unorm), [`blur_rg16float`](blur::blur_rg16float), [`blur_rg32float`](blur::blur_rg32float), [`blur_r32float`](blur::blur_r32float), [`blur_packed_10`](packed::blur_packed_10), [`blur_packed_16`](packed::blur_packed_16) |
//! | mip levels | [`halve`](mips::halve), [`halve_rgba8unorm`](mips::halve_rgba8unorm), [`halve_rgba16float`](mips::halve_rgba16float), [`halve_rg16unorm`](mips::halve_rg16unorm), [`halve_rg16float`](mips::halve_rg16float), [`halve_rg32float`](mips::halve_rg32float), [`halve_r32float`](mips::halve_r32float) |
//! | summed-area tables of moments | [`resolve_summed`](soft::resolve_summed), [`halve_summed`](soft::halve_summed) for each level after the first, [`prefix_sums`](soft::prefix_sums) twice |
//! | of six | [`resolve_summed_6`](soft::resolve_summed_6), [`halve_summed_6`](soft::halve_summed_6), [`prefix_sums_6`](soft::prefix_sums_6) |
//! | tiles that casters come near | [`tile_depths`](tiles::tile_depths), [`tile_list`](tiles::tile_list); over them [`resolve_symmetric_tiles`](tiles::resolve_symmetric_tiles), [`blur_tiles`](tiles::blur_tiles) |
//! | geometry from the camera | [`surface`](shade::surface), [`surface_with_plane`](mips::surface_with_plane) |
//! | shading | [`shade_hamburger`](shade::shade_hamburger), [`shade_hausdorff`](shade::shade_hausdorff), [`shade_variance`](variance::shade_variance), [`shade_pcf`](shade::shade_pcf), [`shade_pcf_gaussian`](shade::shade_pcf_gaussian), [`shade_hamburger_6`](six::shade_hamburger_6), [`shade_trigonometric`](trigonometric::shade_trigonometric), [`shade_esm`](exponential::shade_esm), [`shade_evsm`](exponential::shade_evsm), [`shade_convolution`](convolution::shade_convolution), [`shade_convolution_8`](convolution::shade_convolution_8), [`shade_moments_4`](moment_maps::shade_moments_4), [`shade_moments_4_compensated`](moment_maps::shade_moments_4_compensated), [`shade_moments_6`](moment_maps::shade_moments_6), [`shade_moments_6_compensated`](moment_maps::shade_moments_6_compensated), [`shade_moments_8`](moment_maps::shade_moments_8), [`shade_moments_8_compensated`](moment_maps::shade_moments_8_compensated), [`shade_moments_10`](moment_maps::shade_moments_10), [`shade_moments_10_compensated`](moment_maps::shade_moments_10_compensated), [`shade_packed_10`](packed::shade_packed_10), [`shade_packed_16`](packed::shade_packed_16), [`shade_soft`](soft::shade_soft), [`shade_soft_6`](soft::shade_soft_6), [`shade_vssm`](soft::shade_vssm), [`shade_pcss`](soft::shade_pcss), [`shade_hamburger_tiles`](tiles::shade_hamburger_tiles), [`shade_pcf_gaussian_tiles`](tiles::shade_pcf_gaussian_tiles), [`shade_stochastic`](translucent::shade_stochastic) |
//! | with mip levels | [`shade_hamburger_mips`](shade::shade_hamburger_mips), [`shade_hausdorff_mips`](shade::shade_hausdorff_mips), [`shade_variance_mips`](variance::shade_variance_mips), [`shade_hamburger_6_mips`](six::shade_hamburger_6_mips), [`shade_trigonometric_mips`](trigonometric::shade_trigonometric_mips), [`shade_esm_mips`](exponential::shade_esm_mips), [`shade_evsm_mips`](exponential::shade_evsm_mips), [`shade_convolution_mips`](convolution::shade_convolution_mips), [`shade_convolution_8_mips`](convolution::shade_convolution_8_mips), [`shade_moments_4_mips`](moment_maps::shade_moments_4_mips), [`shade_moments_4_compensated_mips`](moment_maps::shade_moments_4_compensated_mips), [`shade_moments_6_mips`](moment_maps::shade_moments_6_mips), [`shade_moments_6_compensated_mips`](moment_maps::shade_moments_6_compensated_mips), [`shade_moments_8_mips`](moment_maps::shade_moments_8_mips), [`shade_moments_8_compensated_mips`](moment_maps::shade_moments_8_compensated_mips), [`shade_moments_10_mips`](moment_maps::shade_moments_10_mips), [`shade_moments_10_compensated_mips`](moment_maps::shade_moments_10_compensated_mips) |
//! | pictures of several lights | [`sum_lights`](shade::sum_lights) |
//! | single scattering, marched | [`scatter_march`](scattering::scatter_march), [`scatter_march_spot`](scattering::scatter_march_spot) |
//! | prefiltered | [`rectify`](scattering::rectify), [`prefix_means`](scattering::prefix_means), [`scatter_prefiltered`](scattering::scatter_prefiltered), [`scatter_prefiltered_6`](scattering::scatter_prefiltered_6) |
//!
//! Kernels that look at samples have a counterpart for textures of one sample in each texel, with `_single` after the
//! first word of the name: `resolve_single_unit`, `shade_single_pcf`.
//!
//! Passes that give a texel for each index have a fragment form, too, if their `#[kernel]` says `forms(fragment)`:
//! `NAME_fragment`, one for all formats.
#![no_std]

#[cfg(not(target_arch = "spirv"))]
extern crate std;

#[macro_use]
mod filtered;
#[macro_use]
mod samples;

pub mod blur;
pub mod bounds;
pub mod canonical;
pub mod convolution;
pub mod depth;
pub mod exponential;
mod grid;
#[cfg(not(target_arch = "spirv"))]
pub mod inputs;
pub mod library;
pub mod mips;
pub mod moment_bounds;
pub mod moment_maps;
pub mod packed;
pub mod points;
pub mod quantize;
pub mod resolve;
pub mod scattering;
pub mod shade;
pub mod six;
pub mod soft;
pub mod tiles;
pub mod translucent;
pub mod trigonometric;
pub mod variance;

hankel_dsl::kernels![
    depth::light_depth,
    depth::full_screen,
    resolve::resolve_unit,
    resolve::resolve_single_unit,
    resolve::resolve_symmetric,
    resolve::resolve_single_symmetric,
    resolve::resolve_plain,
    resolve::resolve_single_plain,
    six::resolve_symmetric_6,
    six::resolve_single_symmetric_6,
    six::resolve_plain_6,
    six::resolve_single_plain_6,
    trigonometric::resolve_trigonometric_unorm,
    trigonometric::resolve_single_trigonometric_unorm,
    trigonometric::resolve_trigonometric_plain,
    trigonometric::resolve_single_trigonometric_plain,
    moment_maps::resolve_plain_8,
    moment_maps::resolve_single_plain_8,
    moment_maps::resolve_plain_10,
    moment_maps::resolve_single_plain_10,
    convolution::resolve_convolution_rgba8unorm,
    convolution::resolve_single_convolution_rgba8unorm,
    convolution::resolve_convolution_rgba16unorm,
    convolution::resolve_single_convolution_rgba16unorm,
    convolution::resolve_convolution_8_rgba8unorm,
    convolution::resolve_single_convolution_8_rgba8unorm,
    convolution::resolve_convolution_8_rgba16unorm,
    convolution::resolve_single_convolution_8_rgba16unorm,
    exponential::resolve_esm,
    exponential::resolve_single_esm,
    exponential::resolve_evsm,
    exponential::resolve_single_evsm,
    exponential::resolve_positive_evsm,
    exponential::resolve_single_positive_evsm,
    variance::resolve_variance,
    variance::resolve_single_variance,
    blur::blur,
    blur::blur_rgba8unorm,
    blur::blur_rgba16float,
    blur::blur_rg16unorm,
    blur::blur_rg16float,
    blur::blur_rg32float,
    blur::blur_r32float,
    packed::resolve_packed_10,
    packed::resolve_single_packed_10,
    packed::resolve_packed_16,
    packed::resolve_single_packed_16,
    packed::blur_packed_10,
    packed::blur_packed_16,
    mips::halve,
    mips::halve_rgba8unorm,
    mips::halve_rgba16float,
    mips::halve_rg16unorm,
    mips::halve_rg16float,
    mips::halve_rg32float,
    mips::halve_r32float,
    shade::surface,
    mips::surface_with_plane,
    shade::shade_hamburger,
    shade::shade_hausdorff,
    variance::shade_variance,
    shade::shade_pcf,
    shade::shade_single_pcf,
    shade::shade_pcf_gaussian,
    shade::shade_single_pcf_gaussian,
    shade::sum_lights,
    six::shade_hamburger_6,
    trigonometric::shade_trigonometric,
    exponential::shade_esm,
    exponential::shade_evsm,
    convolution::shade_convolution,
    convolution::shade_convolution_8,
    moment_maps::shade_moments_4,
    moment_maps::shade_moments_4_compensated,
    moment_maps::shade_moments_6,
    moment_maps::shade_moments_6_compensated,
    moment_maps::shade_moments_8,
    moment_maps::shade_moments_8_compensated,
    moment_maps::shade_moments_10,
    moment_maps::shade_moments_10_compensated,
    packed::shade_packed_10,
    packed::shade_packed_16,
    shade::shade_hamburger_mips,
    shade::shade_hausdorff_mips,
    variance::shade_variance_mips,
    six::shade_hamburger_6_mips,
    trigonometric::shade_trigonometric_mips,
    exponential::shade_esm_mips,
    exponential::shade_evsm_mips,
    convolution::shade_convolution_mips,
    convolution::shade_convolution_8_mips,
    moment_maps::shade_moments_4_mips,
    moment_maps::shade_moments_4_compensated_mips,
    moment_maps::shade_moments_6_mips,
    moment_maps::shade_moments_6_compensated_mips,
    moment_maps::shade_moments_8_mips,
    moment_maps::shade_moments_8_compensated_mips,
    moment_maps::shade_moments_10_mips,
    moment_maps::shade_moments_10_compensated_mips,
    soft::resolve_summed,
    soft::resolve_single_summed,
    soft::resolve_summed_6,
    soft::resolve_single_summed_6,
    soft::halve_summed,
    soft::halve_summed_6,
    soft::prefix_sums,
    soft::prefix_sums_6,
    soft::shade_soft,
    soft::shade_soft_6,
    soft::shade_vssm,
    soft::shade_single_vssm,
    soft::shade_pcss,
    soft::shade_single_pcss,
    tiles::tile_depths,
    tiles::tile_single_depths,
    tiles::tile_list,
    tiles::resolve_symmetric_tiles,
    tiles::resolve_single_symmetric_tiles,
    tiles::blur_tiles,
    tiles::shade_hamburger_tiles,
    tiles::shade_pcf_gaussian_tiles,
    tiles::shade_single_pcf_gaussian_tiles,
    translucent::translucent,
    translucent::translucent_moments,
    translucent::resolve_translucent_unit,
    translucent::resolve_single_translucent_unit,
    translucent::resolve_translucent_symmetric,
    translucent::resolve_single_translucent_symmetric,
    translucent::resolve_translucent_plain,
    translucent::resolve_single_translucent_plain,
    variance::translucent_variance,
    variance::resolve_translucent_variance,
    variance::resolve_single_translucent_variance,
    translucent::translucent_moments_6,
    translucent::resolve_translucent_symmetric_6,
    translucent::resolve_single_translucent_symmetric_6,
    translucent::resolve_translucent_plain_6,
    translucent::resolve_single_translucent_plain_6,
    translucent::resolve_translucent_packed_10,
    translucent::resolve_single_translucent_packed_10,
    translucent::resolve_translucent_packed_16,
    translucent::resolve_single_translucent_packed_16,
    translucent::stochastic_depths,
    translucent::shade_stochastic,
    translucent::shade_single_stochastic,
    translucent::tint,
    translucent::tinted,
    scattering::scatter_march,
    scattering::scatter_single_march,
    scattering::scatter_march_spot,
    scattering::scatter_single_march_spot,
    scattering::rectify,
    scattering::prefix_means,
    scattering::scatter_prefiltered,
    scattering::scatter_prefiltered_6,
    bounds::hamburger_4msm,
    bounds::hausdorff_4msm,
    bounds::hausdorff_4msm_compensated,
    bounds::vsm,
    moment_bounds::moment_bound_n1,
    moment_bounds::moment_bound_n2,
    moment_bounds::moment_bound_n3,
    moment_bounds::moment_bound_n4,
    moment_bounds::moment_bound_n5,
    moment_bounds::moment_bound_n6,
    moment_bounds::moment_bound_adjoint_n1,
    moment_bounds::moment_bound_adjoint_n2,
    moment_bounds::moment_bound_adjoint_n3,
    moment_bounds::moment_bound_adjoint_n4,
    moment_bounds::moment_bound_adjoint_n5,
    moment_bounds::moment_bound_adjoint_n6,
    moment_bounds::moment_bound_compensated_n1,
    moment_bounds::moment_bound_compensated_n2,
    moment_bounds::moment_bound_compensated_n3,
    moment_bounds::moment_bound_compensated_n4,
    moment_bounds::moment_bound_compensated_n5,
    moment_bounds::moment_bound_compensated_n6,
    moment_bounds::moment_bound_adjoint_compensated_n1,
    moment_bounds::moment_bound_adjoint_compensated_n2,
    moment_bounds::moment_bound_adjoint_compensated_n3,
    moment_bounds::moment_bound_adjoint_compensated_n4,
    moment_bounds::moment_bound_adjoint_compensated_n5,
    moment_bounds::moment_bound_adjoint_compensated_n6,
    canonical::canonical_n1,
    canonical::canonical_n2,
    canonical::canonical_n3,
    canonical::canonical_n4,
    canonical::canonical_n5,
    canonical::canonical_n6,
    canonical::canonical_adjoint_n1,
    canonical::canonical_adjoint_n2,
    canonical::canonical_adjoint_n3,
    canonical::canonical_adjoint_n4,
    canonical::canonical_adjoint_n5,
    canonical::canonical_adjoint_n6,
    six::hamburger_6msm,
    six::hamburger_6msm_compensated,
    trigonometric::trigonometric_4msm,
    trigonometric::trigonometric_4msm_compensated,
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
