//! Run time against error: the ways to make a scene's shadows, each measured.
//!
//! [`Session`] measures every configuration of every scene: its light against [`truth::by_rays`], and its
//! passes in rounds in which every configuration has its turn. What is finished is kept in a file, so a
//! session that was ended goes on where it was. [`growth`] says how times grow.

pub mod growth;
mod pictures;
mod session;
mod store;

use std::fmt;
use std::time::{Duration, Instant};

use hankel_host::device::Device;

use crate::error::Result;
use crate::executor::{Clock, Quiet, Shaders, Timing};
use crate::frame::{Frame, Show};
use crate::scattering::{self, Scattering};
use crate::scene::{Fit, Light, Medium, Mesh, Scene, Shadow};
use crate::techniques::{self, Map, Technique};
#[cfg(doc)]
use crate::truth;
use crate::visibility::SAMPLES;

pub use pictures::Pictures;
pub use session::{Ask, Measurement, Session, Status, Subject};
pub use store::StoreError;

/// A way to make a scene's shadows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration {
    /// From depths to shadow.
    pub technique: &'static Technique,
    /// How its map is stored.
    pub map: Map,
    /// Texels along an edge of the map.
    pub size: u32,
    /// Taps of the filter along an axis.
    pub filter: u32,
    /// What the map holds.
    pub fit: Fit,
    /// Samples of depth in a texel: see [`Shadow::multisampling`].
    pub multisampling: u32,
    /// How a medium's light is made; without one, the scene has no medium.
    pub scattering: Option<Scattered>,
}

/// A way to make what a medium scatters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scattered {
    /// How its light is computed.
    pub technique: &'static Scattering,
    /// Steps along each ray, of techniques that march along rays.
    pub steps: u32,
}

impl fmt::Display for Scattered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.technique.name)?;
        match self.technique.has_steps {
            true => write!(f, ", {} steps", self.steps),
            false => Ok(()),
        }
    }
}

impl Configuration {
    /// The technique and its map, without sizes; how a medium's light is made is another matter.
    #[must_use]
    pub fn method(&self) -> String {
        let (format, range) = (self.map.format.name(), self.map.depth_range.name());
        let mut name = self.technique.name.to_owned();
        let of_format = |m: &&Map| m.format == self.map.format;
        // Named only where there is a choice.
        if self.technique.maps.len() > 1 {
            name = format!("{name} {format}");
        }
        if self.technique.maps.iter().filter(of_format).count() > 1 {
            name = format!("{name} {range}");
        }
        // Four are the rule.
        match self.multisampling {
            1 => name + ", one sample",
            _ => name,
        }
    }

    /// The technique and its map, and how a medium's light is made, without sizes.
    #[must_use]
    pub fn way(&self) -> String {
        match &self.scattering {
            Some(scattering) => format!("{}; {scattering}", self.method()),
            None => self.method(),
        }
    }

    /// Whether it is meant for a scene's lights and its medium.
    #[must_use]
    pub fn suits(&self, scene: &Scene) -> bool {
        let has_medium = scene.medium.is_some();
        let is_scattered = self.scattering.is_some();
        let is_for_lights = self.technique.not_for(&scene.lights).is_none();
        let mut lights = scene.lights.iter();
        let refused = |l: &Light| self.scattering.and_then(|s| l.refuses(s.technique));
        let is_refused = lights.any(|l| refused(l).is_some());
        is_for_lights && !is_refused && is_scattered == has_medium
    }

    /// The same without what there is of a medium.
    #[must_use]
    pub const fn without_scattering(&self) -> Self {
        Self {
            scattering: None,
            ..*self
        }
    }

    /// A scene with these shadows. What else the scene says of them stays, but for biases of another technique:
    /// see [`Shadow::by`].
    #[must_use]
    pub fn on(&self, scene: &Scene) -> Scene {
        let with = |medium: Medium| match self.scattering {
            Some(Scattered { technique, steps }) => Medium {
                technique,
                steps,
                ..medium
            },
            None => medium,
        };
        Scene {
            medium: scene.medium.map(with),
            shadow: Shadow {
                size: self.size,
                filter: self.filter,
                fit: self.fit,
                multisampling: self.multisampling,
                ..scene.shadow.by(self.technique, self.map)
            },
            ..scene.clone()
        }
    }
}

impl fmt::Display for Configuration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, {}², ", self.method(), self.size)?;
        match self.filter {
            1 => f.write_str("no filter")?,
            taps => write!(f, "{taps} taps")?,
        }
        match self.fit {
            Fit::Scene => Ok(()),
            Fit::Camera => f.write_str(", fitted"),
        }?;
        match &self.scattering {
            Some(scattering) => write!(f, "; {scattering}"),
            None => Ok(()),
        }
    }
}

/// What configurations are made of: every combination is one.
#[derive(Clone, Debug, PartialEq)]
pub struct Choices {
    /// Each with all its maps.
    pub techniques: Vec<&'static Technique>,
    /// Texels along an edge of the map.
    pub sizes: Vec<u32>,
    /// Taps along an axis.
    pub filters: Vec<u32>,
    /// What the map holds.
    pub fits: Vec<Fit>,
    /// Samples of depth in a texel, 4 or 1.
    pub multisampling: Vec<u32>,
    /// Techniques of scattering, for scenes with a medium.
    pub scatterings: Vec<&'static Scattering>,
    /// Steps along each ray, of those that march along rays.
    pub steps: Vec<u32>,
}

