//! From what is wanted of a scene's shadows to the way to make them.
//!
//! A plan is found by probes on the device that will draw. Nothing is fitted to other scenes but one
//! bound ([`DOUBLING`]).
//!
//! 1. **Time.** Each method (a technique and its map) is timed with small maps and with and without a
//!    filter. Its time is taken to be linear in the map's texels and in the filter's taps; that orders all
//!    configurations from the fastest to the slowest.
//!    In a scene with a medium, the time of a technique of scattering is taken to be what it adds to the first
//!    method's.
//! 2. **Error.** In this order the light of each configuration is drawn in full and compared with rays
//!    ([`Pixels`]) in some pixels; in a scene with a medium it is the light that comes through that, with what it
//!    scatters ([`Through`]). Pixels are added until it is decided, at three standard errors, whether
//!    the error is within the budget; with all of them it is exact. Rays are the expensive part, and are
//!    shared by all configurations. A larger map is not tried if half its size was too far off for
//!    [`DOUBLING`] to make up.
//! 3. **Choice.** The search ends where the predicted times leave those that were found behind. The
//!    fastest few of these have their times taken in rounds, and the fastest is the plan.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt;

use hankel_host::device::Device;
use rayon::prelude::*;
use serde::Serialize;

use crate::error::Result;
use crate::executor::{Progress, Shaders, Timing};
use crate::frame::{Show, graph};
use crate::graph::{Omission, Summary};
use crate::lights::light_view;
use crate::measure::{Choices, Configuration, Pictures, Sample, Scattered, median, sample};
use crate::passes::TRANSLUCENT;
use crate::scene::{Fit, Mesh, Scene};
use crate::truth::scattering::Through;
use crate::truth::{Arriving, Pixels};

/// By how much a map of twice the size may divide the root mean square error at most. What
/// `hankel bench frames` has measured is less, but for errors that are near 0: see docs/frames.md.
pub const DOUBLING: f64 = 3.0;

/// A configuration is worth a closer look if its predicted time is at most so many times the least that
/// was found.
const SLACK: f64 = 2.5;
/// One is in the last rounds if its time is at most so many times the least.
const CLOSE: f64 = 2.0;
/// Rounds in which the fastest are timed.
const ROUNDS: usize = 7;
/// Pixels that are compared at first, and how many times as many whenever that decides nothing.
const FIRST: usize = 4096;
const MORE: usize = 2;
/// Standard errors that decide.
const SURE: f64 = 3.0;

/// What is wanted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Wanted {
    /// The greatest root mean square error of the light against rays, above 0; in a scene with a medium, of the
    /// light that comes through it with what it scatters.
    pub error: f64,
    /// The greatest time of a frame in seconds.
    pub seconds: Option<f64>,
    /// The most bytes on the device.
    pub bytes: Option<usize>,
}

/// An error, from some of a picture's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Estimate {
    /// The root mean square over these pixels.
    pub rms: f64,
    /// Three standard errors below it.
    pub low: f64,
    /// Three standard errors above it.
    pub high: f64,
}

impl fmt::Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.4} ({:.4} to {:.4})", self.rms, self.low, self.high)
    }
}

/// What a map of what the camera sees has for it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gain {
    /// Area of a texel of the whole scene's map, divided by that of a fitted one.
    pub area: f64,
    /// Depth of the whole scene's map, divided by that of the fitted one.
    pub depth: f64,
}

/// The way to make a scene's shadows.
#[derive(Clone, Debug, Serialize)]
pub struct Plan {
    /// In words.
    pub choice: String,
    /// The scene with it.
    #[serde(skip)]
    pub scene: Scene,
    /// The configuration.
    #[serde(skip)]
    pub configuration: Configuration,
    /// What was wanted.
    pub wanted: Wanted,
    /// The error that it will have.
    pub error: Estimate,
    /// The time that a frame will take, in seconds.
    pub seconds: f64,
    /// The passes, each with its time.
    pub times: Vec<Timing>,
    /// Bytes on the device.
    pub bytes: usize,
    /// What is done, and what has no effect and is not done.
    pub summary: Summary,
    /// Other ways, and why each was left out.
    pub rejected: Vec<Omission>,
    /// What fitting the map to the camera's view gives on this scene.
    pub gain: Gain,
    /// Configurations that were compared with rays.
    pub probed: usize,
    /// Of so many configurations.
    pub considered: usize,
    /// Pixels for which rays were cast.
    pub pixels: usize,
}

