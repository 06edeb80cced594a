enable clip_distances;

struct Placed {
    @builtin(position) position: vec4<f32>,
    @builtin(clip_distances) distances: array<f32, 2>,
}

@vertex fn main(@location(0) position: vec4<f32>) -> Placed {
    return Placed(position, array<f32, 2>(position.x, position.y));
}
