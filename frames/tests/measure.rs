//! Measuring that can be interrupted, and plans against everything that could have been chosen.

use std::collections::BTreeMap;
use std::path::Path;

use hankel_dsl::glam::Vec3;
use hankel_frames::measure::{Ask, Choices, Measurement, Session, Subject};
use hankel_frames::plan::{Impossible, Plan, Wanted, plan};
use hankel_frames::scattering::Scattering;
use hankel_frames::scene::{Fit, Medium, Scene, Source, Spot};
use hankel_frames::techniques::Technique;
use hankel_frames::truth::{Arriving, by_rays, by_technique};
use hankel_frames::{FrameError, NoShaders, Progress, Quiet};
use hankel_host::device::NativeDevice;

fn subject(output: [u32; 2]) -> Subject {
    let text = format!(
        "[geometry]\nprocedural = 'fence'\n[camera]\neye = [3.2, 3.4, 7.2]\ntarget = [0.0, 0.1, -0.4]\n\
         [light]\ndirection = [0.5, -0.55, -0.67]\n[output]\nwidth = {}\nheight = {}\n",
        output[0], output[1]
    );
    let scene = Scene::parse(&text, Path::new("test.toml")).unwrap_or_else(|e| panic!("{e}"));
    let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
    Subject {
        name: "fence".into(),
        scene,
        mesh,
    }
}

fn choices() -> Choices {
    Choices {
        techniques: ["hamburger", "vsm", "pcf"]
            .map(|n| Technique::named(n).unwrap())
            .to_vec(),
        sizes: vec![64, 128],
        filters: vec![1, 3],
        fits: vec![Fit::Camera],
        ..Choices::default()
    }
}

#[test]
fn what_is_finished_is_not_measured_again() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("measured.jsonl");
    let conditions = [("device", "a".to_owned())];
    let subject = subject([32, 18]);
    let mut device = NativeDevice::new();
    let mut measure = |rounds: usize| -> (Vec<Measurement>, Vec<(usize, usize)>) {
        let ask = Ask {
            configurations: choices().configurations()[..3].to_vec(),
            rounds,
        };
        let mut session = Session::open(&file, &conditions).unwrap();
        session.expect(std::slice::from_ref(&subject), &ask);
        let mut told = Vec::new();
        let mut tell = |s: &hankel_frames::measure::Status| {
            assert!(s.remaining.is_some());
            told.push((s.done, s.steps));
        };
        let found = session.measure(&mut device, &NoShaders, &subject, &ask, &mut tell);
        assert!(session.truth(&subject).is_some());
        (found.unwrap(), told)
    };
    let (one, told) = measure(1);
    assert_eq!(told, (1..=7).map(|i| (i, 7)).collect::<Vec<_>>());
    let (two, told) = measure(2);
    // Only the second round was left.
    assert_eq!(told, [(8, 10), (9, 10), (10, 10)]);
    assert_eq!(two.len(), 3);
    for (one, two) in one.iter().zip(&two) {
        assert_eq!((one.errors, one.bytes), (two.errors, two.bytes));
        assert_eq!((&one.rounds[0], two.rounds.len()), (&two.rounds[0], 2));
        assert!(two.seconds() > 0.0 && two.bytes > 0);
        let sum: f64 = two.passes().iter().map(|p| p.seconds).sum();
        assert!(sum > 0.0 && two.passes().last().unwrap().name == "shade");
    }
    let (again, told) = measure(2);
    assert_eq!((again, told), (two, Vec::new()));

    // Ended in the middle: what is whole is kept.
    let text = std::fs::read_to_string(&file).unwrap();
    let half = text.len() - text.lines().last().unwrap().len() / 2;
    std::fs::write(&file, &text[..half]).unwrap();
    let (_, told) = measure(2);
    assert_eq!(told, [(10, 10)]);

    // Under other conditions, or of another scene, nothing is added.
    let other = Session::open(&file, &[("device", "b".to_owned())]);
    let error = other.err().unwrap().to_string();
    assert!(
        error.contains("device a") && error.contains("another folder"),
        "{error}"
    );
    let mut moved = subject.clone();
    moved.scene.camera.fov = 41.0;
    let ask = Ask {
        configurations: choices().configurations()[..3].to_vec(),
        rounds: 2,
    };
    let mut session = Session::open(&file, &conditions).unwrap();
    let refused = session.measure(&mut device, &NoShaders, &moved, &ask, &mut |_| ());
    assert!(matches!(refused, Err(FrameError::Store(_))), "{refused:?}");
}

/// The errors of everything that could be chosen, over all pixels.
fn exhaustively(subject: &Subject, truth: &Arriving) -> BTreeMap<String, f64> {
    let of = |c: &hankel_frames::measure::Configuration| {
        let light = by_technique(&c.on(&subject.scene), &subject.mesh).unwrap();
        (c.to_string(), light.errors(truth).unwrap().rms)
    };
    let all = choices().configurations();
    let suiting = all.iter().filter(|c| c.suits(&subject.scene));
    suiting.map(of).collect()
}

fn planned(subject: &Subject, wanted: Wanted) -> Result<Plan, Impossible> {
    planned_of(subject, &choices(), wanted, &mut Quiet)
}

