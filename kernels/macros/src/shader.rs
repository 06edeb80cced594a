//! SPIR-V entry points: thin functions that load, call the kernel and store, with one guard.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use crate::kernel::{Compute, Kernel, Role, Stage, Texture, Variant};

impl Kernel {
    pub fn expand_shader(&self) -> TokenStream {
        let entries = self.variants.iter().map(|v| self.entry_point(v));
        quote! {
            ::hankel_dsl::on_spirv! {
                #[allow(missing_docs, unused_imports, clippy::all, reason = "generated")]
                pub mod shader {
                    use super::*;
                    use ::hankel_dsl::spirv_std::arch::IndexUnchecked;
                    use ::hankel_dsl::glam::{UVec2, UVec3, Vec4};

                    #(#entries)*
                }
            }
        }
    }

    fn entry_point(&self, variant: &Variant) -> TokenStream {
        let function = format_ident!("{}", variant.entry);
        let entry = &variant.entry;
        let (stage, builtins, body) = match &self.stage {
            Stage::Compute(c) => {
                let threads = &c.threads;
                (
                    quote!(compute(threads(#(#threads),*), entry_point_name = #entry)),
                    self.compute_builtins(c),
                    self.compute_body(c, variant),
                )
            }
            Stage::Vertex => (
                quote!(vertex(entry_point_name = #entry)),
                TokenStream::new(),
                self.interface_body(variant),
            ),
            Stage::Fragment => (
                quote!(fragment(entry_point_name = #entry)),
                TokenStream::new(),
                self.interface_body(variant),
            ),
        };
        let params = self.shader_params(variant);
        let outputs = self.shader_outputs(variant);
        quote! {
            #[::hankel_dsl::spirv_std::spirv(#stage)]
            pub fn #function(#builtins #params #outputs) {
                #body
            }
        }
    }

    fn compute_builtins(&self, c: &Compute) -> TokenStream {
        let group = self.group().map(|(slot, size)| {
            quote! {
                #[spirv(local_invocation_index)] local_index: u32,
                #[spirv(workgroup)] group_front: &mut [#slot; #size],
                #[spirv(workgroup)] group_back: &mut [#slot; #size],
            }
        });
        let id = c
            .per_group
            .then(|| quote!(#[spirv(workgroup_id)] workgroup_id: UVec3,));
        quote! {
            #[spirv(global_invocation_id)] invocation: UVec3,
            #id
            #group
        }
    }

    fn group(&self) -> Option<(&syn::Type, usize)> {
        self.params.iter().find_map(|p| match &p.role {
            Role::Group { slot, size } => Some((slot, *size as usize)),
            _ => None,
        })
    }

    fn shader_params(&self, variant: &Variant) -> TokenStream {
        let mut binding = 0_u32;
        let params = self.params.iter().map(|p| {
            let name = &p.name;
            let here = binding;
            binding += u32::from(p.role.is_bound());
            match &p.role {
                Role::Uniform(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(#[spirv(uniform, descriptor_set = 0, binding = #here)] #name: &#ty,)
                }
                Role::Element(ty) | Role::Storage(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(#[spirv(storage_buffer, descriptor_set = 0, binding = #here)] #name: &[#ty],)
                }
                // `&mut`: a shared slice would be decorated NonWritable.
                Role::Atomic => {
                    quote!(#[spirv(storage_buffer, descriptor_set = 0, binding = #here)] #name: &mut [u32],)
                }
                Role::Texture(t) => {
                    let ty = match t {
                        Texture::Flat => quote!(Sampled2d),
                        Texture::Multisampled => quote!(Sampled2dMultisampled),
                        Texture::Volume => quote!(Sampled3d),
                    };
                    quote!(#[spirv(descriptor_set = 0, binding = #here)] #name: &::hankel_dsl::image::#ty,)
                }
                Role::Sampler => {
                    quote!(#[spirv(descriptor_set = 0, binding = #here)] #name: &::hankel_dsl::spirv_std::Sampler,)
                }
                Role::Constant { id, default } => {
                    quote!(#[spirv(spec_constant(id = #id, default = #default))] #name: u32,)
                }
                Role::Attribute(ty) | Role::Varying(ty) => quote!(#name: #ty,),
                Role::Index | Role::Group { .. } | Role::Phase => TokenStream::new(),
            }
        });
        params.collect()
    }

    fn shader_outputs(&self, variant: &Variant) -> TokenStream {
        let binding = self.params.iter().filter(|p| p.role.is_bound()).count() as u32;
        match &self.stage {
            Stage::Compute(_) => {
                let Some(ty) = self.outputs.first() else {
                    return TokenStream::new();
                };
                if let Some(format) = variant.format {
                    let dimensions = self.dimensions();
                    let image = format_ident!("Storage{}d{}", dimensions, format.variant);
                    return quote! {
                        #[spirv(descriptor_set = 0, binding = #binding)] output: &::hankel_dsl::image::#image,
                    };
                }
                let ty = self.concrete(ty, variant);
                quote!(#[spirv(storage_buffer, descriptor_set = 0, binding = #binding)] output: &mut [#ty],)
            }
            stage => self
                .outputs
                .iter()
                .enumerate()
                .map(|(i, ty)| {
                    let name = output_name(stage, i);
                    if matches!(stage, Stage::Vertex) && i == 0 {
                        quote!(#[spirv(position)] #name: &mut #ty,)
                    } else {
                        quote!(#name: &mut #ty,)
                    }
                })
                .collect(),
        }
    }

    /// The call of the kernel; `at` is the index.
    fn call(&self, variant: &Variant, phase: Option<&TokenStream>) -> TokenStream {
        let name = &self.name;
        let generics = variant.scalar.as_ref().map(|s| quote!(::<#s>));
        let args = self.params.iter().map(|p| {
            let name = &p.name;
            match &p.role {
                // SAFETY (of the loads): the guard, and as many elements as the output has.
                Role::Element(_) if phase.is_some() => quote! {
                    if (invocation.x as usize) < #name.len() {
                        Some(unsafe { *#name.index_unchecked(invocation.x as usize) })
                    } else {
                        None
                    }
                },
                Role::Element(_) => {
                    quote!(unsafe { *#name.index_unchecked(invocation.x as usize) })
                }
                Role::Uniform(_)
                | Role::Constant { .. }
                | Role::Attribute(_)
                | Role::Varying(_) => {
                    quote!(#name)
                }
                Role::Storage(_) => quote!(::hankel_dsl::Buffer::new(#name)),
                Role::Atomic => quote!(::hankel_dsl::Atomics::new(&*#name)),
                Role::Texture(t) => {
                    let ty = texture_type(*t);
                    quote!(#ty::new(#name))
                }
                Role::Sampler => quote!(::hankel_dsl::Sampler::new(#name)),
                Role::Index => match self.dimensions() {
                    1 => quote!(invocation.x),
                    2 => quote!(UVec2::new(invocation.x, invocation.y)),
                    _ => quote!(invocation),
                },
                Role::Group { .. } => quote!(::hankel_dsl::Group::new(&*group_now, local_index)),
                Role::Phase => quote!(#phase),
            }
        });
        quote!(super::super::#name #generics (#(#args),*))
    }

    fn compute_body(&self, c: &Compute, variant: &Variant) -> TokenStream {
        if let Some(phases) = c.phases {
            return self.phased_body(phases, c.per_group, variant);
        }
        let call = self.call(variant, None);
        if self.outputs.is_empty() {
            let extent = self.extent_param().map(|p| &p.name);
            return quote! {
                if (invocation.x as usize) < #extent.len() {
                    #call;
                }
            };
        }
        match (variant.format.is_some(), self.dimensions()) {
            (false, _) => quote! {
                if (invocation.x as usize) < output.len() {
                    let value = #call;
                    unsafe { *output.index_unchecked_mut(invocation.x as usize) = value };
                }
            },
            // `&`, not `&&`: one branch.
            (true, 2) => quote! {
                let size: UVec2 = output.query_size();
                if (invocation.x < size.x) & (invocation.y < size.y) {
                    let value = ::hankel_dsl::Texel::channels(#call);
                    unsafe { ::hankel_dsl::image::write(output, UVec2::new(invocation.x, invocation.y), value) };
                }
            },
            (true, _) => quote! {
                let size: UVec3 = output.query_size();
                if (invocation.x < size.x) & (invocation.y < size.y) & (invocation.z < size.z) {
                    let value = ::hankel_dsl::Texel::channels(#call);
                    unsafe { ::hankel_dsl::image::write(output, invocation, value) };
                }
            },
        }
    }

    /// Phases alternate between two arrays, so that one barrier between them is enough.
    fn phased_body(&self, phases: u32, per_group: bool, variant: &Variant) -> TokenStream {
        let steps = (0..=phases).map(|phase| {
            let (now, next) = if phase % 2 == 0 {
                (quote!(group_back), quote!(group_front))
            } else {
                (quote!(group_front), quote!(group_back))
            };
            let call = self.call(variant, Some(&quote!(#phase)));
            if phase == phases {
                return quote! {
                    let value = { let group_now = &*#now; #call };
                };
            }
            quote! {
                let value = { let group_now = &*#now; #call };
                unsafe { *#next.index_unchecked_mut(local_index as usize) = value };
                ::hankel_dsl::spirv_std::arch::workgroup_memory_barrier_with_group_sync();
            }
        });
        let store = if per_group {
            quote! {
                if (local_index == 0) & ((workgroup_id.x as usize) < output.len()) {
                    unsafe { *output.index_unchecked_mut(workgroup_id.x as usize) = value };
                }
            }
        } else {
            quote! {
                if (invocation.x as usize) < output.len() {
                    unsafe { *output.index_unchecked_mut(invocation.x as usize) = value };
                }
            }
        };
        quote!(#(#steps)* #store)
    }

    fn interface_body(&self, variant: &Variant) -> TokenStream {
        let call = self.call(variant, None);
        let names: Vec<Ident> = (0..self.outputs.len())
            .map(|i| output_name(&self.stage, i))
            .collect();
        if let [name] = &names[..] {
            return quote!(*#name = #call;);
        }
        let values: Vec<Ident> = (0..names.len())
            .map(|i| format_ident!("value{i}"))
            .collect();
        quote! {
            let (#(#values),*) = #call;
            #(*#names = #values;)*
        }
    }
}

/// The name of an output of a stage with an interface.
pub fn output_name(stage: &Stage, i: usize) -> Ident {
    match stage {
        Stage::Vertex if i == 0 => format_ident!("position_out"),
        Stage::Vertex => format_ident!("varying{}", i - 1),
        _ => format_ident!("target{i}"),
    }
}

/// The DSL's type of a texture.
pub fn texture_type(t: Texture) -> TokenStream {
    match t {
        Texture::Flat => quote!(::hankel_dsl::Texture2d),
        Texture::Multisampled => quote!(::hankel_dsl::Texture2dMultisampled),
        Texture::Volume => quote!(::hankel_dsl::Texture3d),
    }
}
