#version 310 es
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Values { uint values[]; };
layout(std430, binding = 1) buffer Result { uint result[]; };

void main() {
    uint n = 0u;
    for (uint i = 0u; i < values[0]; i += 1u) {
        for (uint j = 0u; j < values[0]; j += 1u) {
            n += 1u;
        }
    }
    result[0] = n;
}
