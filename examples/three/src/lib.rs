//! Moment shadows in three.js: the page in `page`, shown to a headless Chromium by `../chromium.mjs`, with
//! WebGPU and with WebGL 2. What is here starts that, and reads what it gives.

use std::error::Error;
use std::ffi::OsString;
use std::path::Path;
use std::process::Command;

use hankel_example_renderer::SIZE;

/// What three.js draws.
pub struct Drawn {
    /// The picture, four bytes a pixel.
    pub picture: Vec<u8>,
    /// The shadow of each pixel, from 0 (lit) to 1; 0 where the light does not come, anyway.
    pub shadows: Vec<f32>,
}

/// Draws the scene by WebGPU, then by WebGL 2. `chromium` is the program, `three` the folder of the npm package,
/// and `libraries` what `hankel build --form functions` wrote.
///
/// # Errors
///
/// Node.js or Chromium cannot be started, or the page fails; the error says what it said.
pub fn draw(chromium: &Path, three: &Path, libraries: &Path) -> Result<[Drawn; 2], Box<dyn Error>> {
    let out = tempfile::tempdir()?;
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let script = here.join("../chromium.mjs");
    let served = |name: &str, folder: &Path| {
        let mut argument = OsString::from(format!("{name}="));
        argument.push(folder);
        argument
    };
    let done = Command::new("node")
        .arg(&script)
        .args([chromium, out.path()])
        .args([
            served("page", &here.join("page")),
            served("three", three),
            served("libraries", libraries),
        ])
        .output()
        .map_err(|error| format!("node: {error}"))?;
    if !done.status.success() {
        let words = String::from_utf8_lossy(&done.stderr);
        return Err(format!("{}: {words}", script.display()).into());
    }
    let read = |name: &str| read(&out.path().join(name));
    Ok([read("webgpu.bin")?, read("webgl.bin")?])
}

/// Reads what the page posted: four floats of linear light for each pixel, and one for its shadow.
fn read(path: &Path) -> Result<Drawn, Box<dyn Error>> {
    let bytes = std::fs::read(path)?;
    let pixels = SIZE[0] as usize * SIZE[1] as usize;
    if bytes.len() != 4 * 5 * pixels {
        return Err(format!("{} has {} bytes", path.display(), bytes.len()).into());
    }
    let floats: Vec<f32> = bytes
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    let (colours, shadows) = floats.split_at(4 * pixels);
    // Light as it is shown, as the other examples have it.
    let shown = |light: f32| (255.0 * light.clamp(0.0, 1.0).sqrt()).round() as u8;
    Ok(Drawn {
        picture: colours
            .chunks_exact(4)
            .flat_map(|c| [shown(c[0]), shown(c[1]), shown(c[2]), 255])
            .collect(),
        shadows: shadows.to_vec(),
    })
}
