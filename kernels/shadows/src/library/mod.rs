//! The functions that engines include, as a library in every language: what the published methods are
//! made of, without bindings or entry points. Vectors hold moments: `x` is the first.
//!
//! | what | functions |
//! | --- | --- |
//! | the least shadow that moments allow | [`bounds`] |
//! | what is nearer than a receiver, for soft shadows | [`blockers`] |
//! | bounds from two to twelve moments with a free total | [`totals`] |
//! | exponential and convolution shadow maps | [`exponential`], [`convolution`] |
//! | translucent casters, single scattering | [`translucent`], [`scattering`] |
//! | resolves and filters that look a map up more than once | [`lookups`] |
//! | what a map stores | [`store`] |
//! | published and measured biases | [`biases`] |
//! | the few depths that have given moments | [`depths`] |

pub mod biases;
pub mod blockers;
pub mod bounds;
pub mod convolution;
pub mod depths;
pub mod exponential;
pub mod lookups;
pub mod scattering;
pub mod store;
pub mod totals;
pub mod translucent;

hankel_dsl::library! {
    /// Moment shadow mapping. Depths are in [0, 1] ("unit") or [-1, 1] ("symmetric"); the j-th moment
    /// is the mean of the depth's j-th power over the filter region.
    shadows {
        api: 1,
        functions: [
            bounds::hamburger_bound,
            bounds::hamburger_bounds,
            bounds::hausdorff_bound,
            bounds::hausdorff_symmetric_bound,
            bounds::variance_bound,
            bounds::hamburger_six_bounds,
            bounds::trigonometric_bounds,
            bounds::blend_bounds,
            bounds::mix_bias,
            bounds::mix_bias_six,
            bounds::cut_leak,
            blockers::blockers_of_two,
            blockers::blockers_of_four,
            blockers::blockers_of_six,
            lookups::penumbra_reach,
            exponential::exponential_of_depth,
            exponential::exponential_bound,
            exponential::exponential_moments_of_depth,
            exponential::exponential_variance_bound,
            convolution::convolution_cosines_of_depth,
            convolution::convolution_sines_of_depth,
            convolution::convolution_high_cosines_of_depth,
            convolution::convolution_high_sines_of_depth,
            convolution::convolution_shadow,
            convolution::convolution_shadow_of_eight,
            translucent::blend_translucent,
            translucent::blend_translucent_six,
            translucent::stochastic_depths,
            scattering::henyey_greenstein,
            scattering::transmittance,
            scattering::rectified_depth,
            scattering::lit_share,
            totals::bounds_of_two,
            totals::bounds_of_four,
            totals::bounds_of_six,
            totals::bounds_of_eight,
            totals::bounds_of_ten,
            totals::bounds_of_twelve,
            totals::bounds_of_four_compensated,
            totals::bounds_of_six_compensated,
            store::symmetric_depth,
            store::moments_of_depth,
            store::trigonometric_moments_of_depth,
            store::quantize_unit_four,
            store::dequantize_unit_four,
            store::quantize_symmetric_four,
            store::dequantize_symmetric_four,
            store::symmetric_to_unit,
            store::quantize_symmetric_six_first,
            store::quantize_symmetric_six_second,
            store::dequantize_symmetric_six_low,
            store::dequantize_symmetric_six_high,
            store::pack_ten_bits,
            store::unpack_ten_bits,
            store::to_fixed_four,
            store::mean_of_fixed_four,
            store::rectangle_of_fixed_four,
            lookups::resolve_four,
            lookups::resolve_quantized_four,
            lookups::mean_of_table_four,
            lookups::percentage_closer,
            lookups::percentage_closer_weighted,
            lookups::mean_of_footprint,
            depths::two_depths,
            depths::three_depths,
            depths::three_shares,
        ],
        constants: [
            biases::SYMMETRIC_FOUR_SIXTEEN_BITS_TARGET,
            biases::SYMMETRIC_FOUR_SIXTEEN_BITS_STRENGTH,
            biases::SYMMETRIC_FOUR_FLOAT_TARGET,
            biases::SYMMETRIC_FOUR_FLOAT_STRENGTH,
            biases::SYMMETRIC_FOUR_LECTURE_TARGET,
            biases::SYMMETRIC_FOUR_LECTURE_STRENGTH,
            biases::UNIT_FOUR_TARGET,
            biases::UNIT_FOUR_STRENGTH,
            biases::CLAMPED_FOUR_TARGET,
            biases::CLAMPED_FOUR_STRENGTH,
            biases::HAUSDORFF_SYMMETRIC_FOUR_TARGET,
            biases::HAUSDORFF_SYMMETRIC_FOUR_SIXTEEN_BITS_STRENGTH,
            biases::HAUSDORFF_SYMMETRIC_FOUR_FLOAT_STRENGTH,
            biases::HAUSDORFF_UNIT_FOUR_TARGET,
            biases::HAUSDORFF_UNIT_FOUR_SIXTEEN_BITS_STRENGTH,
            biases::TRIGONOMETRIC_SIXTEEN_BITS_STRENGTH,
            biases::TRIGONOMETRIC_FLOAT_STRENGTH,
            biases::SYMMETRIC_SIX_FLOAT_LOW_TARGET,
            biases::SYMMETRIC_SIX_FLOAT_HIGH_TARGET,
            biases::SYMMETRIC_SIX_FLOAT_STRENGTH,
            biases::SYMMETRIC_SIX_SIXTEEN_BITS_LOW_TARGET,
            biases::SYMMETRIC_SIX_SIXTEEN_BITS_HIGH_TARGET,
            biases::SYMMETRIC_SIX_SIXTEEN_BITS_STRENGTH,
            biases::MEASURED_SYMMETRIC_FOUR_SIXTEEN_BITS,
            biases::MEASURED_SYMMETRIC_FOUR_FLOAT,
            biases::MEASURED_SYMMETRIC_SIX_FLOAT,
            biases::MEASURED_SYMMETRIC_SIX_TEN_BITS,
            biases::MEASURED_TRIGONOMETRIC_FLOAT,
            biases::MEASURED_TRIGONOMETRIC_SIXTEEN_BITS,
        ],
    }
}
