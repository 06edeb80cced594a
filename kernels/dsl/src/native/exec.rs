//! What `#[kernel]` expands to on the host: taking a call's arguments apart, and the loops over
//! invocations.

use core::any::Any;
use core::ops::Range;
use core::panic::Location;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::string::{String, ToString};
use std::{format, vec};

use bytemuck::Pod;
use glam::{IVec4, UVec2, UVec3, UVec4, Vec4};
use rayon::prelude::*;

use super::call::{Arg, Call, CallError, Mode, Sampler, TextureMut, TextureRef, texture_bytes};
use super::describe::{self, SamplerKind, TexelAccess, TexelFormat, TextureKind};
use super::fragment;
use super::lanes::{self, Scalar, Work, on_lanes};
use super::layout::Lane;
use super::sanitize::{self, Access, Space};
use crate::math::Elementary;
use crate::{Real, Texel};

/// Invocations that a thread takes at once.
const CHUNK: usize = 4096;

/// Stands in for the native code of an entry point in a plug-in that was built without it.
pub fn not_built(_: &mut Call<'_>) -> Result<(), CallError> {
    Err(CallError::NotBuilt)
}

/// The arguments of a call, taken in order.
pub struct Args<'a> {
    args: vec::IntoIter<Arg<'a>>,
    constants: vec::IntoIter<u32>,
    /// Textures that were taken.
    textures: u8,
}

impl<'a> Args<'a> {
    /// Takes the arguments out of `call`, which must have as many as said.
    pub fn take(call: &mut Call<'a>, args: usize, constants: usize) -> Result<Self, CallError> {
        for (expected, got) in [(args, call.args.len()), (constants, call.constants.len())] {
            if expected != got {
                return Err(CallError::Count { expected, got });
            }
        }
        Ok(Self {
            args: core::mem::take(&mut call.args).into_iter(),
            constants: core::mem::take(&mut call.constants).into_iter(),
            textures: 0,
        })
    }

    /// A specialisation constant.
    pub fn constant(&mut self) -> u32 {
        self.constants.next().unwrap_or_default()
    }

