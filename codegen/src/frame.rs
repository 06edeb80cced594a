//! An exported frame: `frame.json`, which says all that a player in another engine needs to run a
//! graph of passes with the shaders beside it. The player needs nothing of Hankel.
//!
//! ```text
//! OUT/frame.json            resources, passes, shaders with their bindings, uniforms by meaning
//! OUT/frame/NAME.bin        what buffers hold at first, geometry among them
//! OUT/LANGUAGE/KERNEL.EXT   the shaders of its passes, constants frozen; and what every build has
//! ```
//!
//! The schema is `codegen/frame.schema.json`, derived from the types below. Words for formats, filters,
//! topologies and the like are WebGPU's, and so are the conventions: y is up in clip space, depths go
//! from 0 to 1, rows of textures from the top, front faces wind counter-clockwise.

use std::collections::{BTreeMap, BTreeSet};

use hankel_dsl::native::describe::{self, ConstantValue, Kernel, Stage, Type};
use rspirv::dr::Operand;
use rspirv::spirv::{Decoration, Op};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::Language;
use crate::build::{Generated, Modules, Request, Variant, assemble};
use crate::error::{Error, Failure, Result};
use crate::folder::MOST_BYTES;
use crate::headers::{Layouts, meaning};
use crate::manifest::{self, Binding, Interface, KernelEntry, LanguageEntry, StageName, Versions};
use crate::placement::Placement;
use crate::spirv;

/// The file that describes a frame.
pub const FRAME_FILE: &str = "frame.json";

/// The folder of what buffers hold at first.
pub const CONTENTS: &str = "frame";

/// Number of this format; raised when a reader of the old one would misunderstand.
pub const FORMAT: u32 = 1;

/// A frame: run `passes` in order, and `picture` holds the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[schemars(title = "Hankel frame")]
pub struct Frame {
    /// Number of this format.
    pub format: u32,
    /// What made the files.
    pub made_by: Versions,
    /// The scene file's name.
    pub scene: String,
    /// How the scene's shadows are made.
    pub shadow: Shadow,
    /// How the light of the scene's medium is made, if it has one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub scattering: Option<Scattering>,
    /// How passes run that give a texel for each index: as `compute` passes, or drawn by `fragment` shaders as far as
    /// those can.
    #[serde(skip_serializing_if = "is_compute", default = "compute")]
    pub image_passes: String,
    /// The texture that holds the picture after the last pass: linear light, rows from the top.
    pub picture: String,
    /// Buffers, by name.
    pub buffers: BTreeMap<String, Buffer>,
    /// Textures, by name.
    pub textures: BTreeMap<String, Texture>,
    /// Samplers, by name.
    pub samplers: BTreeMap<String, Sampler>,
    /// What the numbers in uniform buffers mean, by the buffer's name. A player that moves the camera or
    /// the light writes other values there, and runs the passes again.
    pub uniforms: BTreeMap<String, Uniform>,
    /// Shaders, by the names that passes call them by.
    pub shaders: BTreeMap<String, Shader>,
    /// Passes, in the order in which they run.
    pub passes: Vec<Pass>,
}

fn compute() -> String {
    "compute".into()
}

fn is_compute(form: &str) -> bool {
    form == "compute"
}

/// How shadows are made, as scene files say it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Shadow {
    /// The technique.
    pub technique: String,
    /// The format of its map.
    pub format: String,
    /// The interval that depths are mapped to: `unit` or `symmetric`.
    pub depth_range: String,
    /// Texels along an edge of the map.
    pub size: u32,
    /// Samples of depth in each texel, of which the map is made: 4 or 1.
    #[serde(default = "four")]
    pub multisampling: u32,
    /// Taps of the filter along an axis; 1: none.
    pub filter: u32,
    /// What the map holds: `scene` or `camera`. The latter's light has to follow the camera.
    pub fit: String,
    /// Samples of a soft shadow: for the search of blockers, and for the filter.
    pub samples: [u32; 2],
    /// Against rounding of moments.
    pub moment_bias: f32,
    /// What is taken off a receiver's depth, in units of the map's whole depth.
    pub depth_bias: f32,
    /// Light up to this share counts as none, and the rest is scaled to reach from 0 to 1: against light leaks.
    pub leak_cut: f32,
    /// Whether the map has mip levels.
    #[serde(skip_serializing_if = "core::ops::Not::not", default)]
    pub mips: bool,
    /// How many times as long as wide a pixel's footprint in such a map is at most, 1 or more.
    #[serde(default = "one")]
    pub anisotropy: u32,
}