/// Why there is no plan.
#[derive(Clone, Debug, Serialize)]
pub struct Impossible {
    /// What was wanted.
    pub wanted: Wanted,
    /// The least error of all that was tried within time and memory, and whose it is.
    pub nearest: Option<(String, Estimate)>,
    /// The ways, and why each was left out.
    pub rejected: Vec<Omission>,
    /// Of so many configurations; 0 if nothing that was chosen is for the scene.
    pub considered: usize,
}

impl fmt::Display for Plan {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.choice)?;
        write!(f, "{}", self.summary)?;
        let [width, height] = [self.scene.width, self.scene.height];
        writeln!(
            f,
            "predicted: error {}, {:.2} ms, {:.1} MB, {width}x{height} pixels",
            self.error,
            self.seconds * 1e3,
            self.bytes as f64 / 1e6,
        )?;
        for t in &self.times {
            writeln!(f, "  {:<16} {:>8.2} ms", t.name, t.seconds * 1e3)?;
        }
        let fitted = match self.configuration.fit {
            Fit::Camera => "fitted to what the camera sees",
            Fit::Scene => "of the whole scene",
        };
        writeln!(
            f,
            "the map is {fitted}: a texel of the fitted map has {:.0} % of the area, and the map {:.0} % of the depth, \
             that they have without fitting",
            100.0 / self.gain.area,
            100.0 / self.gain.depth
        )?;
        writeln!(
            f,
            "{} of {} configurations compared with rays through {} pixels",
            self.probed, self.considered, self.pixels
        )?;
        for r in &self.rejected {
            writeln!(f, "not {}: {}", r.what, r.why)?;
        }
        Ok(())
    }
}

impl fmt::Display for Impossible {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.considered == 0 {
            writeln!(f, "nothing that was chosen is for this scene")?;
        } else {
            let Wanted {
                error,
                seconds,
                bytes,
            } = self.wanted;
            write!(f, "nothing has an error of at most {error}")?;
            if let Some(seconds) = seconds {
                write!(f, " in at most {} ms", seconds * 1e3)?;
            }
            if let Some(bytes) = bytes {
                write!(f, " with at most {} MB", bytes as f64 / 1e6)?;
            }
            writeln!(f, " here")?;
        }
        if let Some((name, error)) = &self.nearest {
            writeln!(f, "nearest: {name}, {error}")?;
        }
        for r in &self.rejected {
            writeln!(f, "not {}: {}", r.what, r.why)?;
        }
        Ok(())
    }
}

/// Steps along rays through a medium are enough if their doubling changes this share of the greatest error that is
/// allowed.
const STEADY: f64 = 0.1;

/// What rays tell of a pixel.
enum Rays {
    Light(Pixels),
    Through(Through),
}

/// Rays through some of a picture's pixels, as many as are asked for.
struct Truth {
    rays: Rays,
    /// All pixels, such that any number of the first ones is spread over the picture.
    order: Vec<usize>,
    width: usize,
    /// The light of the first ones.
    known: Vec<f32>,
}

impl Truth {
    fn new(scene: &Scene, mesh: &Mesh, budget: f64) -> Self {
        let width = scene.width as usize;
        let through = Through::new(scene, mesh, STEADY * budget);
        let count = width * scene.height as usize;
        Self {
            rays: through.map_or_else(|| Rays::Light(Pixels::of(scene, mesh)), Rays::Through),
            order: spread(count),
            width,
            known: Vec::new(),
        }
    }

    fn know(&mut self, count: usize) {
        let (known, count) = (self.known.len(), count.min(self.order.len()));
        if known < count {
            let light = |&pixel: &usize| match &self.rays {
                Rays::Light(pixels) => {
                    let at = [pixel % self.width, pixel / self.width];
                    pixels.light(at.map(|i| i as u32))
                }
                Rays::Through(through) => through.pixel(pixel as u32),
            };
            let more: Vec<f32> = self.order[known..count].par_iter().map(light).collect();
            self.known.extend(more);
        }
    }

