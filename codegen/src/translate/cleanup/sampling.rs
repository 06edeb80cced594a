//! Where a varying is evaluated: naga 30.0.1 reads the decorations `Centroid` and `Sample`, and takes
//! the center all the same where none says how to interpolate
//! (`tests/upstream/naga-centroid`).

use std::collections::BTreeMap;

use naga::{Binding, Module, Sampling, TypeInner};

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
            module.types.replace(ty, new);
        }
    }
}
