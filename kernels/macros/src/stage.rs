//! What vertex and fragment kernels have of their own: what passes between stages and how, depths,
//! built-ins.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};
use syn::Type;
use syn::spanned::Spanned as _;

use crate::kernel::{BuiltIn, Kernel, Role, Stage, argument, last_segment};

/// A type at a stage's interface.
pub struct Passed {
    /// The value's, without what says how it is interpolated.
    pub ty: Type,
    /// What it is wrapped in, from the outside.
    wrappers: Vec<Wrapper>,
}

/// The DSL's types that say how a value is interpolated.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Wrapper {
    Flat,
    Linear,
    Centroid,
    PerSample,
}

impl Passed {
    pub fn of(ty: &Type) -> Self {
        let all = [
            Wrapper::Flat,
            Wrapper::Linear,
            Wrapper::Centroid,
            Wrapper::PerSample,
        ];
        let (mut ty, mut wrappers) = (ty.clone(), Vec::new());
        while let Some((wrapper, inner)) = all
            .iter()
            .find_map(|it| Some((*it, argument(&ty, &format!("{it:?}"))?)))
        {
            wrappers.push(wrapper);
            ty = inner;
        }
        Self { ty, wrappers }
    }

    /// Integers cannot be interpolated.
    fn is_integer(&self) -> bool {
        const INTEGERS: [&str; 8] = [
            "u32", "i32", "UVec2", "UVec3", "UVec4", "IVec2", "IVec3", "IVec4",
        ];
        last_segment(&self.ty).is_some_and(|s| INTEGERS.iter().any(|name| s.ident == name))
    }

    /// The variant of `describe::Interpolation`, if its wrappers go together.
    fn interpolation(&self) -> Option<Ident> {
        let name = match (&self.wrappers[..], self.is_integer()) {
            ([] | [Wrapper::Flat], true) | ([Wrapper::Flat], false) => "Flat",
            (_, true) => return None,
            ([], false) => "Perspective",
            ([Wrapper::Centroid], false) => "PerspectiveCentroid",
            ([Wrapper::PerSample], false) => "PerspectiveSample",
            ([Wrapper::Linear], false) => "Linear",
            ([Wrapper::Linear, Wrapper::Centroid], false) => "LinearCentroid",
            ([Wrapper::Linear, Wrapper::PerSample], false) => "LinearSample",
            _ => return None,
        };
        Some(format_ident!("{name}"))
    }

