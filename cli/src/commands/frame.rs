//! Exported frames: `build --scene` and `check --scene`.

use std::path::{Path, PathBuf};

use hankel_codegen::build::{Generated, MANIFEST_FILE, Request, check_output, write};
use hankel_codegen::frame::{self, Draft, FRAME_FILE, Frame};
use hankel_frames::scene::Scene;
use hankel_frames::{FrameError, export, recorded, recorded_medium};
use hankel_system::input;

use super::build::{depend, keep, tell};
use super::scene::{AUTO, Asked, files, with_technique};
use crate::args::{Build, Check, Form, Format, Generate};
use crate::failure::{Failure, Outcome, Result, blame_of_input};
use crate::print::say;
use crate::session::{Followed, Session};

/// Most bytes of `frame.json`.
const MAX_BYTES: u64 = 64 << 20;

/// Writes the frame of `args.frame.scene`.
pub fn build(args: &Build, file: &Path, quiet: bool) -> Result<Outcome> {
    refuse(&args.generate)?;
    for (option, given) in [
        ("--form functions", args.form == Form::Functions),
        ("--watch", args.watch),
    ] {
        if given {
            return Err(Failure::input(
                format!("{option} does not go with --scene"),
                "A frame is made of the kernels in this program: build it after an edit of the scene, \
                 without this option.",
            ));
        }
    }
    check_output(&args.out)?;
    let of_scene = &args.frame;
    let asked = Asked {
        technique: of_scene.technique.as_deref(),
        error: of_scene.error,
        maps: &of_scene.maps,
        backend: of_scene.backend.unwrap_or_default(),
        image_passes: of_scene.image_passes.unwrap_or_default(),
    };
    let scene = asked.read(file)?;
    let quiet = quiet || args.format == Format::Json;
    let Some(scene) = asked.planned(scene, quiet)? else {
        return Ok(Outcome::CheckFailed);
    };
    let draft = draft(&scene, file)?;
    let session = Session::linked(quiet);
    let request = session.request(&args.generate)?;
    let generated = generate(&session, &request, &draft)?;
    let followed = Followed {
        paths: inputs(args, file, &scene)?,
        environment: Vec::new(),
    };
    keep(args, generated.files.keys(), &followed.paths)?;
    let report = write(&generated, &args.out, args.force)?;
    depend(args, MANIFEST_FILE, &followed)?;
    if !quiet {
        let bytes: usize = draft.contents.values().map(Vec::len).sum();
        say!(
            "{}: {} passes, {:.1} MB of buffers",
            args.out.join(FRAME_FILE).display(),
            draft.frame.passes.len(),
            bytes as f64 / 1e6
        );
    }
    tell(args, &report, quiet);
    Ok(Outcome::Fine)
}

/// What to do with a frame that says what is not known.
const AGAIN: &str = "Build the frame again: another version of hankel wrote it, or it was edited.";

/// What a folder with the frame of `file` must hold.
pub fn expected(args: &Check, file: &Path, quiet: bool) -> Result<Generated> {
    refuse(&args.generate)?;
    let mut scene = Scene::read(file)?;
    match args.technique.as_deref() {
        None => {}
        Some(AUTO) => {
            let record = read(&args.folder)?;
            scene.shadow = recorded(&record.shadow).ok_or_else(|| {
                Failure::input(
                    format!(
                        "{}: there is no technique {} with a map of {} texels, {}, fit to the {}",
                        args.folder.join(FRAME_FILE).display(),
                        record.shadow.technique,
                        record.shadow.format,
                        record.shadow.depth_range,
                        record.shadow.fit
                    ),
                    AGAIN,
                )
            })?;
            if let (Some(medium), Some(scattering)) = (&mut scene.medium, &record.scattering) {
                *medium = recorded_medium(medium, scattering).ok_or_else(|| {
                    Failure::input(
                        format!(
                            "{}: there is no technique of scattering {}",
                            args.folder.join(FRAME_FILE).display(),
                            scattering.technique
                        ),
                        AGAIN,
                    )
                })?;
            }
        }
        Some(name) => scene.shadow = with_technique(scene.shadow, name)?,
    }
    // Of a file that cannot be read, the comparison tells.
    if let Ok(record) = read(&args.folder) {
        scene.image_passes = record.image_passes.parse().unwrap_or_default();
    }
    let session = Session::linked(quiet);
    let request = session.request_again(&args.generate, &args.folder)?;
    generate(&session, &request, &draft(&scene, file)?)
}

/// Refuses what a folder with a frame cannot be compared with: a build of kernels.
pub fn refuse_without_scene(args: &Check) -> Result<()> {
    if args.scene.is_none() && read(&args.folder).is_ok() {
        return Err(Failure::input(
            format!("{} holds a frame", args.folder.display()),
            "Give its scene with --scene, and --technique if it was not built with the scene's own \
             technique.",
        ));
    }
    Ok(())
}

/// The frame that a folder holds.
fn read(folder: &Path) -> Result<Frame> {
    let file = folder.join(FRAME_FILE);
    let text = input::read_text(&file, MAX_BYTES)
        .map_err(|error| Failure::new(blame_of_input(&error), &error, None))?;
    Frame::from_json(text.as_bytes()).map_err(|problem| {
        Failure::input(
            format!("{}: {problem}", file.display()),
            "Give a folder that `hankel build --scene` made.",
        )
    })
}

/// Refuses options that say what the frame itself says.
fn refuse(it: &Generate) -> Result<()> {
    let given = [
        ("--manifest-path", it.source.manifest_path.is_some()),
        ("--kernel", !it.kernels.is_empty()),
        ("--set", !it.set.is_empty()),
        ("--variant", !it.variants.is_empty()),
        ("--open-constants", it.open_constants),
    ];
    match given.into_iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(Failure::input(
            format!("{option} does not go with --scene"),
            "Leave it out: the frame determines the kernels, which are built in, and the values of their \
             constants.",
        )),
        None => Ok(()),
    }
}

fn draft(scene: &Scene, file: &Path) -> Result<Draft> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let mesh = scene.mesh()?;
    Ok(export(scene, &name, &mesh).map_err(FrameError::from)?)
}

fn generate(session: &Session, request: &Request, draft: &Draft) -> Result<Generated> {
    Ok(frame::generate(request, draft, &session.modules(request)?)?)
}

/// The files that a frame follows from beside this program, as absolute paths.
fn inputs(args: &Build, file: &Path, scene: &Scene) -> Result<Vec<PathBuf>> {
    let mut files = files(file, scene);
    files.extend(args.generate.placement.bindings.clone());
    let absolute = |file: PathBuf| {
        std::path::absolute(&file)
            .map_err(|e| Failure::machine(format!("{}: {e}", file.display()), None))
    };
    files.into_iter().map(absolute).collect()
}
