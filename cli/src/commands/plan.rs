use hankel_frames::measure::Choices;
use hankel_frames::plan::{Impossible, Plan, Wanted, plan};
use hankel_frames::scattering::{self, Scattering};
use hankel_frames::scene::{Fit, Mesh, Scene};
use hankel_frames::techniques::{self, Technique};
use hankel_host::device::{self, Device};

use crate::args::{Backend, Choose, Fitted, Format, Maps, Plan as Args};
use crate::failure::{Failure, Outcome, Result};
use crate::print::{self, say};
use crate::progress::Progress;
use crate::session::{Session, Words};

pub fn run(args: &Args, quiet: bool) -> Result<Outcome> {
    let scene = Scene::read(&args.scene)?;
    let choices = choices(&args.choose, scene.medium.is_some())?;
    let mesh = scene.mesh()?;
    let wanted = Wanted {
        error: args.error,
        seconds: args.time.map(|milliseconds| milliseconds * 1e-3),
        bytes: args.memory.map(|megabytes| (megabytes * 1e6) as usize),
    };
    let quiet = quiet || args.format == Format::Json;
    let found = of_scene(&scene, &mesh, &choices, wanted, args.backend, quiet)?;
    match (args.format, &found) {
        (Format::Json, Ok(plan)) => print::json(plan),
        (Format::Json, Err(none)) => print::json(none),
        (Format::Text, Ok(plan)) => say!("{plan}"),
        (Format::Text, Err(none)) => say!("{none}"),
    }
    Ok(Outcome::of(found.is_ok()))
}

/// Plans on the backend.
pub fn of_scene(
    scene: &Scene,
    mesh: &Mesh,
    choices: &Choices,
    wanted: Wanted,
    backend: Backend,
    quiet: bool,
) -> Result<std::result::Result<Plan, Impossible>> {
    let (mut device, shaders) = open(backend, quiet)?;
    let mut progress = Progress::new(quiet);
    Ok(plan(
        &mut *device,
        &shaders,
        scene,
        mesh,
        choices,
        wanted,
        &mut progress,
    )?)
}

/// A device, and the shaders that it takes.
pub fn open(backend: Backend, quiet: bool) -> Result<(Box<dyn Device>, Words)> {
    // Whether there is a driver shows before anything else is done.
    let device = device::open(backend.into())?;
    let shaders = match backend {
        Backend::Native => Words::new(),
        Backend::Vulkan => Session::linked(quiet).all_words()?,
    };
    Ok((device, shaders))
}

/// The technique of a name.
pub fn technique(name: &str) -> Result<&'static Technique> {
    Technique::named(name).ok_or_else(|| {
        let names = techniques::ALL.map(|t| t.name).join(", ");
        Failure::input(
            format!("there is no technique {name}"),
            format!("There are {names}."),
        )
    })
}

/// What was chosen, and what there is of the rest. Without a medium in a scene, nothing is scattered.
pub fn choices(args: &Choose, has_medium: bool) -> Result<Choices> {
    let mut choices = of_maps(&args.maps);
    if !args.technique.is_empty() {
        let named: Result<Vec<_>> = args.technique.iter().map(|name| technique(name)).collect();
        choices.techniques = named?;
    }
    if !args.scattering.is_empty() {
        let named: Result<Vec<_>> = args
            .scattering
            .iter()
            .map(|name| scattering(name))
            .collect();
        choices.scatterings = named?;
    }
    if !args.steps.is_empty() {
        choices.steps = sorted(args.steps.clone());
    }
    let of_media = [
        ("--scattering", args.scattering.is_empty()),
        ("--steps", args.steps.is_empty()),
    ];
    for (option, is_missing) in of_media {
        if !is_missing && !has_medium {
            return Err(Failure::input(
                format!("{option} is for scenes with a medium, and the scene has no medium"),
                format!("Leave {option} out, or add a [medium] to the scene."),
            ));
        }
    }
    let mut seen = Vec::new();
    choices.techniques.retain(|t| is_new(&mut seen, t.name));
    let mut seen = Vec::new();
    choices.scatterings.retain(|t| is_new(&mut seen, t.name));
    Ok(choices)
}

fn is_new(seen: &mut Vec<&'static str>, name: &'static str) -> bool {
    let is_new = !seen.contains(&name);
    seen.push(name);
    is_new
}

/// The technique of scattering of a name.
fn scattering(name: &str) -> Result<&'static Scattering> {
    Scattering::named(name).ok_or_else(|| {
        let names = scattering::ALL.map(|t| t.name).join(", ");
        Failure::input(
            format!("there is no technique of scattering {name}"),
            format!("There are {names}."),
        )
    })
}

fn sorted(mut all: Vec<u32>) -> Vec<u32> {
    all.sort_unstable();
    all.dedup();
    all
}

/// The maps that were chosen, with all techniques.
pub fn of_maps(args: &Maps) -> Choices {
    let mut choices = Choices::default();
    if !args.size.is_empty() {
        choices.sizes = sorted(args.size.clone());
    }
    if !args.filter.is_empty() {
        choices.filters = sorted(args.filter.clone());
    }
    if !args.fit.is_empty() {
        let chosen = |fit: &Fit| {
            let wanted = match fit {
                Fit::Scene => Fitted::Scene,
                Fit::Camera => Fitted::Camera,
            };
            args.fit.contains(&wanted)
        };
        choices.fits.retain(chosen);
    }
    if !args.multisampling.is_empty() {
        let chosen = |samples: &u32| args.multisampling.contains(samples);
        choices.multisampling.retain(chosen);
    }
    choices
}
