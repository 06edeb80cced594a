@group(0) @binding(0) var source: texture_storage_2d<rgba16float, read>;
@group(0) @binding(1) var result: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let last = min(textureDimensions(source), textureDimensions(result)) - vec2<u32>(1u);
    textureStore(result, last, textureLoad(source, last));
}
