//! From final SPIR-V to text, by way of naga.
//!
//! Decisions:
//!
//! - One module has one entry point, so slots are counted for each kernel by itself: HLSL
//!   registers for each class (t, u, b, s) and MSL slots for each kind from 0 in the order of the
//!   bindings, all in `space0`; GLSL 4.50 keeps SPIR-V's binding numbers; GLSL ES counts for each
//!   kind, because devices have few; WGSL keeps group and binding. [`Placement`] moves them.
//! - The kernel's own guard is the only bounds check unless the options ask for more. WGSL's and
//!   SPIR-V's implementations have checks of their own.
//! - Specialisation constants stay overridable in SPIR-V and WGSL. naga's other writers cannot
//!   express them: by default the texts get the value, before optimisation; if the options ask for it,
//!   GLSL and HLSL take it from a macro and MSL from a function constant.
//! - Arithmetic of an exact kernel is neither contracted nor reordered. naga knows nothing of that:
//!   in GLSL and HLSL each result gets a `precise` variable, MSL a pragma, and WGSL cannot say it.
//!   A pinned kernel gets `precise` on fewer (it reaches what a value is computed from) where that costs no
//!   device, and is written all the same elsewhere.
//! - What a language cannot express is [`Written::Unsupported`], with the reason; what goes wrong is an
//!   error.

mod cleanup;
mod extent;
mod glsl;
mod hlsl;
mod msl;
mod open;
pub(crate) mod reading;
pub(crate) mod text;
mod wgsl;

pub(crate) use cleanup::{each_statement, each_within};
pub(crate) use wgsl::ENABLE_SUBGROUPS;

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::str::FromStr;

use hankel_dsl::native::describe::{BuiltIn, ConstantValue, Kernel, Output, Role, Rounding, Stage};
use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{
    AddressSpace, Expression, ImageClass, ImageDimension, Literal, Module, Scalar, ScalarKind,
    StorageAccess, StorageFormat, TypeInner,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::comment;
use crate::error::{Failure, Step, guarded};
use crate::lint::Finding;
use crate::placement::Placement;
use crate::spirv::behind::copy_behind_loops;
use crate::spirv::uniform::{self, Group, Memory};
use crate::{Error, Language, VERSION, spirv};
use reading::Dropped;

/// What a final module has that naga does not read, though the texts that are made of it say it: for those who give
/// SPIR-V to naga, as wgpu does.
pub fn refused_by_naga(spirv: &[u8]) -> Option<&'static str> {
    let module = spirv::load(&spirv::words(spirv, "").ok()?, "").ok()?;
    reading::refused(&module)
}

/// What to do about an index that is out of range, beyond the kernel's own guard.
///
/// As far as naga's writers go: MSL checks everything; GLSL checks reads of textures; HLSL
/// restricts indices into arrays and vectors (Direct3D itself checks buffers). SPIR-V and WGSL are
/// the same under every choice: their implementations check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BoundsChecks {
    /// Nothing: the kernel's guard is enough.
    #[default]
    Unchecked,
    /// Use the last valid index.
    Restrict,
    /// Read zero, skip the write. HLSL has no such writer: it restricts.
    ReadZeroWrite,
}

impl FromStr for BoundsChecks {
    type Err = Error;

    fn from_str(value: &str) -> Result<Self, Error> {
        Ok(match value {
            "unchecked" => Self::Unchecked,
            "restrict" => Self::Restrict,
            "readzwrite" | "readzerowrite" => Self::ReadZeroWrite,
            _ => {
                return Err(Error::Option {
                    option: "bounds checks",
                    value: value.into(),
                    expected: "unchecked, restrict or readzwrite",
                });
            }
        })
    }
}

/// HLSL's shader model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShaderModel(naga::back::hlsl::ShaderModel);

impl Default for ShaderModel {
    fn default() -> Self {
        Self(naga::back::hlsl::ShaderModel::V6_0)
    }
}

const SHADER_MODELS: [(&str, naga::back::hlsl::ShaderModel); 11] = {
    use naga::back::hlsl::ShaderModel::*;
    [
        ("5.1", V5_1),
        ("6.0", V6_0),
        ("6.1", V6_1),
        ("6.2", V6_2),
        ("6.3", V6_3),
        ("6.4", V6_4),
        ("6.5", V6_5),
        ("6.6", V6_6),
        ("6.7", V6_7),
        ("6.8", V6_8),
        ("6.9", V6_9),
    ]
};

impl FromStr for ShaderModel {
    type Err = Error;

    fn from_str(value: &str) -> Result<Self, Error> {
        let wanted = value.replace('_', ".");
        SHADER_MODELS
            .iter()
            .find(|(name, _)| *name == wanted)
            .map(|(_, model)| Self(*model))
            .ok_or(Error::Option {
                option: "shader model",
                value: value.into(),
                expected: "5.1, or 6.0 to 6.9",
            })
    }
}

impl fmt::Display for ShaderModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known = SHADER_MODELS.iter().find(|(_, model)| *model == self.0);
        f.write_str(known.map_or("5.1", |(name, _)| name))
    }
}

/// Metal's language version.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct MslVersion {
    /// Before the dot.
    pub major: u8,
    /// After it.
    pub minor: u8,
}

impl Default for MslVersion {
    fn default() -> Self {
        Self { major: 2, minor: 4 }
    }
}

impl FromStr for MslVersion {
    type Err = Error;

