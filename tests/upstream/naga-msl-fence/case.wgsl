@group(0) @binding(0) var texels: texture_storage_2d<r32uint, read_write>;

@compute @workgroup_size(1)
fn main() {
    let at = vec2<u32>(0u, 0u);
    textureStore(texels, at, vec4<u32>(7u, 0u, 0u, 1u));
    textureStore(texels, at, textureLoad(texels, at) + vec4<u32>(1u));
}
