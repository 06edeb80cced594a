//! Measuring many configurations, in a way that can be interrupted.

use std::collections::HashMap;
use std::path::Path;
use std::time::{Duration, Instant};

use hankel_host::device::Device;
use rayon::prelude::*;

use super::store::{Line, Store, StoreError};
use super::{Configuration, Pictures, median, sample};
use crate::error::Result;
use crate::executor::{Shaders, Timing};
use crate::scene::{Mesh, Scene};
use crate::truth::scattering::Through;
use crate::truth::{Arriving, Errors, by_rays};

/// A scene in one size of the picture.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The scene's name.
    pub name: String,
    /// What there is. Its shadow is not used.
    pub scene: Scene,
    /// Its triangles.
    pub mesh: Mesh,
}

impl Subject {
    /// Its name and size, which tell it from others of a session.
    #[must_use]
    pub fn key(&self) -> String {
        format!("{} {}x{}", self.name, self.scene.width, self.scene.height)
    }

    /// What it holds, as a number (FNV-1a) that is another for another content.
    fn fingerprint(&self) -> u64 {
        let mut view = format!("{:?} {:?}", self.scene.camera, self.scene.lights);
        if let Some(medium) = &self.scene.medium {
            view.push_str(&format!(" {medium:?}"));
        }
        let mesh: &Mesh = &self.mesh;
        let parts: [&[u8]; 6] = [
            view.as_bytes(),
            bytemuck::cast_slice(&mesh.positions),
            bytemuck::cast_slice(&mesh.normals),
            bytemuck::cast_slice(&mesh.colours),
            bytemuck::cast_slice(&mesh.opacities),
            bytemuck::cast_slice(mesh.indices()),
        ];
        // Where one ends and the next begins counts, too.
        let bytes = parts.into_iter().flat_map(|part| {
            part.len()
                .to_le_bytes()
                .into_iter()
                .chain(part.iter().copied())
        });
        bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        })
    }
}

/// By so much the doubling of the steps along rays through a medium changes the truth at most: a tenth of an error
/// of 0.0025.
const STEADY: f64 = 2.5e-4;

/// What is measured of each subject.
#[derive(Clone, Debug)]
pub struct Ask {
    /// Each of them.
    pub configurations: Vec<Configuration>,
    /// How often each one's time is taken.
    pub rounds: usize,
}

impl Ask {
    /// Those that are meant for a subject's light.
    fn of<'a>(&'a self, subject: &'a Subject) -> impl Iterator<Item = &'a Configuration> {
        let all = self.configurations.iter();
        all.filter(|configuration| configuration.suits(&subject.scene))
    }
}

/// A measured configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Measurement {
    /// The scene's name.
    pub scene: String,
    /// Pixels of the picture.
    pub output: [u32; 2],
    /// What was measured.
    pub configuration: Configuration,
    /// Against [`crate::truth::by_rays`]; in a scene with a medium of the light that comes through it, see
    /// [`crate::truth::scattering::behind`].
    pub errors: Errors,
    /// Of what the medium scatters alone.
    pub scattered: Option<Errors>,
    /// On the device.
    pub bytes: usize,
    /// The times of the passes in each round.
    pub rounds: Vec<Vec<Timing>>,
}

impl Measurement {
    /// The median over the rounds of all passes together.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        let whole = |passes: &Vec<Timing>| passes.iter().map(|p| p.seconds).sum();
        median(self.rounds.iter().map(whole).collect())
    }

    /// The passes, in order, each with the median of its times.
    #[must_use]
    pub fn passes(&self) -> Vec<Timing> {
        let names = self.rounds.first().into_iter().flatten().enumerate();
        let of = |(i, first): (usize, &Timing)| Timing {
            name: first.name.clone(),
            seconds: median(self.rounds.iter().map(|r| r[i].seconds).collect()),
        };
        names.map(of).collect()
    }
}

/// A kind of step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Truth,
    Errors,
    Round,
}

/// How far a session is.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// What was done last.
    pub what: String,
    /// Steps that are done, those of an earlier process included.
    pub done: usize,
    /// All steps.
    pub steps: usize,
    /// How long the rest will take if it goes on like this; `None` before anything was done.
    pub remaining: Option<Duration>,
}

/// Steps of each kind: how many there are, how many are done, and how long those of this process took.
#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    steps: usize,
    done: usize,
    timed: usize,
    seconds: f64,
}

/// A file of measurements, and what is added to it.
pub struct Session {
    store: Store,
    conditions: HashMap<String, String>,
    truths: HashMap<String, Vec<f32>>,
    errors: HashMap<(String, String), (Errors, Option<Errors>, usize)>,
    rounds: HashMap<(String, String), Vec<Vec<Timing>>>,
    tallies: [Tally; 3],
}

