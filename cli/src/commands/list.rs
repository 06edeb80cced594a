use hankel_codegen::Language;
use hankel_codegen::manifest::KernelEntry;
use hankel_codegen::translate::Options;
use hankel_dsl::native::describe::{
    BuiltIn, ConstantValue, Interpolation, Kernel, Output, Precision, Role, Rounding, SamplerKind,
    Stage, Type,
};

use crate::args::{Format, List};
use crate::failure::{Outcome, Result};
use crate::print::{self, say};
use crate::session::Session;

pub fn run(args: &List, quiet: bool) -> Result<Outcome> {
    let session = Session::to_generate(args.source.manifest_path.as_deref(), &args.kernels, quiet)?;
    let request = session.request_for(
        args.kernels.clone(),
        vec![Language::Spirv],
        Options::default(),
    );
    let generated = session.generate(&request)?;
    if args.format == Format::Json {
        print::json(&generated.manifest.kernels);
        return Ok(Outcome::Fine);
    }
    say!(
        "{:<26} {:<9} {:>10} {:>10} {:>9} {:>8} {:>7} {:>7}  summary",
        "kernel",
        "stage",
        "operations",
        "arithmetic",
        "registers",
        "branches",
        "memory",
        "texture"
    );
    for kernel in &session.kernels() {
        let Some(entry) = generated.manifest.kernels.get(&kernel.name) else {
            continue;
        };
        row(kernel, entry);
        if args.bindings {
            bindings(kernel);
        }
    }
    Ok(Outcome::Fine)
}

fn row(kernel: &Kernel, entry: &KernelEntry) {
    let stage = match &kernel.stage {
        Stage::Compute {
            dimensions,
            cooperative: false,
            ..
        } => format!("map {dimensions}-D"),
        Stage::Compute { .. } => "workgroup".into(),
        Stage::Vertex => "vertex".into(),
        Stage::Fragment => "fragment".into(),
    };
    let c = &entry.cost;
    say!(
        "{:<26} {:<9} {:>10} {:>10} {:>9} {:>8} {:>7} {:>7}  {}",
        kernel.name,
        stage,
        c.operations,
        c.arithmetic,
        c.registers,
        c.branches,
        c.memory,
        c.texture,
        kernel.summary
    );
}

