#version 310 es
layout(local_size_x = 1) in;
layout(std430, binding = 0) readonly buffer Values { uint values[]; };
layout(std430, binding = 1) buffer Result { uint result[]; };

void main() {
    uint word = values[0];
    uint digits[4] = uint[4](word & 15u, (word >> 4) & 15u, (word >> 8) & 15u, (word >> 12) & 15u);
    uint i = 0u;
    bool all = false;
    while (true) {
        bool more = i < 4u;
        bool next = false;
        if (more) {
            next = digits[i] < 12u;
            i += 1u;
        }
        all = !more;
        if (!next) {
            break;
        }
    }
    result[0] = all ? 1u : 0u;
}
