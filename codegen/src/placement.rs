//! Where bindings are in the generated texts, if a host wants them elsewhere than where they are by
//! default: bases for whole languages, and places of single bindings from a TOML file.
//!
//! ```toml
//! # [KERNEL.PARAMETER], both as manifest.json names them
//! [shade_hamburger.map]
//! hlsl = { register = 4, space = 2 }
//! wgsl = { group = 2, binding = 0 }
//! msl = { slot = 7 }
//! glsl = { binding = 3 }
//! essl310 = { binding = 1 }
//! ```
//!
//! What the file does not name stays where it is: two bindings in one place are an error. SPIR-V keeps
//! its descriptor set 0 and its numbers, and GLSL ES 3.00 has neither: it binds by name.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};

use hankel_dsl::native::describe::Kernel;
use hankel_system::fields::{self, Table};
use hankel_system::input;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::Spanned;

use crate::Language;
use crate::error::{Error, Failure, Result, Step};
use crate::headers::Layouts;
use crate::manifest::{self, Binding, BindingKind};

/// Bytes that a file of places may have.
const MAX_BYTES: u64 = 1 << 20;

/// Where the bindings of all kernels are.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Placement {
    /// HLSL: the register space of every binding.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub hlsl_space: u8,
    /// HLSL: the first register of every class (t, u, b, s).
    #[serde(skip_serializing_if = "is_zero", default)]
    pub register_base: u16,
    /// WGSL: the group of every binding.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub wgsl_group: u8,
    /// MSL: the first slot of buffers, of textures and of samplers.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub msl_slot_base: u8,
    /// GLSL and GLSL ES 3.10: what is added to every binding.
    #[serde(skip_serializing_if = "is_zero", default)]
    pub glsl_binding_base: u8,
    /// Places of single bindings, by kernel and parameter.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub bindings: BTreeMap<String, BTreeMap<String, Places>>,
    /// Where those were read; it is for messages alone.
    #[serde(skip)]
    origin: Origin,
}

/// Places of one binding. What is not said is as the options for whole languages have it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Places {
    /// In HLSL.
    #[serde(
        skip_serializing_if = "Option::is_none",
        default,
        deserialize_with = "fields::optional"
    )]
    pub hlsl: Option<HlslPlace>,
    /// In WGSL.
    #[serde(
        skip_serializing_if = "Option::is_none",
        default,
        deserialize_with = "fields::optional"
    )]
    pub wgsl: Option<WgslPlace>,
    /// In MSL.
    #[serde(
        skip_serializing_if = "Option::is_none",
        default,
        deserialize_with = "fields::optional"
    )]
    pub msl: Option<MslPlace>,
    /// In GLSL 4.50.
    #[serde(
        skip_serializing_if = "Option::is_none",
        default,
        deserialize_with = "fields::optional"
    )]
    pub glsl: Option<GlslPlace>,
    /// In GLSL ES 3.10.
    #[serde(
        skip_serializing_if = "Option::is_none",
        default,
        deserialize_with = "fields::optional"
    )]
    pub essl310: Option<GlslPlace>,
}

/// A place in HLSL.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HlslPlace {
    /// The register's number; its class follows from the binding's kind.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub register: Option<u16>,
    /// The register space.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub space: Option<u8>,
}

/// A place in WGSL.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct WgslPlace {
    /// `@group`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub group: Option<u8>,
    /// `@binding`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub binding: Option<u16>,
}

/// A place in MSL.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MslPlace {
    /// The slot among the buffers, textures or samplers.
    pub slot: u8,
}

/// A place in GLSL.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GlslPlace {
    /// `layout(binding = …)`.
    pub binding: u8,
}

/// The file that places were read from, and the lines of the tables in it, from 1.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Origin {
    file: Option<PathBuf>,
    lines: BTreeMap<String, BTreeMap<String, usize>>,
}

fn is_zero<T: Default + PartialEq>(number: &T) -> bool {
    *number == T::default()
}