const fn one() -> u32 {
    1
}

const fn four() -> u32 {
    4
}

/// How a medium's light is made, as scene files say it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Scattering {
    /// The technique.
    pub technique: String,
    /// Steps along each ray, where one is marched along.
    pub steps: u32,
}

/// A buffer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Buffer {
    /// Its size in bytes.
    pub bytes: u64,
    /// Type of an element; the manifest's `layouts` describe structures.
    #[serde(rename = "type")]
    pub ty: String,
    /// Bytes from one element to the next.
    pub stride: u32,
    /// What passes use it as.
    pub usage: BTreeSet<BufferUsage>,
    /// The file with its bytes, little endian, by the path from here. Without one, passes write it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub contents: Option<String>,
    /// It never changes; what others hold at first may be replaced from frame to frame.
    #[serde(skip_serializing_if = "core::ops::Not::not", default)]
    pub constant: bool,
    /// What its elements are, where that is said.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub meaning: String,
}

/// What a buffer is used as.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum BufferUsage {
    /// Indices of a draw.
    Index,
    /// Elements that shaders read or write.
    Storage,
    /// One value that shaders read.
    Uniform,
    /// A vertex attribute.
    Vertex,
}

/// A texture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Texture {
    /// 1, 2 or 3.
    pub dimensions: u32,
    /// Width, height, depth of level 0 in texels.
    pub size: [u32; 3],
    /// Layers.
    pub layers: u32,
    /// Mip levels.
    pub levels: u32,
    /// Samples of a texel.
    pub samples: u32,
    /// The format.
    pub format: String,
    /// What passes use it as.
    pub usage: BTreeSet<TextureUsage>,
}

/// What a texture is used as.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum TextureUsage {
    /// A level of it is copied to.
    CopyDestination,
    /// It is copied from.
    CopySource,
    /// It is drawn into, or the samples of what was drawn are resolved into it.
    RenderAttachment,
    /// Shaders write or read texels of it in its own format.
    StorageBinding,
    /// Shaders read it, through a sampler or by coordinates.
    TextureBinding,
}

/// A sampler.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Sampler {
    /// Between texels, magnified: `nearest` or `linear`.
    pub mag_filter: String,
    /// Between texels, minified.
    pub min_filter: String,
    /// Between mip levels.
    pub mipmap_filter: String,
    /// Beyond the edge, along u, v, w: `clamp-to-edge`, `repeat`, `mirror-repeat`.
    pub address_modes: [String; 3],
    /// How depths are compared, if they are: `less`, `less-equal`, …
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub compare: Option<String>,
    /// Most samples along the longer axis of a pixel's footprint.
    pub max_anisotropy: u16,
}

/// What a uniform buffer holds.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Uniform {
    /// What it is.
    pub meaning: String,
    /// It never changes.
    #[serde(skip_serializing_if = "core::ops::Not::not", default)]
    pub constant: bool,
    /// Its numbers.
    pub fields: Vec<Field>,
}

/// A number or vector in a uniform buffer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Field {
    /// Its name, with a dot between a structure's and that of its part; `value` in a buffer without
    /// structure.
    pub name: String,
    /// Bytes from the buffer's start.
    pub offset: u32,
    /// Size in bytes.
    pub size: u32,
    /// Its type: `f32`, `vec4<f32>`, `array<f32, 4>`.
    #[serde(rename = "type")]
    pub ty: String,
    /// What it holds at first: a number, or a list of the components; `null` stands for what is no finite
    /// number.
    pub value: Value,
    /// What it is, with units and range; nothing if the buffer's meaning says it.
    #[serde(skip_serializing_if = "String::is_empty", default)]
    pub meaning: String,
}

/// A shader, with constants frozen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Shader {
    /// The kernel that it is.
    pub kernel: String,
    /// The values of the kernel's specialisation constants that it was frozen with.
    #[schemars(schema_with = "manifest::constants_schema")]
    pub constants: BTreeMap<String, ConstantValue>,
    /// `compute`, `vertex` or `fragment`.
    pub stage: StageName,
    /// Compute: invocations of a workgroup along x, y, z.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub workgroup_size: Option<[u32; 3]>,
    /// What is bound, and where, in each language. The vertex and the fragment shader of a draw share
    /// no place in SPIR-V, WGSL, HLSL and GLSL; in MSL each stage has slots of its own.
    pub bindings: Vec<Binding>,
    /// Vertex attributes and interpolated inputs.
    pub inputs: Vec<Interface>,
    /// Interpolated outputs and colour attachments.
    pub outputs: Vec<Interface>,
    /// File and entry point in each language.
    pub languages: BTreeMap<Language, LanguageEntry>,
    /// Languages that cannot express it, and why.
    #[serde(skip_serializing_if = "BTreeMap::is_empty", default)]
    pub unsupported: BTreeMap<Language, String>,
}