    /// A read-only buffer.
    pub fn slice<T: Pod>(&mut self, name: &'static str) -> Result<&'a [T], CallError> {
        match self.args.next() {
            Some(Arg::Bytes(bytes)) => cast(name, bytes),
            Some(Arg::BytesMut(bytes)) => cast(name, bytes),
            _ => Err(CallError::Kind {
                name,
                expected: "a buffer",
            }),
        }
    }

    /// A uniform value.
    pub fn uniform<T: Pod>(&mut self, name: &'static str) -> Result<&'a T, CallError> {
        match self.slice(name)? {
            [value] => Ok(value),
            slice => Err(CallError::Size {
                name,
                bytes: size_of_val(slice),
                size: size_of::<T>(),
            }),
        }
    }

    /// A buffer to be written.
    pub fn slice_mut<T: Pod>(&mut self, name: &'static str) -> Result<&'a mut [T], CallError> {
        match self.args.next() {
            Some(Arg::BytesMut(bytes)) => {
                let len = bytes.len();
                bytemuck::try_cast_slice_mut(bytes).map_err(|_| CallError::Size {
                    name,
                    bytes: len,
                    size: size_of::<T>(),
                })
            }
            _ => Err(CallError::Kind {
                name,
                expected: "a buffer that can be written",
            }),
        }
    }

    /// The words of a buffer that invocations write where they like. Its elements have `size`
    /// bytes.
    pub fn words(&mut self, name: &'static str, size: usize) -> Result<&'a [AtomicU32], CallError> {
        let words = match self.args.next() {
            Some(Arg::BytesMut(bytes)) => shared_words(name, bytes, size)?,
            _ => {
                return Err(CallError::Kind {
                    name,
                    expected: "a buffer that can be written",
                });
            }
        };
        if size_of_val(words).is_multiple_of(size) {
            sanitize::name(name, words, size);
            Ok(words)
        } else {
            Err(CallError::Size {
                name,
                bytes: size_of_val(words),
                size,
            })
        }
    }

    /// What an image pass writes: a storage texture of this format; without one a render target. That is a texture
    /// of any format of the kernel's channels, or the fragments of a run, row by row, as 32-bit numbers.
    pub fn image<T: Texel<Channels: Channels>>(
        &mut self,
        name: &'static str,
        format: Option<TexelFormat>,
    ) -> Result<TextureMut<'a>, CallError> {
        if let Some(format) = format {
            return self.texture_mut(name, format);
        }
        match self.args.next() {
            Some(Arg::TextureMut(t)) => {
                let wanted = <T::Channels as Channels>::NUMBERS;
                if t.format.numbers() != wanted {
                    let problem = format!(
                        "it is {}, the kernel draws {} channels",
                        t.format.name(),
                        wanted.word()
                    );
                    return Err(CallError::Texture { name, problem });
                }
                check_size(name, t.size, t.format, t.bytes.len())?;
                Ok(t)
            }
            Some(Arg::BytesMut(bytes)) => {
                let format = target_format::<T>();
                let count = bytes.len() / format.bytes();
                if count * format.bytes() != bytes.len() {
                    return Err(CallError::Size {
                        name,
                        bytes: bytes.len(),
                        size: format.bytes(),
                    });
                }
                let rows = (count as u32).div_ceil(fragment::COLUMNS);
                Ok(TextureMut {
                    size: [fragment::COLUMNS, rows, 1],
                    format,
                    bytes,
                })
            }
            _ => Err(CallError::Kind {
                name,
                expected: "a texture or a buffer that can be written",
            }),
        }
    }

    /// [`Args::image`] whose texels any invocation writes.
    pub fn image_texels<T: Texel<Channels: Channels>>(
        &mut self,
        name: &'static str,
        format: Option<TexelFormat>,
    ) -> Result<Texels<'a>, CallError> {
        let TextureMut {
            size,
            format,
            bytes,
        } = self.image::<T>(name, format)?;
        let words = shared_words(name, bytes, format.bytes())?;
        sanitize::name(name, words, format.bytes());
        Ok(Texels {
            size,
            format,
            memory: Memory::Shared(words),
        })
    }

    /// The texels of a storage texture.
    pub fn texels(
        &mut self,
        name: &'static str,
        format: TexelFormat,
        access: TexelAccess,
        array: bool,
    ) -> Result<Texels<'a>, CallError> {
        if !access.writes() {
            return self.constant_texels(name, format, array);
        }
        let TextureMut {
            size,
            format,
            bytes,
        } = self.texture_mut(name, format)?;
        let words = shared_words(name, bytes, format.bytes())?;
        sanitize::name(name, words, format.bytes());
        Ok(Texels {
            size,
            format,
            memory: Memory::Shared(words),
        })
    }

    /// The texels of a storage texture that is only read.
    fn constant_texels(
        &mut self,
        name: &'static str,
        format: TexelFormat,
        array: bool,
    ) -> Result<Texels<'a>, CallError> {
        let Some(Arg::Texture(t)) = self.args.next() else {
            return Err(CallError::Kind {
                name,
                expected: "a texture",
            });
        };
        let problem = if t.format != format {
            format!(
                "it is {}, the kernel reads {}",
                t.format.name(),
                format.name()
            )
        } else if t.levels != 1 || t.samples != 1 {
            "it has several levels or samples, but the kernel reads one".into()
        } else if t.layers != 1 && !array {
            "it has several layers, but the kernel reads one".into()
        } else {
            let [width, height, depth] = t.size;
            // One of them is 1.
            let size = [width, height, depth.saturating_mul(t.layers)];
            check_size(name, size, format, t.bytes.len())?;
            return Ok(Texels {
                size,
                format,
                memory: Memory::Constant(t.bytes),
            });
        };
        Err(CallError::Texture { name, problem })
    }