    fn from_str(value: &str) -> Result<Self, Error> {
        let bad = || Error::Option {
            option: "MSL version",
            value: value.into(),
            expected: "1.0 to 1.2, 2.0 to 2.4, 3.0 to 3.2, or 4.0",
        };
        let (major, minor) = value.split_once('.').ok_or_else(bad)?;
        let version = Self {
            major: major.parse().map_err(|_| bad())?,
            minor: minor.parse().map_err(|_| bad())?,
        };
        match (version.major, version.minor) {
            (1 | 3, 0..=2) | (2, 0..=4) | (4, 0) => Ok(version),
            _ => Err(bad()),
        }
    }
}

impl fmt::Display for MslVersion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}

/// Choices for what is written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Options {
    /// Bounds checks in HLSL, MSL and GLSL.
    pub bounds_checks: BoundsChecks,
    /// HLSL's shader model.
    pub shader_model: ShaderModel,
    /// Metal's version.
    pub msl_version: MslVersion,
    /// Specialisation constants that get a fixed value, by name, in every language.
    pub constants: BTreeMap<String, ConstantValue>,
    /// Whether the others stay open in HLSL, GLSL (by a macro) and MSL (as function constants), too.
    pub open_constants: bool,
    /// Kernels that are written once more with constants fixed: by the end of the copy's name, the
    /// constants' values. A kernel has the variants all of whose constants it has.
    pub variants: BTreeMap<String, BTreeMap<String, ConstantValue>>,
    /// Where bindings are.
    pub placement: Placement,
}

impl Options {
    fn policies(&self) -> BoundsCheckPolicies {
        let policy = match self.bounds_checks {
            BoundsChecks::Unchecked => BoundsCheckPolicy::Unchecked,
            BoundsChecks::Restrict => BoundsCheckPolicy::Restrict,
            BoundsChecks::ReadZeroWrite => BoundsCheckPolicy::ReadZeroSkipWrite,
        };
        BoundsCheckPolicies {
            index: policy,
            buffer: policy,
            image_load: policy,
            binding_array: policy,
        }
    }
}

/// Where a binding is in a language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Place {
    /// The variable's name in the text.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub name: Option<String>,
    /// What numbers it: `binding` (WGSL), `t`, `u`, `b`, `s` (HLSL register), `buffer`, `texture`,
    /// `sampler` (MSL, GLSL), `uniform`, `image` (GLSL).
    pub class: String,
    /// The number; none where the language has none in the text (GLSL ES 3.00).
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub index: Option<u32>,
    /// WGSL's group, HLSL's space.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub space: Option<u32>,
    /// GLSL: name of the block around a buffer.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub block: Option<String>,
    /// GLSL: bindings of the textures that this sampler has become one with.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub combined_with: Vec<u32>,
}

/// A kernel in a language.
#[derive(Clone, Debug, PartialEq)]
pub struct Text {
    /// The text.
    pub source: String,
    /// The entry point's name in it.
    pub entry_point: String,
    /// Where each binding is, by its number in set 0. What the kernel does not use is not there.
    pub places: BTreeMap<u32, Place>,
    /// MSL: slot of the buffer that holds the sizes of the others in bytes, one `u32` for each
    /// that [`Self::sized`] lists.
    pub sizes_slot: Option<u32>,
    /// MSL: bindings whose sizes that buffer holds, in order.
    pub sized: Vec<u32>,
    /// Extensions or device features beyond the language's core that the text needs.
    pub requires: Vec<String>,
}

/// What came of a language.
#[derive(Clone, Debug, PartialEq)]
pub enum Written {
    /// The text.
    Text(Text),
    /// The language cannot express the kernel.
    Unsupported(String),
    /// The text is right, but implementations refuse it while it has constants to be set: it must be
    /// written with their values.
    Unsettable,
}

/// A kernel in naga's representation, cleaned up and validated.
#[derive(Clone, Debug)]
pub struct Ir {
    module: Module,
    info: ModuleInfo,
    kernel: String,
    /// The clean-up applied in full.
    clean: bool,
    /// What it was read from.
    spirv: rspirv::dr::Module,
    /// What of that naga's reader does not take over.
    dropped: Dropped,
}

impl Ir {
    /// Reads a final module.
    ///
    /// # Errors
    ///
    /// naga cannot read it, or its validator rejects it.
    pub fn read(spirv: &[u8], kernel: &Kernel) -> Result<Self, Failure> {
        let name = kernel.name.as_str();
        let module = spirv::load(&spirv::words(spirv, name)?, name)?;
        Self::of(module, kernel)
    }

    fn of(spirv: rspirv::dr::Module, kernel: &Kernel) -> Result<Self, Failure> {
        let name = kernel.name.as_str();
        let dropped = Dropped::of(&spirv);
        let mut given = reading::with_number_masks(&spirv).unwrap_or_else(|| spirv.clone());
        copy_behind_loops(&mut given);
        let bytes = spirv::bytes(&spirv::store(&given));
        let read = || {
            let mut module = parse(&bytes, name)?;
            cleanup::restore_sampling(&mut module, &dropped.sampling);
            cleanup::restore_layers(&mut module);
            cleanup::restore_depths(&mut module);
            Ok(module)
        };
        let mut module = guarded(read, name, Step::Parse)?;
        let check = || {
            let info = validate(&module, name)?;
            extent::split_expressions(&mut module, &info);
            match extent::check(&module, &info) {
                Ok(()) => Ok(info),
                Err(message) => Err(Failure {
                    kernel: name.into(),
                    step: Step::Check,
                    construct: None,
                    message,
                    panicked: false,
                }),
            }
        };
        let info = guarded(check, name, Step::Check)?;
        let raw = Self {
            module,
            info,
            kernel: name.into(),
            clean: false,
            spirv,
            dropped,
        };
        // Where the clean-up does not apply, what naga read is still right.
        let mut ir = match raw.cleaned(kernel) {
            Some((module, info, clean)) => Self {
                module,
                info,
                clean,
                ..raw
            },
            None => raw,
        };
        if kernel.rounding == Rounding::Exact {
            cleanup::name_roundings(&mut ir.module, &ir.info);
        }
        Ok(ir)
    }

