#version 450
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) readonly buffer Values { float values[]; };
layout(set = 0, binding = 1) buffer Result { float result[]; };

void main() {
    result[0] = values[0] * 0.1 * 0.7;
}
