//! SPIR-V entry points: thin functions that load, call the kernel and store, with one guard.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use crate::general::{Form, own};
use crate::kernel::{BuiltIn, Compute, Kernel, Role, Stage, Variant, texture_type};

impl Kernel {
    pub fn expand_shader(&self) -> TokenStream {
        let fragment = self.fragment_variant();
        let variants = self.variants.iter().chain(&fragment);
        let entries = variants.map(|v| self.entry_point(v));
        quote! {
            ::hankel_dsl::on_spirv! {
                #[allow(
                    clippy::all,
                    dead_code,
                    missing_docs,
                    unexpected_cfgs,
                    unused_braces,
                    unused_imports,
                    reason = "generated"
                )]
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
            _ if variant.fragment => (
                quote!(fragment(entry_point_name = #entry)),
                self.fragment_builtins(),
                self.fragment_body(variant),
            ),
            Stage::Compute(c) => {
                let threads = &c.threads;
                (
                    quote!(compute(threads(#(#threads),*), entry_point_name = #entry)),
                    self.compute_builtins(),
                    self.compute_body(c, variant),
                )
            }
            Stage::Vertex => (
                quote!(vertex(entry_point_name = #entry)),
                self.stage_builtins(),
                self.interface_body(variant),
            ),
            Stage::Fragment => {
                let depth = self.returns_depth().then(|| quote!(depth_replacing,));
                (
                    quote!(fragment(#depth entry_point_name = #entry)),
                    self.stage_builtins(),
                    self.interface_body(variant),
                )
            }
        };
        let params = self.shader_params(variant);
        let outputs = self.shader_outputs(variant);
        quote! {
            #[cfg(any(not(hankel_select), hankel_kernel = #entry))]
            #[::hankel_dsl::spirv_std::spirv(#stage)]
            pub fn #function(#builtins #params #outputs) {
                #body
            }
        }
    }

    fn compute_builtins(&self) -> TokenStream {
        let asked = [
            (
                BuiltIn::LocalId,
                quote!(#[spirv(local_invocation_id)] __local_id: UVec3,),
            ),
            (
                BuiltIn::LocalIndex,
                quote!(#[spirv(local_invocation_index)] __local_index: u32,),
            ),
            (
                BuiltIn::GroupId,
                quote!(#[spirv(workgroup_id)] __group_id: UVec3,),
            ),
            (
                BuiltIn::SubgroupSize,
                quote!(#[spirv(subgroup_size)] __subgroup_size: u32,),
            ),
            (
                BuiltIn::SubgroupInvocationId,
                quote!(#[spirv(subgroup_local_invocation_id)] __subgroup_invocation_id: u32,),
            ),
            (
                BuiltIn::SubgroupId,
                quote!(#[spirv(subgroup_id)] __subgroup_id: u32,),
            ),
            (
                BuiltIn::SubgroupCount,
                quote!(#[spirv(num_subgroups)] __subgroup_count: u32,),
            ),
        ];
        let asked = asked
            .into_iter()
            .filter(|(built_in, _)| self.asks_for(*built_in))
            .map(|(_, tokens)| tokens);
        quote! {
            #[spirv(global_invocation_id)] invocation: UVec3,
            #(#asked)*
        }
    }

    fn asks_for(&self, built_in: BuiltIn) -> bool {
        self.params
            .iter()
            .any(|p| matches!(p.role, Role::BuiltIn(b) if b == built_in))
    }

    /// Whether the kernel wants to know how many workgroups there are.
    pub fn asks_for_groups(&self) -> bool {
        self.asks_for(BuiltIn::GroupCount)
    }

    /// As much of a `UVec3` as the kernel has dimensions.
    fn of_dimensions(&self, of: &TokenStream) -> TokenStream {
        match self.dimensions() {
            1 => quote!(#of.x),
            2 => quote!(UVec2::new(#of.x, #of.y)),
            _ => quote!(#of),
        }
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
                    if p.push {
                        return quote!(#[spirv(push_constant)] #name: &#ty,);
                    }
                    quote!(#[spirv(uniform, descriptor_set = 0, binding = #here)] #name: &#ty,)
                }
                Role::Element(ty) | Role::Storage(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(#[spirv(storage_buffer, descriptor_set = 0, binding = #here)] #name: &[#ty],)
                }
                // `&mut`: a shared slice would be decorated NonWritable.
                Role::ElementMut(ty)
                | Role::StorageMut { ty, .. }
                | Role::Atomic { scalar: ty, .. } => {
                    let ty = self.concrete(ty, variant);
                    quote!(#[spirv(storage_buffer, descriptor_set = 0, binding = #here)] #name: &mut [#ty],)
                }
                Role::Texture(kind) => {
                    quote!(#[spirv(descriptor_set = 0, binding = #here)] #name: &::hankel_dsl::image::#kind,)
                }
                Role::StorageTexture { kind, format, .. } => {
                    let shape = kind.image();
                    quote! {
                        #[spirv(descriptor_set = 0, binding = #here)]
                        #name: &<#format as ::hankel_dsl::Format>::#shape,
                    }
                }
                Role::Sampler(_) => {
                    quote!(#[spirv(descriptor_set = 0, binding = #here)] #name: &::hankel_dsl::spirv_std::Sampler,)
                }
                Role::Constant { id, default, .. } => {
                    quote!(#[spirv(spec_constant(id = #id, default = #default))] #name: u32,)
                }
                Role::Attribute(ty) => quote!(#name: #ty,),
                Role::Varying(passed) => {
                    let (decoration, ty) = (passed.decoration(), &passed.ty);
                    quote!(#decoration #name: #ty,)
                }
                Role::Shared { ty, length, .. } => {
                    quote!(#[spirv(workgroup)] #name: &mut [#ty; #length],)
                }
                Role::Index | Role::BuiltIn(_) => TokenStream::new(),
            }
        });
        params.collect()
    }

    fn shader_outputs(&self, variant: &Variant) -> TokenStream {
        let binding = self.params.iter().filter(|p| p.role.is_bound()).count() as u32;
        match &self.stage {
            _ if variant.fragment => self.fragment_targets(),
            Stage::Compute(_) => {
                self.outputs.iter().enumerate().map(|(i, ty)| {
                    let (binding, output) = (binding + i as u32, self.output_ident(i));
                    if let Some(format) = self.output_format(i, variant) {
                        let format = format.variant();
                        let image = match self.dimensions() {
                            3 => quote!(Volume),
                            _ => quote!(Flat),
                        };
                        return quote! {
                            #[spirv(descriptor_set = 0, binding = #binding)]
                            #output: &<::hankel_dsl::format::#format as ::hankel_dsl::Format>::#image,
                        };
                    }
                    let ty = self.concrete(ty, variant);
                    quote!(#[spirv(storage_buffer, descriptor_set = 0, binding = #binding)] #output: &mut [#ty],)
                }).collect()
            }
            stage => self
                .returned()
                .iter()
                .enumerate()
                .map(|(i, returned)| {
                    let (name, ty) = (output_name(stage, i), returned.ty());
                    let decoration = returned.decoration();
                    quote!(#decoration #name: &mut #ty,)
                })
                .collect(),
        }
    }

    /// The call of the kernel; `at` is the index.
    pub fn call(&self, variant: &Variant) -> TokenStream {
        let form = self.form();
        let name = &self.name;
        let generics = variant.scalar.as_ref().map(|s| quote!(::<#s>));
        let args = self.params.iter().map(|p| {
            let name = &p.name;
            match &p.role {
                // SAFETY (of the loads): the guard, and as many elements as the output has.
                Role::Element(_) if form == Form::Cooperative => quote! {
                    if __inside & (__number < #name.len()) {
                        Some(unsafe { *#name.index_unchecked(__number) })
                    } else {
                        None
                    }
                },
                Role::Element(_) if form == Form::General => {
                    quote!(unsafe { *#name.index_unchecked(__number) })
                }
                Role::Element(_) => {
                    quote!(unsafe { *#name.index_unchecked(invocation.x as usize) })
                }
                Role::ElementMut(_) => {
                    let own = own(p);
                    quote!(&mut #own)
                }
                Role::Uniform(_) | Role::Attribute(_) => quote!(#name),
                Role::Constant { ty, .. } => {
                    quote!(<#ty as ::hankel_dsl::Specialised>::of_word(#name))
                }
                Role::Varying(passed) => passed.wrap(&quote!(#name)),
                Role::Storage(_) => quote!(::hankel_dsl::Buffer::new(#name)),
                Role::StorageMut { .. } => quote!(::hankel_dsl::StorageMut::new(&*#name)),
                Role::Atomic { .. } => quote!(::hankel_dsl::Atomics::new(&*#name)),
                Role::Texture(kind) => {
                    let ty = texture_type(kind);
                    quote!(#ty::new(#name))
                }
                Role::StorageTexture { kind, .. } => {
                    let ty = kind.ty();
                    quote!(#ty::new(#name))
                }
                Role::Sampler(kind) => {
                    let ty = kind.ty();
                    quote!(#ty::new(#name))
                }
                Role::Index => self.of_dimensions(&quote!(invocation)),
                Role::Shared { atomic: false, .. } => quote!(::hankel_dsl::Shared::new(&*#name)),
                Role::Shared { atomic: true, .. } => {
                    quote!(::hankel_dsl::SharedAtomics::new(&*#name))
                }
                Role::BuiltIn(BuiltIn::LocalIndex) => quote!(__local_index),
                Role::BuiltIn(BuiltIn::LocalId) => self.of_dimensions(&quote!(__local_id)),
                Role::BuiltIn(BuiltIn::GroupId) => self.of_dimensions(&quote!(__group_id)),
                Role::BuiltIn(BuiltIn::GroupCount) => quote!(__groups),
                Role::BuiltIn(BuiltIn::SubgroupSize) => quote!(__subgroup_size),
                Role::BuiltIn(BuiltIn::SubgroupInvocationId) => quote!(__subgroup_invocation_id),
                Role::BuiltIn(BuiltIn::SubgroupId) => quote!(__subgroup_id),
                Role::BuiltIn(BuiltIn::SubgroupCount) => quote!(__subgroup_count),
                // What lies in w differs from device to device.
                Role::BuiltIn(BuiltIn::FragCoord) => {
                    quote!(::hankel_dsl::glam::Vec4::truncate(#name))
                }
                // SPIR-V's mask is an array of such numbers.
                Role::BuiltIn(BuiltIn::SampleMask) => quote!(#name[0]),
                Role::BuiltIn(_) => quote!(#name),
            }
        });
        quote!(super::super::#name #generics (#(#args),*))
    }

    fn compute_body(&self, c: &Compute, variant: &Variant) -> TokenStream {
        let call = self.call(variant);
        match self.form() {
            Form::General => return self.general_body(c, &call, variant),
            Form::Cooperative => return self.cooperative_body(c, &call, variant),
            Form::Plain => {}
        }
        match (variant.format.is_some(), self.dimensions()) {
            (false, _) => quote! {
                if (invocation.x as usize) < output.len() {
                    let __value = #call;
                    unsafe { *output.index_unchecked_mut(invocation.x as usize) = __value };
                }
            },
            // `&`, not `&&`: one branch.
            (true, 2) => quote! {
                let __size: UVec2 = output.query_size();
                if (invocation.x < __size.x) & (invocation.y < __size.y) {
                    let __value = ::hankel_dsl::Texel::channels(#call);
                    unsafe { ::hankel_dsl::image::write(output, UVec2::new(invocation.x, invocation.y), __value) };
                }
            },
            (true, _) => quote! {
                let __size: UVec3 = output.query_size();
                if (invocation.x < __size.x) & (invocation.y < __size.y) & (invocation.z < __size.z) {
                    let __value = ::hankel_dsl::Texel::channels(#call);
                    unsafe { ::hankel_dsl::image::write(output, invocation, __value) };
                }
            },
        }
    }

    fn interface_body(&self, variant: &Variant) -> TokenStream {
        let call = self.call(variant);
        let names: Vec<Ident> = (0..self.outputs.len())
            .map(|i| output_name(&self.stage, i))
            .collect();
        let values: Vec<Ident> = (0..names.len())
            .map(|i| format_ident!("__value{i}"))
            .collect();
        let stored = self.returned();
        let stored = stored
            .iter()
            .zip(&values)
            .map(|(it, value)| it.stored(value));
        let pattern = match &values[..] {
            [one] => quote!(#one),
            _ => quote!((#(#values),*)),
        };
        quote! {
            let #pattern = #call;
            #(*#names = #stored;)*
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