    /// A texture to be read.
    pub fn texture(
        &mut self,
        name: &'static str,
        kind: TextureKind,
    ) -> Result<TextureRef<'a>, CallError> {
        let Some(Arg::Texture(t)) = self.args.next() else {
            return Err(CallError::Kind {
                name,
                expected: "a texture",
            });
        };
        let beyond = &t.size[kind.dimensions() as usize..];
        if kind.is_multisampled() != (t.samples > 1)
            || t.samples == 0
            || beyond.iter().any(|n| *n != 1)
        {
            let problem = format!(
                "{}x{}x{} texels with {} samples are of the wrong shape",
                t.size[0], t.size[1], t.size[2], t.samples
            );
            return Err(CallError::Texture { name, problem });
        }
        if t.format.numbers() != kind.channels() {
            let problem = format!(
                "it is {}, the kernel reads {} channels",
                t.format.name(),
                kind.channels().word()
            );
            return Err(CallError::Texture { name, problem });
        }
        if let Some(problem) = kind.misfit(t.layers) {
            return Err(CallError::Texture { name, problem });
        }
        if !kind.has_levels() && t.levels != 1 {
            let problem = format!("it has {} mip levels, not 1", t.levels);
            return Err(CallError::Texture { name, problem });
        }
        let expected = texture_bytes(t.size, t.levels, t.layers, t.samples, t.format);
        if expected == 0 || expected != t.bytes.len() {
            let problem = format!(
                "{} bytes were given, its size and format need {expected}",
                t.bytes.len()
            );
            return Err(CallError::Texture { name, problem });
        }
        let number = self.textures;
        self.textures = number.saturating_add(1);
        Ok(TextureRef { number, ..t })
    }

    /// A texture to be written.
    pub fn texture_mut(
        &mut self,
        name: &'static str,
        format: TexelFormat,
    ) -> Result<TextureMut<'a>, CallError> {
        let Some(Arg::TextureMut(t)) = self.args.next() else {
            return Err(CallError::Kind {
                name,
                expected: "a texture that can be written",
            });
        };
        if t.format != format {
            let problem = format!(
                "it is {}, the kernel writes {}",
                t.format.name(),
                format.name()
            );
            return Err(CallError::Texture { name, problem });
        }
        check_size(name, t.size, t.format, t.bytes.len())?;
        Ok(t)
    }

    /// A sampler.
    pub fn sampler(&mut self, name: &'static str, kind: SamplerKind) -> Result<Sampler, CallError> {
        match self.args.next() {
            Some(Arg::Sampler(s)) if kind.fits(&s) => Ok(s),
            _ => Err(CallError::Kind {
                name,
                expected: kind.wanted(),
            }),
        }
    }
}

/// Exclusive bytes as words that threads share.
fn shared_words<'a>(
    name: &'static str,
    bytes: &'a mut [u8],
    size: usize,
) -> Result<&'a [AtomicU32], CallError> {
    let len = bytes.len();
    let words: &mut [u32] = bytemuck::try_cast_slice_mut(bytes).map_err(|_| CallError::Size {
        name,
        bytes: len,
        size,
    })?;
    // SAFETY: an `AtomicU32` has size and alignment of a `u32`, and the words are borrowed
    // exclusively for as long as they are shared.
    Ok(unsafe { core::slice::from_raw_parts(words.as_mut_ptr().cast::<AtomicU32>(), words.len()) })
}

/// A texture of which any texel may be read and written at any time.
#[derive(Clone, Copy)]
pub struct Texels<'a> {
    size: [u32; 3],
    format: TexelFormat,
    memory: Memory<'a>,
}

/// Where the texels of a storage texture lie.
#[derive(Clone, Copy)]
enum Memory<'a> {
    /// Written by anybody at any time.
    Shared(&'a [AtomicU32]),
    /// Only read.
    Constant(&'a [u8]),
}

impl Texels<'_> {
    /// Width, height, depth or layers.
    pub fn size(self) -> [u32; 3] {
        self.size
    }

    /// How many texels there are: of the fragments of a run, the last row may not be whole.
    pub fn count(self) -> usize {
        let bytes = match self.memory {
            Memory::Shared(words) => size_of_val(words),
            Memory::Constant(bytes) => bytes.len(),
        };
        bytes / self.format.bytes()
    }

    /// Writes the texel at `at`, which lies inside.
    #[inline]
    #[track_caller]
    pub fn store<T: Texel<Channels: Channels>>(self, at: UVec3, texel: T) {
        let mut texel_words = [0_u32; 4];
        let bytes = &mut bytemuck::cast_slice_mut(&mut texel_words)[..self.format.bytes()];
        texel.channels().store(self.format, bytes);
        let Memory::Shared(words) = self.memory else {
            // Its type has no `store`.
            return;
        };
        let slots = &words[self.words_of(at)];
        sanitize::look(Space::Texture, Access::Write, slots, Location::caller());
        for (word, slot) in texel_words.iter().zip(slots) {
            slot.store(*word, Relaxed);
        }
    }

    /// The texel at `at`, which lies inside.
    #[inline]
    #[track_caller]
    pub fn load<T: Texel<Channels: Channels>>(self, at: UVec3) -> T {
        let range = self.words_of(at);
        let words = match self.memory {
            Memory::Shared(words) => words,
            Memory::Constant(bytes) => {
                let own = &bytes[4 * range.start..4 * range.end];
                return T::of(Channels::load(self.format, own));
            }
        };
        let slots = &words[range];
        sanitize::look(Space::Texture, Access::Read, slots, Location::caller());
        let mut texel_words = [0_u32; 4];
        for (word, slot) in texel_words.iter_mut().zip(slots) {
            *word = slot.load(Relaxed);
        }
        T::of(Channels::load(
            self.format,
            bytemuck::cast_slice(&texel_words),
        ))
    }

    /// The words of a texel.
    #[inline]
    fn words_of(self, at: UVec3) -> Range<usize> {
        let [width, height, _] = self.size.map(|n| n as usize);
        let i = (at.z as usize * height + at.y as usize) * width + at.x as usize;
        let count = self.format.bytes() / 4;
        i * count..(i + 1) * count
    }
}

