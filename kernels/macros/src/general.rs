//! Kernels that are more than a map to one output: several outputs, elements changed in place, a
//! range that no output gives, and workgroups that share memory and wait. One function for each
//! side of each form.

use proc_macro2::{Ident, TokenStream};
use quote::{format_ident, quote};

use crate::kernel::{Compute, Kernel, Param, Role, Stage, Variant, text_of};
use crate::range::Range;
use crate::twin;

/// What the code around a kernel's body looks like.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// A map to one output, a vertex or a fragment.
    Plain,
    /// Any other kernel whose invocations have nothing to do with one another.
    General,
    /// The invocations of a workgroup share memory and wait for one another.
    Cooperative,
}

/// The local copy of an element that is changed in place.
pub fn own(param: &Param) -> Ident {
    format_ident!("__{}_own", param.name)
}

/// The workgroup memory behind a parameter.
pub fn memory(param: &Param) -> Ident {
    format_ident!("__{}_memory", param.name)
}

impl Kernel {
    /// Which form it has.
    pub fn form(&self) -> Form {
        let Stage::Compute(c) = &self.stage else {
            return Form::Plain;
        };
        if c.cooperative {
            Form::Cooperative
        } else if self.outputs.len() != 1
            || !matches!(c.range, Range::Outputs)
            || self
                .params
                .iter()
                .any(|p| matches!(p.role, Role::ElementMut(_) | Role::BuiltIn(_)))
        {
            Form::General
        } else {
            Form::Plain
        }
    }

    /// Whether it has anything to do with subgroups: an expression.
    pub fn uses_subgroups(&self) -> TokenStream {
        let asks = self
            .params
            .iter()
            .any(|p| matches!(p.role, Role::BuiltIn(b) if b.is_of_subgroup()));
        if asks {
            quote!(true)
        } else {
            twin::uses_subgroups(&self.item, &self.helpers)
        }
    }

    /// Elements that are changed in place.
    pub fn changed(&self) -> impl Iterator<Item = &Param> {
        self.params
            .iter()
            .filter(|p| matches!(p.role, Role::ElementMut(_)))
    }

    /// Names for the parts of what the function returns.
    pub fn values(&self) -> Vec<Ident> {
        (0..self.outputs.len())
            .map(|i| format_ident!("__value{i}"))
            .collect()
    }

