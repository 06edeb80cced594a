#version 310 es
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Values { uint values[]; };
layout(std430, binding = 1) buffer Result { uint result[]; };

void main() {
    uint n = 0u;
    while (n < values[0]) {
        n += 1u;
    }
    result[0] = n;
}