fn cast<'a, T: Pod>(name: &'static str, bytes: &'a [u8]) -> Result<&'a [T], CallError> {
    bytemuck::try_cast_slice(bytes).map_err(|_| CallError::Size {
        name,
        bytes: bytes.len(),
        size: size_of::<T>(),
    })
}

fn check_size(
    name: &'static str,
    size: [u32; 3],
    format: TexelFormat,
    bytes: usize,
) -> Result<(), CallError> {
    let expected = texture_bytes(size, 1, 1, 1, format);
    if expected == 0 || expected != bytes {
        let problem = format!("{bytes} bytes were given, its size and format need {expected}");
        return Err(CallError::Texture { name, problem });
    }
    Ok(())
}

/// Fails unless a buffer has an element for every invocation.
pub fn enough(name: &'static str, got: usize, expected: usize) -> Result<(), CallError> {
    if got < expected {
        Err(CallError::Length {
            name,
            expected,
            got,
        })
    } else {
        Ok(())
    }
}

/// Fails unless a texture has the size of the range that is written to it.
pub fn covers(name: &'static str, size: [u32; 3], extent: [u32; 3]) -> Result<(), CallError> {
    if size == extent {
        return Ok(());
    }
    let [size, extent] = [size, extent].map(|[x, y, z]| format!("{x}x{y}x{z}"));
    let problem = format!("it has {size} texels, but {extent} invocations run");
    Err(CallError::Texture { name, problem })
}

/// How many invocations a range has.
pub fn count(extent: [u32; 3]) -> Result<usize, CallError> {
    let count = extent.iter().map(|n| u128::from(*n)).product::<u128>();
    u32::try_from(count)
        .map(|n| n as usize)
        .map_err(|_| CallError::Range { extent })
}

/// Runs the loops; a kernel's panic becomes an error.
pub(super) fn guard(f: &mut dyn FnMut()) -> Result<(), CallError> {
    catch_unwind(AssertUnwindSafe(f)).map_err(|payload| {
        let message = message(payload.as_ref());
        CallError::Panic {
            message: match sanitize::panicked_at() {
                Some(place) => format!("{message}, at {place}"),
                None => message,
            },
        }
    })
}

fn message(payload: &(dyn Any + Send)) -> String {
    payload
        .downcast_ref::<String>()
        .cloned()
        .or_else(|| payload.downcast_ref::<&str>().map(ToString::to_string))
        .unwrap_or_else(|| "no message".to_string())
}

/// Runs `part` for consecutive parts of `out` with the index of each part's first byte. A part has
/// `chunk` bytes; in a sanitized call it has the `one` bytes of a single invocation, which is
/// at `at(number)`, and the parts come in the order of that call. A kernel's panic becomes an error.
///
/// This and [`for_ranges`] are the loops around all kernels. They are compiled once, and call a kernel's code
/// through a pointer: as generic functions they would be compiled with each kernel, and its body several times.
fn for_chunks(
    mode: Mode,
    out: &mut [u8],
    one: usize,
    chunk: usize,
    at: &dyn Fn(u32) -> UVec3,
    part: &(dyn Fn(usize, &mut [u8]) + Sync),
) -> Result<(), CallError> {
    guard(&mut || {
        if let Some(order) = sanitize::order(out.len() / one) {
            for i in order {
                sanitize::enter_alone(at(i), i);
                let start = i as usize * one;
                part(start, &mut out[start..start + one]);
            }
        } else if mode.parallel {
            out.par_chunks_mut(chunk)
                .enumerate()
                .for_each(|(i, c)| part(i * chunk, c));
        } else {
            out.chunks_mut(chunk)
                .enumerate()
                .for_each(|(i, c)| part(i * chunk, c));
        }
    })
}