impl Default for Choices {
    /// All techniques, from 256² to 2048² texels of four samples and of one, up to 9 x 9 taps, maps of the whole scene
    /// and fitted ones; of scattering all techniques, with 8, 32 and 128 steps.
    fn default() -> Self {
        Self {
            techniques: techniques::ALL.to_vec(),
            sizes: vec![256, 512, 1024, 2048],
            filters: vec![1, 3, 5, 9],
            fits: vec![Fit::Scene, Fit::Camera],
            multisampling: vec![SAMPLES, 1],
            scatterings: scattering::ALL.to_vec(),
            steps: vec![8, 32, 128],
        }
    }
}

impl Choices {
    /// The ways to make what a medium scatters.
    #[must_use]
    pub fn scattered(&self) -> Vec<Scattered> {
        let mut all = Vec::new();
        for &technique in &self.scatterings {
            let count = if technique.has_steps {
                self.steps.len()
            } else {
                1
            };
            let steps = self.steps.iter().take(count);
            all.extend(steps.map(|&steps| Scattered { technique, steps }));
        }
        all
    }

    /// All of them: those for scenes without a medium, and each of these with each way to make what a medium
    /// scatters. [`Configuration::suits`] tells them apart.
    #[must_use]
    pub fn configurations(&self) -> Vec<Configuration> {
        let shadows = self.shadows();
        let mut all = shadows.clone();
        for scattering in self.scattered() {
            let with = |c: &Configuration| Configuration {
                scattering: Some(scattering),
                ..*c
            };
            all.extend(shadows.iter().map(with));
        }
        all
    }

    /// Those without a medium. Soft shadows have no filter: each once, with the narrowest.
    fn shadows(&self) -> Vec<Configuration> {
        let mut all = Vec::new();
        let narrowest: Vec<u32> = self.filters.iter().copied().min().into_iter().collect();
        for &technique in &self.techniques {
            let filters = match technique.is_soft {
                true => &narrowest,
                false => &self.filters,
            };
            let ways = technique.maps.iter().flat_map(|&map| {
                let with = move |&multisampling| (map, multisampling);
                self.multisampling.iter().map(with)
            });
            for (map, multisampling) in ways {
                for &size in &self.sizes {
                    for &filter in filters {
                        for &fit in &self.fits {
                            all.push(Configuration {
                                technique,
                                map,
                                size,
                                filter,
                                fit,
                                multisampling,
                                scattering: None,
                            });
                        }
                    }
                }
            }
        }
        all
    }
}

/// What a frame took.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Its passes, in order.
    pub passes: Vec<Timing>,
    /// Bytes on the device.
    pub bytes: usize,
}

impl Sample {
    /// All passes together.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.passes.iter().map(|p| p.seconds).sum()
    }
}

/// How long a GPU works before it is timed, so that its clocks are up.
const WARM: Duration = Duration::from_millis(100);
/// Runs of a GPU whose median is taken.
const RUNS: usize = 9;

/// The time of a frame whose passes all run, after one in which they have run already: the driver has
/// compiled its shaders, and what is made once is there.
///
/// A GPU lowers its clocks while it waits for the driver's compiler, and takes a while to raise them: the same frame
/// then takes up to 5 times as long on an H200. So there a frame runs for 100 ms first, and is timed several times.
///
/// # Errors
/// See [`crate::FrameError`].
pub fn sample(
    device: &mut dyn Device,
    shaders: &dyn Shaders,
    scene: &Scene,
    mesh: &Mesh,
) -> Result<Sample> {
    let is_gpu = device.is_gpu();
    let mut frame = Frame::still(device, shaders, scene, mesh, Show::Picture)?;
    frame.run(Clock::Frame, &mut Quiet)?;
    let start = Instant::now();
    while is_gpu && start.elapsed() < WARM {
        frame.executor().steady(1)?;
    }
    Ok(Sample {
        passes: frame.executor().steady(if is_gpu { RUNS } else { 1 })?,
        bytes: frame.executor().memory().bytes,
    })
}

/// The middle of an odd number of values, the lower one of the two of an even number; 0 of none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let middle = values.len().saturating_sub(1) / 2;
    values.get(middle).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn names_tell_configurations_apart() {
        let all = Choices::default().configurations();
        let names: BTreeSet<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(names.len(), all.len());
        assert!(names.contains("hamburger rgba16unorm symmetric, 512², 3 taps, fitted"));
        assert!(names.contains("hamburger rgba16unorm symmetric, one sample, 2048², no filter"));
        assert!(names.contains("pcf, 2048², no filter"));
        assert!(names.contains("pcf, one sample, 2048², no filter"));
        assert!(names.contains("soft, one sample, 2048², no filter"));
        assert!(names.contains("pcf, 2048², no filter; prefiltered"));
        assert!(names.contains("esm, 256², 9 taps, fitted; ray-marching, 8 steps"));
    }

    #[test]
    fn a_median_is_one_of_the_values() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.0);
        assert_eq!(median(Vec::new()), 0.0);
    }
}