impl Placement {
    /// Takes the places of single bindings from a file.
    ///
    /// # Errors
    ///
    /// It cannot be read, or is no such file: the message names the line. Whether there are such
    /// kernels and parameters is asked of [`Self::check`].
    pub fn read(&mut self, file: &Path) -> Result<()> {
        let fail = |problem: String| Error::Bindings {
            place: file.display().to_string(),
            problem,
        };
        let text = input::read_text(file, MAX_BYTES).map_err(|error| fail(error.problem()))?;
        type Tables = BTreeMap<Spanned<String>, BTreeMap<Spanned<String>, Table<Places>>>;
        let tables: Tables =
            toml::from_str(&text).map_err(|error| fail(error.to_string().trim().to_owned()))?;
        let line = |span: Range<usize>| 1 + text[..span.start].matches('\n').count();
        self.bindings.clear();
        self.origin = Origin {
            file: Some(file.to_owned()),
            lines: BTreeMap::new(),
        };
        for (kernel, params) in tables {
            let lines = params
                .keys()
                .map(|param| (param.get_ref().clone(), line(param.span())))
                .collect();
            let places = params
                .into_iter()
                .map(|(param, Table(places))| (param.into_inner(), places))
                .collect();
            self.origin.lines.insert(kernel.get_ref().clone(), lines);
            self.bindings.insert(kernel.into_inner(), places);
        }
        Ok(())
    }

    /// The same, as a manifest has it: without the file's path.
    #[must_use]
    pub fn without_origin(&self) -> Self {
        Self {
            origin: Origin::default(),
            ..self.clone()
        }
    }

    /// Whether everything is where it is by default.
    #[must_use]
    pub fn is_default(&self) -> bool {
        self.without_origin() == Self::default()
    }

    /// Whether every binding that has a place of its own is one of `kernels`', and of a kind that can
    /// have it.
    ///
    /// # Errors
    ///
    /// An unknown kernel or parameter, or a sampler's place in GLSL.
    pub fn check(&self, kernels: &[Kernel]) -> Result<()> {
        for (name, params) in &self.bindings {
            let known = || kernels.iter().map(|kernel| kernel.name.as_str());
            let Some(kernel) = kernels.iter().find(|kernel| kernel.name == *name) else {
                let first = params.keys().next().map_or("", String::as_str);
                return Err(Error::Bindings {
                    place: self.place(name, first),
                    problem: format!("no kernel is named `{name}`; there are: {}", list(known())),
                });
            };
            let bindings = bindings(kernel);
            for (param, places) in params {
                let fail = |problem: String| Error::Bindings {
                    place: self.place(name, param),
                    problem: format!("kernel `{name}` {problem}"),
                };
                let Some(binding) = bindings.iter().find(|binding| binding.name == *param) else {
                    return Err(fail(format!(
                        "has no bound parameter `{param}`; it has: {}",
                        list(bindings.iter().map(|binding| binding.name.as_str()))
                    )));
                };
                let is_sampler = matches!(
                    binding.kind,
                    BindingKind::Sampler
                        | BindingKind::NonFilteringSampler
                        | BindingKind::ComparisonSampler
                );
                if is_sampler && (places.glsl.is_some() || places.essl310.is_some()) {
                    return Err(fail(format!(
                        "reads through the sampler `{param}`, which has no binding of its own in GLSL: \
                         its textures have theirs"
                    )));
                }
            }
        }
        Ok(())
    }

    /// What the file says of a kernel, for a copy of it with another name; nothing of other kernels.
    pub(crate) fn of_copy(&self, kernel: &str, copy: &str) -> Self {
        let only = |places: Option<BTreeMap<String, Places>>| {
            places.map(|it| (copy.to_owned(), it)).into_iter().collect()
        };
        let lines = self.origin.lines.get(kernel).cloned();
        Self {
            bindings: only(self.bindings.get(kernel).cloned()),
            origin: Origin {
                file: self.origin.file.clone(),
                lines: lines.map(|it| (copy.to_owned(), it)).into_iter().collect(),
            },
            ..*self
        }
    }

    /// Group and binding in WGSL of each binding, by its number in SPIR-V; also of those that the
    /// kernel's code does not use, since a bind group has them.
    ///
    /// # Errors
    ///
    /// Two have the same place.
    pub(crate) fn in_wgsl(&self, kernel: &Kernel) -> Result<BTreeMap<u32, (u32, u32)>, Failure> {
        let mut slots = Slots::new(self, kernel, Language::Wgsl);
        let mut all = BTreeMap::new();
        for binding in bindings(kernel) {
            let moved = slots.places(binding.binding).and_then(|it| it.wgsl);
            let group = moved.and_then(|it| it.group).unwrap_or(self.wgsl_group);
            let number = moved.and_then(|it| it.binding);
            let place = (u32::from(group), number.map_or(binding.binding, u32::from));
            slots.take(binding.binding, "binding", place.0, place.1, u32::MAX)?;
            all.insert(binding.binding, place);
        }
        Ok(all)
    }