    /// `let (__value0, __value1) = CALL;`
    pub fn take_values(&self, call: &TokenStream) -> TokenStream {
        let values = self.values();
        match &values[..] {
            [] => quote!(#call;),
            [one] => quote!(let #one = #call;),
            _ => quote!(let (#(#values),*) = #call;),
        }
    }

    /// Host: takes the outputs, finds the range, checks that all is large enough.
    fn host_prelude(&self, variant: &Variant) -> TokenStream {
        let outputs = (0..self.outputs.len()).map(|i| {
            let (ident, text) = (self.output_ident(i), self.output_text(i));
            match self.output_format(i, variant) {
                Some(format) => {
                    let format = format.variant();
                    quote!(let #ident = args.texels(
                        #text,
                        describe::TexelFormat::#format,
                        describe::TexelAccess::Write,
                        false,
                    )?;)
                }
                None => {
                    let ty = self.concrete(&self.outputs[i], variant);
                    quote! {
                        let #ident = ::hankel_dsl::StorageMut::<#ty>::new(
                            args.words(#text, size_of::<#ty>())?,
                        );
                    }
                }
            }
        });
        let extent = self.host_extent(self.output_format(0, variant).is_some());
        // The last workgroup's invocations are told where they have no element.
        let told = self.form() == Form::Cooperative;
        let lengths = self
            .params
            .iter()
            .filter(|p| match p.role {
                Role::Element(_) => !told,
                Role::ElementMut(_) => true,
                _ => false,
            })
            .map(|p| {
                let (name, text) = (&p.name, text_of(&p.name));
                quote!(exec::enough(#text, #name.len() as usize, __count)?;)
            });
        let sizes = (0..self.outputs.len()).map(|i| {
            let (ident, text) = (self.output_ident(i), self.output_text(i));
            if self.output_format(i, variant).is_some() {
                quote!(exec::covers(#text, #ident.size(), __extent)?;)
            } else {
                quote!(exec::enough(#text, #ident.len() as usize, __count)?;)
            }
        });
        quote! {
            #(#outputs)*
            #extent
            let __count = exec::count(__extent)?;
            #(#lengths)*
            #(#sizes)*
        }
    }

    /// Host: stores the values of invocation `__number` at `__at`.
    pub fn host_stores(&self, variant: &Variant) -> TokenStream {
        let stores = self.values().into_iter().enumerate().map(|(i, value)| {
            let ident = self.output_ident(i);
            if self.output_format(i, variant).is_some() {
                quote!(#ident.store(__at, #value);)
            } else {
                quote!(#ident.set(__number, #value);)
            }
        });
        quote!(#(#stores)*)
    }

    /// The host's loop over all invocations.
    pub fn run_general(&self, c: &Compute, call: &TokenStream, variant: &Variant) -> TokenStream {
        let prelude = self.host_prelude(variant);
        let place = self
            .params
            .iter()
            .any(|p| matches!(p.role, Role::BuiltIn(_)))
            .then(|| {
                let threads = c.all_threads();
                quote!(let __it = workgroup::Invocation::new(__at, __extent, [#(#threads),*]);)
            });
        let (names, owns): (Vec<_>, Vec<_>) = self.changed().map(|p| (&p.name, own(p))).unzip();
        let take = self.take_values(call);
        let stores = self.host_stores(variant);
        quote! {
            #prelude
            exec::for_each(__mode, __extent, |__at, __number| {
                #place
                #(let mut #owns = #names.get(__number);)*
                #take
                #(#names.set(__number, #owns);)*
                #stores
            })
        }
    }

    /// The host's loop over all workgroups.
    pub fn run_cooperative(
        &self,
        c: &Compute,
        call: &TokenStream,
        variant: &Variant,
    ) -> TokenStream {
        let prelude = self.host_prelude(variant);
        let threads = c.all_threads();
        let (memories, handles): (Vec<_>, Vec<_>) = self
            .params
            .iter()
            .filter_map(|p| match &p.role {
                Role::Shared { ty, length, atomic } => {
                    let (name, memory) = (&p.name, memory(p));
                    let text = text_of(name);
                    let (word, handle) = if *atomic {
                        (quote!(u32), quote!(SharedAtomics))
                    } else {
                        (quote!(#ty), quote!(Shared))
                    };
                    Some((
                        quote!(let #memory = workgroup::memory::<#word, #length>(#text);),
                        quote! {
                            let #name = ::hankel_dsl::#handle::<#ty, #length>::new(&#memory);
                        },
                    ))
                }
                _ => None,
            })
            .unzip();
        let take = self.take_values(call);
        let stores = self.host_stores(variant);
        let subgroups = self.uses_subgroups();
        quote! {
            #prelude
            workgroup::for_each_group(__mode, __extent, [#(#threads),*], #subgroups, |__group| {
                #(#memories)*
                __group.run(|__it| {
                    #(#handles)*
                    async move {
                        #take
                        let __at = __it.at;
                        if let Some(__number) = __it.number {
                            #stores
                        }
                    }
                })
            })
        }
    }

    /// The shader: `let __extent = …;`.
    fn shader_extent(&self, variant: &Variant) -> TokenStream {
        let first = self.output_ident(0);
        if let Some(said) = self.said_extent() {
            said
        } else if let Some(param) = self.counted() {
            let name = &param.name;
            quote!(let __extent: u32 = #name.len() as u32;)
        } else if self.output_format(0, variant).is_some() {
            let ty = self.index_type();
            quote!(let __extent: #ty = #first.query_size();)
        } else {
            quote!(let __extent: u32 = #first.len() as u32;)
        }
    }

    /// The shader: whether the invocation is in range, and its number among those that are.
    fn shader_place(&self) -> (TokenStream, TokenStream) {
        // `&`, not `&&`: one branch.
        match self.dimensions() {
            1 => (
                quote!(invocation.x < __extent),
                quote!(invocation.x as usize),
            ),
            2 => (
                quote!((invocation.x < __extent.x) & (invocation.y < __extent.y)),
                quote!((invocation.y * __extent.x + invocation.x) as usize),
            ),
            _ => (
                quote!(
                    (invocation.x < __extent.x)
                        & (invocation.y < __extent.y)
                        & (invocation.z < __extent.z)
                ),
                quote!(
                    ((invocation.z * __extent.y + invocation.y) * __extent.x + invocation.x)
                        as usize
                ),
            ),
        }
    }

    /// The shader: stores the values of the invocation. In range, and the host gives outputs of at
    /// least that many elements.
    fn shader_stores(&self, variant: &Variant) -> TokenStream {
        let at = match self.dimensions() {
            1 => quote!(invocation.x),
            2 => quote!(UVec2::new(invocation.x, invocation.y)),
            _ => quote!(invocation),
        };
        let stores = self.values().into_iter().enumerate().map(|(i, value)| {
            let ident = self.output_ident(i);
            if self.output_format(i, variant).is_some() {
                quote! {
                    let texel = ::hankel_dsl::Texel::channels(#value);
                    unsafe { ::hankel_dsl::image::write(#ident, #at, texel) };
                }
            } else {
                quote!(unsafe { *#ident.index_unchecked_mut(__number) = #value };)
            }
        });
        quote!(#(#stores)*)
    }

    /// The shader: `let __groups = …;`, how many workgroups the range needs, where that is asked.
    fn shader_groups(&self, c: &Compute) -> TokenStream {
        if !self.asks_for_groups() {
            return TokenStream::new();
        }
        let threads = &c.threads;
        match &threads[..] {
            [x] => quote!(let __groups = __extent.div_ceil(#x);),
            [x, y] => quote! {
                let __groups = UVec2::new(__extent.x.div_ceil(#x), __extent.y.div_ceil(#y));
            },
            _ => {
                let (x, y, z) = (threads[0], threads[1], threads[2]);
                quote! {
                    let __groups = UVec3::new(
                        __extent.x.div_ceil(#x),
                        __extent.y.div_ceil(#y),
                        __extent.z.div_ceil(#z),
                    );
                }
            }
        }
    }

    /// The shader's body of a general kernel: the guard, then what one invocation does.
    pub fn general_body(&self, c: &Compute, call: &TokenStream, variant: &Variant) -> TokenStream {
        let extent = self.shader_extent(variant);
        let groups = self.shader_groups(c);
        let (inside, number) = self.shader_place();
        let (names, owns): (Vec<_>, Vec<_>) = self.changed().map(|p| (&p.name, own(p))).unzip();
        let take = self.take_values(call);
        let stores = self.shader_stores(variant);
        // SAFETY (of the accesses): the guard, and the host gives buffers of at least this many
        // elements.
        quote! {
            #extent
            #groups
            if #inside {
                let __number = #number;
                #(let mut #owns = unsafe { *#names.index_unchecked(__number) };)*
                #take
                #(unsafe { *#names.index_unchecked_mut(__number) = #owns };)*
                #stores
            }
        }
    }

    /// The shader's body of a cooperative kernel. No guard around the call: every invocation must
    /// come to every barrier.
    pub fn cooperative_body(
        &self,
        c: &Compute,
        call: &TokenStream,
        variant: &Variant,
    ) -> TokenStream {
        let take = self.take_values(call);
        let has_elements = self
            .params
            .iter()
            .any(|p| matches!(p.role, Role::Element(_)));
        if self.outputs.is_empty() && !has_elements && !self.asks_for_groups() {
            return take;
        }
        let extent = self.shader_extent(variant);
        let groups = self.shader_groups(c);
        let (inside, number) = self.shader_place();
        let stores = self.shader_stores(variant);
        let store = (!self.outputs.is_empty()).then(|| quote!(if __inside { #stores }));
        quote! {
            #extent
            #groups
            let __inside = #inside;
            let __number = #number;
            #take
            #store
        }
    }
}