    /// The error over the pixels that are known.
    fn estimate(&self, picture: &Arriving) -> Estimate {
        let pairs = self.order.iter().zip(&self.known);
        let squares: Vec<f64> = pairs
            .map(|(pixel, truth)| (f64::from(picture.values[*pixel]) - f64::from(*truth)).powi(2))
            .collect();
        estimate(&squares, self.order.len())
    }

    /// Whether a picture's error is within the budget; rays are added until that is sure.
    fn decide(&mut self, picture: &Arriving, budget: f64) -> (bool, Estimate) {
        let mut wanted = FIRST.max(self.known.len());
        loop {
            self.know(wanted);
            let estimate = self.estimate(picture);
            if estimate.high <= budget {
                return (true, estimate);
            }
            if estimate.low > budget || self.known.len() == self.order.len() {
                return (false, estimate);
            }
            wanted = self.known.len() * MORE;
        }
    }
}

/// 0 to `count` - 1, such that any number of the first ones is spread evenly: multiples of the golden
/// section of `count`, or of the next number without a common divisor.
fn spread(count: usize) -> Vec<usize> {
    let divisor = |mut a: usize, mut b: usize| {
        while b > 0 {
            (a, b) = (b, a % b);
        }
        a
    };
    let mut step = (count as f64 * 0.618_033_988_749_894_9) as usize;
    while step > 0 && divisor(step, count) != 1 {
        step += 1;
    }
    let step = step.max(1);
    (0..count).map(|i| (i * step) % count.max(1)).collect()
}

/// The root of the mean of `squares`, some of `all` there are, with three standard errors. One error
/// of the greatest size that there may be counts as not seen yet: few pixels prove little.
fn estimate(squares: &[f64], all: usize) -> Estimate {
    let n = squares.len().max(1) as f64;
    let mean = squares.iter().sum::<f64>() / n;
    let rest = 1.0 - n / all.max(1) as f64;
    if rest <= 0.0 {
        let rms = mean.sqrt();
        return Estimate {
            rms,
            low: rms,
            high: rms,
        };
    }
    let variance = squares.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    let wide = SURE * (variance / n * rest).sqrt();
    Estimate {
        rms: mean.sqrt(),
        low: (mean - wide).max(0.0).sqrt(),
        high: (mean + wide + rest / n).sqrt(),
    }
}

/// The time of a method's frames: linear in the map's texels and in the taps.
#[derive(Clone, Copy, Debug)]
struct Times {
    sizes: [u32; 2],
    filters: [u32; 2],
    /// By size, then by filter.
    filtered: [[f64; 2]; 2],
    /// Without a filter.
    plain: [f64; 2],
}

impl Times {
    fn of(&self, size: u32, filter: u32) -> f64 {
        let texels = |s: u32| f64::from(s).powi(2);
        let [a, b] = self.sizes;
        let along = |[at_a, at_b]: [f64; 2]| {
            let share = if a == b {
                0.0
            } else {
                (texels(size) - texels(a)) / (texels(b) - texels(a))
            };
            at_a + (at_b - at_a) * share
        };
        let [f, g] = self.filters;
        // Noise must not make larger maps free.
        let least = self.plain[0].min(self.filtered[0][0]) * 0.5;
        if filter <= 1 {
            return along(self.plain).max(least);
        }
        let at = |i: usize| along([self.filtered[0][i], self.filtered[1][i]]);
        let share = if f == g {
            0.0
        } else {
            f64::from(filter) - f64::from(f)
        } / f64::from(g.abs_diff(f).max(1));
        (at(0) + (at(1) - at(0)) * share).max(least)
    }
}

/// Plans on a device.
struct Search<'a> {
    device: &'a mut dyn Device,
    shaders: &'a dyn Shaders,
    scene: &'a Scene,
    mesh: &'a Mesh,
    pictures: Pictures,
}