fn planned_of(
    subject: &Subject,
    choices: &Choices,
    wanted: Wanted,
    progress: &mut dyn Progress,
) -> Result<Plan, Impossible> {
    let (scene, mesh) = (&subject.scene, &subject.mesh);
    let mut device = NativeDevice::new();
    plan(
        &mut device,
        &NoShaders,
        scene,
        mesh,
        choices,
        wanted,
        progress,
    )
    .unwrap()
}

const fn within(error: f64) -> Wanted {
    Wanted {
        error,
        seconds: None,
        bytes: None,
    }
}

#[test]
fn a_plan_is_within_the_error() {
    let subject = subject([96, 54]);
    let truth = by_rays(&subject.scene, &subject.mesh, &mut |_| ());
    let all = exhaustively(&subject, &truth);
    let mut errors: Vec<f64> = all.values().copied().collect();
    errors.sort_by(f64::total_cmp);
    // Half of the configurations are good enough.
    let budget = errors[errors.len() / 2];
    let plan = planned(&subject, within(budget)).unwrap();
    let error = all[&plan.choice];
    assert!(error <= budget, "{}: {error} of {budget}", plan.choice);
    assert!(
        plan.error.low <= error + 1e-9 && error <= plan.error.high + 1e-9,
        "{:?} {error}",
        plan.error
    );
    assert!(plan.probed <= plan.considered && plan.considered == all.len());
    assert!(plan.pixels <= 96 * 54 && plan.pixels >= 4096);
    let text = plan.to_string();
    for part in [
        "1. depth: light_depth",
        "predicted: error",
        "fitted to what the camera sees",
        "not ",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn what_cannot_be_had_is_said() {
    let subject = subject([48, 27]);
    let truth = by_rays(&subject.scene, &subject.mesh, &mut |_| ());
    let all = exhaustively(&subject, &truth);
    let least = all.values().copied().fold(f64::INFINITY, f64::min);
    let none = planned(&subject, within(1e-4)).unwrap_err();
    let (name, nearest) = none.nearest.clone().unwrap();
    // The nearest of those that were tried; which of half the size were hopeless was not.
    assert!(nearest.low <= all[&name] && all[&name] <= nearest.high);
    assert!(nearest.rms >= least - 1e-9, "{nearest:?} {least}");
    assert!(none.to_string().contains("too far off"), "{none}");
    // Memory and time that nothing has.
    let wanted = Wanted {
        bytes: Some(1000),
        ..within(0.9)
    };
    let none = planned(&subject, wanted).unwrap_err();
    assert!(
        none.to_string().contains("beyond the memory budget"),
        "{none}"
    );
    let wanted = Wanted {
        seconds: Some(1e-7),
        ..within(0.9)
    };
    let none = planned(&subject, wanted).unwrap_err();
    assert!(
        none.to_string().contains("beyond the time budget"),
        "{none}"
    );
}

/// No step may begin.
struct Never;

impl Progress for Never {
    fn begin(&mut self, name: &str, _: usize, _: usize) {
        panic!("began: {name}");
    }

    fn advance(&mut self, _: f32) {}
}

#[test]
fn what_is_not_for_the_lights_is_said_before_anything_is_drawn() {
    let mut subject = subject([48, 27]);
    let by = |names: &[&str]| Choices {
        techniques: names
            .iter()
            .map(|name| Technique::named(name).unwrap())
            .collect(),
        ..choices()
    };
    let chosen = by(&["pcss", "soft"]);
    let none = planned_of(&subject, &chosen, within(0.9), &mut Never).unwrap_err();
    assert_eq!(none.considered, 0);
    let text = none.to_string();
    for part in [
        "nothing that was chosen is for this scene",
        "not pcss: it is for lights with an area",
        "not soft: it is for lights with an area",
        "give a light a `radius`",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    let json = serde_json::to_value(&none).unwrap();
    assert_eq!(json["considered"], 0);
    assert_eq!(json["rejected"][0]["what"], "pcss");
    let why = json["rejected"][0]["why"].as_str().unwrap();
    assert!(why.contains("`radius`"), "{why}");

    // It is said beside a plan as well.
    let chosen = by(&["pcss", "pcf"]);
    let plan = planned_of(&subject, &chosen, within(0.9), &mut Quiet).unwrap();
    let text = plan.to_string();
    assert!(text.contains("not pcss: it is for lights"), "{text}");

    // With an area it is for the light.
    let pcss = Technique::named("pcss").unwrap();
    assert!(pcss.not_for(&subject.scene.lights).is_some());
    subject.scene.lights[0].area.radius = 0.02;
    assert_eq!(pcss.not_for(&subject.scene.lights), None);

    // Ways to scatter light that are not for spot lights.
    subject.scene.medium = Some(Medium::default());
    subject.scene.lights[0].source = Source::Spot(Spot {
        position: Vec3::new(0.0, 4.0, 0.0),
        direction: Vec3::NEG_Y,
        angle: 60.0,
        inner: 48.0,
    });
    let chosen = Choices {
        scatterings: vec![Scattering::named("prefiltered").unwrap()],
        ..by(&["pcss", "pcf"])
    };
    let none = planned_of(&subject, &chosen, within(0.9), &mut Never).unwrap_err();
    let text = none.to_string();
    assert!(
        text.contains("not scattering by prefiltered: it must be `ray-marching`"),
        "{text}"
    );
    assert!(!text.contains("not pcss"), "{text}");
}
