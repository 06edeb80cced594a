struct Reading {
    bias: f32,
    spread: f32,
}

@group(0) @binding(0) var<uniform> reading: Reading;
@group(0) @binding(1) var map: texture_depth_2d;
@group(0) @binding(2) var compare: sampler_comparison;

@fragment
fn shadow_lit(@location(0) place: vec3f) -> @location(0) f32 {
    let dx = dpdx(place);
    let dy = dpdy(place);
    let area = dx.x * dy.y - dx.y * dy.x;
    var plane = vec2f();
    if abs(area) > 1e-12 {
        plane = vec2f(dy.y * dx.z - dx.y * dy.z, dx.x * dy.z - dy.x * dx.z) / area;
    }
    let step = reading.spread / vec2f(textureDimensions(map));
    var sum = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let aside = vec2f(vec2i(x, y)) * step;
            let reference = saturate(place.z + dot(plane, aside) - reading.bias);
            sum += textureSampleCompare(map, compare, place.xy + aside, reference);
        }
    }
    return sum / 9;
}