    /// The same, read from what a language needs, where it needs something.
    fn in_words_of(&self, language: Language, kernel: &Kernel) -> Result<Cow<'_, Self>, Failure> {
        let mut spirv = self.spirv.clone();
        let mut ir = if reading::for_language(&mut spirv, language) {
            Cow::Owned(Self::of(spirv, kernel)?)
        } else {
            Cow::Borrowed(self)
        };
        if language != Language::Wgsl
            && let Some(binding) = pushed(kernel)
        {
            let ir = ir.to_mut();
            if push_constants_to_uniform(&mut ir.module, binding) {
                ir.info = validate(&ir.module, &ir.kernel)?;
            }
        }
        if language == Language::Hlsl {
            let mut module = ir.module.clone();
            if cleanup::convert_wide_signs(&mut module, &ir.info) {
                let ir = ir.to_mut();
                ir.info = validate(&module, &ir.kernel)?;
                ir.module = module;
            }
        }
        if matches!(language, Language::Essl310 | Language::Essl300)
            && cleanup::has_bit_counts(&ir.module)
        {
            cleanup::name_bit_counts(&mut ir.to_mut().module);
        }
        let pinned = kernel.rounding == Rounding::Pinned
            && matches!(
                language,
                Language::Hlsl | Language::Glsl | Language::Essl310
            );
        if pinned {
            let ir = ir.to_mut();
            cleanup::name_results(&mut ir.module, &ir.info);
        }
        Ok(ir)
    }

    /// Whether the text will read as by hand: no private globals, no inner function, no blocks
    /// around buffers. Shapes that Hankel's DSL does not make may stay as naga reads them.
    pub fn is_clean(&self) -> bool {
        self.clean
    }

    /// What makes it slow in every language ([`crate::lint`]).
    pub fn findings(&self) -> Vec<Finding> {
        crate::lint::of_module(&self.module, None)
    }

    /// The module cleaned up, and whether its entry point is one function.
    fn cleaned(&self, kernel: &Kernel) -> Option<(Module, ModuleInfo, bool)> {
        let name = kernel.name.as_str();
        let step = || -> Result<_, Failure> {
            let mut module = self.module.clone();
            cleanup::constant_indices(&mut module);
            let folded = cleanup::fold_entry_point(&mut module);
            cleanup::unwrap_blocks(&mut module);
            cleanup::matrix_types(&mut module);
            cleanup::plain_loops(&mut module);
            cleanup::turn_empty_ifs(&mut module);
            cleanup::drop_last_return(&mut module);
            let members: Vec<String> = (0..kernel.outputs.len())
                .map(|index| spirv::names::output_name(kernel, index))
                .collect();
            let result = format!("{}Output", spirv::names::camel_case(name));
            cleanup::name_result(&mut module, &result, &members);
            validate(&module, name)?;
            naga::compact::compact(&mut module, naga::compact::KeepUnused::No);
            cleanup::drop_dead_locals(&mut module);
            cleanup::drop_copies(&mut module);
            validate(&module, name)?;
            naga::compact::compact(&mut module, naga::compact::KeepUnused::No);
            cleanup::drop_unused_locals(&mut module);
            let info = validate(&module, name)?;
            cleanup::name_loads(&mut module, &info);
            cleanup::name_phis(&mut module);
            cleanup::name_values(&mut module, &info);
            let info = validate(&module, name)?;
            Ok((module, info, folded))
        };
        guarded(step, name, Step::Check).ok()
    }

    /// Writes `language`. SPIR-V is what it was read from and not written again.
    ///
    /// # Errors
    ///
    /// The writer fails, or WGSL cannot be read back.
    pub fn write(
        &self,
        language: Language,
        kernel: &Kernel,
        options: &Options,
    ) -> Result<Written, Failure> {
        if let Some(reason) = self.unsupported(language, kernel, options) {
            return Ok(Written::Unsupported(reason));
        }
        let step = Step::Write(language);
        let ir = guarded(|| self.in_words_of(language, kernel), &self.kernel, step)?;
        let job = Job {
            ir: &ir,
            kernel,
            options,
            language,
        };
        let mut written = guarded(
            || match language {
                Language::Spirv => Ok(Written::Unsupported("SPIR-V is not written again".into())),
                Language::Wgsl => wgsl::write(&job),
                Language::Hlsl => hlsl::write(&job),
                Language::Msl => msl::write(&job),
                Language::Glsl | Language::Essl310 | Language::Essl300 => glsl::write(&job),
            },
            &self.kernel,
            step,
        )?;
        if let Written::Text(text) = &mut written {
            job.restore_digits(text);
            text.source = head(language, kernel, &text.source);
        }
        Ok(written)
    }

    /// Why a language cannot express the kernel, where that can be told without trying.
    fn unsupported(
        &self,
        language: Language,
        kernel: &Kernel,
        options: &Options,
    ) -> Option<String> {
        if let Some(reason) = &self.dropped.reason {
            return Some(reason.clone());
        }
        if kernel.rounding == Rounding::Exact
            && let Some(reason) = inexact(language, options)
        {
            return Some(reason);
        }
        if let Some(reason) = self.float_atomics(language, options) {
            return Some(reason);
        }
        if language == Language::Hlsl && self.has_signed_extremes() {
            return Some(
                "compilers of HLSL compare signed numbers in a byte address buffer as unsigned ones: \
                 take the smallest or largest of `x ^ 0x8000_0000` as u32"
                    .into(),
            );
        }
        let es = matches!(language, Language::Essl310 | Language::Essl300);
        let takes = |built_in| {
            let role = Role::BuiltIn { built_in };
            kernel.params.iter().any(|p| p.role == role)
        };
        if es && takes(BuiltIn::SampleIndex) {
            return Some(format!(
                "{language} does not know the sample: it came with 3.20"
            ));
        }
        if es && (takes(BuiltIn::SampleMask) || kernel.outputs.contains(&Output::SampleMask)) {
            return Some(format!(
                "{language} has no masks of samples: they came with 3.20"
            ));
        }
        if language == Language::Essl300 && takes(BuiltIn::PrimitiveIndex) {
            return Some(format!("{language} does not know the primitive's number"));
        }
        if (es || language == Language::Msl) && self.has_grained_derivatives() {
            return Some(format!(
                "{language} has no coarse and no fine derivatives: use `dpdx`, `dpdy`, `fwidth`"
            ));
        }
        let glsl = es || language == Language::Glsl;
        if glsl && self.reads_and_compares_depths() {
            return Some(format!(
                "a depth texture of {language} is compared, or read as it is: bind what is read once more, as a \
                 `Texture2d`"
            ));
        }
        if glsl && self.gathers_compared_layers() {
            return Some(format!(
                "naga's {language} writer gives a gather of comparisons in an array of textures or a \
                 cube gradients, which it does not take"
            ));
        }
        if !kernel.subgroups.is_unused()
            && let Some(reason) = without_subgroups(language, options)
        {
            return Some(reason);
        }
        let old = options.shader_model.0 < naga::back::hlsl::ShaderModel::V6_2;
        let wide = [ScalarKind::Float, ScalarKind::Uint, ScalarKind::Sint];
        let wide = wide.iter().any(|kind| self.has_wide(*kind));
        if language == Language::Hlsl && old && wide && self.stores_wide() {
            return Some(format!(
                "HLSL loads 64-bit numbers from buffers from shader model 6.2 on, not in {}",
                options.shader_model
            ));
        }
        if self.has_wide(ScalarKind::Float)
            && (es || matches!(language, Language::Wgsl | Language::Msl))
        {
            return Some(format!("{language} has no 64-bit floating-point numbers"));
        }
        if language != Language::Wgsl && cleanup::has_late_loops(&self.module) {
            return Some(format!(
                "naga's {language} writer would re-evaluate a loop's condition at its end; \
                 write the loop with one test at its beginning"
            ));
        }
        if language == Language::Wgsl && uniform::divides_at_barrier(&self.spirv, Memory::Doubted) {
            return Some(
                "WGSL lets an implementation refuse a barrier in a branch or a loop that depends on \
                 memory that others write"
                    .into(),
            );
        }
        if language == Language::Wgsl
            && uniform::divides_at_subgroup(&self.spirv, Memory::Doubted, Group::Workgroup)
        {
            return Some(
                "WGSL refuses an operation of a subgroup in a branch or a loop that may not be the same for the \
                 workgroup"
                    .into(),
            );
        }
        if language == Language::Wgsl
            && uniform::divides_at_neighbours(&self.spirv, Memory::Doubted)
        {
            return Some(
                "WGSL refuses derivatives, and textures at the level of the fragment, in a branch or a loop that may \
                 not be the same for all fragments, or behind an index or a division that may fail: do it before, mask \
                 the index, or use `sample_level` or `sample_gradient`"
                    .into(),
            );
        }
        let wide_integers = self.has_wide(ScalarKind::Uint) || self.has_wide(ScalarKind::Sint);
        if wide_integers && (es || language == Language::Wgsl) {
            return Some(format!("{language} has no 64-bit integers"));
        }
        if wide_integers && language == Language::Glsl {
            return Some("naga's GLSL writer has no 64-bit integers".into());
        }
        if language == Language::Essl300 {
            if matches!(kernel.stage, Stage::Compute { .. }) {
                return Some(format!("{language} has no compute shaders"));
            }
            if self.gathers() {
                return Some(format!(
                    "{language} does not gather texels: it came with 3.10"
                ));
            }
            if cleanup::has_functions_of_bits(&self.module) {
                return Some(format!(
                    "{language} has no `count_ones`, `leading_zeros`, `trailing_zeros`, `reverse_bits` and the like: \
                     they came with 3.10"
                ));
            }
            if self
                .globals()
                .any(|(global, _)| matches!(global.space, AddressSpace::Storage { .. }))
            {
                return Some(format!("{language} has no storage buffers"));
            }
        }
        for (_, inner) in self.globals() {
            let TypeInner::Image { dim, class, .. } = *inner else {
                continue;
            };
            match class {
                ImageClass::Storage { format, access }
                    if language == Language::Wgsl
                        && access.contains(StorageAccess::LOAD | StorageAccess::STORE)
                        && !is_read_and_written(format) =>
                {
                    return Some(format!(
                        "WGSL reads and writes textures of r32float, r32uint and r32sint, not of \
                         {format:?}: take a texture to read and one to write"
                    ));
                }
                ImageClass::Storage { .. } if language == Language::Essl300 => {
                    return Some(format!("{language} has no storage textures"));
                }
                ImageClass::Storage { format, .. }
                    if language == Language::Essl310 && !in_es(format) =>
                {
                    return Some(format!("{language} has no {format:?} storage textures"));
                }
                ImageClass::Storage { format, access }
                    if language == Language::Essl310
                        && access.contains(StorageAccess::LOAD | StorageAccess::STORE)
                        && !is_read_and_written(format) =>
                {
                    return Some(format!(
                        "{language} cannot both read and write {format:?} textures"
                    ));
                }
                ImageClass::Sampled { multi: true, .. } if language == Language::Essl300 => {
                    return Some(format!("{language} has no multisampled textures"));
                }
                ImageClass::Storage { .. } | ImageClass::Sampled { .. }
                    if es && dim == ImageDimension::D1 =>
                {
                    return Some(format!("{language} has no one-dimensional textures"));
                }
                _ => {}
            }
        }
        None
    }

    /// Why atomics of floats cannot be written, if there are any. naga's HLSL writer adds their bits
    /// as whole numbers (`tests/upstream/naga-hlsl-float-atomics`), and its GLSL writer leaves out the
    /// extension that they need.
    fn float_atomics(&self, language: Language, options: &Options) -> Option<String> {
        let lacks = match language {
            Language::Msl if options.msl_version < FLOAT_ATOMICS_MSL => format!(
                "MSL {} has no atomics of floats: they came with {FLOAT_ATOMICS_MSL}",
                options.msl_version
            ),
            Language::Msl | Language::Spirv => return None,
            Language::Glsl => "GLSL 4.50 has no atomics of floats".into(),
            _ => format!("{language} has no atomics of floats"),
        };
        let is_float = |ty: naga::Handle<naga::Type>| matches!(self.module.types[ty].inner, TypeInner::Atomic(scalar) if scalar.kind == ScalarKind::Float);
        let used = self.module.types.iter().any(|(handle, _)| is_float(handle));
        used.then(|| format!("{lacks}; add by compare and exchange on the bits"))
    }

    /// Whether there is an atomic minimum or maximum of signed numbers. naga's HLSL writer calls the
    /// methods of a byte address buffer, of which DXC 1.7 makes invalid SPIR-V and glslang an
    /// unsigned comparison.
    fn has_signed_extremes(&self) -> bool {
        let signed = self.module.types.iter().any(|(_, ty)| {
            matches!(ty.inner, TypeInner::Atomic(scalar) if scalar.kind == ScalarKind::Sint)
        });
        let functions = self.module.functions.iter().map(|(_, function)| function);
        let entries = self.module.entry_points.iter().map(|entry| &entry.function);
        signed
            && functions
                .chain(entries)
                .any(|function| has_extreme(&function.body))
    }

    /// Whether there are derivatives that must be coarse or fine.
    fn has_grained_derivatives(&self) -> bool {
        self.has(|expression| {
            matches!(expression, Expression::Derivative { ctrl, .. } if *ctrl != naga::DerivativeControl::None)
        })
    }

    /// Whether texels are gathered.
    fn gathers(&self) -> bool {
        self.has(|expression| {
            matches!(
                expression,
                Expression::ImageSample {
                    gather: Some(_),
                    ..
                }
            )
        })
    }

    /// Whether comparisons with the texels of a layer or of a cube are gathered.
    fn gathers_compared_layers(&self) -> bool {
        let globals = &self.module.global_variables;
        let entries = self.module.entry_points.iter().map(|it| &it.function);
        let mut all = entries.chain(self.module.functions.iter().map(|(_, it)| it));
        all.any(|function| {
            let is_layered = |image| {
                let ty = match function.expressions[image] {
                    Expression::GlobalVariable(variable) => globals[variable].ty,
                    Expression::FunctionArgument(number) => function.arguments[number as usize].ty,
                    _ => return true,
                };
                matches!(
                    self.module.types[ty].inner,
                    TypeInner::Image { arrayed: true, .. }
                        | TypeInner::Image {
                            dim: ImageDimension::Cube,
                            ..
                        }
                )
            };
            function
                .expressions
                .iter()
                .any(|(_, expression)| match expression {
                    Expression::ImageSample {
                        image,
                        gather: Some(_),
                        depth_ref: Some(_),
                        ..
                    } => is_layered(*image),
                    _ => false,
                })
        })
    }

    /// Whether some depths are compared and others read as they are.
    fn reads_and_compares_depths(&self) -> bool {
        let compared = |it: &Expression| {
            matches!(
                it,
                Expression::ImageSample {
                    depth_ref: Some(_),
                    ..
                }
            )
        };
        let functions = self.module.functions.iter().map(|(_, function)| function);
        let mut all = functions.chain(self.module.entry_points.iter().map(|it| &it.function));
        let read = all.any(|function| {
            function.expressions.iter().any(|(_, it)| {
                let (Expression::ImageLoad { image, .. }
                | Expression::ImageSample {
                    image,
                    depth_ref: None,
                    ..
                }) = *it
                else {
                    return false;
                };
                let Expression::GlobalVariable(image) = function.expressions[image] else {
                    return false;
                };
                let ty = self.module.global_variables[image].ty;
                matches!(
                    self.module.types[ty].inner,
                    TypeInner::Image {
                        class: ImageClass::Depth { .. },
                        ..
                    }
                )
            })
        });
        read && self.has(compared)
    }

    /// Whether any expression of any function is like that.
    fn has(&self, like: impl Fn(&Expression) -> bool) -> bool {
        let functions = self.module.functions.iter().map(|(_, function)| function);
        let entries = self.module.entry_points.iter().map(|entry| &entry.function);
        functions
            .chain(entries)
            .flat_map(|function| function.expressions.iter())
            .any(|(_, expression)| like(expression))
    }

    fn globals(&self) -> impl Iterator<Item = (&naga::GlobalVariable, &TypeInner)> {
        self.module
            .global_variables
            .iter()
            .map(|(_, global)| (global, &self.module.types[global.ty].inner))
    }

    /// Whether a buffer holds 64-bit numbers.
    fn stores_wide(&self) -> bool {
        fn holds(module: &Module, ty: naga::Handle<naga::Type>) -> bool {
            match &module.types[ty].inner {
                TypeInner::Scalar(scalar) | TypeInner::Vector { scalar, .. } => scalar.width == 8,
                TypeInner::Array { base, .. } => holds(module, *base),
                TypeInner::Struct { members, .. } => {
                    members.iter().any(|member| holds(module, member.ty))
                }
                _ => false,
            }
        }
        let globals = self.module.global_variables.iter();
        globals
            .map(|(_, global)| global)
            .filter(|global| matches!(global.space, AddressSpace::Storage { .. }))
            .any(|global| holds(&self.module, global.ty))
    }

    /// Whether any type, literal or conversion is of a 64-bit scalar.
    fn has_wide(&self, kind: ScalarKind) -> bool {
        let is = |scalar: Scalar| scalar.kind == kind && scalar.width == 8;
        let literal = |expression: &Expression| match *expression {
            Expression::Literal(Literal::F64(_)) => kind == ScalarKind::Float,
            Expression::Literal(Literal::I64(_)) => kind == ScalarKind::Sint,
            Expression::Literal(Literal::U64(_)) => kind == ScalarKind::Uint,
            Expression::As {
                kind: to,
                convert: Some(8),
                ..
            } => to == kind,
            _ => false,
        };
        let functions = self.module.functions.iter().map(|(_, function)| function);
        let mut functions =
            functions.chain(self.module.entry_points.iter().map(|entry| &entry.function));
        self.module.types.iter().any(|(_, ty)| match ty.inner {
            TypeInner::Scalar(scalar)
            | TypeInner::Vector { scalar, .. }
            | TypeInner::Matrix { scalar, .. }
            | TypeInner::ValuePointer { scalar, .. } => is(scalar),
            _ => false,
        }) || functions.any(|function| function.expressions.iter().any(|(_, it)| literal(it)))
    }
}

