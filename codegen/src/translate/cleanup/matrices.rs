//! Four columns that are a matrix become the language's own matrix type: a host that reflects a text finds
//! `mat4x4<f32>`, `float4x4`, `mat4`, which its mathematics library fills, and not a structure that it has never heard
//! of. rust-gpu has no matrix types; glam's is a structure of its columns. In memory both are the same.

use hankel_dsl::native::layout::COLUMNS;
use naga::{Handle, Module, Scalar, Type, TypeInner, VectorSize};

use super::walk::replace_type;

/// Replaces the structures. What accesses a member accesses a column by the same number then.
pub fn matrix_types(module: &mut Module) {
    let found: Vec<Handle<Type>> = module
        .types
        .iter()
        .filter(|(_, ty)| is_matrix(module, ty))
        .map(|(handle, _)| handle)
        .collect();
    // naga has each type once. An author's own structure with the same columns would become the same type as glam's,
    // so both stay as they are.
    if let [columns] = found[..] {
        let matrix = Type {
            name: None,
            inner: TypeInner::Matrix {
                columns: VectorSize::Quad,
                rows: VectorSize::Quad,
                scalar: Scalar::F32,
            },
        };
        replace_type(module, columns, matrix);
    }
}

fn is_matrix(module: &Module, ty: &Type) -> bool {
    let TypeInner::Struct { members, span: 64 } = &ty.inner else {
        return false;
    };
    let column = TypeInner::Vector {
        size: VectorSize::Quad,
        scalar: Scalar::F32,
    };
    members.len() == COLUMNS.len()
        && members
            .iter()
            .zip(COLUMNS)
            .enumerate()
            .all(|(i, (member, name))| {
                member.name.as_deref() == Some(name)
                    && member.offset == 16 * i as u32
                    && module.types[member.ty].inner == column
            })
}

#[cfg(test)]
mod tests {
    use naga::{Span, StructMember};

    use super::*;

    /// A module with a structure of vectors that have these names.
    fn structure(names: [&str; 4]) -> Module {
        let mut module = Module::default();
        let vector = module.types.insert(
            Type {
                name: None,
                inner: TypeInner::Vector {
                    size: VectorSize::Quad,
                    scalar: Scalar::F32,
                },
            },
            Span::UNDEFINED,
        );
        let members = names.iter().enumerate().map(|(i, name)| StructMember {
            name: Some((*name).into()),
            ty: vector,
            binding: None,
            offset: 16 * i as u32,
        });
        let inner = TypeInner::Struct {
            members: members.collect(),
            span: 64,
        };
        let name = Some("Columns".into());
        module.types.insert(Type { name, inner }, Span::UNDEFINED);
        module
    }

    fn matrices(module: &Module) -> usize {
        let types = module.types.iter();
        types
            .filter(|(_, ty)| matches!(ty.inner, TypeInner::Matrix { .. }))
            .count()
    }

    #[test]
    fn glams_columns_become_a_matrix_and_no_other_vectors_do() {
        let mut module = structure(COLUMNS);
        matrix_types(&mut module);
        assert_eq!((matrices(&module), module.types.len()), (1, 2));
        let mut module = structure(["red", "green", "blue", "alpha"]);
        matrix_types(&mut module);
        assert_eq!(matrices(&module), 0);
    }
}
