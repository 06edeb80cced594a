//! Draws the scene by Bevy's shadow shaders:
//! `hankel-example-bevy FOLDER_OF_BEVY LIBRARIES PICTURE.png`.

use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<_> = std::env::args_os().skip(1).collect();
    let [bevy, libraries, picture] = arguments.as_slice() else {
        return Err("usage: hankel-example-bevy FOLDER_OF_BEVY LIBRARIES PICTURE.png".into());
    };
    let library = Path::new(libraries).join("naga-oil/hankel_shadows.wgsl");
    let library = std::fs::read_to_string(&library)
        .map_err(|error| format!("{}: {error}", library.display()))?;
    let drawn = hankel_example_bevy::draw(Path::new(bevy), &library)?;
    hankel_example_renderer::save(Path::new(picture), &drawn.picture)
}