/// Whether a block has an atomic minimum or maximum, at any depth.
fn has_extreme(block: &naga::Block) -> bool {
    use naga::{AtomicFunction, Statement};
    block.iter().any(|statement| match statement {
        Statement::Atomic { fun, .. } => matches!(fun, AtomicFunction::Min | AtomicFunction::Max),
        Statement::Block(block) => has_extreme(block),
        Statement::If { accept, reject, .. } => has_extreme(accept) || has_extreme(reject),
        Statement::Switch { cases, .. } => cases.iter().any(|case| has_extreme(&case.body)),
        Statement::Loop {
            body, continuing, ..
        } => has_extreme(body) || has_extreme(continuing),
        _ => false,
    })
}

/// Why arithmetic may be done otherwise than it is written, where a text cannot forbid it.
fn inexact(language: Language, options: &Options) -> Option<String> {
    let lacks = match language {
        Language::Wgsl => "WGSL lets every implementation contract and reorder sums".into(),
        Language::Msl if options.msl_version < EXACT_MSL => format!(
            "MSL {} lets a compiler contract and reorder sums: `#pragma METAL fp` came with {EXACT_MSL}",
            options.msl_version
        ),
        Language::Essl300 => "GLSL ES 3.00 has no `precise`".into(),
        _ => return None,
    };
    Some(format!(
        "{lacks}; the kernel is right only if it is computed as it is written"
    ))
}

