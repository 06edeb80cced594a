//! What was generated: the file that engines and build tools read.
//!
//! JSON; the schema is `codegen/manifest.schema.json`, derived from the types below. Everything is
//! sorted, nothing names the machine or the time.

use std::collections::{BTreeMap, BTreeSet};

use hankel_dsl::native::describe::{
    self, ConstantValue, Kernel, Output, Role, SamplerKind, Scalar, Stage,
};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Serialize};

use crate::build::Request;
use crate::cost::Cost;
use crate::error;
use crate::headers::{Layouts, meaning};
use crate::lint::Finding;
use crate::placement::Placement;
use crate::spirv::names::output_name;
use crate::translate::{self, Options, Place};
use crate::{Language, VERSION};

/// Number of this format; raised when a reader of the old one would misunderstand.
pub const FORMAT: u32 = 1;

/// The manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(title = "Hankel manifest")]
pub struct Manifest {
    /// Number of this format.
    pub format: u32,
    /// What made the files.
    pub made_by: Versions,
    /// The kernel crate.
    pub crate_name: String,
    /// SHA-256 over everything that the files follow from: SPIR-V, descriptions, options, versions.
    pub inputs_sha256: String,
    /// The options that they were made with.
    pub options: WriteOptions,
    /// The kernels by the names of their entry points.
    pub kernels: BTreeMap<String, KernelEntry>,
    /// The structures of buffers, as the headers name them.
    pub layouts: BTreeMap<String, LayoutEntry>,
    /// Every file but this one, by its path from here.
    pub files: BTreeMap<String, FileEntry>,
}

/// Versions of what the files follow from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Versions {
    /// Hankel.
    pub hankel: String,
    /// rust-gpu, which made the SPIR-V.
    pub rust_gpu: String,
    /// The crate with SPIRV-Tools.
    pub spirv_tools: String,
    /// naga.
    pub naga: String,
}

impl Versions {
    /// This build's, with the version of rust-gpu that made the SPIR-V.
    pub fn with(rust_gpu: &str) -> Self {
        Self {
            hankel: VERSION.into(),
            rust_gpu: rust_gpu.into(),
            spirv_tools: env!("HANKEL_SPIRV_TOOLS_VERSION").into(),
            naga: env!("HANKEL_NAGA_VERSION").into(),
        }
    }
}

/// Options that the files were made with.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct WriteOptions {
    /// The choice of kernels: names of entry points or functions, `*` for any letters; none: all.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub kernels: Vec<String>,
    /// The choice of languages; none: all.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub targets: Vec<Language>,
    /// Bounds checks in HLSL, MSL and GLSL.
    pub bounds_checks: translate::BoundsChecks,
    /// HLSL's shader model.
    pub shader_model: String,
    /// Metal's version.
    pub msl_version: String,
    /// Specialisation constants that were given a value for good.
    #[schemars(schema_with = "constants_schema")]
    pub constants: BTreeMap<String, ConstantValue>,
    /// The others stay open in HLSL, GLSL and MSL, too.
    #[serde(skip_serializing_if = "core::ops::Not::not", default)]
    pub open_constants: bool,
    /// Kernels that were written once more with constants fixed: by the end of the copy's name, the
    /// constants' values.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    #[schemars(schema_with = "variants_schema")]
    pub variants: BTreeMap<String, BTreeMap<String, ConstantValue>>,
    /// Where bindings are, if not where they are by default.
    #[serde(skip_serializing_if = "Placement::is_default", default)]
    pub placement: Placement,
}

impl WriteOptions {
    /// Those of a request.
    pub fn of(request: &Request) -> Self {
        let options = &request.options;
        let sorted: (BTreeSet<_>, BTreeSet<_>) = (
            request.filter.iter().cloned().collect(),
            request.targets.iter().copied().collect(),
        );
        Self {
            kernels: sorted.0.into_iter().collect(),
            targets: sorted.1.into_iter().collect(),
            bounds_checks: options.bounds_checks,
            shader_model: options.shader_model.to_string(),
            msl_version: options.msl_version.to_string(),
            constants: options.constants.clone(),
            open_constants: options.open_constants,
            variants: options.variants.clone(),
            placement: options.placement.without_origin(),
        }
    }