impl Search<'_> {
    fn sample(&mut self, configuration: &Configuration) -> Result<Sample> {
        let scene = configuration.on(self.scene);
        sample(self.device, self.shaders, &scene, self.mesh)
    }

    fn light(&mut self, configuration: &Configuration) -> Result<Arriving> {
        let (device, shaders) = (&mut *self.device, self.shaders);
        self.pictures
            .light(device, shaders, self.scene, self.mesh, configuration)
    }

    /// Times a method with two sizes and filters.
    fn times(&mut self, of: &Configuration, choices: &Choices) -> Result<Times> {
        let ends = |all: &[u32]| {
            let least = all.iter().copied().min().unwrap_or(1);
            let next = all.iter().copied().filter(|x| *x > least).min();
            let greatest = all.iter().copied().max().unwrap_or(1);
            [least, next.unwrap_or(least), greatest]
        };
        let [size, next, _] = ends(&choices.sizes);
        let taps: Vec<u32> = choices.filters.iter().copied().filter(|f| *f > 1).collect();
        let [filter, _, widest] = ends(&taps);
        let mut times = Times {
            sizes: [size, next],
            filters: [filter, widest],
            filtered: [[0.0; 2]; 2],
            plain: [0.0; 2],
        };
        for (i, size) in [size, next].into_iter().enumerate() {
            if i == 1 && size == times.sizes[0] {
                times.filtered[1] = times.filtered[0];
                times.plain[1] = times.plain[0];
                continue;
            }
            if choices.filters.contains(&1) {
                let c = Configuration {
                    size,
                    filter: 1,
                    ..*of
                };
                times.plain[i] = self.sample(&c)?.seconds();
            }
            for (j, filter) in times.filters.into_iter().enumerate() {
                if filter > 1 {
                    let c = Configuration {
                        size,
                        filter,
                        ..*of
                    };
                    times.filtered[i][j] = self.sample(&c)?.seconds();
                }
            }
        }
        Ok(times)
    }
}

impl Search<'_> {
    /// Times each method with the first way to make what a medium scatters, and each of these ways with the first
    /// method.
    fn predictions(
        &mut self,
        configurations: &[Configuration],
        choices: &Choices,
        progress: &mut dyn Progress,
    ) -> Result<Predictions> {
        let mut this = Predictions::default();
        let Some(first) = configurations.first() else {
            return Ok(this);
        };
        for (i, c) in configurations.iter().enumerate() {
            if let Entry::Vacant(method) = this.methods.entry(c.method()) {
                let scattering = first.scattering;
                let of = Configuration { scattering, ..*c };
                method.insert(self.times(&of, choices)?);
            }
            if let Some(scattering) = c.scattering.filter(|s| Some(*s) != first.scattering)
                && let Entry::Vacant(way) = this.ways.entry(scattering.to_string())
            {
                let scattering = c.scattering;
                let of = Configuration {
                    scattering,
                    ..*first
                };
                way.insert(self.times(&of, choices)?);
            }
            progress.advance((i + 1) as f32 / configurations.len() as f32);
        }
        this.first = this.methods.get(&first.method()).copied();
        Ok(this)
    }
}

/// Predicted times.
#[derive(Default)]
struct Predictions {
    methods: BTreeMap<String, Times>,
    /// The first method's.
    first: Option<Times>,
    /// Those of the first method with another way to make what a medium scatters.
    ways: BTreeMap<String, Times>,
}

impl Predictions {
    fn of(&self, c: &Configuration) -> Option<f64> {
        let own = self.methods.get(&c.method())?.of(c.size, c.filter);
        let way = |scattering: Scattered| {
            let with = self.ways.get(&scattering.to_string())?;
            Some(with.of(c.size, c.filter) - self.first?.of(c.size, c.filter))
        };
        let more = c.scattering.and_then(way).unwrap_or(0.0);
        // Noise must not make anything free.
        Some((own + more).max(0.25 * own))
    }
}

/// A configuration that does what is wanted.
struct Found {
    configuration: Configuration,
    seconds: f64,
    bytes: usize,
}