/// The binding that push constants have where a language has none.
fn pushed(kernel: &Kernel) -> Option<u32> {
    kernel.params.iter().find_map(|param| match param.role {
        Role::Uniform {
            binding,
            push: true,
            ..
        } => Some(binding),
        _ => None,
    })
}

/// Makes push constants a uniform buffer: HLSL, MSL and GLSL for OpenGL have one form for both. Tells
/// whether there are any.
fn push_constants_to_uniform(module: &mut Module, binding: u32) -> bool {
    let mut found = false;
    for (_, global) in module.global_variables.iter_mut() {
        if global.space == AddressSpace::Immediate {
            global.space = AddressSpace::Uniform;
            global.binding = Some(naga::ResourceBinding { group: 0, binding });
            found = true;
        }
    }
    found
}

/// Why a language has no operations of subgroups.
fn without_subgroups(language: Language, options: &Options) -> Option<String> {
    match language {
        Language::Essl310 | Language::Essl300 => Some(format!(
            "{language} has no operations of subgroups: exchange values through workgroup memory"
        )),
        Language::Hlsl if options.shader_model.0 < naga::back::hlsl::ShaderModel::V6_0 => {
            Some(format!(
                "HLSL has operations of waves from shader model 6.0 on, not in {}",
                options.shader_model
            ))
        }
        Language::Msl if options.msl_version < SUBGROUPS_MSL => Some(format!(
            "MSL {} has no sums over SIMD-groups on every device: they came with {SUBGROUPS_MSL}",
            options.msl_version
        )),
        _ => None,
    }
}