impl Session {
    /// Opens a file of measurements, or makes it. `conditions` are names and values that must be the
    /// same whenever something is added: the device, for example.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn open(file: &Path, conditions: &[(&str, String)]) -> Result<Self, StoreError> {
        let (store, lines) = Store::open(file)?;
        let mut this = Self {
            store,
            conditions: HashMap::new(),
            truths: HashMap::new(),
            errors: HashMap::new(),
            rounds: HashMap::new(),
            tallies: [Tally::default(); 3],
        };
        for line in lines {
            this.learn(line);
        }
        for (name, value) in conditions {
            this.require(name, value)?;
        }
        Ok(this)
    }

    fn learn(&mut self, line: Line) {
        match line {
            Line::Conditions { name, value } => {
                self.conditions.insert(name, value);
            }
            Line::Truth { subject, values } => {
                self.truths.insert(subject, values);
            }
            Line::Errors {
                subject,
                configuration,
                errors,
                scattered,
                bytes,
            } => {
                let known = (errors, scattered, bytes);
                self.errors.insert((subject, configuration), known);
            }
            Line::Round {
                subject,
                configuration,
                passes,
            } => {
                let of = self.rounds.entry((subject, configuration));
                of.or_default().push(passes);
            }
        }
    }

    fn add(&mut self, line: Line) -> Result<(), StoreError> {
        self.store.add(&line)?;
        self.learn(line);
        Ok(())
    }

    fn require(&mut self, name: &str, value: &str) -> Result<(), StoreError> {
        match self.conditions.get(name) {
            Some(was) if was == value => Ok(()),
            Some(was) => Err(StoreError::Other {
                file: self.store.path().to_path_buf(),
                was: format!("{name} {was}"),
                is: value.to_owned(),
            }),
            None => self.add(Line::Conditions {
                name: name.to_owned(),
                value: value.to_owned(),
            }),
        }
    }

    /// The light of a subject's pixels by rays, if it was measured.
    #[must_use]
    pub fn truth(&self, subject: &Subject) -> Option<Arriving> {
        self.truths.get(&subject.key()).map(|values| Arriving {
            width: subject.scene.width,
            height: subject.scene.height,
            values: values.clone(),
        })
    }

    /// The truth of a subject, and of what its medium scatters.
    fn truths(
        &mut self,
        subject: &Subject,
        status: &mut dyn FnMut(&Status),
    ) -> Result<(Arriving, Option<Arriving>)> {
        let (scene, mesh, key) = (&subject.scene, &subject.mesh, subject.key());
        let scattered_key = format!("{key}, scattered");
        let picture = |values: Vec<f32>| Arriving {
            width: scene.width,
            height: scene.height,
            values,
        };
        let known = self.truths.get(&key).cloned();
        let scattered = self.truths.get(&scattered_key).cloned();
        if let Some(values) = known
            && scattered.is_some() == scene.medium.is_some()
        {
            return Ok((picture(values), scattered.map(picture)));
        }
        let start = Instant::now();
        let through = Through::new(scene, mesh, STEADY);
        let (values, scattered) = match &through {
            None => (by_rays(scene, mesh, &mut |_| ()).values, None),
            Some(through) => {
                let pixels = (0..scene.width * scene.height).into_par_iter();
                let both = pixels.map(|i| {
                    let scattered = through.scattered(i);
                    (through.surfaces(i) + scattered, scattered)
                });
                let both = both.map(|(seen, scattered)| (seen as f32, scattered as f32));
                let (seen, scattered): (Vec<f32>, Vec<f32>) = both.unzip();
                (seen, Some(scattered))
            }
        };
        if let Some(values) = &scattered {
            self.add(Line::Truth {
                subject: scattered_key,
                values: values.clone(),
            })?;
        }
        self.add(Line::Truth {
            subject: key.clone(),
            values: values.clone(),
        })?;
        status(&self.finished(Kind::Truth, start, format!("{key}: light by rays")));
        Ok((picture(values), scattered.map(picture)))
    }

    /// Says which subjects will be measured, for [`Status::remaining`].
    pub fn expect(&mut self, subjects: &[Subject], ask: &Ask) {
        self.tallies = [Tally::default(); 3];
        for subject in subjects {
            let key = subject.key();
            let truth = usize::from(self.truths.contains_key(&key));
            self.count(Kind::Truth, 1, truth);
            for configuration in ask.of(subject) {
                let both = (key.clone(), configuration.to_string());
                let known = usize::from(self.errors.contains_key(&both));
                self.count(Kind::Errors, 1, known);
                let rounds = self.rounds.get(&both).map_or(0, Vec::len);
                self.count(Kind::Round, ask.rounds, rounds.min(ask.rounds));
            }
        }
    }

    const fn count(&mut self, kind: Kind, steps: usize, done: usize) {
        let tally = &mut self.tallies[kind as usize];
        tally.steps += steps;
        tally.done += done;
    }

    fn finished(&mut self, kind: Kind, start: Instant, what: String) -> Status {
        let tally = &mut self.tallies[kind as usize];
        tally.done += 1;
        tally.timed += 1;
        tally.seconds += start.elapsed().as_secs_f64();
        Status {
            what,
            done: self.tallies.iter().map(|t| t.done).sum(),
            steps: self.tallies.iter().map(|t| t.steps).sum(),
            remaining: self.remaining(),
        }
    }

    /// Steps of a kind that has not been timed yet count as those of all kinds.
    fn remaining(&self) -> Option<Duration> {
        let timed: usize = self.tallies.iter().map(|t| t.timed).sum();
        let seconds: f64 = self.tallies.iter().map(|t| t.seconds).sum();
        let rest = self.tallies.iter().map(|t| {
            let mean = match t.timed {
                0 => seconds / timed as f64,
                timed => t.seconds / timed as f64,
            };
            mean * t.steps.saturating_sub(t.done) as f64
        });
        (timed > 0).then(|| Duration::from_secs_f64(rest.sum()))
    }

    /// Measures what of a subject is not known yet, and gives all that was asked for. In each round
    /// every configuration has its turn, in the order of the one before turned round.
    ///
    /// # Errors
    /// [`crate::FrameError`]. What was measured until then is kept.
    pub fn measure(
        &mut self,
        device: &mut dyn Device,
        shaders: &dyn Shaders,
        subject: &Subject,
        ask: &Ask,
        status: &mut dyn FnMut(&Status),
    ) -> Result<Vec<Measurement>> {
        let (scene, mesh, key) = (&subject.scene, &subject.mesh, subject.key());
        let content = format!("{:016x}", subject.fingerprint());
        self.require(&format!("the content of {key}:"), &content)?;
        let (truth, scattered_truth) = self.truths(subject, status)?;
        let mut pictures = Pictures::default();
        let name_of = |c: &Configuration| (key.clone(), c.to_string());
        for configuration in ask.of(subject) {
            let (subject, name) = name_of(configuration);
            if self.errors.contains_key(&(subject.clone(), name.clone())) {
                continue;
            }
            let start = Instant::now();
            let configured = configuration.on(scene);
            let light = pictures.light(device, shaders, scene, mesh, configuration)?;
            let errors = light.errors(&truth)?;
            let scattered = match &scattered_truth {
                Some(truth) => {
                    let drawn = pictures.scattered(device, shaders, scene, mesh, configuration)?;
                    Some(drawn.errors(truth)?)
                }
                None => None,
            };
            let bytes = sample(device, shaders, &configured, mesh)?.bytes;
            let what = format!("{key}: errors of {name}");
            self.add(Line::Errors {
                subject,
                configuration: name,
                errors,
                scattered,
                bytes,
            })?;
            status(&self.finished(Kind::Errors, start, what));
        }
        let mut order: Vec<&Configuration> = ask.of(subject).collect();
        for round in 0..ask.rounds {
            order.reverse();
            for configuration in &order {
                let both = name_of(configuration);
                if self.rounds.get(&both).is_some_and(|r| r.len() > round) {
                    continue;
                }
                let start = Instant::now();
                let passes = sample(device, shaders, &configuration.on(scene), mesh)?.passes;
                let (subject, configuration) = both;
                let what = format!("{key}, round {}: {configuration}", round + 1);
                self.add(Line::Round {
                    subject,
                    configuration,
                    passes,
                })?;
                status(&self.finished(Kind::Round, start, what));
            }
        }
        let known = ask.of(subject).filter_map(|configuration| {
            let both = name_of(configuration);
            let (errors, scattered, bytes) = *self.errors.get(&both)?;
            Some(Measurement {
                scene: subject.name.clone(),
                output: [scene.width, scene.height],
                configuration: *configuration,
                errors,
                scattered,
                bytes,
                rounds: self.rounds.get(&both)?.clone(),
            })
        });
        Ok(known.collect())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn whatever_changes_a_picture_makes_another_subject() {
        let text = "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\ntarget = [0.0, 0.5, 0.0]\n\
                    [light]\ndirection = [-1.0, -2.0, -0.5]\n[shadow]\ntechnique = \"hamburger\"\n";
        let scene = Scene::parse(text, Path::new("s.toml")).unwrap();
        let mesh = scene.mesh().unwrap();
        let of = |change: &dyn Fn(&mut Mesh)| {
            let mut mesh = mesh.clone();
            change(&mut mesh);
            let (name, scene) = ("s".into(), scene.clone());
            Subject { name, scene, mesh }.fingerprint()
        };
        let changes: [&dyn Fn(&mut Mesh); 6] = [
            &|_| {},
            &|mesh| mesh.opacities = vec![0.5; mesh.positions.len()],
            &|mesh| mesh.opacities = vec![0.25; mesh.positions.len()],
            &|mesh| mesh.normals[0].x += 0.5,
            &|mesh| mesh.colours[0].x += 0.5,
            &|mesh| mesh.triangles.swap(0, 1),
        ];
        let all: std::collections::BTreeSet<u64> = changes.into_iter().map(of).collect();
        assert_eq!(all.len(), changes.len());
    }
}