    /// How the texts are to be written.
    ///
    /// # Errors
    ///
    /// A version is none that can be written.
    pub fn options(&self) -> error::Result<Options> {
        Ok(Options {
            bounds_checks: self.bounds_checks,
            shader_model: self.shader_model.parse()?,
            msl_version: self.msl_version.parse()?,
            constants: self.constants.clone(),
            open_constants: self.open_constants,
            variants: self.variants.clone(),
            placement: self.placement.clone(),
        })
    }
}

/// A file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FileEntry {
    /// SHA-256 in hexadecimal.
    pub sha256: String,
    /// Size in bytes.
    pub bytes: u64,
}

/// How many invocations of a compute kernel run. Those that the last workgroups have beyond it do
/// nothing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum RangeEntry {
    /// As many as a buffer has elements.
    Elements {
        /// The binding's name.
        name: String,
    },
    /// A fixed number along x, y, z.
    Fixed {
        /// It.
        size: [u32; 3],
    },
    /// What a uniform says: as many `u32` in a row as there are dimensions.
    Uniform {
        /// The binding's name.
        name: String,
        /// Where they begin, in bytes.
        offset: u32,
    },
}

fn range_entry(range: &describe::Range) -> Option<RangeEntry> {
    Some(match range {
        describe::Range::Outputs => return None,
        describe::Range::Elements { param } => RangeEntry::Elements {
            name: param.clone(),
        },
        describe::Range::Fixed { size } => RangeEntry::Fixed { size: *size },
        describe::Range::Uniform { param, offset } => RangeEntry::Uniform {
            name: param.clone(),
            offset: *offset,
        },
    })
}

/// An entry point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KernelEntry {
    /// The Rust function.
    pub function: String,
    /// Its file within the crate.
    pub file: String,
    /// The attribute's line, from 1.
    pub line: u32,
    /// The first paragraph of its documentation.
    pub summary: String,
    /// `compute`, `vertex` or `fragment`.
    pub stage: StageName,
    /// Compute: invocations of a workgroup along x, y, z.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub workgroup_size: Option<[u32; 3]>,
    /// Compute: how many dimensions index the output.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub dimensions: Option<u32>,
    /// Compute: bytes of workgroup memory.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub workgroup_bytes: Option<u32>,
    /// Compute: how many invocations run where the outputs do not say it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub range: Option<RangeEntry>,
    /// Compute: the kernel that draws the same texels into render targets, from the same function and with the same
    /// parameters, if there is one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub fragment_form: Option<String>,
    /// Fragment: it is the fragment form of compute kernels. Draw a triangle that covers all of its targets, without
    /// depth and blending; what those kernels take for an index is the pixel, with row 0 where texels have it.
    #[serde(skip_serializing_if = "core::ops::Not::not", default)]
    pub full_screen: bool,
    /// Floating-point type of a function that has several: `f32` or `f64`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub precision: Option<String>,
    /// What is bound, in the order of the bindings in set 0.
    pub bindings: Vec<Binding>,
    /// Specialisation constants.
    pub constants: Vec<Constant>,
    /// Vertex attributes and interpolated inputs.
    pub inputs: Vec<Interface>,
    /// Interpolated outputs and colour attachments.
    pub outputs: Vec<Interface>,
    /// What it costs, counted in the SPIR-V.
    pub cost: Cost,
    /// What makes it slow in the languages that it is written in.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub findings: Vec<Finding>,
    /// How closely backends agree with the native scalar run.
    pub tolerance: Tolerance,
    /// What compilers and drivers may do with its floating-point arithmetic.
    #[serde(default)]
    pub rounding: Rounding,
    /// What it does with subgroups; absent if nothing.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub subgroups: Option<Subgroups>,
    /// The text in each language.
    pub languages: BTreeMap<Language, LanguageEntry>,
    /// Languages that cannot express it, and why.
    pub unsupported: BTreeMap<Language, String>,
}

