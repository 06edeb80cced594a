//! Whether a pass fits its kernels.

use std::fmt;

use hankel_dsl::glam::{Vec3, Vec4};
use hankel_dsl::native::describe::{Domain, Kernel, Layout, Output, Role, Scalar, Stage, Type};
use hankel_dsl::native::layout::Element;
use hankel_host::device::extent::{self, Extent};
use hankel_host::device::slots::{self, Given, Slot, Use};
use hankel_host::device::{Blend, DeviceError, TextureShape};
use hankel_shadows::depth::Transform;

use super::{Argument, Call, Graph, Handle, Origin, Result, Shape, Surfaces};

/// Why a pass was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GraphError {
    /// Its kernel.
    #[error("pass `{pass}`, kernel `{kernel}`: {problem}")]
    Kernel {
        /// The pass.
        pass: String,
        /// The kernel.
        kernel: String,
        /// What does not fit, and what would.
        problem: String,
    },
    /// An argument of its kernel.
    #[error("pass `{pass}`, kernel `{kernel}`, `{parameter}`: {problem}")]
    Argument {
        /// The pass.
        pass: String,
        /// The kernel.
        kernel: String,
        /// The parameter, or `output`.
        parameter: String,
        /// What does not fit, and what would.
        problem: String,
    },
    /// What it draws, or draws into.
    #[error("pass `{pass}`: {problem}")]
    Draw {
        /// The pass.
        pass: String,
        /// What does not fit, and what would.
        problem: String,
    },
    /// Textures that are to be the mip levels of one.
    #[error("pass `{pass}`, level {level}: {problem}")]
    Levels {
        /// The pass.
        pass: String,
        /// The level, from 0.
        level: usize,
        /// What does not fit, and what would.
        problem: String,
    },
    /// A light that the scene's technique, or its medium, is not for.
    #[error("light {number}, `position`: {problem}")]
    Light {
        /// Which of the scene's lights, from 1.
        number: usize,
        /// What to do.
        problem: String,
    },
    /// A texture that cannot hold what it is filled with.
    #[error("`{value}`: its texels are {format}, which are integers: make it with `cleared`")]
    Fill {
        /// The texture.
        value: String,
        /// Its format.
        format: String,
    },
}

/// Names of a pass and its kernel, for messages.
#[derive(Clone, Copy)]
pub(super) struct Place<'a> {
    pub pass: &'a str,
    pub kernel: &'a str,
}

impl Place<'_> {
    pub fn kernel(self, problem: impl Into<String>) -> GraphError {
        GraphError::Kernel {
            pass: self.pass.into(),
            kernel: self.kernel.into(),
            problem: problem.into(),
        }
    }

    pub fn argument(self, parameter: &str, problem: impl Into<String>) -> GraphError {
        GraphError::Argument {
            pass: self.pass.into(),
            kernel: self.kernel.into(),
            parameter: parameter.into(),
            problem: problem.into(),
        }
    }

    /// The devices' rules, in this module's words.
    fn device(self, slots: &[Slot<'_>], error: DeviceError) -> GraphError {
        match error {
            DeviceError::Argument {
                argument, problem, ..
            } => {
                let slot = slots.iter().find(|s| s.to_string() == argument);
                self.argument(slot.map_or(argument.as_str(), |s| &s.name), problem)
            }
            DeviceError::Constants { problem, .. } | DeviceError::Stage { problem, .. } => {
                self.kernel(problem)
            }
            other => self.kernel(other.to_string()),
        }
    }
}

/// Names with commas.
pub(super) fn listed<T: fmt::Display>(names: impl IntoIterator<Item = T>) -> String {
    let names: Vec<String> = names.into_iter().map(|n| format!("`{n}`")).collect();
    if names.is_empty() {
        "nothing".into()
    } else {
        names.join(", ")
    }
}

pub(super) const fn stage_name(stage: &Stage) -> &'static str {
    match stage {
        Stage::Compute { .. } => "compute",
        Stage::Vertex => "vertex",
        Stage::Fragment => "fragment",
    }
}

/// The type of an element.
fn element(layout: &Layout) -> Type {
    match layout.fields.as_slice() {
        [field] if field.name.is_empty() => field.ty.clone(),
        _ => Type::Struct {
            layout: layout.clone(),
        },
    }
}

/// Whether both are the same in memory, and called the same. What their numbers are like may be
/// said in different places.
fn same_type(a: &Type, b: &Type) -> bool {
    match (a, b) {
        (Type::Struct { layout: a }, Type::Struct { layout: b }) => same(a, b),
        (
            Type::Array {
                element: a,
                length,
                stride,
            },
            Type::Array {
                element: b,
                length: other_length,
                stride: other_stride,
            },
        ) => (length, stride) == (other_length, other_stride) && same_type(a, b),
        _ => a == b,
    }
}

