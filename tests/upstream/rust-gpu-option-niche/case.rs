enum Material {
    Diffuse(Vec3),
    Glass(f32),
}

struct Hit {
    distance: f32,
    material: Material,
}

fn hit(x: f32) -> Option<Hit> {
    let material = if x < 1.0 { Material::Diffuse(Vec3::splat(x)) } else { Material::Glass(x) };
    (x > 0.0).then_some(Hit { distance: x, material })
}

#[kernel(compute, threads(64))]
pub fn shade(#[element] x: f32) -> f32 {
    match hit(x) {
        Some(Hit { distance, material: Material::Diffuse(colour) }) => distance + colour.x,
        Some(Hit { material: Material::Glass(index), .. }) => index,
        None => -1.0,
    }
}
