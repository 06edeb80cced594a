//! Draws the scene by three.js in WebGPU: `hankel-example-three CHROMIUM FOLDER_OF_THREE LIBRARIES PICTURE.png`.

use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let [chromium, three, libraries, picture] = arguments.as_slice() else {
        return Err(
            "usage: hankel-example-three CHROMIUM FOLDER_OF_THREE LIBRARIES PICTURE.png".into(),
        );
    };
    let [by_webgpu, _] =
        hankel_example_three::draw(chromium.as_ref(), three.as_ref(), libraries.as_ref())?;
    hankel_example_renderer::save(Path::new(picture), &by_webgpu.picture)
}