fn same(a: &Layout, b: &Layout) -> bool {
    (&a.name, a.size, a.fields.len()) == (&b.name, b.size, b.fields.len())
        && a.fields.iter().zip(&b.fields).all(|(a, b)| {
            (&a.name, a.offset, a.size) == (&b.name, b.offset, b.size) && same_type(&a.ty, &b.ty)
        })
}

impl Graph {
    /// The number of a kernel.
    pub(super) fn find(&self, place: Place<'_>) -> Result<usize> {
        let all = || self.kernels.iter().map(|e| &e.kernel);
        if let Some(i) = all().position(|k| k.name == place.kernel) {
            return Ok(i);
        }
        let variants: Vec<&str> = all()
            .filter(|k| k.function == place.kernel && !k.is_fragment_form())
            .map(|k| k.name.as_str())
            .collect();
        let help = if variants.is_empty() {
            let close = |k: &&Kernel| {
                let (a, b) = (k.name.as_str(), place.kernel);
                let head = a.bytes().zip(b.bytes()).take_while(|(a, b)| a == b).count();
                head * 2 > a.len().max(b.len())
            };
            let close: Vec<&str> = all().filter(close).map(|k| k.name.as_str()).collect();
            match close.as_slice() {
                [] => "list it in `kernels![…]` of its crate".into(),
                names => format!("did you mean {}?", listed(names)),
            }
        } else {
            format!(
                "that function makes {}: name one of them",
                listed(&variants)
            )
        };
        Err(place.kernel(format!("there is no such kernel; {help}")))
    }

    /// The value of a handle that a pass wants to read now.
    pub(super) fn current(
        &self,
        handle: Handle,
        refuse: impl Fn(String) -> GraphError,
    ) -> Result<&super::Value> {
        let Some(value) = self.value(handle) else {
            return Err(refuse(
                "the handle belongs to another graph: use what this graph's passes returned".into(),
            ));
        };
        if let Some(pass) = value.changed_by {
            return Err(refuse(format!(
                "pass `{}` has changed `{}` in its place: use the handle that it returned",
                self.passes[pass].label, value.label
            )));
        }
        Ok(value)
    }

    /// What holds mip levels, if they can be those of one texture.
    pub(super) fn check_levels(&self, pass: &str, levels: &[Handle]) -> Result<TextureShape> {
        let mut whole: Option<TextureShape> = None;
        for (level, handle) in levels.iter().enumerate() {
            let refuse = |problem: String| GraphError::Levels {
                pass: pass.into(),
                level,
                problem,
            };
            let value = self.current(*handle, refuse)?;
            let Shape::Texture(shape) = value.shape else {
                return Err(refuse(format!(
                    "`{}` is a buffer: give textures",
                    value.label
                )));
            };
            let whole = *whole.get_or_insert(shape);
            let wanted = TextureShape {
                size: whole.level_size(level as u32),
                ..TextureShape::d2(1, 1, whole.format.texel())
            };
            if shape != wanted {
                let [width, height, _] = wanted.size;
                return Err(refuse(format!(
                    "`{}` is {:?} texels of {} in {} dimensions, with {} levels, {} layers and {} samples, but \
                     {width}x{height} of {} are wanted, with one of each",
                    value.label,
                    shape.size,
                    shape.format.name(),
                    shape.dimensions,
                    shape.levels,
                    shape.layers,
                    shape.samples,
                    wanted.format.name(),
                )));
            }
        }
        let Some(whole) = whole else {
            return Err(GraphError::Levels {
                pass: pass.into(),
                level: 0,
                problem: "it is not given: a texture has one level at least".into(),
            });
        };
        if levels.len() > whole.most_levels() as usize {
            return Err(GraphError::Levels {
                pass: pass.into(),
                level: levels.len() - 1,
                problem: format!(
                    "the level before has one texel: {} are all",
                    whole.most_levels()
                ),
            });
        }
        Ok(whole.with_levels(levels.len() as u32))
    }

    /// The value that was first in the place of another: the same for all that share a place.
    pub(crate) fn root(&self, mut handle: Handle) -> Handle {
        while let Origin::Changed { from, .. } = self.values[handle.at()].origin {
            handle = from;
        }
        handle
    }