/// [`for_chunks`] of elements, by the index of each part's first one.
fn for_elements<T: Pod>(
    mode: Mode,
    out: &mut [T],
    part: &(dyn Fn(usize, &mut [T]) + Sync),
) -> Result<(), CallError> {
    let one = size_of::<T>();
    let along = |i: u32| UVec3::new(i, 0, 0);
    let out = bytemuck::cast_slice_mut(out);
    for_chunks(mode, out, one, CHUNK * one, &along, &|start, bytes| {
        part(start / one, bytemuck::cast_slice_mut(bytes));
    })
}

/// A map over one dimension, invocation by invocation.
pub fn map1<T: Pod>(
    mode: Mode,
    out: &mut [T],
    f: impl Fn(usize) -> T + Sync,
) -> Result<(), CallError> {
    for_elements(mode, out, &|start, chunk| {
        for (i, slot) in chunk.iter_mut().enumerate() {
            *slot = f(start + i);
        }
    })
}

/// Calls `f` for each invocation of `extent`: where it is, and its number, counted along x, then
/// y, then z.
pub fn for_each(
    mode: Mode,
    extent: [u32; 3],
    f: impl Fn(UVec3, u32) + Sync,
) -> Result<(), CallError> {
    let count = extent.iter().map(|n| *n as usize).product();
    for_each_of(mode, extent, count, f)
}

/// [`for_each`] of the first `count` invocations.
pub fn for_each_of(
    mode: Mode,
    extent: [u32; 3],
    count: usize,
    f: impl Fn(UVec3, u32) + Sync,
) -> Result<(), CallError> {
    let [width, height, _] = extent.map(|n| n as usize);
    let row = width.max(1);
    let at = |i: usize| {
        let line = i / row;
        UVec3::new(
            (i - line * row) as u32,
            (line % height) as u32,
            (line / height) as u32,
        )
    };
    let place = |i: u32| at(i as usize);
    for_ranges(mode, count, &place, &|range| {
        let mut i = range.start;
        while i < range.end {
            let first = at(i);
            let stop = range.end.min(i + row - first.x as usize);
            for (x, j) in (first.x..).zip(i..stop) {
                f(UVec3::new(x, first.y, first.z), j as u32);
            }
            i = stop;
        }
    })
}

/// Calls `part` with consecutive ranges of `count` invocations; in a sanitized call with single ones, in its
/// order, each of which is at `at(number)`. A kernel's panic becomes an error.
fn for_ranges(
    mode: Mode,
    count: usize,
    at: &dyn Fn(u32) -> UVec3,
    part: &(dyn Fn(Range<usize>) + Sync),
) -> Result<(), CallError> {
    guard(&mut || {
        if let Some(order) = sanitize::order(count) {
            for i in order {
                sanitize::enter_alone(at(i), i);
                part(i as usize..i as usize + 1);
            }
        } else if mode.parallel {
            (0..count.div_ceil(CHUNK))
                .into_par_iter()
                .for_each(|i| part(i * CHUNK..count.min((i + 1) * CHUNK)));
        } else {
            part(0..count);
        }
    })
}

/// The body of a map that is generic over `Real`.
pub trait LaneBody: Sync {
    /// The scalar type.
    type Scalar: Scalar;
    /// An output element.
    type Out: Pod;
    /// What is the same for all invocations, over lanes.
    type Uniforms<L: Real>;
    /// It.
    fn uniforms<L: Lane<Scalar = Self::Scalar>>(&self) -> Self::Uniforms<L>;
    /// Invocation `i`.
    fn one(&self, i: usize) -> Self::Out;
    /// Invocations from `start` on, as many as `L` has lanes, into `out`, which is that long.
    fn many<L: Lane<Scalar = Self::Scalar> + Elementary>(
        &self,
        uniforms: &Self::Uniforms<L>,
        start: usize,
        out: &mut [Self::Out],
    );
}

