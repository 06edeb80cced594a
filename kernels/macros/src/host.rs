//! The host's half: the native executor and the description of each entry point.

use proc_macro2::TokenStream;
use quote::{format_ident, quote, quote_spanned};
use syn::spanned::Spanned;

use crate::general::{Form, own};
use crate::kernel::{
    BuiltIn, Compute, FragmentForm, Kernel, Role, Stage, StorageKind, Variant, text_of,
    texture_type,
};
use crate::shader::output_name;
use crate::stage::{Passed, Returned};
use crate::twin;

impl Kernel {
    pub fn expand_host(&self) -> TokenStream {
        let fragment = self.fragment_variant();
        let variants = || self.variants.iter().chain(&fragment);
        let image = self.is_image_pass().then(|| {
            let entries = variants().map(|v| &v.entry);
            let run = self.run_image();
            quote! {
                #[cfg(any(not(hankel_select), #(hankel_kernel = #entries),*))]
                #run
            }
        });
        let entries = variants().map(|v| {
            let description = self.description(v);
            let run = if self.is_image_pass() {
                self.run_form(v)
            } else {
                self.run(v)
            };
            let entry = &v.entry;
            // `hankel` sets these two: what is only described, or does not run, is not compiled.
            let wanted = quote!(any(not(hankel_select), hankel_kernel = #entry));
            let inputs = match (&self.inputs, &v.scalar) {
                (None, _) => quote!(None),
                (Some(path), None) => quote!(Some(#path as native::inputs::Make)),
                (Some(path), Some(scalar)) => {
                    quote!(Some(#path::<#scalar> as native::inputs::Make))
                }
            };
            quote! {
                all.push({
                    #[cfg(#wanted)]
                    #run
                    #[cfg(#wanted)]
                    let inputs = #inputs;
                    #[cfg(not(#wanted))]
                    use exec::not_built as run;
                    #[cfg(not(#wanted))]
                    let inputs = None;
                    native::Entry { kernel: #description, run, inputs }
                });
            }
        });
        let compensated = self.compensated.as_ref().map(|name| {
            quote_spanned! {name.span()=>
                const _: fn() -> native::Entries = #name::entries;
            }
        });
        let of_other = match &self.fragment_form {
            Some(FragmentForm::Of(name)) => Some(quote_spanned! {name.span()=>
                const _: fn() -> native::Entries = #name::entries;
            }),
            _ => None,
        };
        let uniforms = self.uniform_checks();
        let buffers = self.buffer_checks();
        let twin = (self.form() == Form::Cooperative).then(|| {
            let twin = twin::twin(&self.item, &format_ident!("twin"), &self.helpers);
            // As the native code that calls it.
            let entries = self.variants.iter().map(|v| &v.entry);
            quote! {
                #[cfg(any(not(hankel_select), #(hankel_kernel = #entries),*))]
                #twin
            }
        });
        quote! {
            ::hankel_dsl::on_host! {
                /// The entry points that come from the function.
                #[allow(
                    clippy::all,
                    unexpected_cfgs,
                    unused_braces,
                    unused_parens,
                    unused_imports,
                    unused_mut,
                    unused_parens,
                    unused_variables,
                    reason = "generated"
                )]
                #[must_use]
                pub fn entries() -> ::hankel_dsl::native::Entries {
                    use ::hankel_dsl::native::{self, describe, exec, fragment, layout, workgroup};
                    #compensated
                    #of_other
                    #uniforms
                    #buffers
                    #twin
                    #image
                    let mut all = native::Entries::new();
                    #(#entries)*
                    all
                }
            }
        }
    }

    /// What lies in a buffer, element after element, has a stride that every language has.
    fn buffer_checks(&self) -> TokenStream {
        let params = self.params.iter().filter_map(|p| match &p.role {
            Role::Element(ty)
            | Role::ElementMut(ty)
            | Role::Storage(ty)
            | Role::StorageMut { ty, .. } => Some((text_of(&p.name), ty)),
            _ => None,
        });
        let compute = matches!(self.stage, Stage::Compute(_));
        let outputs = self.outputs.iter().enumerate().filter_map(|(i, ty)| {
            let texels = self
                .variants
                .iter()
                .any(|v| self.output_format(i, v).is_some());
            (compute && !texels).then(|| (self.output_text(i), ty))
        });
        params
            .chain(outputs)
            .flat_map(|(name, ty)| self.variants.iter().map(move |v| (name.clone(), ty, v)))
            .map(|(name, ty, v)| {
                let concrete = self.concrete(ty, v);
                let message = format!(
                    "buffer `{name}`: a vector of three numbers takes 12 bytes in Rust and 16 in shaders: take a PackedVec3, a vector of four, or a structure"
                );
                quote_spanned! {ty.span()=>
                    const _: () = assert!(
                        size_of::<#concrete>().is_multiple_of(<#concrete as layout::Element>::ALIGN),
                        #message
                    );
                }
            })
            .collect()
    }

    fn uniform_checks(&self) -> TokenStream {
        self.params
            .iter()
            .filter_map(|p| match &p.role {
                Role::Uniform(ty) => Some((p, ty)),
                _ => None,
            })
            .flat_map(|(p, ty)| self.variants.iter().map(move |v| (p, ty, v)))
            .map(|(p, ty, v)| {
                let name = &p.name;
                let concrete = self.concrete(ty, v);
                let message = format!(
                    "uniform `{name}`: in a uniform buffer, elements of an array take a multiple of 16 bytes, such as Vec4, and a structure within another one begins and ends at a multiple of 16 bytes; F16x4 is a structure of 8 bytes: take two F16x2"
                );
                let few = p.push.then(|| {
                    let message = format!(
                        "`{name}`: push constants have at most 128 bytes on many devices: take a #[uniform]"
                    );
                    quote_spanned! {ty.span()=>
                        const _: () =
                            assert!(size_of::<#concrete>() <= native::PUSH_CONSTANT_BYTES, #message);
                    }
                });
                quote_spanned! {ty.span()=>
                    const _: () = assert!(<#concrete as layout::Element>::UNIFORM, #message);
                    #few
                }
            })
            .collect()
    }

    fn description(&self, variant: &Variant) -> TokenStream {
        let (entry, function, summary) = (&variant.entry, text_of(&self.name), &self.summary);
        let stage = match &self.stage {
            _ if variant.fragment => quote!(describe::Stage::Fragment),
            Stage::Vertex => quote!(describe::Stage::Vertex),
            Stage::Fragment => quote!(describe::Stage::Fragment),
            Stage::Compute(c) => {
                let threads = c.all_threads();
                let dimensions = c.threads.len() as u32;
                let cooperative = c.cooperative;
                let bytes = self.params.iter().filter_map(|p| match &p.role {
                    Role::Shared { ty, length, .. } => {
                        Some(quote!(((#length) * size_of::<#ty>()) as u32))
                    }
                    _ => None,
                });
                let bytes = quote!(0 #(+ #bytes)*);
                let range = self.describe_range();
                quote! {
                    describe::Stage::Compute {
                        threads: [#(#threads),*],
                        dimensions: #dimensions,
                        cooperative: #cooperative,
                        workgroup_bytes: #bytes,
                        range: #range,
                    }
                }
            }
        };
        let precision = match &variant.scalar {
            Some(s) => quote!(Some(<#s as layout::HasPrecision>::PRECISION)),
            None => quote!(None),
        };
        let params = self.describe_params(variant);
        let outputs = self.describe_outputs(variant);
        let tolerance = self.tolerance.of(variant);
        let (ulp, absolute, why) = (tolerance.ulp, tolerance.absolute, &tolerance.why);
        let non_finite = tolerance.non_finite;
        let invariant = self.invariant;
        let rounding = format_ident!("{}", self.rounding.variant());
        let subgroups = self.uses_subgroups();
        let sized = self.sized_by_subgroups;
        let compensated = match &self.compensated {
            Some(name) => {
                let name = text_of(name);
                quote!(Some(describe::text(#name)))
            }
            None => quote!(None),
        };
        let image_pass = self.describe_image_pass(variant);
        quote! {
            describe::Kernel {
                name: describe::text(#entry),
                function: describe::text(#function),
                summary: describe::text(#summary),
                file: describe::text(file!()),
                line: line!(),
                licence: describe::text(option_env!("CARGO_PKG_LICENSE").unwrap_or_default()),
                stage: #stage,
                precision: #precision,
                params: [#(#params),*].into(),
                outputs: [#(#outputs),*].into(),
                tolerance: describe::Tolerance {
                    ulp: #ulp,
                    absolute: #absolute,
                    non_finite: #non_finite,
                    why: describe::text(#why),
                },
                rounding: describe::Rounding::#rounding,
                subgroups: describe::Subgroups::of(#subgroups, #sized),
                compensated: #compensated,
                image_pass: #image_pass,
                invariant: #invariant,
            }
        }
    }

    fn describe_params(&self, variant: &Variant) -> Vec<TokenStream> {
        let (mut binding, mut location) = (0_u32, 0_u32);
        self.params
            .iter()
            .map(|p| {
                let name = text_of(&p.name);
                let (b, l) = (binding, location);
                binding += u32::from(p.role.is_bound());
                location += u32::from(matches!(p.role, Role::Attribute(_) | Role::Varying(_)));
                let layout = |ty: &syn::Type| {
                    let ty = self.concrete(ty, variant);
                    quote!(<#ty as layout::Element>::layout())
                };
                let role = match &p.role {
                    Role::Uniform(ty) => {
                        let layout = layout(ty);
                        let push = p.push;
                        quote!(Uniform { binding: #b, layout: #layout, push: #push })
                    }
                    Role::Element(ty) => {
                        let layout = layout(ty);
                        quote!(Element { binding: #b, layout: #layout })
                    }
                    Role::Storage(ty) => {
                        let layout = layout(ty);
                        quote!(Storage { binding: #b, layout: #layout })
                    }
                    Role::ElementMut(ty) => {
                        let layout = layout(ty);
                        quote!(ElementMut { binding: #b, layout: #layout })
                    }
                    Role::StorageMut { ty, unordered } => {
                        let layout = layout(ty);
                        quote!(StorageMut { binding: #b, layout: #layout, unordered: #unordered })
                    }
                    Role::Atomic { scalar, unordered } => quote!(Atomic {
                        binding: #b,
                        scalar: <#scalar as layout::AtomicScalar>::SCALAR,
                        unordered: #unordered,
                    }),
                    Role::Texture(kind) => {
                        quote!(Texture { binding: #b, texture: describe::TextureKind::#kind })
                    }
                    Role::StorageTexture {
                        kind,
                        format,
                        access,
                    } => {
                        let (dimensions, array) = (kind.dimensions(), *kind == StorageKind::Layers);
                        let access = access_type(access.as_ref());
                        quote!(StorageTexture {
                            binding: #b,
                            format: <#format as ::hankel_dsl::Format>::FORMAT,
                            dimensions: #dimensions,
                            array: #array,
                            access: <#access as ::hankel_dsl::Access>::ACCESS,
                        })
                    }
                    Role::Sampler(kind) => {
                        let kind = kind.variant();
                        quote!(Sampler { binding: #b, sampler: #kind })
                    }
                    Role::Constant { id, default, ty } => {
                        let scalar = format_ident!(
                            "{}",
                            match ty.to_string().as_str() {
                                "i32" => "I32",
                                "f32" => "F32",
                                "bool" => "Bool",
                                _ => "U32",
                            }
                        );
                        quote!(Constant {
                            id: #id,
                            scalar: describe::Scalar::#scalar,
                            default: #default,
                        })
                    }
                    Role::Index => quote!(Index),
                    Role::BuiltIn(built_in) => {
                        let built_in = built_in.variant();
                        quote!(BuiltIn { built_in: describe::BuiltIn::#built_in })
                    }
                    Role::Shared { ty, length, atomic } => quote!(Shared {
                        layout: <#ty as layout::Element>::layout(),
                        length: (#length) as u32,
                        atomic: #atomic,
                    }),
                    Role::Attribute(ty) => {
                        quote!(Attribute { location: #l, ty: <#ty as layout::Element>::ty() })
                    }
                    Role::Varying(passed) => {
                        let (ty, interpolation) = (&passed.ty, passed.describe());
                        quote!(Varying {
                            location: #l,
                            ty: <#ty as layout::Element>::ty(),
                            interpolation: #interpolation,
                        })
                    }
                };
                let inputs = p.inputs.describe();
                quote!(describe::Param {
                    name: describe::text(#name),
                    role: describe::Role::#role,
                    inputs: #inputs,
                })
            })
            .collect()
    }

    /// How many of the outputs the host has arrays or textures for.
    fn stored_on_host(&self) -> usize {
        match self.stage {
            Stage::Compute(_) => self.outputs.len(),
            _ => self
                .returned()
                .iter()
                .filter(|it| it.is_stored_on_host())
                .count(),
        }
    }

    fn describe_outputs(&self, variant: &Variant) -> Vec<TokenStream> {
        if variant.fragment {
            return self.describe_targets();
        }
        if !matches!(self.stage, Stage::Compute(_)) {
            return self.returned().iter().map(Returned::describe).collect();
        }
        let binding = self.params.iter().filter(|p| p.role.is_bound()).count() as u32;
        self.outputs
            .iter()
            .enumerate()
            .map(|(i, ty)| {
                let binding = binding + i as u32;
                match self.output_format(i, variant) {
                    Some(format) => {
                        let format = format.variant();
                        let dimensions = self.dimensions() as u32;
                        quote!(describe::Output::Texture {
                            binding: #binding,
                            format: describe::TexelFormat::#format,
                            dimensions: #dimensions,
                        })
                    }
                    None => {
                        let ty = self.concrete(ty, variant);
                        quote!(describe::Output::Buffer {
                            binding: #binding,
                            layout: <#ty as layout::Element>::layout(),
                        })
                    }
                }
            })
            .collect()
    }

    /// Takes the arguments of a call, but for those that are written to as the result.
    pub fn take_args(&self, variant: &Variant) -> TokenStream {
        let (count, constants) = (
            self.params
                .iter()
                .filter(|p| {
                    p.role.is_bound() || matches!(p.role, Role::Attribute(_) | Role::Varying(_))
                })
                .count()
                + self.stored_on_host(),
            self.params
                .iter()
                .filter(|p| matches!(p.role, Role::Constant { .. }))
                .count(),
        );
        let takes = self.params.iter().map(|p| {
            let (name, text) = (&p.name, text_of(&p.name));
            match &p.role {
                Role::Uniform(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(let #name = args.uniform::<#ty>(#text)?;)
                }
                Role::Element(ty) | Role::Storage(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(let #name = args.slice::<#ty>(#text)?;)
                }
                Role::Attribute(ty) | Role::Varying(Passed { ty, .. }) => {
                    quote!(let #name = args.slice::<#ty>(#text)?;)
                }
                Role::ElementMut(ty) | Role::StorageMut { ty, .. } => {
                    let ty = self.concrete(ty, variant);
                    quote! {
                        let #name = ::hankel_dsl::StorageMut::<#ty>::new(
                            args.words(#text, size_of::<#ty>())?,
                        );
                    }
                }
                Role::Atomic { scalar, .. } => quote! {
                    let #name = ::hankel_dsl::Atomics::<#scalar>::new(args.words(#text, 4)?);
                },
                Role::Texture(kind) => {
                    quote!(let #name = args.texture(#text, describe::TextureKind::#kind)?;)
                }
                Role::StorageTexture {
                    kind,
                    format,
                    access,
                } => {
                    let (ty, array) = (kind.ty(), *kind == StorageKind::Layers);
                    let access = access_type(access.as_ref());
                    quote! {
                        let #name = #ty::<#format, #access>::new(
                            args.texels(
                                #text,
                                <#format as ::hankel_dsl::Format>::FORMAT,
                                <#access as ::hankel_dsl::Access>::ACCESS,
                                #array,
                            )?,
                        );
                    }
                }
                Role::Sampler(kind) => {
                    let kind = kind.variant();
                    quote!(let #name = args.sampler(#text, #kind)?;)
                }
                Role::Constant { ty, .. } => {
                    quote!(let #name = <#ty as ::hankel_dsl::Specialised>::of_word(args.constant());)
                }
                Role::Index | Role::BuiltIn(_) | Role::Shared { .. } => TokenStream::new(),
            }
        });
        quote! {
            let mut args = exec::Args::take(call, #count, #constants)?;
            #(#takes)*
        }
    }

    /// `fn run`.
    fn run(&self, variant: &Variant) -> TokenStream {
        let takes = self.take_args(variant);
        let body = match &self.stage {
            Stage::Compute(c) => self.run_compute(c, variant),
            _ => self.run_interface(variant),
        };
        // Whether a fragment that is begun again has written before is found by looking.
        let looks = matches!(self.stage, Stage::Fragment)
            && self.params.iter().any(|p| p.role.is_written());
        let mode = if looks {
            quote!(call.mode.looked_at())
        } else {
            quote!(call.mode)
        };
        quote! {
            fn run(call: &mut native::Call<'_>) -> Result<(), native::CallError> {
                let (__mode, _session) = native::sanitize::begin(#mode);
                #takes
                #body
            }
        }
    }

    /// The call of the kernel for invocation `i`.
    pub fn host_call(&self, variant: &Variant) -> TokenStream {
        let form = self.form();
        let name = &self.name;
        let generics = variant.scalar.as_ref().map(|s| quote!(::<#s>));
        let args = self.params.iter().map(|p| {
            let name = &p.name;
            match &p.role {
                Role::Element(_) if form == Form::Cooperative => {
                    quote!(__it.number.and_then(|n| #name.get(n as usize)).copied())
                }
                Role::Element(_) if form == Form::General => quote!(#name[__number as usize]),
                Role::Element(_) | Role::Attribute(_) => quote!(#name[__i]),
                Role::Varying(passed) => passed.wrap(&quote!(#name[__i])),
                Role::Uniform(_) | Role::Constant { .. } => quote!(#name),
                Role::Storage(_) => quote!(::hankel_dsl::Buffer::new(#name)),
                Role::ElementMut(_) => {
                    let own = own(p);
                    quote!(&mut #own)
                }
                Role::StorageMut { .. } | Role::StorageTexture { .. } | Role::Atomic { .. } => {
                    quote!(#name)
                }
                Role::Texture(kind) => {
                    let ty = texture_type(kind);
                    quote!(#ty::new(#name))
                }
                Role::Sampler(kind) => {
                    let ty = kind.ty();
                    quote!(#ty::new(#name))
                }
                Role::Index => match form {
                    Form::Cooperative => self.host_place(&quote!(__it.at)),
                    Form::General => self.host_place(&quote!(__at)),
                    Form::Plain if self.dimensions() == 1 => quote!(__i as u32),
                    Form::Plain => quote!(__i),
                },
                Role::BuiltIn(BuiltIn::LocalIndex) => quote!(__it.local_index),
                Role::BuiltIn(BuiltIn::LocalId) => self.host_place(&quote!(__it.local)),
                Role::BuiltIn(BuiltIn::GroupId) => self.host_place(&quote!(__it.group)),
                Role::BuiltIn(BuiltIn::GroupCount) => self.host_place(&quote!(__it.groups)),
                Role::BuiltIn(BuiltIn::SubgroupSize) => quote!(__it.subgroup_size),
                Role::BuiltIn(BuiltIn::SubgroupInvocationId) => {
                    quote!(__it.subgroup_invocation_id())
                }
                Role::BuiltIn(BuiltIn::SubgroupId) => quote!(__it.subgroup_id()),
                Role::BuiltIn(BuiltIn::SubgroupCount) => quote!(__it.subgroup_count),
                Role::BuiltIn(built_in) => built_in.on_host(),
                Role::Shared { .. } => quote!(#name),
            }
        });
        match form {
            Form::Cooperative => quote!(twin(#(#args),*).await),
            _ => quote!(super::#name #generics (#(#args),*)),
        }
    }

    /// As much of a `UVec3` as the kernel has dimensions.
    fn host_place(&self, of: &TokenStream) -> TokenStream {
        match self.dimensions() {
            1 => quote!(#of.x),
            2 => quote!(#of.truncate()),
            _ => quote!(#of),
        }
    }

    fn elements(&self) -> impl Iterator<Item = &crate::kernel::Param> {
        self.params.iter().filter(|p| {
            matches!(
                p.role,
                Role::Element(_) | Role::Attribute(_) | Role::Varying(_)
            )
        })
    }

    fn length_checks(&self) -> TokenStream {
        self.elements()
            .map(|p| {
                let (name, text) = (&p.name, text_of(&p.name));
                quote!(exec::enough(#text, #name.len(), __count)?;)
            })
            .collect()
    }

    fn run_compute(&self, c: &Compute, variant: &Variant) -> TokenStream {
        let call = self.host_call(variant);
        match self.form() {
            Form::General => return self.run_general(c, &call, variant),
            Form::Cooperative => return self.run_cooperative(c, &call, variant),
            Form::Plain => {}
        }
        let checks = self.length_checks();
        let out = self.concrete(&self.outputs[0], variant);
        let map = if self.real.is_some() {
            self.lane_map(variant, &call, &out)
        } else {
            quote!(exec::map1(__mode, output, |__i| #call))
        };
        quote! {
            let output = args.slice_mut::<#out>("output")?;
            let __count = output.len();
            #checks
            #map
        }
    }

    /// A map that is generic over `Real`: a body that the executor calls with scalars or lanes.
    fn lane_map(&self, variant: &Variant, call: &TokenStream, out: &TokenStream) -> TokenStream {
        let name = &self.name;
        let scalar = variant.scalar.as_ref();
        // Samplers and textures have no lanes; neither has an index.
        let spreads = self.params.iter().all(|p| {
            matches!(
                p.role,
                Role::Uniform(_) | Role::Element(_) | Role::Constant { .. }
            )
        });
        if !spreads || self.scalar {
            return quote!(exec::map1(__mode, output, |__i| #call));
        }
        let fields = self.params.iter().map(|p| {
            let name = &p.name;
            match &p.role {
                Role::Uniform(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(#name: &'a #ty,)
                }
                Role::Element(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(#name: &'a [#ty],)
                }
                Role::Constant { ty, .. } => quote!(#name: #ty,),
                _ => quote!(#name: u32,),
            }
        });
        let names: Vec<_> = self.params.iter().map(|p| &p.name).collect();
        let windows = self.elements().map(|p| {
            let name = &p.name;
            quote!(let #name = &#name[__start..__start + L::LANES];)
        });
        let (uniforms, uniform_types): (Vec<_>, Vec<_>) = self
            .params
            .iter()
            .filter_map(|p| match &p.role {
                Role::Uniform(ty) => Some((&p.name, self.concrete(ty, variant))),
                _ => None,
            })
            .unzip();
        let args = self.params.iter().map(|p| {
            let name = &p.name;
            match &p.role {
                Role::Element(ty) => {
                    let ty = self.concrete(ty, variant);
                    quote!(<#ty as layout::Lanewise<#scalar>>::load::<L>(#name))
                }
                _ => quote!(#name),
            }
        });
        quote! {
            struct Body<'a> {
                #(#fields)*
                __marker: core::marker::PhantomData<&'a ()>,
            }
            impl exec::LaneBody for Body<'_> {
                type Scalar = #scalar;
                type Out = #out;
                type Uniforms<L: ::hankel_dsl::Real> =
                    (#(<#uniform_types as layout::Splat<#scalar>>::Over<L>,)*);
                #[inline(always)]
                fn uniforms<L: layout::Lane<Scalar = #scalar>>(&self) -> Self::Uniforms<L> {
                    (#(<#uniform_types as layout::Splat<#scalar>>::splat::<L>(*self.#uniforms),)*)
                }
                #[inline(always)]
                fn one(&self, __i: usize) -> #out {
                    let Self { #(#names,)* .. } = *self;
                    #call
                }
                #[inline(always)]
                fn many<L: layout::Lane<Scalar = #scalar> + ::hankel_dsl::math::Elementary>(
                    &self,
                    __uniforms: &Self::Uniforms<L>,
                    __start: usize,
                    __out: &mut [#out],
                ) {
                    let Self { #(#names,)* .. } = *self;
                    let (#(#uniforms,)*) = __uniforms;
                    #(#windows)*
                    let __value = super::#name::<L>(#(#args),*);
                    <#out as layout::Lanewise<#scalar>>::store::<L>(&__value, __out);
                }
            }
            exec::map1_lanes(__mode, output, &Body { #(#names,)* __marker: core::marker::PhantomData })
        }
    }

    fn run_interface(&self, variant: &Variant) -> TokenStream {
        let call = self.host_call(variant);
        let checks = self.length_checks();
        let returned = self.returned();
        // The arrays, and what is written into them.
        let kept: Vec<_> = returned
            .iter()
            .enumerate()
            .filter(|(_, it)| it.is_stored_on_host())
            .collect();
        let names: Vec<_> = kept
            .iter()
            .map(|(i, _)| output_name(&self.stage, *i))
            .collect();
        let takes = names.iter().zip(&kept).map(|(name, (_, returned))| {
            let (ty, text) = (returned.ty(), text_of(name));
            quote!(let #name = args.slice_mut::<#ty>(#text)?;)
        });
        let first = &names[0];
        let same = names.iter().skip(1).map(|name| {
            let text = text_of(name);
            quote!(exec::enough(#text, #name.len(), __count)?;)
        });
        let values: Vec<_> = (0..returned.len())
            .map(|i| format_ident!("__value{i}"))
            .collect();
        let masks = returned
            .iter()
            .zip(&values)
            .filter(|(it, _)| !it.is_stored_on_host())
            .map(|(it, value)| it.stored_on_host(value));
        let stored = kept.iter().map(|(i, it)| it.stored_on_host(&values[*i]));
        let pattern = match &values[..] {
            [one] => quote!(#one),
            _ => quote!((#(#values),*)),
        };
        let value = quote!({
            let #pattern = #call;
            #(#masks;)*
            (#(#stored,)*)
        });
        let map = match self.stage {
            Stage::Fragment => {
                quote!(fragment::map_fragments(__mode, (#(#names,)*), |__i, __fragment| #value))
            }
            _ => quote!(exec::map_tuple(__mode, (#(#names,)*), |__i| #value)),
        };
        quote! {
            #(#takes)*
            let __count = #first.len();
            #(#same)*
            #checks
            #map
        }
    }
}

/// What is done with a storage texture: writing, if nothing is said.
fn access_type(said: Option<&syn::Type>) -> TokenStream {
    said.map_or_else(|| quote!(::hankel_dsl::access::Write), |said| quote!(#said))
}