/// What is bound to a parameter.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Resource {
    /// The buffer of this name, all of it.
    Buffer(String),
    /// The texture of this name, all levels and layers.
    Texture(String),
    /// The sampler of this name.
    Sampler(String),
}

/// A shader with its arguments.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Call {
    /// The shader.
    pub shader: String,
    /// What is bound, by the binding's name in the shader.
    pub bind: BTreeMap<String, Resource>,
}

/// A pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum Pass {
    /// Fills with one value.
    Clear {
        /// Its name.
        label: String,
        /// What is filled: buffers with zeros.
        resources: Vec<Resource>,
        /// Red, green, blue, alpha of what textures are filled with; without it zeros. Such textures are
        /// render attachments, so that a pass that draws nothing can fill them.
        #[serde(skip_serializing_if = "Option::is_none", default)]
        value: Option<[f64; 4]>,
    },
    /// Copies textures into the mip levels of one.
    Levels {
        /// Its name.
        label: String,
        /// What they are copied into, all of its levels.
        texture: String,
        /// Textures with one level each, level 0 first.
        levels: Vec<String>,
    },
    /// Runs a compute shader.
    Compute {
        /// Its name.
        label: String,
        /// The shader with its arguments.
        call: Call,
        /// Invocations that have something to do, along x, y, z.
        invocations: [u32; 3],
        /// Workgroups to dispatch; the last ones' other invocations do nothing.
        workgroups: [u32; 3],
        /// A buffer that says how many invocations have something to do, fewer than `invocations`. A player may
        /// dispatch all workgroups, or as many as that needs.
        #[serde(skip_serializing_if = "Option::is_none", default)]
        workgroups_from: Option<WorkgroupsFrom>,
    },
    /// Draws a triangle that covers all pixels of its targets: three vertices without attributes and indices, one
    /// sample of a pixel, no depth, no blending, nothing culled.
    FullScreen {
        /// Its name.
        label: String,
        /// The vertex shader.
        vertex: Call,
        /// The fragment shader with its arguments.
        fragment: Call,
        /// Textures that the fragment shader's outputs go to, in order; what they held before is not wanted.
        targets: Vec<String>,
    },
    /// Draws triangles.
    Draw(Box<Draw>),
}

/// Where a buffer says how many invocations of a compute pass have something to do.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct WorkgroupsFrom {
    /// The buffer, which an earlier pass writes.
    pub buffer: String,
    /// Bytes from its start to the first number.
    pub offset: u32,
    /// Numbers, each of 32 bits: along x, y, z. Along the axes without a number, there is one invocation.
    pub dimensions: u32,
}

/// A pass that draws.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Draw {
    /// Its name.
    pub label: String,
    /// The vertex shader with its arguments.
    pub vertex: Call,
    /// The fragment shader with its arguments; without one, depth alone is drawn.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub fragment: Option<Call>,
    /// Vertex attributes, each in a buffer of its own.
    pub attributes: Vec<Attribute>,
    /// Indices of vertices.
    pub indices: Indices,
    /// `triangle-list`.
    pub topology: String,
    /// Faces that are left out: `none`, `front` or `back`.
    pub cull_mode: String,
    /// Samples of a pixel.
    pub samples: u32,
    /// What the fragment shader's outputs go to, in order.
    pub colour_targets: Vec<ColourTarget>,
    /// The depth buffer.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub depth_target: Option<DepthTarget>,
}

/// A vertex attribute.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Attribute {
    /// Its name in the shader.
    pub name: String,
    /// Its location.
    pub location: u32,
    /// `float32x3` and so on.
    pub format: String,
    /// The buffer, packed.
    pub buffer: String,
    /// Bytes from one vertex to the next.
    pub stride: u32,
}

/// Indices of a draw.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Indices {
    /// The buffer.
    pub buffer: String,
    /// `uint32`.
    pub format: String,
    /// How many there are.
    pub count: u32,
}

