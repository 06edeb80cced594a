//! Where a varying is evaluated: naga 30.0.1 reads the decorations `Centroid` and `Sample`, and takes
//! the center all the same where none says how to interpolate
//! (`tests/upstream/naga-centroid`).

use std::collections::BTreeMap;

use naga::{Binding, Module, Sampling, TypeInner};

use super::walk::replace_type;

/// Says it again, by whether it is an input, and location.
pub fn restore_sampling(module: &mut Module, sampling: &BTreeMap<(bool, u32), Sampling>) {
    if sampling.is_empty() {
        return;
    }
    let restore = |binding: &mut Option<Binding>, input: bool| {
        if let Some(Binding::Location {
            location,
            interpolation: Some(_),
            sampling: place,
            ..
        }) = binding
            && let Some(wanted) = sampling.get(&(input, *location))
        {
            *place = Some(*wanted);
        }
    };
    let mut outputs = Vec::new();
    for entry in &mut module.entry_points {
        for argument in &mut entry.function.arguments {
            restore(&mut argument.binding, true);
        }
        if let Some(result) = &mut entry.function.result {
            restore(&mut result.binding, false);
            outputs.push(result.ty);
        }
    }
    for ty in outputs {
        let mut new = module.types[ty].clone();
        if let TypeInner::Struct { members, .. } = &mut new.inner {
            for member in members {
                restore(&mut member.binding, false);
            }
            replace_type(module, ty, new);
        }
    }
}

#[cfg(test)]
mod tests {
    use naga::{EntryPoint, Function, FunctionResult, ShaderStage, Span, Type};

    use super::*;

    /// A module of other tools may say `Sample` of what is no output of its entry point, and two of its entry points
    /// may return the same type.
    #[test]
    fn a_result_without_such_an_output_stays_as_it_is() {
        let mut module = Module::default();
        let ty = Type {
            name: None,
            inner: TypeInner::Struct {
                members: Vec::new(),
                span: 0,
            },
        };
        let ty = module.types.insert(ty, Span::UNDEFINED);
        for name in ["one", "other"] {
            module.entry_points.push(EntryPoint {
                name: name.into(),
                stage: ShaderStage::Vertex,
                early_depth_test: None,
                workgroup_size: [0; 3],
                workgroup_size_overrides: None,
                function: Function {
                    result: Some(FunctionResult { ty, binding: None }),
                    ..Function::default()
                },
                mesh_info: None,
                task_payload: None,
                incoming_ray_payload: None,
            });
        }
        let types = module.types.clone();
        restore_sampling(&mut module, &[((false, 0), Sampling::Sample)].into());
        assert!(module.types.iter().eq(types.iter()));
    }
}
