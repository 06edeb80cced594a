//! The example draws what its page shows, and its shadows are where rays say that they are.

use std::path::Path;

use hankel_example_renderer::check;

#[test]
fn the_example_draws_what_its_page_shows() {
    let drawn = hankel_example_wgpu::draw().expect("a Vulkan device");
    check::picture(
        &drawn,
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("picture.png")
            .as_ref(),
    );
    check::shadows(&drawn);
}
