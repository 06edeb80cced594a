//! How many layers an array of textures has: SPIR-V's query gives it behind the size, and naga 30.0.1 reads
//! only the size, so that the component behind is one that its vector does not have
//! (`tests/upstream/naga-layers`).

use naga::{Expression, ImageQuery, Module, TypeInner};

/// Makes queries of their own of the components that give a number of layers.
pub fn restore_layers(module: &mut Module) {
    let (types, globals) = (&module.types, &module.global_variables);
    let functions = module.functions.iter_mut().map(|(_, function)| function);
    let entries = module.entry_points.iter_mut().map(|it| &mut it.function);
    for function in functions.chain(entries) {
        let layers: Vec<_> = function
            .expressions
            .iter()
            .filter_map(|(handle, expression)| {
                let Expression::AccessIndex { base, index } = *expression else {
                    return None;
                };
                let Expression::ImageQuery {
                    image,
                    query: ImageQuery::Size { .. },
                } = function.expressions[base]
                else {
                    return None;
                };
                let ty = match function.expressions[image] {
                    Expression::GlobalVariable(variable) => globals[variable].ty,
                    Expression::FunctionArgument(number) => {
                        function.arguments.get(number as usize)?.ty
                    }
                    _ => return None,
                };
                // A layer has two dimensions.
                let is_number =
                    index == 2 && matches!(types[ty].inner, TypeInner::Image { arrayed: true, .. });
                is_number.then_some((handle, image))
            })
            .collect();
        for (handle, image) in layers {
            function.expressions[handle] = Expression::ImageQuery {
                image,
                query: ImageQuery::NumLayers,
            };
        }
    }
}