/// The first version of MSL with all operations of SIMD-groups on every device that has it.
const SUBGROUPS_MSL: MslVersion = MslVersion { major: 2, minor: 3 };

/// The first version of MSL that can forbid contraction and reordering.
const EXACT_MSL: MslVersion = MslVersion { major: 3, minor: 2 };

/// The first version of MSL with atomics of floats.
const FLOAT_ATOMICS_MSL: MslVersion = MslVersion { major: 3, minor: 0 };

/// Whether WGSL and GLSL ES let a kernel read and write one texture of this format.
fn is_read_and_written(format: StorageFormat) -> bool {
    matches!(
        format,
        StorageFormat::R32Float | StorageFormat::R32Uint | StorageFormat::R32Sint
    )
}

/// Formats of GLSL ES 3.10's images.
fn in_es(format: StorageFormat) -> bool {
    use StorageFormat::*;
    matches!(
        format,
        Rgba32Float
            | Rgba16Float
            | R32Float
            | Rgba8Unorm
            | Rgba8Snorm
            | Rgba32Sint
            | Rgba16Sint
            | Rgba8Sint
            | R32Sint
            | Rgba32Uint
            | Rgba16Uint
            | Rgba8Uint
            | R32Uint
    )
}

/// What a writer works on.
struct Job<'a> {
    ir: &'a Ir,
    kernel: &'a Kernel,
    options: &'a Options,
    language: Language,
}

