//! Image passes: compute kernels all of whose results are texels. One native body runs them in every format
//! and form; the fragment form is one more entry point, which returns the texels as colours.

use proc_macro2::{Ident, Span, TokenStream};
use quote::{format_ident, quote};

use crate::general::Form;
use crate::kernel::{FragmentForm, Kernel, Role, Stage, Variant, text_of};
use crate::range::Range;

impl Kernel {
    /// Whether it gives a texel of each output for each index, and nothing else depends on the outputs' sizes.
    pub fn is_image_pass(&self) -> bool {
        let Stage::Compute(c) = &self.stage else {
            return false;
        };
        let has_own = self.params.iter().any(|p| {
            matches!(
                p.role,
                Role::BuiltIn(_) | Role::Element(_) | Role::ElementMut(_)
            )
        });
        let texels =
            |v: &Variant| (0..self.outputs.len()).all(|i| self.output_format(i, v).is_some());
        !c.cooperative
            && matches!(c.range, Range::Outputs)
            && !self.outputs.is_empty()
            && !has_own
            && self.variants.iter().all(texels)
    }

    /// What is wrong with `forms(fragment)`.
    pub fn check_forms(&self, span: Span) -> syn::Result<()> {
        let writes = self.params.iter().any(|p| p.role.is_written());
        if !self.is_image_pass() || writes || self.dimensions() != 2 {
            return Err(syn::Error::new(
                span,
                "the fragment form draws what the kernel returns, for each pixel: that is of a kernel in 2 dimensions that returns texels, `texture(FORMAT)` or `outputs(FORMAT, …)`, and writes and shares nothing else",
            ));
        }
        if let Some(p) = self.params.iter().find(|p| p.push) {
            return Err(syn::Error::new(
                p.name.span(),
                "forms have the same bindings, and not every device has push constants: take a #[uniform]",
            ));
        }
        Ok(())
    }

    /// The entry point of the fragment form, if it is made here.
    pub fn fragment_variant(&self) -> Option<Variant> {
        match &self.fragment_form {
            Some(FragmentForm::Own) => Some(Variant {
                entry: entry_of(&self.name),
                scalar: None,
                format: None,
                fragment: true,
            }),
            _ => None,
        }
    }

    /// `describe::Kernel::image_pass`.
    pub fn describe_image_pass(&self, variant: &Variant) -> TokenStream {
        let fragment = match &self.fragment_form {
            None => return quote!(None),
            Some(_) if variant.fragment => return quote!(Some(describe::ImagePass::Fragment)),
            Some(FragmentForm::Own) => entry_of(&self.name),
            Some(FragmentForm::Of(name)) => entry_of(name),
        };
        quote!(Some(describe::ImagePass::Compute { fragment: describe::text(#fragment) }))
    }

    /// The outputs of the fragment form.
    pub fn describe_targets(&self) -> Vec<TokenStream> {
        let targets = self.outputs.iter().enumerate().map(|(i, ty)| {
            let location = i as u32;
            quote!(describe::Output::Target {
                location: #location,
                ty: <#ty as layout::Element>::ty(),
            })
        });
        targets.collect()
    }

    /// `fn run` of one format or form.
    pub fn run_form(&self, variant: &Variant) -> TokenStream {
        let formats = (0..self.outputs.len()).map(|i| match self.output_format(i, variant) {
            Some(format) if !variant.fragment => {
                let format = format.variant();
                quote!(Some(describe::TexelFormat::#format))
            }
            _ => quote!(None),
        });
        quote! {
            fn run(call: &mut native::Call<'_>) -> Result<(), native::CallError> {
                image(call, [#(#formats),*])
            }
        }
    }

    /// `fn image`: the native body of all formats and forms.
    pub fn run_image(&self) -> TokenStream {
        let variant = &self.variants[0];
        let takes = self.take_args(variant);
        let count = self.outputs.len();
        let call = self.host_call(variant);
        let run = if self.form() == Form::Plain {
            let ty = &self.outputs[0];
            let map = if self.dimensions() == 2 {
                quote!(map_texels2)
            } else {
                quote!(map_texels)
            };
            let index = self.index_type();
            quote! {
                let output = args.image::<#ty>("output", __formats[0])?;
                exec::#map(__mode, output, |__i: #index| #call)
            }
        } else {
            let outputs = self.outputs.iter().enumerate().map(|(i, ty)| {
                let (ident, text) = (self.output_ident(i), self.output_text(i));
                quote!(let #ident = args.image_texels::<#ty>(#text, __formats[#i])?;)
            });
            let first = self.output_ident(0);
            let sizes = (0..count).map(|i| {
                let (ident, text) = (self.output_ident(i), self.output_text(i));
                quote! {
                    exec::covers(#text, #ident.size(), __extent)?;
                    exec::enough(#text, #ident.count(), __count)?;
                }
            });
            let take = self.take_values(&call);
            let stores = self.host_stores(variant);
            quote! {
                #(#outputs)*
                let (__extent, __count) = (#first.size(), #first.count());
                #(#sizes)*
                exec::for_each_of(__mode, __extent, __count, |__at, __number| {
                    #take
                    #stores
                })
            }
        };
        quote! {
            fn image(
                call: &mut native::Call<'_>,
                __formats: [Option<describe::TexelFormat>; #count],
            ) -> Result<(), native::CallError> {
                let (__mode, _session) = native::sanitize::begin(call.mode);
                #takes
                #run
            }
        }
    }

    /// The shader's parameter that the fragment's index comes from.
    pub fn fragment_builtins(&self) -> TokenStream {
        let asks = self.params.iter().any(|p| matches!(p.role, Role::Index));
        let coord = asks.then(|| quote!(#[spirv(frag_coord)] __coord: Vec4,));
        quote!(#coord)
    }

    /// The shader's outputs.
    pub fn fragment_targets(&self) -> TokenStream {
        let targets = self.outputs.iter().enumerate().map(|(i, ty)| {
            let target = target(i);
            quote!(#target: &mut #ty,)
        });
        targets.collect()
    }

    /// The shader's body.
    pub fn fragment_body(&self, variant: &Variant) -> TokenStream {
        let asks = self.params.iter().any(|p| matches!(p.role, Role::Index));
        // SAFETY: a pixel's centre is not negative, and there are no 2^31 pixels in a row.
        let index = asks.then(|| {
            quote! {
                let invocation = unsafe {
                    UVec2::new(
                        __coord.x.to_int_unchecked::<u32>(),
                        __coord.y.to_int_unchecked::<u32>(),
                    )
                };
            }
        });
        let take = self.take_values(&self.call(variant));
        let stores = self.values().into_iter().enumerate().map(|(i, value)| {
            let target = target(i);
            quote!(*#target = #value;)
        });
        quote! {
            #index
            #take
            #(#stores)*
        }
    }
}

fn entry_of(function: &Ident) -> String {
    format!("{}_fragment", text_of(function))
}

fn target(i: usize) -> Ident {
    format_ident!("target{i}")
}
