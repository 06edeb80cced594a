//! Makes the shader and what Rust calls it by, and makes them again when the program `hankel` changes.

fn main() {
    hankel_build::Build::built_in()
        .kernel("hamburger_4msm")
        .target("wgsl")
        .committed("shaders")
        .run_or_exit();
}
