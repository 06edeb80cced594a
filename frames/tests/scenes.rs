//! The scenes in `scenes/`: each is read, drawn, and compared with rays.

use std::path::{Path, PathBuf};

use hankel_frames::scene::Scene;
use hankel_frames::truth::{Arriving, by_rays, by_technique};

fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let entries =
        std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let paths = entries.map(|entry| entry.unwrap_or_else(|e| panic!("{e}")).path());
    let mut files: Vec<PathBuf> = paths
        .filter(|path| path.extension().is_some_and(|e| e == "toml"))
        .collect();
    files.sort();
    files
}

#[test]
fn every_scene_is_drawn_with_its_shadow() {
    let files = files();
    assert!(files.len() >= 10, "{files:?}");
    for file in files {
        let mut scene = Scene::read(&file).unwrap_or_else(|e| panic!("{e}"));
        let mesh = scene.mesh().unwrap_or_else(|e| panic!("{e}"));
        let name = file.file_stem().unwrap().to_string_lossy();
        (scene.width, scene.height) = (48, 27);
        scene.shadow.size = 256;
        let truth = by_rays(&scene, &mesh, &mut |_| ());
        let none = Arriving {
            values: vec![1.0; truth.values.len()],
            ..truth.clone()
        };
        let without = none.errors(&truth).unwrap().rms;
        let picture = by_technique(&scene, &mesh).unwrap_or_else(|e| panic!("{e}"));
        let errors = picture.errors(&truth).unwrap();
        let what = format!("{name}: {errors}; without shadow {without:.4}");
        println!("{what}");
        match &*name {
            "empty" => assert!(without == 0.0 && errors.rms < 0.01, "{what}"),
            // Casters thinner than a texel, in a picture that holds little shadow.
            "wires" => assert!(without > 0.02 && errors.rms < 0.08, "{what}"),
            _ => assert!(without > 0.1 && errors.rms < 0.75 * without, "{what}"),
        }
    }
}