    /// What the devices' checks look at.
    fn seen<'a>(&'a self, slot: &Slot<'_>, argument: &Argument) -> Given<'a> {
        match argument {
            Argument::Sampler(sampler) => Given::Sampler(*sampler),
            Argument::Value(handle) => {
                let value = &self.values[handle.at()];
                match (&value.origin, &value.shape) {
                    (Origin::Given { bytes, .. }, _) if !slot.role.is_written() => {
                        Given::Bytes(bytes)
                    }
                    (_, Shape::Buffer { bytes, .. }) => Given::Buffer {
                        id: self.root(*handle).index,
                        bytes: *bytes,
                    },
                    (_, Shape::Texture(shape)) => Given::Texture {
                        id: self.root(*handle).index,
                        shape: *shape,
                    },
                }
            }
        }
    }

    /// A call's arguments as the devices' rules take them.
    fn all_seen(&self, slots: &[Slot<'_>], call: &Call) -> Vec<Given<'_>> {
        let pairs = slots.iter().zip(&call.args);
        pairs.map(|(slot, arg)| self.seen(slot, arg)).collect()
    }

    /// How far a compute kernel runs; none of a pass that was refused.
    fn extent(&self, call: &Call) -> Option<Extent> {
        let kernel = &self.kernels[call.kernel].kernel;
        let slots = slots::slots(kernel);
        extent::extent(kernel, &slots, &self.all_seen(&slots, call)).ok()
    }

    /// How many invocations of a compute kernel run along x, y, z, with what is given at first; at most, where a
    /// buffer says it.
    pub(crate) fn invocations(&self, call: &Call) -> [u32; 3] {
        match self.extent(call) {
            Some(Extent::Known(extent)) => extent,
            _ => call.most.unwrap_or_default(),
        }
    }

    /// Where a buffer that a pass writes says how far a compute kernel runs: it, where its numbers begin in bytes,
    /// and how many they are.
    pub(crate) fn workgroups_from(&self, call: &Call) -> Option<(Handle, u32, u32)> {
        let Some(Extent::InBuffer {
            slot,
            offset,
            dimensions,
        }) = self.extent(call)
        else {
            return None;
        };
        match call.args[slot] {
            Argument::Value(handle) => Some((handle, offset, dimensions)),
            Argument::Sampler(_) => None,
        }
    }

    /// Checks a compute kernel's call, or a stage's.
    pub(super) fn check(&self, place: Place<'_>, call: &Call) -> Result<()> {
        let kernel = &self.kernels[call.kernel].kernel;
        let is_compute = matches!(kernel.stage, Stage::Compute { .. });
        let slots = if is_compute {
            slots::slots(kernel)
        } else {
            slots::drawn_slots(kernel)
        };
        let given = self.all_seen(&slots, call);
        for (slot, argument) in slots.iter().zip(&call.args) {
            self.check_type(place, slot, argument)?;
        }
        slots::check(kernel, &slots, &given).map_err(|e| place.device(&slots, e))?;
        if let Stage::Compute { threads, .. } = kernel.stage {
            let extent = extent::extent(kernel, &slots, &given);
            let extent = extent.map_err(|e| place.device(&slots, e))?;
            check_most(place, &slots, extent, call.most, threads)?;
        }
        Ok(())
    }

    /// Whether the elements of a buffer are what the kernel takes them for.
    fn check_type(&self, place: Place<'_>, slot: &Slot<'_>, argument: &Argument) -> Result<()> {
        let Argument::Value(handle) = argument else {
            return Ok(());
        };
        if slot.push {
            let problem = "a frame's values are in buffers: take a `#[uniform]`, not a `#[push]`";
            return Err(place.argument(&slot.name, problem));
        }
        let value = &self.values[handle.at()];
        let Shape::Buffer { layout, .. } = &value.shape else {
            return Ok(());
        };
        let fits = match slot.role {
            Use::Uniform(wanted)
            | Use::Element(wanted)
            | Use::Storage(wanted)
            | Use::ElementMut(wanted)
            | Use::Output(wanted) => same(layout, wanted),
            Use::StorageMut { layout: wanted, .. } => same(layout, wanted),
            Use::Attribute(_, wanted) => same_type(&element(layout), wanted),
            Use::Atomic { scalar, .. } => is_all(&element(layout), scalar),
            _ => return Ok(()),
        };
        if fits {
            return Ok(());
        }
        let wanted = match slot.role {
            Use::Uniform(l) | Use::Element(l) | Use::Storage(l) | Use::ElementMut(l) => {
                l.name.clone()
            }
            Use::StorageMut { layout, .. } => layout.name.clone(),
            Use::Attribute(_, ty) => type_name(ty),
            Use::Atomic { scalar, .. } => type_name(&Type::Scalar { scalar }),
            _ => "something else".into(),
        };
        let has = &layout.name;
        let problem = if *has == wanted {
            format!(
                "`{}` holds another {has} than the kernel takes: its fields differ",
                value.label
            )
        } else {
            format!(
                "`{}` holds {has}, but the kernel takes {wanted}",
                value.label
            )
        };
        Err(place.argument(&slot.name, problem))
    }

    /// What a pass draws: positions, indices and transform.
    pub(super) fn check_surfaces(&self, pass: &str, surfaces: &Surfaces) -> Result<()> {
        let refuse = |what: &str, problem: String| GraphError::Draw {
            pass: pass.into(),
            problem: format!("its {what}: {problem}"),
        };
        let wanted = [
            ("positions", surfaces.positions, Vec3::layout()),
            ("indices", surfaces.indices, u32::layout()),
            (
                "clip_from_world",
                surfaces.clip_from_world,
                Transform::layout(),
            ),
        ];
        for (what, handle, wanted) in wanted {
            let value = self.current(handle, |problem| refuse(what, problem))?;
            match &value.shape {
                Shape::Buffer { layout, bytes } if *layout == wanted => {
                    if what == "indices" && !bytes.is_multiple_of(12) {
                        let problem = format!("{} of them are no triangles", bytes / 4);
                        return Err(refuse(what, problem));
                    }
                }
                _ => {
                    let problem = format!("`{}` is not a buffer of {}", value.label, wanted.name);
                    return Err(refuse(what, problem));
                }
            }
        }
        Ok(())
    }

    /// Whether devices can blend into a target of so many samples, and whether the depth before which that is done
    /// is one of its own samples.
    pub(super) fn check_blend(
        &self,
        pass: &str,
        blend: Blend,
        before: Option<Handle>,
        target: TextureShape,
        samples: u32,
    ) -> Result<()> {
        let refuse = |problem: String| GraphError::Draw {
            pass: pass.into(),
            problem,
        };
        if blend != Blend::Off && !target.format.is_blendable() {
            return Err(refuse(format!(
                "its colour is {}, which no device can blend: draw into floats or normalised integers, or leave \
                 `blend` out",
                target.format.name()
            )));
        }
        if blend == Blend::Second {
            return Err(refuse(
                "frames blend one colour, and this takes a second source".into(),
            ));
        }
        let Some(before) = before else {
            return Ok(());
        };
        if blend == Blend::Off {
            return Err(refuse(
                "`before` is for what is blended: name a mode with `blend`, or leave it out".into(),
            ));
        }
        let value = self.current(before, |problem| refuse(format!("`before`: {problem}")))?;
        let [width, height, _] = target.size;
        let wanted = TextureShape::depth(width, height).multisampled(samples);
        match &value.shape {
            Shape::Texture(shape) if *shape == wanted => Ok(()),
            Shape::Texture(shape) => Err(refuse(format!(
                "`before`: `{}` is {}x{} texels of {} with {} samples, but depth of {width}x{height} with \
                 {samples} is wanted",
                value.label,
                shape.size[0],
                shape.size[1],
                shape.format.name(),
                shape.samples,
            ))),
            Shape::Buffer { .. } => Err(refuse(format!(
                "`before`: `{}` is a buffer, but depth is wanted",
                value.label
            ))),
        }
    }

    /// Each vertex has its attributes.
    pub(super) fn check_attributes(
        &self,
        place: Place<'_>,
        call: &Call,
        surfaces: &Surfaces,
    ) -> Result<()> {
        let bytes = |handle: Handle| self.values[handle.at()].shape.bytes();
        let vertices = bytes(surfaces.positions) / size_of::<Vec3>();
        let kernel = &self.kernels[call.kernel].kernel;
        for (slot, argument) in slots::drawn_slots(kernel).iter().zip(&call.args) {
            let (Use::Attribute(_, ty), Argument::Value(handle)) = (slot.role, argument) else {
                continue;
            };
            let elements = bytes(*handle) / slots::type_bytes(ty).max(1);
            if elements != vertices {
                return Err(place.argument(
                    &slot.name,
                    format!("it has {elements} elements, but there are {vertices} vertices"),
                ));
            }
        }
        Ok(())
    }

    /// The vertex stage hands on what the fragment stage takes, and that gives one colour.
    pub(super) fn check_stages(
        &self,
        place: Place<'_>,
        vertex: &Call,
        kernel: usize,
    ) -> Result<()> {
        let vertex = &self.kernels[vertex.kernel].kernel;
        let fragment = &self.kernels[kernel].kernel;
        let clips = |it: &Output| matches!(it, Output::ClipDistances { .. });
        if vertex.outputs.iter().any(clips) {
            return Err(place.kernel(format!(
                "frames clip at the view alone, and vertex kernel `{}` returns clip distances",
                vertex.name
            )));
        }
        for param in &fragment.params {
            let Role::Varying {
                location,
                ty,
                interpolation,
            } = &param.role
            else {
                continue;
            };
            let is_float = match ty {
                Type::Scalar { scalar } | Type::Vector { scalar, .. } => *scalar == Scalar::F32,
                _ => false,
            };
            if !interpolation.is_usual() || !is_float {
                let problem = "frames interpolate what goes from stage to stage at the centre of each \
                               pixel, in perspective: take an f32 or a vector of them as it is";
                return Err(place.argument(&param.name, problem));
            }
            let handed = vertex.outputs.iter().find_map(|o| match o {
                Output::Varying {
                    location: l, ty, ..
                } if l == location => Some(ty),
                _ => None,
            });
            let problem = match handed {
                Some(handed) if handed == ty => continue,
                Some(handed) => format!(
                    "vertex kernel `{}` hands on {} at location {location}, but this is {}",
                    vertex.name,
                    type_name(handed),
                    type_name(ty)
                ),
                None => format!(
                    "vertex kernel `{}` hands on nothing at location {location}",
                    vertex.name
                ),
            };
            return Err(place.argument(&param.name, problem));
        }
        let colour = Output::Target {
            location: 0,
            ty: element(&Vec4::layout()),
        };
        if fragment.outputs != [colour] {
            return Err(place.kernel("it must return one colour, a `Vec4`, and nothing else"));
        }
        Ok(())
    }
}

/// Whether a constant may have this value.
pub(super) fn allowed(domain: Option<&Domain>, value: f64) -> std::result::Result<(), String> {
    match domain {
        Some(Domain::Values { values }) if !values.contains(&value) => {
            Err(format!("it is {value}, but must be one of {values:?}"))
        }
        Some(Domain::Range { least, most }) if !(*least..=*most).contains(&value) => {
            Err(format!("it is {value}, but must be from {least} to {most}"))
        }
        _ => Ok(()),
    }
}

/// Whether it is said how far a kernel runs at most where a buffer says how far, and only there; no farther
/// than every device can.
fn check_most(
    place: Place<'_>,
    slots: &[Slot<'_>],
    extent: Extent,
    most: Option<[u32; 3]>,
    threads: [u32; 3],
) -> Result<()> {
    let most = match (extent, most) {
        (Extent::Known(_), None) => return Ok(()),
        (Extent::Known(_), Some(_)) => {
            return Err(place.kernel("it is known how far it runs: leave `at_most` out"));
        }
        (Extent::InBuffer { slot, .. }, None) => {
            return Err(place.argument(
                &slots[slot].name,
                "a pass writes how far the kernel runs: say how far at most with `at_most`",
            ));
        }
        (Extent::InBuffer { .. }, Some(most)) => most,
    };
    let groups = [0, 1, 2].map(|i| most[i].div_ceil(threads[i].max(1)));
    if groups.iter().any(|n| *n > WORKGROUPS) {
        return Err(place.kernel(format!(
            "`at_most` is {most:?} invocations, which are {groups:?} workgroups: every device runs \
             {WORKGROUPS} along an axis, and not all run more"
        )));
    }
    Ok(())
}

/// Workgroups along an axis that every device runs (WebGPU's `maxComputeWorkgroupsPerDimension`).
const WORKGROUPS: u32 = 65535;

/// Whether a type is made of such numbers alone.
fn is_all(ty: &Type, wanted: Scalar) -> bool {
    match ty {
        Type::Scalar { scalar } | Type::Vector { scalar, .. } => *scalar == wanted,
        Type::Array { element, .. } => is_all(element, wanted),
        Type::Struct { layout } => layout.fields.iter().all(|f| is_all(&f.ty, wanted)),
    }
}

/// A type's name for messages.
fn type_name(ty: &Type) -> String {
    let scalar = |s| format!("{s:?}").to_lowercase();
    match ty {
        Type::Scalar { scalar: s } => scalar(s),
        Type::Vector { scalar: s, size } => format!("{}x{size}", scalar(s)),
        Type::Array {
            element, length, ..
        } => format!("{}[{length}]", type_name(element)),
        Type::Struct { layout } => layout.name.clone(),
    }
}