/// The kinds of things that are bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Uniform,
    /// Storage buffer; written or only read.
    Buffer {
        written: bool,
    },
    Texture,
    /// Storage texture.
    Image,
    Sampler,
}

/// A global that is bound: its place in SPIR-V, what it is, its name in the kernel.
struct Bound {
    group: u32,
    binding: u32,
    kind: Kind,
    name: String,
    handle: naga::Handle<naga::GlobalVariable>,
    /// Ends in an array without a length.
    unsized_: bool,
}

impl Job<'_> {
    /// The bound globals in the order of their bindings.
    fn bound(&self) -> Vec<Bound> {
        let module = &self.ir.module;
        let mut bound: Vec<Bound> = module
            .global_variables
            .iter()
            .filter_map(|(handle, global)| {
                let place = global.binding?;
                let inner = &module.types[global.ty].inner;
                let kind = match (global.space, inner) {
                    (AddressSpace::Uniform, _) => Kind::Uniform,
                    (AddressSpace::Storage { access }, _) => Kind::Buffer {
                        written: access.contains(StorageAccess::STORE),
                    },
                    (_, TypeInner::Sampler { .. }) => Kind::Sampler,
                    (
                        _,
                        TypeInner::Image {
                            class: ImageClass::Storage { .. },
                            ..
                        },
                    ) => Kind::Image,
                    _ => Kind::Texture,
                };
                let name = global
                    .name
                    .clone()
                    .unwrap_or_else(|| format!("binding{}", place.binding));
                let unsized_ = inner.is_dynamically_sized(&module.types);
                Some(Bound {
                    group: place.group,
                    binding: place.binding,
                    kind,
                    name,
                    handle,
                    unsized_,
                })
            })
            .collect();
        bound.sort_by_key(|it| (it.group, it.binding));
        bound
    }

    /// naga puts an underscore after every name that ends in a digit (`b1_`): takes it away again
    /// where the name is free and no type's.
    fn restore_digits(&self, text: &mut Text) {
        let module = &self.ir.module;
        let functions = module.entry_points.iter().map(|entry| &entry.function);
        let mut names: Vec<&str> = Vec::new();
        for (_, ty) in module.types.iter() {
            names.extend(ty.name.as_deref());
            if let TypeInner::Struct { members, .. } = &ty.inner {
                names.extend(members.iter().filter_map(|member| member.name.as_deref()));
            }
        }
        names.extend(
            module
                .global_variables
                .iter()
                .filter_map(|(_, it)| it.name.as_deref()),
        );
        names.extend(
            module
                .overrides
                .iter()
                .filter_map(|(_, it)| it.name.as_deref()),
        );
        names.push(&self.kernel.name);
        for function in functions {
            names.extend(
                function
                    .arguments
                    .iter()
                    .filter_map(|it| it.name.as_deref()),
            );
            names.extend(
                function
                    .local_variables
                    .iter()
                    .filter_map(|(_, it)| it.name.as_deref()),
            );
            names.extend(function.named_expressions.values().map(String::as_str));
        }
        names.sort_unstable();
        names.dedup();
        let present = text::numbered_names(&text.source);
        let renamed: HashMap<String, &str> = names
            .into_iter()
            .filter(|name| name.ends_with(|letter: char| letter.is_ascii_digit()))
            .filter(|name| !looks_like_a_type(name) && !present.contains(name))
            .map(|name| (format!("{name}_"), name))
            .collect();
        if renamed.is_empty() {
            return;
        }
        text.source = text::without_underscores(&text.source, &renamed);
        if let Some(name) = renamed.get(&text.entry_point) {
            text.entry_point = (*name).to_owned();
        }
        for place in text.places.values_mut() {
            for slot in [&mut place.name, &mut place.block].into_iter().flatten() {
                if let Some(name) = renamed.get(slot) {
                    *slot = (*name).to_owned();
                }
            }
        }
    }

    /// Makes arithmetic exact in GLSL and HLSL, if the kernel asks for it: its results have variables
    /// ([`cleanup::name_roundings`], [`cleanup::name_results`]), which become `precise`.
    fn precise(&self, source: String, scalars: &[&str]) -> Result<String, Failure> {
        if self.kernel.rounding == Rounding::Free {
            return Ok(source);
        }
        let functions = self.ir.module.functions.iter().map(|(_, it)| it);
        let entries = self.ir.module.entry_points.iter().map(|it| &it.function);
        let wanted: usize = functions
            .chain(entries)
            .flat_map(|function| function.named_expressions.values())
            .filter(|name| *name == cleanup::ROUNDED)
            .count();
        let source = text::precise(&source, scalars);
        let declared = source
            .lines()
            .filter(|line| {
                let mut words = line.split_whitespace();
                words.next() == Some("precise")
                    && words
                        .nth(1)
                        .is_some_and(|name| name.starts_with(cleanup::ROUNDED))
            })
            .count();
        if declared >= wanted {
            return Ok(source);
        }
        Err(Failure {
            construct: Some("arithmetic that must be `precise`".into()),
            message: format!("{declared} of {wanted} results have a variable of their own"),
            ..self.failure(&fmt::Error)
        })
    }

    fn failure(&self, error: &dyn std::error::Error) -> Failure {
        Failure {
            kernel: self.kernel.name.clone(),
            step: Step::Write(self.language),
            construct: None,
            message: chain(error),
            panicked: false,
        }
    }
}

