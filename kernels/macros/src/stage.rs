//! What vertex and fragment kernels have of their own: what passes between stages and how, depths,
//! built-ins.

use proc_macro2::{Ident, TokenStream};
use quote::quote;
use syn::Type;

use crate::kernel::{BuiltIn, Kernel, Role, Stage, argument, last_segment};

/// A type at a stage's interface.
pub struct Passed {
    /// The value's, without `Flat`.
    pub ty: Type,
    /// It is a `Flat<T>`.
    wrapped: bool,
}

impl Passed {
    pub fn of(ty: &Type) -> Self {
        match argument(ty, "Flat") {
            Some(ty) => Self { ty, wrapped: true },
            None => Self {
                ty: ty.clone(),
                wrapped: false,
            },
        }
    }

    /// Whether it is that of one vertex. Integers cannot be interpolated.
    pub fn flat(&self) -> bool {
        const INTEGERS: [&str; 8] = [
            "u32", "i32", "UVec2", "UVec3", "UVec4", "IVec2", "IVec3", "IVec4",
        ];
        self.wrapped
            || last_segment(&self.ty).is_some_and(|s| INTEGERS.iter().any(|name| s.ident == name))
    }

    /// The attribute of the entry point's parameter.
    pub fn decoration(&self) -> TokenStream {
        if self.flat() {
            quote!(#[spirv(flat)])
        } else {
            TokenStream::new()
        }
    }

    /// What the kernel takes, of the value.
    pub fn wrap(&self, value: &TokenStream) -> TokenStream {
        if self.wrapped {
            quote!(::hankel_dsl::Flat(#value))
        } else {
            value.clone()
        }
    }

    /// The value, of what the kernel returns.
    pub fn unwrap(&self, value: &Ident) -> TokenStream {
        if self.wrapped {
            quote!(#value.0)
        } else {
            quote!(#value)
        }
    }
}

/// What a vertex or fragment kernel returns.
pub enum Returned {
    Position,
    Varying { location: u32, passed: Passed },
    Target { location: u32, ty: Type },
    Depth,
}

impl Kernel {
    /// What it returns, in order; vertex and fragment kernels only.
    pub fn returned(&self) -> Vec<Returned> {
        let mut location = 0;
        let mut next = || {
            location += 1;
            location - 1
        };
        let vertex = matches!(self.stage, Stage::Vertex);
        self.outputs
            .iter()
            .enumerate()
            .map(|(i, ty)| match (vertex, i) {
                (true, 0) => Returned::Position,
                (true, _) => Returned::Varying {
                    location: next(),
                    passed: Passed::of(ty),
                },
                (false, _) if is_depth(ty) => Returned::Depth,
                (false, _) => Returned::Target {
                    location: next(),
                    ty: ty.clone(),
                },
            })
            .collect()
    }

    /// Whether it is a fragment kernel that returns a depth.
    pub fn returns_depth(&self) -> bool {
        matches!(self.stage, Stage::Fragment) && self.outputs.iter().any(is_depth)
    }

    /// Parameters of the entry point for what it knows beside its inputs.
    pub fn stage_builtins(&self) -> TokenStream {
        let asked = self.params.iter().filter_map(|p| match p.role {
            Role::BuiltIn(built_in) => built_in.entry_param(&p.name),
            _ => None,
        });
        quote!(#(#asked)*)
    }
}

fn is_depth(ty: &Type) -> bool {
    last_segment(ty).is_some_and(|s| s.ident == "Depth")
}

impl Returned {
    /// Its type in memory.
    pub fn ty(&self) -> TokenStream {
        match self {
            Self::Position => quote!(::hankel_dsl::glam::Vec4),
            Self::Varying { passed, .. } => {
                let ty = &passed.ty;
                quote!(#ty)
            }
            Self::Target { ty, .. } => quote!(#ty),
            Self::Depth => quote!(f32),
        }
    }

    /// The attribute of the entry point's parameter.
    pub fn decoration(&self) -> TokenStream {
        match self {
            Self::Position => quote!(#[spirv(position)]),
            Self::Varying { passed, .. } => passed.decoration(),
            Self::Target { .. } => TokenStream::new(),
            Self::Depth => quote!(#[spirv(frag_depth)]),
        }
    }

    /// What is stored, of what the kernel returns.
    pub fn stored(&self, value: &Ident) -> TokenStream {
        match self {
            Self::Varying { passed, .. } => passed.unwrap(value),
            Self::Position | Self::Target { .. } => quote!(#value),
            Self::Depth => quote!(#value.0),
        }
    }

    /// The same on the host, which clamps depths itself.
    pub fn stored_on_host(&self, value: &Ident) -> TokenStream {
        match self {
            Self::Depth => quote!(fragment::depth(#value)),
            _ => self.stored(value),
        }
    }

    /// `describe::Output`.
    pub fn describe(&self) -> TokenStream {
        let ty = self.ty();
        match self {
            Self::Position => quote!(describe::Output::Position),
            Self::Varying { location, passed } => {
                let flat = passed.flat();
                quote!(describe::Output::Varying {
                    location: #location,
                    ty: <#ty as layout::Element>::ty(),
                    flat: #flat,
                })
            }
            Self::Target { location, .. } => quote!(describe::Output::Target {
                location: #location,
                ty: <#ty as layout::Element>::ty(),
            }),
            Self::Depth => quote!(describe::Output::Depth),
        }
    }
}

impl BuiltIn {
    /// Why a kernel of this stage cannot have it.
    pub fn foreign_to(self, stage: &Stage) -> Option<&'static str> {
        match (self, stage) {
            (Self::VertexIndex | Self::InstanceIndex, Stage::Vertex)
            | (Self::FragCoord | Self::FrontFacing | Self::SampleIndex, Stage::Fragment)
            | (
                Self::LocalId
                | Self::LocalIndex
                | Self::GroupId
                | Self::GroupCount
                | Self::SubgroupSize
                | Self::SubgroupInvocationId
                | Self::SubgroupId
                | Self::SubgroupCount,
                Stage::Compute(_),
            ) => None,
            (it, _) if it.is_of_subgroup() => Some("subgroups belong to compute kernels"),
            (Self::VertexIndex | Self::InstanceIndex, _) => {
                Some("only a vertex kernel knows its vertex and instance")
            }
            (Self::FragCoord | Self::FrontFacing | Self::SampleIndex, _) => {
                Some("only a fragment kernel knows its fragment")
            }
            _ => Some("workgroups and their memory belong to compute kernels"),
        }
    }

    /// The entry point's parameter; those of compute kernels are passed on in parts.
    fn entry_param(self, name: &Ident) -> Option<TokenStream> {
        Some(match self {
            Self::VertexIndex => quote!(#[spirv(vertex_index)] #name: u32,),
            Self::InstanceIndex => quote!(#[spirv(instance_index)] #name: u32,),
            Self::FragCoord => quote!(#[spirv(frag_coord)] #name: Vec4,),
            Self::FrontFacing => quote!(#[spirv(front_facing)] #name: bool,),
            Self::SampleIndex => quote!(#[spirv(sample_id, flat)] #name: u32,),
            _ => return None,
        })
    }

    /// What the host gives for it in the executors of vertices and fragments.
    pub fn on_host(self) -> TokenStream {
        match self {
            Self::VertexIndex => quote!(__i as u32),
            // One instance is run.
            Self::InstanceIndex => quote!(0_u32),
            Self::FragCoord => quote!(__fragment.coord),
            Self::FrontFacing => quote!(__fragment.front_facing),
            Self::SampleIndex => quote!(__fragment.sample_index),
            _ => TokenStream::new(),
        }
    }
}
