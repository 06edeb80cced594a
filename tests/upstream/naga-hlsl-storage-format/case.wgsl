@group(0) @binding(0) var image: texture_storage_2d<rgba16float, write>;

@compute @workgroup_size(1)
fn main() {
    textureStore(image, vec2(0u), vec4(1.0));
}