/// What compilers and drivers may do with a kernel's floating-point arithmetic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Rounding {
    /// Contract a product and a sum into one operation, and reorder sums.
    #[default]
    Free,
    /// Neither, which the files of languages that can ask for it do. In the others the result is
    /// as good, but has other bits.
    Pinned,
    /// Neither, which all files ask for: otherwise the result is wrong. Hand SPIR-V to the driver
    /// as it is; naga, and so wgpu, would drop what forbids it.
    Exact,
}

/// What a kernel does with subgroups. The device must have them (WebGPU's feature `subgroups`; SPIR-V's
/// capabilities; HLSL's waves; Metal's SIMD-groups).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Subgroups {
    /// It uses them, and its result is the same for every size.
    AnySize,
    /// Its result depends on their size, which differs from device to device.
    Sized,
}

/// A pipeline stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StageName {
    /// Compute.
    Compute,
    /// Vertex.
    Vertex,
    /// Fragment.
    Fragment,
}

/// Something that is bound.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Binding {
    /// Descriptor set in SPIR-V.
    pub set: u32,
    /// Number in it.
    pub binding: u32,
    /// The parameter's name; `out` for what the kernel returns.
    pub name: String,
    /// What it is.
    pub kind: BindingKind,
    /// The kernel writes it.
    pub written: bool,
    /// Storage textures: the kernel reads texels of it.
    #[serde(skip_serializing_if = "core::ops::Not::not", default)]
    pub read: bool,
    /// Buffers: the type of the value or of an element; a structure's name is in `layouts`.
    #[serde(rename = "type", skip_serializing_if = "Option::is_none", default)]
    pub ty: Option<String>,
    /// Buffers: bytes of the value, or from one element to the next.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub stride: Option<u32>,
    /// Buffers of elements: what an element belongs to.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub element_for_each: Option<String>,
    /// Textures: `1d`, `2d`, `2d-array`, `2d-multisampled`, `3d`, `cube`, `cube-array`; of depths
    /// `depth-2d`, `depth-2d-array`, `depth-cube`; of integers `uint-2d`, `uint-2d-array`, `uint-3d`,
    /// or with `sint-`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub texture: Option<String>,
    /// Storage textures: the format.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub format: Option<String>,
    /// Where it is in each language; absent where the kernel's code does not use it.
    pub places: BTreeMap<Language, Place>,
}

/// The kinds of bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum BindingKind {
    /// A uniform buffer.
    Uniform,
    /// Push constants in SPIR-V, `var<immediate>` in WGSL, neither of which is bound; a uniform buffer,
    /// root constants or `setBytes` in HLSL, MSL and GLSL, where [`Binding::places`] says.
    PushConstants,
    /// A storage buffer.
    Storage,
    /// A storage buffer of integers on which only atomic operations work.
    Atomic,
    /// A texture that is read.
    Texture,
    /// A texture of which any texel is written, or read, or both.
    StorageTexture,
    /// A sampler.
    Sampler,
    /// A sampler that takes the nearest texel of the nearest level: WebGPU's `non-filtering`.
    NonFilteringSampler,
    /// A sampler that compares depths with a reference.
    ComparisonSampler,
}

/// Before and after how a texture is seen, in [`Binding::texture`].
const DEPTH: &str = "depth-";
const UINT: &str = "uint-";
const SINT: &str = "sint-";
const MULTISAMPLED: &str = "-multisampled";

impl Binding {
    /// How a texture is seen, in WebGPU's words.
    #[must_use]
    pub fn view_dimension(&self) -> Option<&str> {
        let texture = self.texture.as_deref()?;
        let before = [DEPTH, UINT, SINT].into_iter();
        let texture = before
            .filter_map(|it| texture.strip_prefix(it))
            .next()
            .unwrap_or(texture);
        Some(texture.strip_suffix(MULTISAMPLED).unwrap_or(texture))
    }

    /// Whether it is a texture of depths.
    #[must_use]
    pub fn is_depth(&self) -> bool {
        self.texture
            .as_deref()
            .is_some_and(|it| it.starts_with(DEPTH))
    }

