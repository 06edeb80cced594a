//! Shading kernels of techniques that filter a map: what they make of a texel, they make of a texel of any level.

/// Two shading kernels of a technique: one looks the map up at its own resolution, the other in its mip levels, with
/// the footprint of a pixel ([`crate::mips`]).
///
/// The technique is a function of the light, its uniforms, a texel of each texture of the map, the receiver's depth
/// from 0 to 1, and its constants, in this order. The kernels have the same parameters. What follows them is how
/// both compute: `pinned`, `parity(…)`. Functions that make their inputs have the same name in
/// `crate::inputs::maps` and `crate::inputs::mips`.
macro_rules! shading {
    (
        $(#[$doc:meta])* $shade:ident,
        $(#[$mips_doc:meta])* $mips:ident,
        $of:ident($first:ident $(, $map:ident)*),
        inputs($inputs:ident),
        uniforms($($(#[$($about:tt)*])* $uniform:ident: &$uniform_type:ident$(<$number:ident>)?),*),
        constants($($(#[$($set:tt)*])* $constant:ident: $constant_type:ident),*),
        $($how:tt)*
    ) => {
        $(#[$doc])*
        #[kernel(fragment, inputs = crate::inputs::maps::$inputs, $($how)*)]
        pub fn $shade(
            #[varying] world: Vec3,
            #[varying]
            #[unit_vector]
            normal: Vec3,
            #[varying]
            #[range(0.0..=1.0)]
            colour: Vec3,
            #[uniform] light: &crate::shade::Light,
            $(#[uniform] $(#[$($about)*])* $uniform: &$uniform_type$(<$number>)?,)*
            #[texture] $first: Texture2d<'_>,
            $(#[texture] $map: Texture2d<'_>,)*
            #[sampler] sampler: Sampler,
            $($(#[$($set)*])* $constant: $constant_type,)*
        ) -> Vec4 {
            crate::shade::shade_with(light, world, normal, colour, |uv, z| {
                $of(
                    light,
                    $($uniform,)*
                    $first.sample_level(sampler, uv, 0.0),
                    $($map.sample_level(sampler, uv, 0.0),)*
                    z,
                    $($constant,)*
                )
            })
        }

        $(#[$mips_doc])*
        #[kernel(fragment, inputs = crate::inputs::mips::$inputs, $($how)*)]
        pub fn $mips(
            #[varying] world: Vec3,
            #[varying]
            #[unit_vector]
            normal: Vec3,
            #[varying]
            #[range(0.0..=1.0)]
            colour: Vec3,
            #[varying]
            #[unit_vector]
            plane: Vec3,
            #[uniform] light: &crate::shade::Light,
            #[uniform] camera: &crate::depth::Transform,
            #[uniform] raster: &crate::mips::Raster,
            $(#[uniform] $(#[$($about)*])* $uniform: &$uniform_type$(<$number>)?,)*
            #[texture] $first: Texture2d<'_>,
            $(#[texture] $map: Texture2d<'_>,)*
            #[sampler] sampler: Sampler,
            $($(#[$($set)*])* $constant: $constant_type,)*
        ) -> Vec4 {
            let view = crate::mips::View {
                light,
                camera,
                raster,
                size: $first.size(),
            };
            view.light_up(world, normal, colour, plane, |footprint, uv, z| {
                let level = footprint.level();
                $of(
                    light,
                    $($uniform,)*
                    footprint.mean(uv, |uv| $first.sample_level(sampler, uv, level)),
                    $(footprint.mean(uv, |uv| $map.sample_level(sampler, uv, level)),)*
                    z,
                    $($constant,)*
                )
            })
        }
    };
}