    /// `FILE:LINE` of a binding's table.
    fn place(&self, kernel: &str, param: &str) -> String {
        let file = self.origin.file.as_deref();
        let file = file.map_or("the bindings".into(), |file| file.display().to_string());
        match self.line(kernel, param) {
            Some(line) => format!("{file}:{line}"),
            None => file,
        }
    }

    fn line(&self, kernel: &str, param: &str) -> Option<usize> {
        self.origin.lines.get(kernel)?.get(param).copied()
    }
}

/// What is bound, as the manifest names it.
fn bindings(kernel: &Kernel) -> Vec<Binding> {
    manifest::bindings(kernel, &Layouts::default())
}

fn list<'a>(names: impl Iterator<Item = &'a str>) -> String {
    match names.collect::<Vec<_>>().join(", ") {
        none if none.is_empty() => "none".into(),
        names => names,
    }
}

/// The places of one kernel's bindings in one language as they are given out: none twice.
pub(crate) struct Slots<'a> {
    placement: &'a Placement,
    kernel: &'a Kernel,
    language: Language,
    /// Parameters' names by binding.
    names: BTreeMap<u32, String>,
    /// Bindings by class, space and number.
    taken: BTreeMap<(&'static str, u32, u32), u32>,
}

impl<'a> Slots<'a> {
    pub(crate) fn new(placement: &'a Placement, kernel: &'a Kernel, language: Language) -> Self {
        let names = bindings(kernel).into_iter();
        Self {
            placement,
            kernel,
            language,
            names: names.map(|it| (it.binding, it.name)).collect(),
            taken: BTreeMap::new(),
        }
    }

    /// What the file says of a binding.
    pub(crate) fn places(&self, binding: u32) -> Option<&'a Places> {
        let of_kernel = self.placement.bindings.get(&self.kernel.name)?;
        of_kernel.get(self.names.get(&binding)?)
    }

    /// Gives a place to a binding; `most` is the language's highest number.
    ///
    /// # Errors
    ///
    /// Another binding has it, or the language does not.
    pub(crate) fn take(
        &mut self,
        binding: u32,
        class: &'static str,
        space: u32,
        number: u32,
        most: u32,
    ) -> Result<(), Failure> {
        let place = place(self.language, class, space, number);
        if number > most {
            let param = self.name(binding);
            let message = format!(
                "`{param}` would be at {place} in {}, which has no number above {most}",
                self.language
            );
            return Err(self.failure(&[binding], message));
        }
        let Some(other) = self.taken.insert((class, space, number), binding) else {
            return Ok(());
        };
        let named = |binding: u32| {
            let param = self.name(binding);
            match self.placement.line(&self.kernel.name, param) {
                Some(line) => format!("`{param}` (line {line})"),
                None => format!("`{param}`"),
            }
        };
        let message = format!(
            "{} and {} are both at {place} in {}",
            named(other),
            named(binding),
            self.language
        );
        Err(self.failure(&[binding, other], message))
    }

    /// An error about bindings; it names the file's line of the first of them that is there.
    fn failure(&self, bindings: &[u32], message: String) -> Failure {
        let kernel = &self.kernel.name;
        let in_file = bindings
            .iter()
            .map(|binding| self.name(*binding))
            .find(|param| self.placement.line(kernel, param).is_some());
        Failure {
            kernel: kernel.clone(),
            step: Step::Place,
            construct: in_file.map(|param| self.placement.place(kernel, param)),
            message,
            panicked: false,
        }
    }

    fn name(&self, binding: u32) -> &str {
        self.names.get(&binding).map_or("?", String::as_str)
    }
}

/// A place in words.
fn place(language: Language, class: &str, space: u32, number: u32) -> String {
    match language {
        Language::Hlsl => format!("register {class}{number} of space {space}"),
        Language::Wgsl | Language::Spirv => format!("binding {number} of group {space}"),
        Language::Msl => format!("{class} slot {number}"),
        Language::Glsl | Language::Essl310 | Language::Essl300 => {
            format!("{class} binding {number}")
        }
    }
}
