//! What the examples have under version control is current. What they draw, their own tests see.
//!
//! `INSTA_UPDATE=always` writes anew what is not current.

use hankel_codegen::Language;
use hankel_codegen::build::{Request, build, generate};
use hankel_codegen::check::{Budget, check};
use hankel_tests::{Crate, root};

fn updates() -> bool {
    std::env::var("INSTA_UPDATE").is_ok_and(|value| value == "always")
}

/// What `hankel build` writes for the example's build script, and what is used without the program.
#[test]
fn committed_shaders_are_current() {
    let shadows = Crate::shadows();
    let request = Request {
        filter: vec!["hamburger_4msm".into()],
        targets: vec![Language::Wgsl],
        ..shadows.request()
    };
    let folder = root().join("examples/wgpu/shaders");
    if updates() {
        build(&request, &shadows.modules(), &folder, true).expect("the folder can be written");
        return;
    }
    let generated = generate(&request, &shadows.modules()).expect("the kernel can be built");
    let report = check(&generated, &folder, &Budget::default()).expect("the folder can be read");
    assert!(
        report.is_fine(),
        "{report}\nINSTA_UPDATE=always cargo test --release -p hankel-tests --test examples writes it"
    );
}