/// A map over one dimension, on SIMD lanes if `mode` says so and the processor has any.
pub fn map1_lanes<B: LaneBody>(mode: Mode, out: &mut [B::Out], body: &B) -> Result<(), CallError> {
    let level = if mode.lanes { lanes::level() } else { None };
    for_elements(mode, out, &|start, chunk| {
        let done = level.and_then(|level| on_lanes(level, LaneChunk { start, chunk, body }));
        if done != Some(true) {
            scalar_chunk(start, chunk, body);
        }
    })
}

/// What is too short for lanes, or everything. One copy for all instruction sets: compiling a kernel's
/// body is what a build of kernels spends its time on.
#[inline(never)]
fn scalar_chunk<B: LaneBody>(start: usize, chunk: &mut [B::Out], body: &B) {
    for (i, slot) in chunk.iter_mut().enumerate() {
        *slot = body.one(start + i);
    }
}

/// A chunk that groups of lanes fill. Not where it is shorter than one group; it says so.
struct LaneChunk<'a, B: LaneBody> {
    start: usize,
    chunk: &'a mut [B::Out],
    body: &'a B,
}

impl<B: LaneBody> Work for LaneChunk<'_, B> {
    type Scalar = B::Scalar;
    type Output = bool;

    #[inline(always)]
    fn run<L: Lane<Scalar = B::Scalar> + Elementary>(self) -> bool {
        let Self { start, chunk, body } = self;
        let Some(last) = chunk.len().checked_sub(L::LANES) else {
            return false;
        };
        // Once, not for each group: the compiler cannot know that storing a result leaves them alone.
        let uniforms = body.uniforms::<L>();
        let mut done = 0;
        while done < chunk.len() {
            // The last group begins early enough to be whole: some results are computed twice.
            let first = done.min(last);
            let group = &mut chunk[first..first + L::LANES];
            lanes::fetch_to_write(group);
            body.many::<L>(&uniforms, start + first, group);
            done = first + L::LANES;
        }
        true
    }
}

/// All channels of a texel, as a texture stores them.
pub trait Channels: Sized {
    /// What they are.
    const NUMBERS: describe::Channels;
    /// Writes them to the bytes of one texel.
    fn store(self, format: TexelFormat, bytes: &mut [u8]);
    /// Reads them.
    fn load(format: TexelFormat, bytes: &[u8]) -> Self;
}

impl Channels for Vec4 {
    const NUMBERS: describe::Channels = describe::Channels::Float;

    #[inline]
    fn store(self, format: TexelFormat, bytes: &mut [u8]) {
        format.store(bytes, self);
    }
    #[inline]
    fn load(format: TexelFormat, bytes: &[u8]) -> Self {
        format.load(bytes)
    }
}

impl Channels for UVec4 {
    const NUMBERS: describe::Channels = describe::Channels::Uint;

    #[inline]
    #[track_caller]
    fn store(self, format: TexelFormat, bytes: &mut [u8]) {
        assert!(
            format.holds(self),
            "a texel of {} does not hold {self}: what becomes of it differs from device to device",
            format.name()
        );
        format.store_integer(bytes, self);
    }
    #[inline]
    fn load(format: TexelFormat, bytes: &[u8]) -> Self {
        format.load_integer(bytes)
    }
}

impl Channels for IVec4 {
    const NUMBERS: describe::Channels = describe::Channels::Sint;

    #[inline]
    #[track_caller]
    fn store(self, format: TexelFormat, bytes: &mut [u8]) {
        assert!(
            format.holds(self.as_uvec4()),
            "a texel of {} does not hold {self}: what becomes of it differs from device to device",
            format.name()
        );
        format.store_integer(bytes, self.as_uvec4());
    }
    #[inline]
    fn load(format: TexelFormat, bytes: &[u8]) -> Self {
        format.load_integer(bytes).as_ivec4()
    }
}

/// The format of 32-bit numbers that holds a value.
fn target_format<T: Texel<Channels: Channels>>() -> TexelFormat {
    use describe::Channels as C;
    match (<T::Channels as Channels>::NUMBERS, size_of::<T>()) {
        (C::Float, 4) => TexelFormat::R32Float,
        (C::Float, 8) => TexelFormat::Rg32Float,
        (C::Float, _) => TexelFormat::Rgba32Float,
        (C::Uint, 4) => TexelFormat::R32Uint,
        (C::Uint, 8) => TexelFormat::Rg32Uint,
        (C::Uint, _) => TexelFormat::Rgba32Uint,
        (C::Sint, 4) => TexelFormat::R32Sint,
        (C::Sint, 8) => TexelFormat::Rg32Sint,
        (C::Sint, _) => TexelFormat::Rgba32Sint,
    }
}

