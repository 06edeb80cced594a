//! Code that somebody else left in a folder above.

use std::fs;

use crate::desk::{Desk, root};

const SCENE: &str = "[geometry]\nprocedural = \"box\"\n[camera]\neye = [3.0, 3.0, 4.0]\n\
target = [0.0, 0.5, 0.0]\n[light]\ndirection = [-1.0, -2.0, -0.5]\n[output]\nwidth = 16\nheight = 9\n";

/// A folder that looks like a checkout, whose build script leaves a trace.
fn planted() -> Desk {
    let desk = Desk::new();
    desk.write(
        "kernels/shadows/Cargo.toml",
        "[package]\nname = \"hankel-shadows\"\nversion = \"0.1.0\"\nedition = \"2024\"\nbuild = \"build.rs\"\n[workspace]\n",
    );
    let trace = desk.path("ran");
    desk.write(
        "kernels/shadows/build.rs",
        format!("fn main() {{ std::fs::write({trace:?}, \"\").unwrap(); }}\n"),
    );
    desk.write("kernels/shadows/src/lib.rs", "");
    desk.write(
        "kernels/dsl/Cargo.toml",
        "[package]\nname = \"hankel-dsl\"\n",
    );
    fs::create_dir_all(desk.path("below/here")).expect("the desk");
    desk
}

#[test]
fn a_checkout_in_a_folder_above_is_not_built() {
    let desk = planted();
    desk.write("below/here/scene.toml", SCENE);
    desk.write("below/here/rows.csv", "b1,b2,depth\n0.5,0.3,0.2\n");
    for line in [
        "list --kernel vsm",
        "build --out s --kernel vsm",
        "check s --kernel vsm",
        "eval vsm --input rows.csv --output out.csv",
        "parity --kernel vsm",
        "render scene.toml --out p.png",
        "new crate-of-mine",
    ] {
        let mut command = desk.command(line);
        command.current_dir(desk.path("below/here"));
        crate::desk::run(&mut command).code(0);
        assert!(!desk.path("ran").exists(), "{line} ran the build script");
    }
    let manifest = desk.read("below/here/crate-of-mine/Cargo.toml");
    let own = root().join("kernels/dsl");
    assert!(
        !manifest.contains("\"../../../kernels/dsl\"") && own.exists(),
        "{manifest}"
    );
}

/// Who names it wants it.
#[test]
fn a_crate_that_is_named_is_built() {
    let desk = planted();
    desk.hankel("list --manifest-path kernels/shadows/Cargo.toml")
        .fails(2, &["kernels!"]);
    assert!(desk.path("ran").exists());
}