    /// `uint` or `sint`, for a texture of integers.
    #[must_use]
    pub fn integers(&self) -> Option<&'static str> {
        let texture = self.texture.as_deref()?;
        match texture {
            _ if texture.starts_with(UINT) => Some("uint"),
            _ if texture.starts_with(SINT) => Some("sint"),
            _ => None,
        }
    }

    /// What is done with the texels of a storage texture, in WebGPU's words.
    #[must_use]
    pub const fn access(&self) -> &'static str {
        match (self.written, self.read) {
            (true, false) => "write-only",
            (true, true) => "read-write",
            (false, _) => "read-only",
        }
    }

    /// Whether it is a texture with several samples in each texel.
    #[must_use]
    pub fn is_multisampled(&self) -> bool {
        self.texture
            .as_deref()
            .is_some_and(|it| it.ends_with(MULTISAMPLED))
    }
}

/// A specialisation constant.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Constant {
    /// Its name.
    pub name: String,
    /// `SpecId` in SPIR-V, `@id` in WGSL, `function_constant` in MSL.
    pub id: u32,
    /// Its type: `i32`, `f32` or `bool`; `u32` where the entry has none.
    #[serde(
        rename = "type",
        default = "unsigned",
        skip_serializing_if = "is_unsigned"
    )]
    pub scalar: String,
    /// The value unless specialised.
    #[schemars(schema_with = "constant_schema")]
    pub default: ConstantValue,
    /// Languages whose file lets it be specialised; the others have a value in it.
    pub overridable_in: Vec<Language>,
    /// The value in the others.
    #[schemars(schema_with = "constant_schema")]
    pub value: ConstantValue,
    /// HLSL and GLSL: the macro whose value it has there, if whoever includes the text defines it.
    #[serde(rename = "macro", skip_serializing_if = "Option::is_none", default)]
    pub macro_name: Option<String>,
}

/// A specialisation constant's value.
fn constant_schema(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": ["boolean", "number"] })
}

/// Values by the constants' names.
pub(crate) fn constants_schema(generator: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "type": "object",
        "additionalProperties": constant_schema(generator),
    })
}

/// These by the ends of names.
fn variants_schema(generator: &mut SchemaGenerator) -> Schema {
    json_schema!({
        "type": "object",
        "additionalProperties": constants_schema(generator),
    })
}

/// The type of most constants, which entries do not name.
fn unsigned() -> String {
    Scalar::U32.name().into()
}

fn is_unsigned(name: &str) -> bool {
    name == Scalar::U32.name()
}

/// The macro that a text in HLSL or GLSL takes a constant from.
pub(crate) fn macro_name(kernel: &str, constant: &str) -> String {
    format!("{kernel}_{constant}").to_uppercase()
}

/// A value at a stage's interface.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Interface {
    /// Its name.
    pub name: String,
    /// `attribute`, `varying`, `position`, `clip_distances`, `depth`, `sample_mask`, `target` or `second_source`.
    pub kind: String,
    /// Location; the position, the depth and the mask of samples have none.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub location: Option<u32>,
    /// Type.
    #[serde(rename = "type")]
    pub ty: String,
    /// How a varying is interpolated, in WGSL's words: `flat`, `linear, centroid`; none for `perspective`.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub interpolation: Option<String>,
}

/// How closely backends agree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Tolerance {
    /// Units in the last place.
    pub ulp: u32,
    /// Or an absolute difference.
    pub absolute: f64,
    /// Finite inputs may give results that are not finite.
    #[serde(skip_serializing_if = "core::ops::Not::not", default)]
    pub non_finite: bool,
    /// Why.
    pub why: String,
}

/// A kernel's file in a language.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LanguageEntry {
    /// Path from the manifest; its hash is in `files`.
    pub file: String,
    /// The entry point's name in it.
    pub entry_point: String,
    /// MSL: slot of the buffer with the sizes in bytes of other buffers, a `uint` for each.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub sizes_buffer: Option<u32>,
    /// MSL: bindings whose sizes that buffer holds, in order.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub sized_bindings: Vec<u32>,
    /// Extensions or device features beyond the language's core.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub requires: Vec<String>,
}