/// `float4`, `u32`, `vec3`, `mat2x2`, `texture2d`, `atan2`: some language's own, or near enough.
fn looks_like_a_type(name: &str) -> bool {
    const STEMS: [&str; 30] = [
        "f", "u", "i", "bf", "float", "double", "half", "int", "uint", "bool", "vec", "ivec",
        "uvec", "bvec", "dvec", "mat", "dmat", "long", "ulong", "short", "ushort", "char", "uchar",
        "min", "sampler", "texture", "image", "log", "exp", "atan",
    ];
    let stem = name.trim_end_matches(|letter: char| letter.is_ascii_digit());
    STEMS.contains(&stem)
        || name.contains(|letter: char| letter.is_ascii_digit()) && {
            let letters: String = name
                .chars()
                .filter(|letter| letter.is_ascii_alphabetic())
                .collect();
            [
                "matx", "floatx", "doublex", "halfx", "intx", "uintx", "minfloat", "minint",
                "minuint",
            ]
            .contains(&letters.as_str())
        }
}

/// An error and its causes in one line.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(inner) = cause {
        let more = inner.to_string();
        if !text.ends_with(&more) {
            text = format!("{}: {more}", text.trim_end_matches([':', ' ']));
        }
        cause = inner.source();
    }
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn parse(spirv: &[u8], name: &str) -> Result<Module, Failure> {
    let options = naga::front::spv::Options {
        adjust_coordinate_space: false,
        strict_capabilities: false,
        block_ctx_dump_prefix: None,
    };
    naga::front::spv::parse_u8_slice(spirv, &options).map_err(|error| Failure {
        kernel: name.into(),
        step: Step::Parse,
        construct: None,
        message: chain(&error),
        panicked: false,
    })
}

fn validate(module: &Module, name: &str) -> Result<ModuleInfo, Failure> {
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    validator
        .subgroup_stages(naga::valid::ShaderStages::all())
        .subgroup_operations(naga::valid::SubgroupOperationSet::all())
        .validate(module)
        .map_err(|error| Failure {
            kernel: name.into(),
            step: Step::Check,
            construct: error.spans().next().map(|(_, what)| what.clone()),
            message: chain(error.as_inner()),
            panicked: false,
        })
}

/// Puts the comment on top that says where a text comes from. GLSL's `#version` stays first:
/// WebGL insists.
fn head(language: Language, kernel: &Kernel, source: &str) -> String {
    // No line number: an edit above the kernel would change every text below it.
    let head = format!(
        "{}// Generated by hankel {VERSION} from `{}` in {}. Do not edit.\n// {}\n",
        comment::licence(&kernel.licence).map_or_else(String::new, |it| format!("// {it}\n")),
        kernel.function,
        file_name(&kernel.file),
        comment::line(&first_line(&kernel.summary)),
    );
    let source = format!("{}\n", source.trim_end());
    match (language, source.split_once('\n')) {
        (Language::Glsl | Language::Essl310 | Language::Essl300, Some((version, rest))) => {
            format!("{version}\n{head}{rest}")
        }
        _ => format!("{head}{source}"),
    }
}

fn first_line(summary: &str) -> String {
    let text = summary.split_whitespace().collect::<Vec<_>>().join(" ");
    if text.is_empty() {
        "No description.".into()
    } else {
        text
    }
}

/// The path within the crate: what the compiler saw may begin with folders of the machine.
pub(crate) fn file_name(file: &str) -> String {
    let file = file.replace('\\', "/");
    match file.rfind("/src/") {
        Some(place) => file[place + 1..].to_owned(),
        None => {
            file.trim_start_matches("./")
                .rsplit_once("/")
                .map_or(file.clone(), |(folder, name)| {
                    if folder == "src" || folder.starts_with("src/") {
                        format!("{folder}/{name}")
                    } else {
                        name.to_owned()
                    }
                })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_and_shown() {
        assert_eq!("6.5".parse::<ShaderModel>().unwrap().to_string(), "6.5");
        assert_eq!("5_1".parse::<ShaderModel>().unwrap().to_string(), "5.1");
        assert!("4.0".parse::<ShaderModel>().is_err());
        assert_eq!(
            "2.1".parse::<MslVersion>().unwrap(),
            MslVersion { major: 2, minor: 1 }
        );
        assert!("2.9".parse::<MslVersion>().is_err());
        assert!("two".parse::<MslVersion>().is_err());
        assert_eq!(
            "restrict".parse::<BoundsChecks>().unwrap(),
            BoundsChecks::Restrict
        );
        assert!("some".parse::<BoundsChecks>().is_err());
    }

    #[test]
    fn file_names_lose_the_machine() {
        assert_eq!(
            file_name("/elsewhere/hankel/kernels/shadows/src/shade.rs"),
            "src/shade.rs"
        );
        assert_eq!(file_name("kernels/shadows/src/a/b.rs"), "src/a/b.rs");
        assert_eq!(file_name("src/lib.rs"), "src/lib.rs");
        assert_eq!(file_name("C:\\x\\src\\lib.rs"), "src/lib.rs");
        assert_eq!(file_name("lib.rs"), "lib.rs");
    }
}
