//! three.js with Hankel's functions, in WebGPU and WebGL 2: it draws what the page shows and what the example in
//! plain wgpu draws of the same scene, and its shadows are where rays say that they are.

use std::path::{Path, PathBuf};

use hankel_codegen::functions::folder::Folder;
use hankel_codegen::functions::{self, crates};
use hankel_example_renderer::{Drawn, check};

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// three.js, as `xtask/setup.sh` puts it there.
fn three() -> PathBuf {
    let variable = |name| std::env::var_os(name).map(PathBuf::from);
    let cache = variable("XDG_CACHE_HOME").or_else(|| Some(variable("HOME")?.join(".cache")));
    let tools = variable("HANKEL_TOOLS").or_else(|| Some(cache?.join("hankel/tools")));
    let three = tools
        .expect("HANKEL_TOOLS or HOME is set")
        .join("node_modules/three");
    assert!(
        three.join("build/three.tsl.js").is_file(),
        "{}: three.js is not here; ./check installs it",
        three.display()
    );
    three
}

/// The browser.
fn chromium() -> PathBuf {
    std::env::var_os("HANKEL_CHROMIUM").map_or_else(|| "chromium".into(), PathBuf::from)
}

#[test]
fn three_js_draws_what_wgpu_draws_and_rays_say() {
    let libraries = tempfile::tempdir().expect("a folder");
    let texts = crates::sources(&here().join("../../kernels/shadows/Cargo.toml"))
        .expect("the sources")
        .texts;
    let all = functions::read(&texts).unwrap_or_else(|e| panic!("{e}"));
    let folder = Folder::new(&all, "hankel", &[], &crates::hash(&texts)).expect("libraries");
    folder.write(libraries.path(), false).expect("libraries");

    let native = hankel_example_wgpu::draw().expect("a Vulkan device");
    let drawn = hankel_example_three::draw(&chromium(), &three(), libraries.path())
        .unwrap_or_else(|e| panic!("{e}"));
    for drawn in drawn {
        let drawn = Drawn {
            picture: drawn.picture,
            shadows: drawn.shadows,
            truth: native.truth.clone(),
        };
        check::shadows(&drawn);
        check::picture(&drawn, &here().join("picture.png"));
        check::picture(&drawn, &here().join("../wgpu/picture.png"));
    }
}