/// A structure in memory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct LayoutEntry {
    /// Its name in the kernels.
    pub name: String,
    /// Size in bytes, also the stride in an array.
    pub size: u32,
    /// Alignment in bytes.
    pub align: u32,
    /// Its fields in order.
    pub fields: Vec<FieldEntry>,
}

/// A field of a structure.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct FieldEntry {
    /// Its name.
    pub name: String,
    /// The first paragraph of its documentation.
    pub summary: String,
    /// Its type.
    #[serde(rename = "type")]
    pub ty: String,
    /// Bytes from the structure's start.
    pub offset: u32,
    /// Size in bytes.
    pub size: u32,
}

impl Manifest {
    /// The JSON text.
    pub fn to_json(&self) -> String {
        // Maps have string keys and floats are finite: nothing here can fail.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Reads a manifest.
    ///
    /// # Errors
    ///
    /// It is none, or of another format.
    pub fn from_json(text: &[u8]) -> Result<Self, String> {
        let manifest: Self = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        if manifest.format != FORMAT {
            return Err(format!(
                "its format is {}, this hankel reads {FORMAT}",
                manifest.format
            ));
        }
        Ok(manifest)
    }
}

/// The schema that the manifest follows, as JSON text.
pub fn schema() -> String {
    let mut text =
        serde_json::to_string_pretty(&schemars::schema_for!(Manifest)).unwrap_or_default();
    text.push('\n');
    text
}

/// The structures, for the manifest.
pub(crate) fn layouts(layouts: &Layouts) -> BTreeMap<String, LayoutEntry> {
    layouts
        .iter()
        .map(|(name, layout)| {
            let fields = layout
                .fields
                .iter()
                .map(|field| FieldEntry {
                    name: field.name.clone(),
                    summary: meaning(field),
                    ty: layouts.spell(&field.ty),
                    offset: field.offset,
                    size: field.size,
                })
                .collect();
            let entry = LayoutEntry {
                name: layout.name.clone(),
                size: layout.size,
                align: layout.align,
                fields,
            };
            (name.to_owned(), entry)
        })
        .collect()
}

/// What the description alone says of a kernel; languages are added as they are written.
pub(crate) fn entry(
    kernel: &Kernel,
    layouts: &Layouts,
    options: &Options,
    cost: Cost,
) -> KernelEntry {
    let (stage, compute) = match &kernel.stage {
        Stage::Compute {
            threads,
            dimensions,
            workgroup_bytes,
            range,
            ..
        } => (
            StageName::Compute,
            Some((*threads, *dimensions, *workgroup_bytes, range_entry(range))),
        ),
        Stage::Vertex => (StageName::Vertex, None),
        Stage::Fragment => (StageName::Fragment, None),
    };
    let (inputs, outputs) = interfaces(kernel, layouts);
    KernelEntry {
        function: kernel.function.clone(),
        file: translate::file_name(&kernel.file),
        line: kernel.line,
        summary: kernel.summary.clone(),
        stage,
        workgroup_size: compute.as_ref().map(|it| it.0),
        dimensions: compute.as_ref().map(|it| it.1),
        workgroup_bytes: compute.as_ref().map(|it| it.2),
        range: compute.and_then(|it| it.3),
        fragment_form: kernel.fragment_form().map(str::to_owned),
        full_screen: kernel.is_fragment_form(),
        precision: kernel.precision.map(|precision| {
            match precision {
                describe::Precision::F32 => "f32",
                describe::Precision::F64 => "f64",
            }
            .into()
        }),
        bindings: bindings(kernel, layouts),
        constants: constants(kernel, options),
        inputs,
        outputs,
        cost,
        findings: Vec::new(),
        tolerance: Tolerance {
            ulp: kernel.tolerance.ulp,
            absolute: kernel.tolerance.absolute,
            non_finite: kernel.tolerance.non_finite,
            why: kernel.tolerance.why.clone(),
        },
        rounding: match kernel.rounding {
            describe::Rounding::Free => Rounding::Free,
            describe::Rounding::Pinned => Rounding::Pinned,
            describe::Rounding::Exact => Rounding::Exact,
        },
        subgroups: match kernel.subgroups {
            describe::Subgroups::Unused => None,
            describe::Subgroups::AnySize => Some(Subgroups::AnySize),
            describe::Subgroups::Sized => Some(Subgroups::Sized),
        },
        languages: BTreeMap::new(),
        unsupported: BTreeMap::new(),
    }
}

impl Constant {
    /// Whether some file lets it be specialised.
    #[must_use]
    pub fn is_overridable(&self) -> bool {
        !self.overridable_in.is_empty()
    }
}

fn constants(kernel: &Kernel, options: &Options) -> Vec<Constant> {
    let constant = |param: &describe::Param| match param.role {
        Role::Constant {
            id,
            scalar,
            default,
        } => {
            // As the type has it: 2 of a float is 2.0.
            let frozen = options
                .constants
                .get(&param.name)
                .and_then(|value| value.word(scalar))
                .map(|word| ConstantValue::of_word(scalar, word));
            let default = ConstantValue::of_word(scalar, default);
            Some(Constant {
                name: param.name.clone(),
                id,
                scalar: scalar.name().into(),
                default,
                overridable_in: match frozen {
                    Some(_) => Vec::new(),
                    None if options.open_constants => Language::ALL.into(),
                    None => vec![Language::Spirv, Language::Wgsl],
                },
                value: frozen.unwrap_or(default),
                macro_name: (frozen.is_none() && options.open_constants)
                    .then(|| macro_name(&kernel.name, &param.name)),
            })
        }
        _ => None,
    };
    kernel.params.iter().filter_map(constant).collect()
}

fn interfaces(kernel: &Kernel, layouts: &Layouts) -> (Vec<Interface>, Vec<Interface>) {
    let made = |name: &str, kind: &str, location: Option<u32>, ty: String| Interface {
        name: name.into(),
        kind: kind.into(),
        location,
        ty,
        interpolation: None,
    };
    let inputs = kernel
        .params
        .iter()
        .filter_map(|param| match &param.role {
            Role::Attribute { location, ty } => Some(made(
                &param.name,
                "attribute",
                Some(*location),
                layouts.spell(ty),
            )),
            Role::Varying {
                location,
                ty,
                interpolation,
            } => Some(Interface {
                interpolation: interpolation.words().map(str::to_owned),
                ..made(&param.name, "varying", Some(*location), layouts.spell(ty))
            }),
            _ => None,
        })
        .collect();
    let outputs = kernel
        .outputs
        .iter()
        .enumerate()
        .filter_map(|(index, output)| {
            let name = output_name(kernel, index);
            match output {
                Output::Position => Some(made(&name, "position", None, "vec4<f32>".into())),
                Output::Depth => Some(made(&name, "depth", None, "f32".into())),
                Output::SampleMask => Some(made(&name, "sample_mask", None, "u32".into())),
                Output::ClipDistances { ty } => {
                    Some(made(&name, "clip_distances", None, layouts.spell(ty)))
                }
                Output::SecondSource { ty } => {
                    Some(made(&name, "second_source", Some(0), layouts.spell(ty)))
                }
                Output::Varying {
                    location,
                    ty,
                    interpolation,
                } => Some(Interface {
                    interpolation: interpolation.words().map(str::to_owned),
                    ..made(&name, "varying", Some(*location), layouts.spell(ty))
                }),
                Output::Target { location, ty } => {
                    Some(made(&name, "target", Some(*location), layouts.spell(ty)))
                }
                _ => None,
            }
        })
        .collect();
    (inputs, outputs)
}

pub(crate) fn bindings(kernel: &Kernel, layouts: &Layouts) -> Vec<Binding> {
    let plain = |binding: u32, name: &str, kind: BindingKind| Binding {
        set: 0,
        binding,
        name: name.into(),
        kind,
        written: false,
        read: false,
        ty: None,
        stride: None,
        element_for_each: None,
        texture: None,
        format: None,
        places: BTreeMap::new(),
    };
    let buffer = |binding: u32, name: &str, kind: BindingKind, layout: &describe::Layout| Binding {
        ty: Some(layouts.name(layout)),
        stride: Some(layout.size),
        ..plain(binding, name, kind)
    };
    let params = kernel.params.iter().filter_map(|param| {
        let name = param.name.as_str();
        Some(match &param.role {
            Role::Uniform {
                binding,
                layout,
                push,
            } => {
                let kind = if *push {
                    BindingKind::PushConstants
                } else {
                    BindingKind::Uniform
                };
                buffer(*binding, name, kind, layout)
            }
            Role::Element { binding, layout } => Binding {
                element_for_each: Some("invocation".into()),
                ..buffer(*binding, name, BindingKind::Storage, layout)
            },
            Role::Storage { binding, layout } => {
                buffer(*binding, name, BindingKind::Storage, layout)
            }
            Role::ElementMut { binding, layout } => Binding {
                written: true,
                element_for_each: Some("invocation".into()),
                ..buffer(*binding, name, BindingKind::Storage, layout)
            },
            Role::StorageMut {
                binding, layout, ..
            } => Binding {
                written: true,
                ..buffer(*binding, name, BindingKind::Storage, layout)
            },
            Role::Atomic {
                binding, scalar, ..
            } => Binding {
                written: true,
                ty: Some(layouts.spell(&describe::Type::Scalar { scalar: *scalar })),
                stride: Some(4),
                ..plain(*binding, name, BindingKind::Atomic)
            },
            Role::Texture { binding, texture } => {
                let before = match texture.channels() {
                    _ if texture.is_depth() => DEPTH,
                    describe::Channels::Float => "",
                    describe::Channels::Uint => UINT,
                    describe::Channels::Sint => SINT,
                };
                let after = if texture.is_multisampled() {
                    MULTISAMPLED
                } else {
                    ""
                };
                Binding {
                    texture: Some(format!("{before}{}{after}", texture.view())),
                    ..plain(*binding, name, BindingKind::Texture)
                }
            }
            Role::StorageTexture {
                binding,
                format,
                dimensions,
                array,
                access,
            } => Binding {
                written: access.writes(),
                read: access.reads(),
                texture: Some(describe::storage_view(*dimensions, *array).into()),
                format: Some(format_name(*format)),
                ..plain(*binding, name, BindingKind::StorageTexture)
            },
            Role::Sampler { binding, sampler } => {
                let kind = match sampler {
                    SamplerKind::Filtering => BindingKind::Sampler,
                    SamplerKind::NonFiltering => BindingKind::NonFilteringSampler,
                    SamplerKind::Comparison => BindingKind::ComparisonSampler,
                };
                plain(*binding, name, kind)
            }
            _ => return None,
        })
    });
    let outputs = kernel
        .outputs
        .iter()
        .enumerate()
        .filter_map(|(index, output)| {
            let name = output_name(kernel, index);
            Some(match output {
                Output::Buffer { binding, layout } => Binding {
                    written: true,
                    element_for_each: Some("invocation".into()),
                    ..buffer(*binding, &name, BindingKind::Storage, layout)
                },
                Output::Texture {
                    binding,
                    format,
                    dimensions,
                } => Binding {
                    written: true,
                    texture: Some(describe::storage_view(*dimensions, false).into()),
                    format: Some(format_name(*format)),
                    ..plain(*binding, &name, BindingKind::StorageTexture)
                },
                _ => return None,
            })
        });
    let mut bindings: Vec<Binding> = params.chain(outputs).collect();
    bindings.sort_by_key(|binding| binding.binding);
    bindings
}

/// `rgba16unorm`: the description's own spelling.
fn format_name(format: describe::TexelFormat) -> String {
    serde_json::to_value(format)
        .ok()
        .and_then(|value| value.as_str().map(str::to_owned))
        .unwrap_or_default()
}
