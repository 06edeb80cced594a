//! Which passes a scene needs, and which it does not.

use std::fmt;

use hankel_dsl::native::describe::TexelFormat;
use serde::Serialize;

use super::cast::SAMPLES;
use crate::scene::{DepthRange, MapFormat, Scene, Technique};

/// A pass of the frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "pass")]
pub enum Pass {
    /// Depth as the light sees it.
    Depth {
        /// Texels along an edge.
        size: u32,
        /// Samples of a texel.
        samples: u32,
    },
    /// From depth to moments.
    Resolve {
        /// The kernel.
        kernel: &'static str,
        /// Texels along an edge.
        size: u32,
        /// The moments' format.
        format: TexelFormat,
    },
    /// One direction of the Gaussian.
    Blur {
        /// The kernel.
        kernel: &'static str,
        /// Along rows or along columns.
        step: [i32; 2],
        /// Weights of the centre and of the taps to one side of it.
        weights: Vec<f32>,
        /// Texels along an edge.
        size: u32,
        /// The moments' format.
        format: TexelFormat,
    },
    /// The picture.
    Shade {
        /// The fragment kernel.
        kernel: &'static str,
        /// Pixels in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Samples of a pixel.
        samples: u32,
    },
}

/// A pass that was left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Omission {
    /// What.
    pub what: &'static str,
    /// Why.
    pub why: &'static str,
}

/// The passes of a frame in their order, and what was left out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// What is done.
    pub passes: Vec<Pass>,
    /// What is not.
    pub omitted: Vec<Omission>,
}

/// Weights of a Gaussian with `taps` taps: of the centre and of the taps to one side. They reach
/// to two standard deviations, and the centre plus twice the others is 1.
#[must_use]
pub fn gaussian(taps: u32) -> Vec<f32> {
    let radius = taps / 2;
    let sigma = f64::from(radius.max(1)) / 2.0;
    let raw: Vec<f64> = (0..=radius)
        .map(|i| (-0.5 * (f64::from(i) / sigma).powi(2)).exp())
        .collect();
    let sum = 2.0 * raw.iter().sum::<f64>() - raw[0];
    raw.iter().map(|w| (w / sum) as f32).collect()
}

impl Plan {
    /// Plans the frame of a scene.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        let shadow = &scene.shadow;
        let size = shadow.size;
        let samples = SAMPLES.len() as u32;
        let mut passes = vec![Pass::Depth { size, samples }];
        let mut omitted = Vec::new();
        let mut omit = |what, why| omitted.push(Omission { what, why });
        if shadow.technique == Technique::Pcf {
            omit(
                "moments",
                "percentage-closer filtering compares the depths themselves",
            );
            omit("blur", "depths cannot be filtered before the comparison");
        } else {
            let format = shadow.format.texel();
            let resolve = match (shadow.format, shadow.depth_range) {
                (MapFormat::Rgba32float, _) => "resolve_plain",
                (MapFormat::Rgba16unorm, DepthRange::Unit) => "resolve_unit",
                (MapFormat::Rgba16unorm, DepthRange::Symmetric) => "resolve_symmetric",
            };
            passes.push(Pass::Resolve {
                kernel: resolve,
                size,
                format,
            });
            if shadow.format == MapFormat::Rgba32float {
                omit("quantisation", "32 bits hold the moments as they are");
            }
            if shadow.filter > 1 {
                let kernel = match shadow.format {
                    MapFormat::Rgba16unorm => "blur_rgba16unorm",
                    MapFormat::Rgba32float => "blur_rgba32float",
                };
                let weights = gaussian(shadow.filter);
                for step in [[1, 0], [0, 1]] {
                    let weights = weights.clone();
                    passes.push(Pass::Blur {
                        kernel,
                        step,
                        weights,
                        size,
                        format,
                    });
                }
            } else {
                omit("blur", "the filter is one texel wide");
            }
            omit("mips", "the map is read at its own resolution");
        }
        if shadow.depth_bias == 0.0 {
            omit("depth bias", "it is 0");
        }
        passes.push(Pass::Shade {
            kernel: match shadow.technique {
                Technique::Hamburger => "shade_hamburger",
                Technique::Hausdorff => "shade_hausdorff",
                Technique::Vsm => "shade_variance",
                Technique::Pcf => "shade_pcf",
            },
            width: scene.width,
            height: scene.height,
            samples,
        });
        Self { passes, omitted }
    }

    /// Kernels that the plan needs, each once.
    #[must_use]
    pub fn kernels(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        for pass in &self.passes {
            let needed: &[&'static str] = match pass {
                Pass::Depth { .. } => &["light_depth"],
                Pass::Resolve { kernel, .. } | Pass::Blur { kernel, .. } => &[kernel],
                Pass::Shade { kernel, .. } => &["surface", kernel],
            };
            for &name in needed {
                if !names.contains(&name) {
                    names.push(name);
                }
            }
        }
        names
    }
}

impl Pass {
    /// A short name for progress and timings.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Depth { .. } => "depth",
            Self::Resolve { .. } => "resolve",
            Self::Blur { step: [0, _], .. } => "blur columns",
            Self::Blur { .. } => "blur rows",
            Self::Shade { .. } => "shade",
        }
    }
}

impl fmt::Display for Pass {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: ", self.name())?;
        match self {
            Self::Depth { size, samples } => {
                write!(
                    f,
                    "light_depth, {size}x{size}, {samples} samples, depth32float"
                )
            }
            Self::Resolve {
                kernel,
                size,
                format,
            } => {
                write!(f, "{kernel}, {size}x{size}, {}", format.name())
            }
            Self::Blur {
                kernel,
                weights,
                size,
                format,
                ..
            } => {
                let taps = 2 * weights.len() - 1;
                write!(f, "{kernel}, {size}x{size}, {}, {taps} taps", format.name())
            }
            Self::Shade {
                kernel,
                width,
                height,
                samples,
            } => {
                write!(
                    f,
                    "surface and {kernel}, {width}x{height}, {samples} samples"
                )
            }
        }
    }
}

impl fmt::Display for Plan {
    /// One line for each pass, then one for each omission.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, pass) in self.passes.iter().enumerate() {
            writeln!(f, "{}. {pass}", i + 1)?;
        }
        for o in &self.omitted {
            writeln!(f, "no {}: {}", o.what, o.why)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_sums_to_one_and_falls() {
        for taps in [1, 3, 7, 31] {
            let w = gaussian(taps);
            assert_eq!(w.len() as u32, taps / 2 + 1);
            let sum = 2.0 * w.iter().sum::<f32>() - w[0];
            assert!((sum - 1.0).abs() < 1e-6, "{taps}: {sum}");
            assert!(w.windows(2).all(|p| p[0] > p[1]));
        }
    }
}