/// Plans a scene's shadows: the fastest of the configurations of `choices` that is within the budgets.
///
/// # Errors
/// See [`crate::FrameError`]. That nothing is within the budgets, or for the scene, is no error.
pub fn plan(
    device: &mut dyn Device,
    shaders: &dyn Shaders,
    scene: &Scene,
    mesh: &Mesh,
    choices: &Choices,
    wanted: Wanted,
    progress: &mut dyn Progress,
) -> Result<std::result::Result<Plan, Impossible>> {
    let mut configurations = choices.configurations();
    configurations.retain(|c| c.suits(scene));
    let blind = blind(&configurations, scene, mesh)?;
    configurations.retain(|c| blind.iter().all(|b| b.what != c.method()));
    let mut unfit = unfit(choices, scene);
    unfit.extend(blind);
    if configurations.is_empty() {
        return Ok(Err(Impossible {
            wanted,
            nearest: None,
            rejected: unfit,
            considered: 0,
        }));
    }
    let mut search = Search {
        device,
        shaders,
        scene,
        mesh,
        pictures: Pictures::default(),
    };
    progress.begin("timing each method", 1, 3);
    let predictions = search.predictions(&configurations, choices, progress)?;
    let mut order: Vec<(f64, Configuration)> = configurations
        .iter()
        .filter_map(|c| Some((predictions.of(c)?, *c)))
        .collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));

    progress.begin("comparing with rays", 2, 3);
    let mut why = Reasons::default();
    let mut truth = Truth::new(scene, mesh, wanted.error);
    let mut found: Vec<Found> = Vec::new();
    let mut errors: Vec<(Configuration, Estimate)> = Vec::new();
    for (i, (predicted, c)) in order.iter().enumerate() {
        progress.advance((i + 1) as f32 / order.len() as f32);
        let best = found
            .iter()
            .map(|f| f.seconds)
            .fold(f64::INFINITY, f64::min);
        if *predicted > best * SLACK {
            why.add(c, Reason::Slower);
            continue;
        }
        if wanted.seconds.is_some_and(|most| *predicted > most * SLACK) {
            why.add(c, Reason::Time);
            continue;
        }
        let half = errors
            .iter()
            .find(|(e, _)| Configuration { size: c.size, ..*e } == *c && e.size * 2 == c.size);
        if let Some((_, half)) = half
            && half.low > wanted.error * DOUBLING
        {
            // What this one has at the very least: for maps that are larger still.
            let least = half.low / DOUBLING;
            let bound = Estimate {
                rms: least,
                low: least,
                high: half.high,
            };
            errors.push((*c, bound));
            why.add(c, Reason::Error(None));
            continue;
        }
        let picture = search.light(c)?;
        let (within, error) = truth.decide(&picture, wanted.error);
        errors.push((*c, error));
        why.probed += 1;
        if !within {
            why.add(c, Reason::Error(Some(error)));
            continue;
        }
        let sample = search.sample(c)?;
        if wanted.bytes.is_some_and(|most| sample.bytes > most) {
            why.add(c, Reason::Memory);
            continue;
        }
        found.push(Found {
            configuration: *c,
            seconds: sample.seconds().min(search.sample(c)?.seconds()),
            bytes: sample.bytes,
        });
    }

    progress.begin("timing the fastest", 3, 3);
    let best = found
        .iter()
        .map(|f| f.seconds)
        .fold(f64::INFINITY, f64::min);
    let (mut last, slower): (Vec<Found>, Vec<Found>) =
        found.into_iter().partition(|f| f.seconds <= best * CLOSE);
    for f in &slower {
        why.add(&f.configuration, Reason::Slower);
    }
    let mut rounds: Vec<Vec<Vec<Timing>>> = vec![Vec::new(); last.len()];
    for round in 0..ROUNDS {
        for (f, rounds) in last.iter().zip(&mut rounds) {
            rounds.push(search.sample(&f.configuration)?.passes);
        }
        progress.advance((round + 1) as f32 / ROUNDS as f32);
    }
    let whole = |passes: &Vec<Timing>| passes.iter().map(|p| p.seconds).sum::<f64>();
    for (f, rounds) in last.iter_mut().zip(&rounds) {
        f.seconds = median(rounds.iter().map(whole).collect());
    }
    let fastest = (0..last.len())
        .filter(|&i| wanted.seconds.is_none_or(|most| last[i].seconds <= most))
        .min_by(|&i, &j| last[i].seconds.total_cmp(&last[j].seconds));
    for (i, f) in last.iter().enumerate() {
        if Some(i) != fastest {
            let reason = match wanted.seconds {
                Some(most) if f.seconds > most => Reason::Time,
                _ => Reason::Slower,
            };
            why.add(&f.configuration, reason);
        }
    }
    let Some(fastest) = fastest else {
        let measured = errors
            .into_iter()
            .filter(|(_, e)| e.rms > e.low || e.low == e.high);
        let nearest = measured.min_by(|a, b| a.1.rms.total_cmp(&b.1.rms));
        return Ok(Err(Impossible {
            wanted,
            nearest: nearest.map(|(c, e)| (c.to_string(), e)),
            rejected: unfit.into_iter().chain(why.told(None)).collect(),
            considered: configurations.len(),
        }));
    };
    let times = of_passes(&rounds[fastest]);
    let chosen = last.swap_remove(fastest);
    let configured = chosen.configuration.on(scene);
    let (made, ..) = graph(&configured, mesh, Show::Picture)?;
    let seconds = chosen.seconds;
    Ok(Ok(Plan {
        choice: chosen.configuration.to_string(),
        configuration: chosen.configuration,
        wanted,
        error: truth.estimate(&search.light(&chosen.configuration)?),
        seconds,
        times,
        bytes: chosen.bytes,
        summary: made.summary(),
        rejected: unfit
            .into_iter()
            .chain(why.told(Some(&chosen.configuration)))
            .collect(),
        gain: gain(&configured, mesh),
        probed: why.probed,
        considered: configurations.len(),
        pixels: truth.known.len(),
        scene: configured,
    }))
}

