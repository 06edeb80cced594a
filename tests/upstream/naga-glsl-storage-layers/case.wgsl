@group(0) @binding(0) var layers: texture_storage_2d_array<rgba8unorm, write>;
@group(0) @binding(1) var<storage, read_write> result: u32;

@compute @workgroup_size(1)
fn main() {
    result = textureNumLayers(layers);
}
