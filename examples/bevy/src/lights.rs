//! Bevy's uniform buffer of lights, filled by the names of its members: one directional light.

use std::error::Error;

use hankel_example_renderer::{EXTENT, LIGHT_RIGHT, LIGHT_UP, MAP_SIZE, TOWARD_LIGHT};
use naga::{Handle, Module, Type, TypeInner};

/// Bevy's defaults: in world units, and in texels.
const DEPTH_BIAS: f32 = 0.02;
const NORMAL_BIAS: f32 = 1.8;

/// The bytes of the buffer at group 0, binding 1.
///
/// # Errors
///
/// The module has no such buffer, or it has other members.
pub fn uniform(module: &Module) -> Result<Vec<u8>, Box<dyn Error>> {
    let at = naga::ResourceBinding {
        group: 0,
        binding: 1,
    };
    let (_, lights) = module
        .global_variables
        .iter()
        .find(|(_, global)| global.binding.as_ref() == Some(&at))
        .ok_or("the shader has no lights")?;
    let size = module.types[lights.ty].inner.size(module.to_ctx());
    let mut bytes = vec![0; size as usize];
    let mut set = |path: &str, words: &[[u8; 4]]| {
        let offset = offset(module, lights.ty, path)?;
        bytes[offset..offset + 4 * words.len()].copy_from_slice(words.as_flattened());
        Ok::<_, String>(())
    };
    let floats = |numbers: &[f32]| -> Vec<[u8; 4]> {
        numbers.iter().map(|number| number.to_le_bytes()).collect()
    };
    // Clip space of the light, depth 1 at the near plane, column by column.
    let columns: Vec<f32> = (0..3)
        .flat_map(|i| {
            let axes = [LIGHT_RIGHT[i], LIGHT_UP[i], 0.5 * TOWARD_LIGHT[i]];
            let [x, y, z] = [0, 1, 2].map(|j| axes[j] / EXTENT[j]);
            [x, y, z, 0.0]
        })
        .chain([0.0, 0.0, 0.5, 1.0])
        .collect();
    let light = "directional_lights.0.";
    let texel = 2.0 * EXTENT[0] / MAP_SIZE[0] as f32;
    for (name, numbers) in [
        ("cascades.0.clip_from_world", columns.as_slice()),
        ("cascades.0.texel_size", &[texel]),
        ("cascades.0.far_bound", &[100.0]),
        ("direction_to_light", &TOWARD_LIGHT),
        ("shadow_depth_bias", &[DEPTH_BIAS]),
        ("shadow_normal_bias", &[NORMAL_BIAS]),
    ] {
        set(&format!("{light}{name}"), &floats(numbers))?;
    }
    set(&format!("{light}num_cascades"), &[1_u32.to_le_bytes()])?;
    set("n_directional_lights", &[1_u32.to_le_bytes()])?;
    Ok(bytes)
}

/// Where a member lies: names and numbers of elements with dots between them.
fn offset(module: &Module, mut ty: Handle<Type>, path: &str) -> Result<usize, String> {
    let mut at = 0;
    for part in path.split('.') {
        let found = match &module.types[ty].inner {
            TypeInner::Struct { members, .. } => members
                .iter()
                .find(|member| member.name.as_deref() == Some(part))
                .map(|member| (member.ty, member.offset)),
            TypeInner::Array { base, stride, .. } => {
                part.parse::<u32>().ok().map(|i| (*base, i * stride))
            }
            _ => None,
        };
        let (inner, offset) = found.ok_or_else(|| format!("Bevy's lights have no `{path}`"))?;
        (ty, at) = (inner, at + offset as usize);
    }
    Ok(at)
}