/// What of the choices is not for a scene's lights, and why.
fn unfit(choices: &Choices, scene: &Scene) -> Vec<Omission> {
    let shadows = choices.techniques.iter().filter_map(|technique| {
        Some(Omission {
            what: technique.name.into(),
            why: technique.not_for(&scene.lights)?.into(),
        })
    });
    let scattered = choices.scatterings.iter().filter_map(|technique| {
        let instead = scene.lights.iter().find_map(|l| l.refuses(technique))?;
        Some(Omission {
            what: format!("scattering by {}", technique.name).into(),
            why: format!("it must be {instead}").into(),
        })
    });
    // Without a medium nothing is scattered.
    let scattered = scattered.filter(|_| scene.medium.is_some());
    shadows.chain(scattered).collect()
}

/// The methods that leave the shadow of a scene's translucent casters out, and why.
fn blind(configurations: &[Configuration], scene: &Scene, mesh: &Mesh) -> Result<Vec<Omission>> {
    let mut seen = BTreeMap::new();
    if mesh.translucent().is_empty() {
        return Ok(Vec::new());
    }
    for c in configurations {
        // It is the same for all sizes.
        if let Entry::Vacant(method) = seen.entry(c.method()) {
            let (graph, ..) = graph(&c.on(scene), mesh, Show::Light)?;
            let mut omitted = graph.omitted().iter();
            let why = omitted.find(|o| o.what == TRANSLUCENT);
            method.insert(why.map(|o| o.why.clone()));
        }
    }
    let blind = seen.into_iter().filter_map(|(method, why)| {
        Some(Omission {
            what: method.into(),
            why: format!("no {TRANSLUCENT}: {}", why?).into(),
        })
    });
    Ok(blind.collect())
}

/// The medians of the rounds' passes.
fn of_passes(rounds: &[Vec<Timing>]) -> Vec<Timing> {
    let names = rounds.first().into_iter().flatten().enumerate();
    let of = |(i, first): (usize, &Timing)| Timing {
        name: first.name.clone(),
        seconds: median(rounds.iter().map(|r| r[i].seconds).collect()),
    };
    names.map(of).collect()
}

fn gain(scene: &Scene, mesh: &Mesh) -> Gain {
    let view = |fit| {
        let mut scene = scene.clone();
        scene.shadow.fit = fit;
        light_view(&scene, &scene.lights[0], mesh)
    };
    let (whole, fitted) = (view(Fit::Scene), view(Fit::Camera));
    let area = |texel: [f32; 2]| f64::from(texel[0]) * f64::from(texel[1]);
    Gain {
        area: area(whole.texel) / area(fitted.texel),
        depth: f64::from(whole.depth) / f64::from(fitted.depth),
    }
}

/// Why a configuration was left out.
#[derive(Clone, Copy, Debug)]
enum Reason {
    /// Its error; `None` if a smaller map told.
    Error(Option<Estimate>),
    Slower,
    Time,
    Memory,
}

/// All of them, by method.
#[derive(Default)]
struct Reasons {
    probed: usize,
    of: BTreeMap<String, Vec<Reason>>,
}