/// What colours are drawn into.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ColourTarget {
    /// The texture, filled first with `clear`.
    pub texture: String,
    /// Where the mean of each texel's samples goes; the samples need not be stored then.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub resolve: Option<String>,
    /// Red, green, blue, alpha of what it is filled with.
    pub clear: [f64; 4],
    /// How colours are put together with what is there, in the order of the triangles; without it they replace
    /// it.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub blend: Option<Blend>,
}

/// Blending, in WebGPU's words.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Blend {
    /// Of red, green and blue.
    pub color: BlendComponent,
    /// Of alpha.
    pub alpha: BlendComponent,
}

/// Blending of some channels: the source times a factor, and what is there times a factor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct BlendComponent {
    /// What is done with both: `add` or `min`; factors of the latter are `one`.
    pub operation: String,
    /// `zero`, `one`, `src-alpha`, `one-minus-src-alpha` or `src`.
    pub src_factor: String,
    /// One of the same.
    pub dst_factor: String,
}

/// The depth buffer of a draw.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct DepthTarget {
    /// The texture.
    pub texture: String,
    /// The depth that it is filled with first; without one, it keeps what is there.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub clear: Option<f32>,
    /// Which depths pass: `less`, `less-equal`, `greater`, `always`.
    pub compare: String,
    /// Whether what passes is written.
    pub write: bool,
    /// Whether a later pass reads it.
    pub store: bool,
}

/// A kernel with values of all of its constants.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frozen {
    /// The kernel.
    pub kernel: String,
    /// The values, by name.
    pub constants: BTreeMap<String, ConstantValue>,
}

/// A frame before its shaders are written.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    /// All but the shaders and what made them.
    pub frame: Frame,
    /// The shaders that its passes call, by name.
    pub shaders: BTreeMap<String, Frozen>,
    /// Files of buffers, by path.
    pub contents: BTreeMap<String, Vec<u8>>,
}

impl Frame {
    /// The JSON text.
    #[must_use]
    pub fn to_json(&self) -> String {
        // Maps have string keys and what is no finite number is written as null: nothing here can fail.
        let mut text = serde_json::to_string_pretty(self).unwrap_or_default();
        text.push('\n');
        text
    }

    /// Reads one.
    ///
    /// # Errors
    ///
    /// It is not a frame, or has another format.
    pub fn from_json(text: &[u8]) -> Result<Self, String> {
        #[derive(Deserialize)]
        struct Format {
            format: u32,
        }
        let Format { format } = serde_json::from_slice(text).map_err(|error| error.to_string())?;
        if format != FORMAT {
            return Err(format!(
                "its format is {format}, this hankel reads {FORMAT}"
            ));
        }
        serde_json::from_slice(text).map_err(|error| error.to_string())
    }

    fn draws(&self) -> impl Iterator<Item = &Draw> {
        self.passes.iter().filter_map(|pass| match pass {
            Pass::Draw(draw) => Some(&**draw),
            Pass::Clear { .. }
            | Pass::Levels { .. }
            | Pass::Compute { .. }
            | Pass::FullScreen { .. } => None,
        })
    }
}

/// The schema that `frame.json` follows, as JSON text.
pub fn schema() -> String {
    let mut text = serde_json::to_string_pretty(&schemars::schema_for!(Frame)).unwrap_or_default();
    text.push('\n');
    text
}

/// Names of a kernel's bindings in [`Call::bind`], by their numbers.
#[must_use]
pub fn names(kernel: &Kernel) -> BTreeMap<u32, String> {
    let bindings = manifest::bindings(kernel, &Layouts::default());
    bindings
        .into_iter()
        .map(|it| (it.binding, it.name))
        .collect()
}

/// A type's name: that of a structure, or `vec4<f32>` and the like.
#[must_use]
pub fn type_name(layout: &describe::Layout) -> String {
    match layout.fields.as_slice() {
        [field] if field.name.is_empty() => Layouts::default().spell(&field.ty),
        _ => layout.name.clone(),
    }
}

/// The numbers in a value of a layout, structures in it taken apart.
#[must_use]
pub fn fields(layout: &describe::Layout, bytes: &[u8]) -> Vec<Field> {
    let mut all = Vec::new();
    add_fields(&mut all, "", 0, layout, bytes);
    all
}

fn add_fields(
    all: &mut Vec<Field>,
    before: &str,
    start: u32,
    layout: &describe::Layout,
    bytes: &[u8],
) {
    for field in &layout.fields {
        let own = if field.name.is_empty() {
            "value"
        } else {
            &field.name
        };
        let name = match before {
            "" => own.to_owned(),
            before => format!("{before}.{own}"),
        };
        let offset = start + field.offset;
        if let Type::Struct { layout } = &field.ty {
            add_fields(all, &name, offset, layout, bytes);
            continue;
        }
        all.push(Field {
            name,
            offset,
            size: field.size,
            ty: Layouts::default().spell(&field.ty),
            value: value(&field.ty, bytes.get(offset as usize..).unwrap_or_default()),
            meaning: meaning(field),
        });
    }
}