fn bindings(kernel: &Kernel) {
    if let Some(p) = kernel.precision {
        say!(
            "    precision {}",
            if p == Precision::F32 { "f32" } else { "f64" }
        );
    }
    match kernel.rounding {
        Rounding::Free => {}
        Rounding::Pinned => {
            say!("    pinned: no contraction or reordering where the language can forbid it");
        }
        Rounding::Exact => say!("    exact: no contraction or reordering in any language"),
    }
    if let Some(name) = kernel.fragment_form() {
        say!("    fragment form: {name}, which draws the same into render targets");
    }
    if let Some(name) = &kernel.compensated {
        say!("    compensated: {name}, which `hankel eval` runs without --fast");
    }
    for p in &kernel.params {
        let what = match &p.role {
            Role::Uniform {
                layout, push: true, ..
            } => format!("push constants: {}", shape(&layout.name, layout)),
            Role::Uniform {
                binding, layout, ..
            } => {
                format!("binding {binding}: uniform {}", shape(&layout.name, layout))
            }
            Role::Element { binding, layout } => {
                format!(
                    "binding {binding}: element of {}",
                    shape(&layout.name, layout)
                )
            }
            Role::Storage { binding, layout } => {
                format!(
                    "binding {binding}: buffer of {}",
                    shape(&layout.name, layout)
                )
            }
            Role::ElementMut { binding, layout } => format!(
                "binding {binding}: element of {}, changed in place",
                shape(&layout.name, layout)
            ),
            Role::StorageMut {
                binding,
                layout,
                unordered,
            } => format!(
                "binding {binding}: buffer of {}, written{}",
                shape(&layout.name, layout),
                in_order(*unordered)
            ),
            Role::Atomic {
                binding,
                scalar,
                unordered,
            } => format!(
                "binding {binding}: atomic {}{}",
                spell(&Type::Scalar { scalar: *scalar }),
                in_order(*unordered)
            ),
            Role::Texture { binding, texture } => format!("binding {binding}: {texture:?}"),
            Role::StorageTexture {
                binding,
                format,
                dimensions,
                array,
                access,
            } => {
                let does = match (access.reads(), access.writes()) {
                    (true, true) => "read and written",
                    (true, false) => "read",
                    _ => "written",
                };
                let layers = if *array { ", layers of" } else { "" };
                let volume = if *dimensions == 3 {
                    ", a volume of"
                } else {
                    ""
                };
                format!(
                    "binding {binding}: texture{layers}{volume} {}, {does}",
                    format.name()
                )
            }
            Role::Sampler { binding, sampler } => {
                let does = match sampler {
                    SamplerKind::Filtering => "",
                    SamplerKind::NonFiltering => " that does not filter",
                    SamplerKind::Comparison => " that compares",
                };
                format!("binding {binding}: sampler{does}")
            }
            Role::Constant {
                id,
                scalar,
                default,
            } => format!(
                "constant {id}, {}, default {}",
                scalar.name(),
                ConstantValue::of_word(*scalar, *default)
            ),
            Role::Attribute { location, ty } => format!("attribute {location}: {}", spell(ty)),
            Role::Varying {
                location,
                ty,
                interpolation,
            } => varying(*location, ty, *interpolation),
            Role::Index if kernel.is_fragment_form() => "the pixel".into(),
            Role::Index => "the invocation's index".into(),
            Role::BuiltIn { built_in } => match built_in {
                BuiltIn::LocalId => "the invocation's place in its workgroup",
                BuiltIn::LocalIndex => "the invocation's number in its workgroup",
                BuiltIn::GroupId => "the workgroup",
                BuiltIn::GroupCount => "how many workgroups there are",
                BuiltIn::SubgroupSize => "how many invocations its subgroup has",
                BuiltIn::SubgroupInvocationId => "the invocation's number in its subgroup",
                BuiltIn::SubgroupId => "the subgroup's number in its workgroup",
                BuiltIn::SubgroupCount => "how many subgroups its workgroup has",
                BuiltIn::VertexIndex => "the vertex's number",
                BuiltIn::InstanceIndex => "the instance's number",
                BuiltIn::FragCoord => "where the fragment is, and its depth",
                BuiltIn::FrontFacing => "whether the primitive faces the viewer",
                BuiltIn::SampleIndex => "which sample of the pixel",
                BuiltIn::SampleMask => "which samples of the pixel the primitive covers",
                BuiltIn::PrimitiveIndex => "the primitive's number",
            }
            .into(),
            Role::Shared {
                layout,
                length,
                atomic,
            } => format!(
                "workgroup memory: {length} of {}{}",
                shape(&layout.name, layout),
                if *atomic { ", atomic" } else { "" }
            ),
        };
        say!("    {:<12} {what}", p.name);
    }
    for o in &kernel.outputs {
        let what = match o {
            Output::Buffer { binding, layout } => {
                format!("binding {binding}: {}", shape(&layout.name, layout))
            }
            Output::Texture {
                binding, format, ..
            } => {
                format!("binding {binding}: texture {}", format.name())
            }
            Output::Position => "clip-space position".into(),
            Output::Depth => "depth".into(),
            Output::SampleMask => "which samples are written".into(),
            Output::ClipDistances { ty } => format!("clip distances: {}", spell(ty)),
            Output::SecondSource { ty } => format!("second source of target 0: {}", spell(ty)),
            Output::Varying {
                location,
                ty,
                interpolation,
            } => varying(*location, ty, *interpolation),
            Output::Target { location, ty } => format!("target {location}: {}", spell(ty)),
        };
        say!("    {:<12} {what}", "output");
    }
}

fn varying(location: u32, ty: &Type, interpolation: Interpolation) -> String {
    let how = match interpolation {
        Interpolation::Flat => ", not interpolated".into(),
        it => it
            .words()
            .map_or_else(String::new, |words| format!(", {words}")),
    };
    format!("varying {location}: {}{how}", spell(ty))
}

const fn in_order(unordered: bool) -> &'static str {
    if unordered { ", unordered" } else { "" }
}

fn shape(name: &str, layout: &hankel_dsl::native::describe::Layout) -> String {
    let fields: Vec<String> = layout
        .fields
        .iter()
        .filter(|f| !f.name.is_empty())
        .map(|f| format!("{} {} @{}", f.name, spell(&f.ty), f.offset))
        .collect();
    if fields.is_empty() {
        name.to_owned()
    } else {
        format!("{name} {{ {} }}, {} bytes", fields.join(", "), layout.size)
    }
}

fn spell(ty: &Type) -> String {
    match ty {
        Type::Scalar { scalar } => format!("{scalar:?}").to_lowercase(),
        Type::Vector { scalar, size } => format!("{scalar:?}x{size}").to_lowercase(),
        Type::Array {
            element, length, ..
        } => format!("[{}; {length}]", spell(element)),
        Type::Struct { layout } => layout.name.clone(),
    }
}
