#version 450
layout(local_size_x = 1) in;
layout(set = 0, binding = 0) readonly buffer Values { float values[]; };
layout(set = 0, binding = 1, rgba16f) writeonly uniform image2D image;

void main() {
    imageStore(image, ivec2(0), vec4(values[0], 1.0, values[1], 1.0));
}