/// What lies at the start of `bytes`; `null` where they end before it does.
fn value(ty: &Type, bytes: &[u8]) -> Value {
    let at = |offset: usize| bytes.get(offset..).unwrap_or_default();
    match ty.in_shader() {
        Type::Scalar { scalar } => number(*scalar, bytes),
        Type::Vector { scalar, size } => (0..*size as usize)
            .map(|i| number(*scalar, at(i * scalar.bytes())))
            .collect(),
        Type::Array {
            element,
            length,
            stride,
        } => (0..*length as usize)
            .map(|i| value(element, at(i * *stride as usize)))
            .collect(),
        Type::Struct { layout } => layout
            .fields
            .iter()
            .map(|field| value(&field.ty, at(field.offset as usize)))
            .collect(),
    }
}

fn number(scalar: describe::Scalar, bytes: &[u8]) -> Value {
    use describe::Scalar as S;
    let word = bytes.first_chunk::<4>();
    let long = bytes.first_chunk::<8>();
    let found = match scalar {
        S::F32 => word.map(|b| serde_json::json!(f32::from_le_bytes(*b))),
        S::U32 => word.map(|b| u32::from_le_bytes(*b).into()),
        S::I32 => word.map(|b| i32::from_le_bytes(*b).into()),
        S::Bool => word.map(|b| (u32::from_le_bytes(*b) != 0).into()),
        S::F16 => bytes
            .first_chunk::<2>()
            .map(|b| u16::from_le_bytes(*b).into()),
        S::F64 => long.map(|b| serde_json::json!(f64::from_le_bytes(*b))),
        S::U64 => long.map(|b| u64::from_le_bytes(*b).into()),
        S::I64 => long.map(|b| i64::from_le_bytes(*b).into()),
    };
    found.unwrap_or(Value::Null)
}

/// Makes the files of a frame in memory: those of a build of its shaders, `frame.json`, and what its
/// buffers hold. Of the request, the constants and the filter are not used: the frame says them.
///
/// # Errors
///
/// A shader is of no kernel of the request, a buffer is too large for a file, two stages of a draw would
/// have bindings in one place; and what [`crate::build::generate`] says of kernels.
pub fn generate(request: &Request, draft: &Draft, modules: &Modules) -> Result<Generated> {
    if let Some((path, bytes)) = draft
        .contents
        .iter()
        .find(|(_, bytes)| bytes.len() as u64 > MOST_BYTES)
    {
        return Err(Error::Frame {
            what: path.clone(),
            problem: format!(
                "it would have {} bytes, but a file of a build has at most {MOST_BYTES}: simplify the \
                 scene's model",
                bytes.len()
            ),
        });
    }
    request.options.placement.check(&request.kernels)?;
    let jobs = jobs(request, draft)?;
    let mut chosen: Vec<&Kernel> = Vec::new();
    for job in &jobs {
        let kernel = find(request, &job.of)?;
        if chosen.iter().all(|other| other.name != kernel.name) {
            chosen.push(kernel);
        }
    }
    chosen.sort_by(|a, b| a.name.cmp(&b.name));
    assemble(request, &chosen, &jobs, modules, None, |entries| {
        let mut frame = draft.frame.clone();
        frame.made_by = Versions::with(&request.rust_gpu);
        for (name, frozen) in &draft.shaders {
            if let Some(entry) = entries.get(name) {
                frame.shaders.insert(name.clone(), shader(frozen, entry));
            }
        }
        check_draws(&frame)?;
        let mut files = vec![(FRAME_FILE.to_owned(), frame.to_json().into_bytes())];
        files.extend(draft.contents.clone());
        Ok(files)
    })
}

fn find<'a>(request: &'a Request, name: &str) -> Result<&'a Kernel> {
    let found = request.kernels.iter().find(|kernel| kernel.name == name);
    found.ok_or_else(|| Error::UnknownKernel {
        name: name.into(),
        known: request.kernels.iter().map(|it| it.name.clone()).collect(),
    })
}

