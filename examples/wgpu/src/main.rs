//! Draws the scene with moment shadows: `hankel-example-wgpu PICTURE.png`.

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args_os().nth(1);
    let path = path.ok_or("usage: hankel-example-wgpu PICTURE.png")?;
    hankel_example_renderer::save(path.as_ref(), &hankel_example_wgpu::draw()?.picture)
}