/// A map over the texels of a texture, row by row.
pub fn map_texels<T: Texel<Channels: Channels>>(
    mode: Mode,
    out: TextureMut<'_>,
    f: impl Fn(UVec3) -> T + Sync,
) -> Result<(), CallError> {
    let TextureMut {
        size: [width, height, _],
        format,
        bytes,
    } = out;
    let texel = format.bytes();
    let at = |i: u32| {
        let line = i / width;
        UVec3::new(i % width, line % height, line / height)
    };
    let row = width as usize * texel;
    for_chunks(mode, bytes, texel, row, &at, &|start, bytes| {
        let first = at((start / texel) as u32);
        for (x, bytes) in (first.x..).zip(bytes.chunks_exact_mut(texel)) {
            f(UVec3::new(x, first.y, first.z))
                .channels()
                .store(format, bytes);
        }
    })
}

/// [`map_texels`] with a two-dimensional index.
pub fn map_texels2<T: Texel<Channels: Channels>>(
    mode: Mode,
    out: TextureMut<'_>,
    f: impl Fn(UVec2) -> T + Sync,
) -> Result<(), CallError> {
    map_texels(mode, out, |at| f(at.truncate()))
}

/// Output slices of a vertex or fragment kernel, written together.
pub trait Slices: Send {
    /// One value for each slice.
    type Values;
    /// Splits all slices at `mid`.
    fn split(self, mid: usize) -> (Self, Self)
    where
        Self: Sized;
    /// Length of the first.
    fn count(&self) -> usize;
    /// Stores the values of invocation `i`.
    fn set(&mut self, i: usize, values: Self::Values);
}

macro_rules! slices {
    ($($t:ident $i:tt),*) => {
        impl<$($t: Send),*> Slices for ($(&mut [$t],)*) {
            type Values = ($($t,)*);
            fn split(self, mid: usize) -> (Self, Self) {
                let pairs = ($(self.$i.split_at_mut(mid),)*);
                (($(pairs.$i.0,)*), ($(pairs.$i.1,)*))
            }
            fn count(&self) -> usize {
                self.0.len()
            }
            #[inline(always)]
            fn set(&mut self, i: usize, values: Self::Values) {
                $(self.$i[i] = values.$i;)*
            }
        }
    };
}

slices!(A 0);
slices!(A 0, B 1);
slices!(A 0, B 1, C 2);
slices!(A 0, B 1, C 2, D 3);
slices!(A 0, B 1, C 2, D 3, E 4);
slices!(A 0, B 1, C 2, D 3, E 4, F 5);
slices!(A 0, B 1, C 2, D 3, E 4, F 5, G 6);
slices!(A 0, B 1, C 2, D 3, E 4, F 5, G 6, H 7);

/// A map with several outputs.
pub fn map_tuple<S: Slices>(
    mode: Mode,
    out: S,
    f: impl Fn(usize) -> S::Values + Sync,
) -> Result<(), CallError> {
    map_parts(mode, out, &|start, mut part| {
        for i in 0..part.count() {
            part.set(i, f(start + i));
        }
    })
}

/// Calls `f` with parts of all slices and the index of each part's first element. A kernel's panic becomes an
/// error.
pub(super) fn map_parts<S: Slices>(
    mode: Mode,
    out: S,
    f: &(dyn Fn(usize, S) + Sync),
) -> Result<(), CallError> {
    let mut out = Some(out);
    guard(&mut || {
        if let Some(out) = out.take() {
            split(mode.parallel, 0, out, f);
        }
    })
}

fn split<S: Slices>(parallel: bool, start: usize, out: S, f: &(dyn Fn(usize, S) + Sync)) {
    let count = out.count();
    if parallel && count > CHUNK {
        let mid = count / 2;
        let (low, high) = out.split(mid);
        rayon::join(
            || split(parallel, start, low, f),
            || split(parallel, start + mid, high, f),
        );
    } else {
        f(start, out);
    }
}