impl Reasons {
    fn add(&mut self, configuration: &Configuration, reason: Reason) {
        for what in Self::names(configuration) {
            self.of.entry(what).or_default().push(reason);
        }
    }

    /// Under which names its reason is told: the method's, and that of the way to make what a medium scatters.
    fn names(configuration: &Configuration) -> impl Iterator<Item = String> {
        let scattering = configuration.scattering.as_ref();
        let scattering = scattering.map(|s| format!("scattering by {s}"));
        [configuration.method()].into_iter().chain(scattering)
    }

    /// For each method one sentence.
    fn told(&self, chosen: Option<&Configuration>) -> Vec<Omission> {
        let told = self.of.iter().map(|(method, reasons)| {
            let mut parts = Vec::new();
            let mut say = |count: usize, what: &str| {
                if count > 0 {
                    parts.push(format!("{count} {what}"));
                }
            };
            let count = |is: fn(&Reason) -> bool| reasons.iter().filter(|r| is(r)).count();
            let errors = reasons.iter().filter_map(|r| match r {
                Reason::Error(Some(e)) => Some(e.rms),
                _ => None,
            });
            let least = errors.fold(f64::INFINITY, f64::min);
            let far = format!("too far off (at best {least:.4})");
            say(count(|r| matches!(r, Reason::Error(Some(_)))), &far);
            say(
                count(|r| matches!(r, Reason::Error(None))),
                "not tried, as maps of half the size are too far off for one step to make up",
            );
            say(
                count(|r| matches!(r, Reason::Slower)),
                "slower than the choice",
            );
            say(
                count(|r| matches!(r, Reason::Time)),
                "beyond the time budget",
            );
            say(
                count(|r| matches!(r, Reason::Memory)),
                "beyond the memory budget",
            );
            let is_chosen = chosen.is_some_and(|c| Self::names(c).any(|name| name == *method));
            let what = if is_chosen {
                format!("{method}, in other configurations")
            } else {
                method.clone()
            };
            Omission {
                what: what.into(),
                why: parts.join(", ").into(),
            }
        });
        told.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_spread_and_each_comes_once() {
        for count in [1, 2, 7, 64, 1000, 64 * 36] {
            let mut all = spread(count);
            // The first half lies in both halves of the picture.
            if count > 60 {
                let low = all[..count / 2].iter().filter(|i| **i < count / 2).count();
                assert!(low.abs_diff(count / 4) <= count / 20, "{count}: {low}");
            }
            all.sort_unstable();
            assert_eq!(all, (0..count).collect::<Vec<_>>());
        }
    }

    #[test]
    fn an_estimate_holds_the_exact_error() {
        // One pixel in 50 is off by 0.5, in no order.
        let of = |i: usize| {
            if (i * 7919).is_multiple_of(50) {
                0.25
            } else {
                0.0
            }
        };
        let all: Vec<f64> = (0..50_000).map(of).collect();
        let exact = (0.25_f64 / 50.0).sqrt();
        let mut width = f64::INFINITY;
        for n in [500, 4000, 20_000, 50_000] {
            let e = estimate(&all[..n], all.len());
            assert!(
                e.low <= exact + 1e-9 && e.high >= exact - 1e-9,
                "{n}: {e:?}"
            );
            assert!(e.high - e.low < width, "{n}: {e:?}");
            width = e.high - e.low;
        }
        assert_eq!(width, 0.0);
        // No error in a few pixels is not yet none at all.
        assert!(estimate(&[0.0; 100], 1000).high > 0.05);
    }

    #[test]
    fn times_go_through_what_was_measured_and_on() {
        let times = Times {
            sizes: [256, 512],
            filters: [3, 9],
            filtered: [[2.0, 3.0], [5.0, 9.0]],
            plain: [1.0, 2.5],
        };
        assert_eq!(times.of(256, 3), 2.0);
        assert_eq!(times.of(512, 9), 9.0);
        assert_eq!(times.of(256, 6), 2.5);
        assert_eq!(times.of(512, 1), 2.5);
        // Four times the texels, three times the step to 512² and once more 512²'s.
        assert_eq!(times.of(1024, 1), 1.0 + 1.5 * 5.0);
    }
}
