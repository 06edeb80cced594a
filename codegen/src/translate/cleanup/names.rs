//! Names for what has none: results, and what is loaded.

use naga::valid::FunctionInfo;
use naga::{Expression, FunctionResult, Handle, ImageQuery, Module, Type, TypeInner};

use super::walk::replace_type;

/// Names the structure that a vertex or fragment stage with several outputs returns.
pub fn name_result(module: &mut Module, name: &str, members: &[String]) {
    let Some(FunctionResult { ty, .. }) = module
        .entry_points
        .first()
        .and_then(|entry| entry.function.result.clone())
    else {
        return;
    };
    let mut named = module.types[ty].clone();
    let TypeInner::Struct {
        members: fields, ..
    } = &mut named.inner
    else {
        return;
    };
    if named.name.is_some() || fields.len() != members.len() {
        return;
    }
    for (field, member) in fields.iter_mut().zip(members) {
        field.name = Some(member.clone());
    }
    named.name = Some(name.into());
    replace_type(module, ty, named);
}

/// Names loaded values after the member, structure, variable or texture that they come from.
pub fn name_loads(module: &mut Module, info: &naga::valid::ModuleInfo) {
    if module.entry_points.len() != 1 {
        return;
    }
    let function = &module.entry_points[0].function;
    let from = Pointers {
        module,
        function,
        types: info.get_entry_point(0),
    };
    let mut names = Vec::new();
    for (handle, expression) in function.expressions.iter() {
        let name = match *expression {
            Expression::Load { pointer } => from.name(pointer),
            Expression::ImageLoad { image, .. } | Expression::ImageSample { image, .. } => {
                texture_name(module, function, image).map(|name| format!("{name}_texel"))
            }
            Expression::ImageQuery {
                image,
                query: ImageQuery::Size { .. },
            } => texture_name(module, function, image).map(|name| format!("{name}_size")),
            _ => None,
        };
        names.extend(name.map(|name| (handle, name)));
    }
    module.entry_points[0]
        .function
        .named_expressions
        .extend(names);
}

/// Pointers into global variables.
struct Pointers<'a> {
    module: &'a Module,
    function: &'a naga::Function,
    types: &'a FunctionInfo,
}

impl Pointers<'_> {
    /// What a value that is loaded from there is called.
    fn name(&self, pointer: Handle<Expression>) -> Option<String> {
        match self.function.expressions[pointer] {
            Expression::GlobalVariable(global) => self.module.global_variables[global].name.clone(),
            Expression::AccessIndex { base, index } => match &self.pointee(base)?.inner {
                TypeInner::Struct { members, .. } => members[index as usize].name.clone(),
                TypeInner::Vector { .. } | TypeInner::Matrix { .. } => {
                    let component = b"xyzw".get(index as usize)?;
                    Some(format!("{}_{}", self.name(base)?, char::from(*component)))
                }
                _ => self.element(pointer, base),
            },
            Expression::Access { base, .. } => self.element(pointer, base),
            _ => None,
        }
    }

    /// An element is called after its structure, else after its array.
    fn element(&self, pointer: Handle<Expression>, base: Handle<Expression>) -> Option<String> {
        match self.pointee(pointer) {
            Some(Type {
                name: Some(name),
                inner: TypeInner::Struct { .. },
            }) => Some(snake_case(name)),
            _ => self.name(base).map(|name| format!("{name}_element")),
        }
    }

    fn pointee(&self, pointer: Handle<Expression>) -> Option<&Type> {
        match *self.types[pointer].ty.inner_with(&self.module.types) {
            TypeInner::Pointer { base, .. } => Some(&self.module.types[base]),
            _ => None,
        }
    }
}

fn texture_name(
    module: &Module,
    function: &naga::Function,
    image: Handle<Expression>,
) -> Option<String> {
    match function.expressions[image] {
        Expression::GlobalVariable(global) => module.global_variables[global].name.clone(),
        _ => None,
    }
}

/// `DepthPair` to `depth_pair`.
fn snake_case(name: &str) -> String {
    let mut snake = String::new();
    let mut after_small = false;
    for letter in name.chars() {
        if letter.is_uppercase() && after_small {
            snake.push('_');
        }
        after_small = !letter.is_uppercase() && letter != '_';
        snake.extend(letter.to_lowercase());
    }
    snake
}

#[cfg(test)]
mod tests {
    #[test]
    fn snake_case_parts_words() {
        assert_eq!(super::snake_case("DepthPair"), "depth_pair");
        assert_eq!(super::snake_case("Moments4"), "moments4");
        assert_eq!(super::snake_case("VSM"), "vsm");
    }
}