fn shader(frozen: &Frozen, entry: &KernelEntry) -> Shader {
    Shader {
        kernel: frozen.kernel.clone(),
        constants: frozen.constants.clone(),
        stage: entry.stage,
        workgroup_size: entry.workgroup_size,
        bindings: entry.bindings.clone(),
        inputs: entry.inputs.clone(),
        outputs: entry.outputs.clone(),
        languages: entry.languages.clone(),
        unsupported: entry.unsupported.clone(),
    }
}

/// The shaders that are written, by name.
fn jobs(request: &Request, draft: &Draft) -> Result<Vec<Variant>> {
    let mut after = 0;
    for draw in draft.frame.draws() {
        if let Some(vertex) = draft.shaders.get(&draw.vertex.shader) {
            after = after.max(names(find(request, &vertex.kernel)?).len());
        }
    }
    let mut jobs = Vec::new();
    for (name, frozen) in &draft.shaders {
        let of = find(request, &frozen.kernel)?;
        let mut options = request.options.clone();
        options.variants.clear();
        options.open_constants = false;
        options.constants = frozen.constants.clone();
        options.placement = options.placement.of_copy(&of.name, name);
        let is_fragment = of.stage == Stage::Fragment;
        if is_fragment {
            options.placement = beyond(&options.placement, after)?;
        }
        jobs.push(Variant {
            of: of.name.clone(),
            kernel: Kernel {
                name: name.clone(),
                ..of.clone()
            },
            options,
            set: u32::from(is_fragment),
        });
    }
    Ok(jobs)
}

/// Where a fragment shader's bindings are: out of the way of those of the vertex shaders, of which each
/// has at most `after`.
fn beyond(placement: &Placement, after: usize) -> Result<Placement> {
    let fail = |option: &str, value: u8| Error::Frame {
        what: format!("{option} {value}"),
        problem: "fragment shaders need the next one, which does not exist: give a smaller number"
            .into(),
    };
    let (group, space, base) = (
        placement.wgsl_group,
        placement.hlsl_space,
        placement.glsl_binding_base,
    );
    let after = u8::try_from(after).ok();
    let mut beyond = placement.clone();
    beyond.wgsl_group = group
        .checked_add(1)
        .ok_or_else(|| fail("--wgsl-group", group))?;
    beyond.hlsl_space = space
        .checked_add(1)
        .ok_or_else(|| fail("--hlsl-space", space))?;
    beyond.glsl_binding_base = after
        .and_then(|after| base.checked_add(after))
        .ok_or_else(|| fail("--glsl-binding-base", base))?;
    Ok(beyond)
}

/// A module with all of its bindings in another descriptor set.
pub(crate) fn in_set(module: &[u8], kernel: &str, set: u32) -> Result<Vec<u8>, Failure> {
    let mut module = spirv::load(&spirv::words(module, kernel)?, kernel)?;
    for note in &mut module.annotations {
        if spirv::op(note) == Op::Decorate
            && note.operands.get(1) == Some(&Operand::Decoration(Decoration::DescriptorSet))
        {
            note.operands[2] = Operand::LiteralBit32(set);
        }
    }
    Ok(spirv::bytes(&spirv::store(&module)))
}

/// Whether the stages of each draw have their bindings in different places, where a pipeline has one
/// place for both.
fn check_draws(frame: &Frame) -> Result<()> {
    const SHARED: [Language; 5] = [
        Language::Spirv,
        Language::Wgsl,
        Language::Hlsl,
        Language::Glsl,
        Language::Essl310,
    ];
    let bindings = |call: &Call| {
        let shader = frame.shaders.get(&call.shader);
        shader.map_or(&[][..], |shader| &shader.bindings)
    };
    for draw in frame.draws() {
        let Some(fragment) = &draw.fragment else {
            continue;
        };
        for language in SHARED {
            for vertex in bindings(&draw.vertex) {
                let Some(place) = vertex.places.get(&language) else {
                    continue;
                };
                let same = bindings(fragment).iter().find(|other| {
                    other.places.get(&language).is_some_and(|other| {
                        (&place.class, place.index, place.space)
                            == (&other.class, other.index, other.space)
                    })
                });
                if let Some(other) = same.filter(|_| place.index.is_some()) {
                    return Err(Error::Frame {
                        what: format!("pass `{}`", draw.label),
                        problem: format!(
                            "`{}` of `{}` and `{}` of `{}` have the same place in {language}: give one \
                             of them another place in the file of `--bindings`",
                            vertex.name, draw.vertex.shader, other.name, fragment.shader
                        ),
                    });
                }
            }
        }
    }
    Ok(())
}
