struct Particle {
    place: vec3f,
    life: f32,
    velocity: vec3f,
    other: f32,
}

struct Step {
    gravity: f32,
    drag: f32,
    bounce: f32,
    time: f32,
    life: f32,
    number: u32,
}

@group(0) @binding(0) var<uniform> step: Step;
@group(0) @binding(1) var<storage, read_write> particles: array<Particle>;

fn hash(x: u32) -> u32 {
    let state = x * 747796405 + 2891336453;
    let word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737;
    return (word >> 22) ^ word;
}

fn unit(bits: u32) -> f32 {
    return f32(bits >> 8) / 16777216;
}

@compute @workgroup_size(256)
fn particles_step(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&particles) {
        return;
    }
    var p = particles[id.x];
    p.life -= step.time;
    if p.life <= 0 {
        let a = hash(id.x ^ hash(step.number));
        let b = hash(a);
        let c = hash(b);
        p = Particle(vec3f(), step.life, vec3f(unit(a) - 0.5, unit(b) * 2 + 4, unit(c) - 0.5), 0);
    } else {
        p.velocity *= 1 - step.drag * step.time;
        p.velocity.y += step.gravity * step.time;
        p.place += p.velocity * step.time;
        if p.place.y < 0 {
            p.place.y *= -step.bounce;
            p.velocity *= vec3f(step.bounce, -step.bounce, step.bounce);
        }
    }
    particles[id.x] = p;
}