    /// What is wrong with it.
    pub fn problem(&self) -> Option<&'static str> {
        match (self.interpolation(), self.is_integer()) {
            (Some(_), _) => None,
            (None, true) => Some("integers are not interpolated: take the integer itself"),
            (None, false) => Some(
                "it is interpolated in one way: `Flat<T>`, `Linear<T>`, `Centroid<T>`, `PerSample<T>`, `Linear<Centroid<T>>` or `Linear<PerSample<T>>`",
            ),
        }
    }

    /// `describe::Interpolation`.
    pub fn describe(&self) -> TokenStream {
        let interpolation = self
            .interpolation()
            .unwrap_or_else(|| format_ident!("Perspective"));
        quote!(describe::Interpolation::#interpolation)
    }

    /// The attribute of the entry point's parameter. rust-gpu has none for the others: `codegen` adds them by the
    /// description.
    pub fn decoration(&self) -> TokenStream {
        if self.interpolation().is_some_and(|it| it == "Flat") {
            quote!(#[spirv(flat)])
        } else {
            TokenStream::new()
        }
    }

    /// What the kernel takes, of the value.
    pub fn wrap(&self, value: &TokenStream) -> TokenStream {
        self.wrappers
            .iter()
            .rev()
            .fold(value.clone(), |value, wrapper| {
                let wrapper = format_ident!("{wrapper:?}");
                quote!(::hankel_dsl::#wrapper(#value))
            })
    }

    /// The value, of what the kernel returns.
    pub fn unwrap(&self, value: &Ident) -> TokenStream {
        self.wrappers
            .iter()
            .fold(quote!(#value), |value, _| quote!(#value.0))
    }
}

/// What a vertex or fragment kernel returns.
pub enum Returned {
    Position,
    Varying { location: u32, passed: Passed },
    Target { location: u32, ty: Type },
    SecondSource { ty: Type },
    Depth,
    SampleMask,
    ClipDistances { count: TokenStream },
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
                (true, _) if is_named(ty, "ClipDistances") => Returned::ClipDistances {
                    count: const_argument(ty).unwrap_or_else(|| quote!(1)),
                },
                (true, _) => Returned::Varying {
                    location: next(),
                    passed: Passed::of(ty),
                },
                (false, _) if is_named(ty, "Depth") => Returned::Depth,
                (false, _) if is_named(ty, "SampleMask") => Returned::SampleMask,
                (false, _) if is_named(ty, "SecondSource") => Returned::SecondSource {
                    ty: argument(ty, "SecondSource").unwrap_or_else(|| ty.clone()),
                },
                (false, _) => Returned::Target {
                    location: next(),
                    ty: ty.clone(),
                },
            })
            .collect()
    }

    /// What is wrong with what it returns; vertex and fragment kernels only.
    pub fn check_returned(&self) -> syn::Result<()> {
        let returned = self.returned();
        let (mut masks, mut clips, mut seconds) = (0, 0, 0);
        let targets: Vec<String> = returned
            .iter()
            .filter_map(|it| match it {
                Returned::Target { ty, .. } => Some(quote!(#ty).to_string()),
                _ => None,
            })
            .collect();
        for (it, ty) in returned.iter().zip(&self.outputs) {
            let problem = match it {
                Returned::Varying { passed, .. } => passed.problem(),
                Returned::SampleMask => {
                    masks += 1;
                    (masks > 1).then_some("a fragment has one mask")
                }
                Returned::ClipDistances { .. } => {
                    clips += 1;
                    (clips > 1 || const_argument(ty).is_none())
                        .then_some("a vertex has one array of distances: `ClipDistances<2>`")
                }
                Returned::SecondSource { ty } => {
                    seconds += 1;
                    (seconds > 1 || targets != [quote!(#ty).to_string()]).then_some(
                        "a second source goes with one target, and is of its type: `-> (Vec4, SecondSource<Vec4>)`",
                    )
                }
                _ => None,
            };
            if let Some(problem) = problem {
                return Err(syn::Error::new(ty.span(), problem));
            }
        }
        if masks == returned.len() {
            return Err(syn::Error::new(
                self.name.span(),
                "a mask says which samples of something are written: return a colour or a Depth beside it",
            ));
        }
        Ok(())
    }

    /// Whether it is a fragment kernel that returns a depth.
    pub fn returns_depth(&self) -> bool {
        matches!(self.stage, Stage::Fragment) && self.outputs.iter().any(|ty| is_named(ty, "Depth"))
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

/// `N` of `Name<N>`.
fn const_argument(ty: &Type) -> Option<TokenStream> {
    let syn::PathArguments::AngleBracketed(arguments) = &last_segment(ty)?.arguments else {
        return None;
    };
    let only = arguments.args.first()?;
    (arguments.args.len() == 1).then(|| quote!(#only))
}

fn is_named(ty: &Type, name: &str) -> bool {
    last_segment(ty).is_some_and(|s| s.ident == name)
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
            Self::SecondSource { ty } => quote!(#ty),
            Self::Depth => quote!(f32),
            Self::SampleMask => quote!([u32; 1]),
            Self::ClipDistances { count } => quote!([f32; #count]),
        }
    }

    /// The attribute of the entry point's parameter.
    pub fn decoration(&self) -> TokenStream {
        match self {
            Self::Position => quote!(#[spirv(position)]),
            Self::Varying { passed, .. } => passed.decoration(),
            // `codegen` makes a second source of the target behind the first.
            Self::Target { .. } | Self::SecondSource { .. } => TokenStream::new(),
            Self::ClipDistances { .. } => quote!(#[spirv(clip_distance)]),
            Self::Depth => quote!(#[spirv(frag_depth)]),
            Self::SampleMask => quote!(#[spirv(sample_mask)]),
        }
    }

    /// What is stored, of what the kernel returns.
    pub fn stored(&self, value: &Ident) -> TokenStream {
        match self {
            Self::Varying { passed, .. } => passed.unwrap(value),
            Self::Position | Self::Target { .. } => quote!(#value),
            Self::ClipDistances { .. } => quote!(#value.all()),
            Self::Depth | Self::SecondSource { .. } => quote!(#value.0),
            Self::SampleMask => quote!([#value.0]),
        }
    }

    /// Whether the host has an array for it. A mask says whether the others are written.
    pub fn is_stored_on_host(&self) -> bool {
        !matches!(self, Self::SampleMask)
    }

    /// The same on the host, which clamps depths itself.
    pub fn stored_on_host(&self, value: &Ident) -> TokenStream {
        match self {
            Self::Depth => quote!(fragment::depth(#value)),
            Self::SampleMask => quote!(fragment::mask(#value)),
            _ => self.stored(value),
        }
    }

    /// `describe::Output`.
    pub fn describe(&self) -> TokenStream {
        let ty = self.ty();
        match self {
            Self::Position => quote!(describe::Output::Position),
            Self::Varying { location, passed } => {
                let interpolation = passed.describe();
                quote!(describe::Output::Varying {
                    location: #location,
                    ty: <#ty as layout::Element>::ty(),
                    interpolation: #interpolation,
                })
            }
            Self::Target { location, .. } => quote!(describe::Output::Target {
                location: #location,
                ty: <#ty as layout::Element>::ty(),
            }),
            Self::Depth => quote!(describe::Output::Depth),
            Self::SampleMask => quote!(describe::Output::SampleMask),
            Self::ClipDistances { .. } => quote!(describe::Output::ClipDistances {
                ty: <#ty as layout::Element>::ty(),
            }),
            Self::SecondSource { .. } => quote!(describe::Output::SecondSource {
                ty: <#ty as layout::Element>::ty(),
            }),
        }
    }
}

impl BuiltIn {
    /// Why a kernel of this stage cannot have it.
    pub fn foreign_to(self, stage: &Stage) -> Option<&'static str> {
        match (self, stage) {
            (Self::VertexIndex | Self::InstanceIndex, Stage::Vertex)
            | (
                Self::FragCoord
                | Self::FrontFacing
                | Self::SampleIndex
                | Self::SampleMask
                | Self::PrimitiveIndex,
                Stage::Fragment,
            )
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
            (
                Self::FragCoord
                | Self::FrontFacing
                | Self::SampleIndex
                | Self::SampleMask
                | Self::PrimitiveIndex,
                _,
            ) => Some("only a fragment kernel knows its fragment"),
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
            Self::SampleMask => quote!(#[spirv(sample_mask, flat)] #name: [u32; 1],),
            Self::PrimitiveIndex => quote!(#[spirv(primitive_id, flat)] #name: u32,),
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
            Self::SampleMask => quote!(__fragment.sample_mask),
            Self::PrimitiveIndex => quote!(__fragment.primitive_index),
            _ => TokenStream::new(),
        }
    }
}
