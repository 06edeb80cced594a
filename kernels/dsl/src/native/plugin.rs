//! Kernel crates as native plug-ins: how `hankel` runs the native code of a crate that it was not
//! built with. A crate compiled as a `cdylib` with `--cfg hankel_plugin` exports one C function,
//! [`SYMBOL`], which returns [`Exports`]; [`Plugin`] loads it.
//!
//! Only C types cross the border, so the two sides may come from different compilers; [`ABI`]
//! changes whenever the meaning of what crosses it does.

#[doc(hidden)]
pub use core::ffi::c_void;
use std::path::{Path, PathBuf};
use std::string::{String, ToString};
#[doc(hidden)]
pub use std::sync::OnceLock;
use std::vec::Vec;
use std::{format, slice};

use super::Entry;
use super::call::{
    Address, Arg, Call, CallError, Compare, Deviation, Filter, Levels, Mode, Sampler, TextureMut,
    TextureRef,
};
use super::describe::Kernel;
use super::inputs::{Given, Make, Request};
use super::sanitize::Order;
use super::texel::FORMATS;

/// Version of what crosses the border.
pub const ABI: u32 = 6;

/// The exported function's name.
pub const SYMBOL: &str = "hankel_plugin";

/// Receives bytes.
pub type Sink = unsafe extern "C" fn(context: *mut c_void, bytes: *const u8, len: usize);

/// What a plug-in exports.
#[repr(C)]
pub struct Exports {
    /// [`ABI`] of the plug-in.
    pub abi: u32,
    /// Sends the descriptions of all entry points to the sink, as JSON.
    pub describe: unsafe extern "C" fn(sink: Sink, context: *mut c_void),
    /// Runs an entry point; 0 on success, else the error's text is sent to the sink.
    pub run: unsafe extern "C" fn(call: *const RawCall, sink: Sink, context: *mut c_void) -> u32,
    /// Makes an entry point's own inputs for a request in JSON, and sends them to the sink as JSON;
    /// `null` if it has none. 0 on success, else the error's text is sent.
    pub inputs: unsafe extern "C" fn(
        kernel: u32,
        request: *const u8,
        len: usize,
        sink: Sink,
        context: *mut c_void,
    ) -> u32,
}

/// A call as it crosses the border.
#[repr(C)]
pub struct RawCall {
    kernel: u32,
    lanes: u32,
    parallel: u32,
    /// [`Order::code`] of a sanitized run, else 0.
    sanitize: u32,
    subgroup_size: u32,
    args: *const RawArg,
    arg_count: usize,
    constants: *const u32,
    constant_count: usize,
}

/// An argument as it crosses the border.
#[repr(C)]
struct RawArg {
    kind: u32,
    format: u32,
    size: [u32; 3],
    levels: u32,
    layers: u32,
    samples: u32,
    sampler: RawSampler,
    data: *mut u8,
    len: usize,
}

/// A sampler as it crosses the border: numbers of the variants, of a comparison one more, so that 0
/// is none; its [`Deviation`].
#[derive(Default)]
#[repr(C)]
struct RawSampler {
    magnify: u32,
    minify: u32,
    mip: u32,
    address: [u32; 3],
    compare: u32,
    anisotropy: u32,
    offset: [i16; 3],
    level: i16,
    channels: [i8; 4],
    twist: i8,
    levels: u8,
    texture: u8,
}

impl RawSampler {
    fn new(sampler: &Sampler) -> Self {
        Self {
            magnify: sampler.magnify as u32,
            minify: sampler.minify as u32,
            mip: sampler.mip as u32,
            address: sampler.address.map(|it| it as u32),
            compare: sampler.compare.map_or(0, |it| it as u32 + 1),
            anisotropy: sampler.anisotropy.into(),
            offset: sampler.deviation.offset,
            level: sampler.deviation.level,
            channels: sampler.deviation.channels,
            twist: sampler.deviation.twist,
            levels: sampler.deviation.levels as u8,
            texture: sampler.deviation.texture,
        }
    }

    fn sampler(&self) -> Option<Sampler> {
        let filter = |n: u32| Filter::ALL.get(n as usize).copied();
        let address = |n: u32| Address::ALL.get(n as usize).copied();
        let [u, v, w] = self.address;
        Some(Sampler {
            magnify: filter(self.magnify)?,
            minify: filter(self.minify)?,
            mip: filter(self.mip)?,
            address: [address(u)?, address(v)?, address(w)?],
            compare: match self.compare {
                0 => None,
                n => Some(*Compare::ALL.get(n as usize - 1)?),
            },
            anisotropy: u16::try_from(self.anisotropy).ok()?,
            deviation: Deviation {
                offset: self.offset,
                level: self.level,
                channels: self.channels,
                twist: self.twist,
                levels: *Levels::ALL.get(usize::from(self.levels))?,
                texture: self.texture,
            },
        })
    }
}

const BYTES: u32 = 0;
const BYTES_MUT: u32 = 1;
const TEXTURE: u32 = 2;
const TEXTURE_MUT: u32 = 3;
const SAMPLER: u32 = 4;

impl RawArg {
    fn new(arg: &mut Arg<'_>) -> Self {
        let mut raw = Self {
            kind: BYTES,
            format: 0,
            size: [0; 3],
            levels: 1,
            layers: 1,
            samples: 0,
            sampler: RawSampler::default(),
            data: core::ptr::null_mut(),
            len: 0,
        };
        let (data, len) = match arg {
            Arg::Bytes(b) => (b.as_ptr().cast_mut(), b.len()),
            Arg::BytesMut(b) => {
                raw.kind = BYTES_MUT;
                (b.as_mut_ptr(), b.len())
            }
            Arg::Texture(t) => {
                raw.kind = TEXTURE;
                (raw.size, raw.samples, raw.format) = (t.size, t.samples, t.format as u32);
                (raw.levels, raw.layers) = (t.levels, t.layers);
                (t.bytes.as_ptr().cast_mut(), t.bytes.len())
            }
            Arg::TextureMut(t) => {
                raw.kind = TEXTURE_MUT;
                (raw.size, raw.samples, raw.format) = (t.size, 1, t.format as u32);
                (t.bytes.as_mut_ptr(), t.bytes.len())
            }
            Arg::Sampler(s) => {
                raw.kind = SAMPLER;
                raw.sampler = RawSampler::new(s);
                (core::ptr::null_mut(), 0)
            }
        };
        (raw.data, raw.len) = (data, len);
        raw
    }

    /// # Safety
    /// `data` and `len` are those of a slice that lives for `'a`, borrowed as `kind` says.
    unsafe fn arg<'a>(&self) -> Option<Arg<'a>> {
        // SAFETY: the caller's; a slice's pointer is never null.
        let bytes = || unsafe { slice::from_raw_parts::<'a>(self.data, self.len) };
        // SAFETY: the same, and exclusively borrowed.
        let bytes_mut = || unsafe { slice::from_raw_parts_mut::<'a>(self.data, self.len) };
        Some(match self.kind {
            BYTES => Arg::Bytes(bytes()),
            BYTES_MUT => Arg::BytesMut(bytes_mut()),
            TEXTURE => Arg::Texture(TextureRef {
                size: self.size,
                levels: self.levels,
                layers: self.layers,
                samples: self.samples,
                number: 0,
                format: *FORMATS.get(self.format as usize)?,
                bytes: bytes(),
            }),
            TEXTURE_MUT => Arg::TextureMut(TextureMut {
                size: self.size,
                format: *FORMATS.get(self.format as usize)?,
                bytes: bytes_mut(),
            }),
            SAMPLER => Arg::Sampler(self.sampler.sampler()?),
            _ => return None,
        })
    }
}

/// The plug-in's side of [`Exports::describe`].
///
/// # Safety
/// `sink` accepts `context` and any bytes.
pub unsafe fn describe(entries: &[Entry], sink: Sink, context: *mut c_void) {
    let kernels: Vec<&Kernel> = entries.iter().map(|e| &e.kernel).collect();
    // Descriptions are plain data: they always have a JSON form.
    let json = serde_json::to_vec(&kernels).unwrap_or_default();
    // SAFETY: the caller's.
    unsafe { sink(context, json.as_ptr(), json.len()) }
}

/// The plug-in's side of [`Exports::run`].
///
/// # Safety
/// `call` was made by [`Plugin::run`], and `sink` accepts `context` and any bytes.
pub unsafe fn run(
    entries: &[Entry],
    call: *const RawCall,
    sink: Sink,
    context: *mut c_void,
) -> u32 {
    // SAFETY: the caller's; pointers and lengths come from live vectors.
    let (call, raw, constants) = unsafe {
        let call = &*call;
        (
            call,
            slice::from_raw_parts(call.args, call.arg_count),
            slice::from_raw_parts(call.constants, call.constant_count),
        )
    };
    // SAFETY: every argument was made from a live `Arg` of the caller.
    let args: Option<Vec<Arg<'_>>> = raw.iter().map(|a| unsafe { a.arg() }).collect();
    let result = match (entries.get(call.kernel as usize), args) {
        (Some(entry), Some(args)) => (entry.run)(&mut Call {
            args,
            constants: constants.to_vec(),
            mode: Mode {
                lanes: call.lanes != 0,
                parallel: call.parallel != 0,
                sanitize: Order::of_code(call.sanitize),
                subgroup_size: call.subgroup_size,
            },
        })
        .map_err(|e| e.to_string()),
        _ => Err("the call does not follow the plug-in interface".to_string()),
    };
    match result {
        Ok(()) => 0,
        Err(text) => {
            // SAFETY: the caller's.
            unsafe { sink(context, text.as_ptr(), text.len()) }
            1
        }
    }
}

/// The plug-in's side of [`Exports::inputs`].
///
/// # Safety
/// `request` points to `len` bytes, and `sink` accepts `context` and any bytes.
pub unsafe fn inputs(
    entries: &[Entry],
    kernel: u32,
    request: *const u8,
    len: usize,
    sink: Sink,
    context: *mut c_void,
) -> u32 {
    // SAFETY: the caller's.
    let request = unsafe { slice::from_raw_parts(request, len) };
    let make = entries.get(kernel as usize).and_then(|e| e.inputs);
    let made = serde_json::from_slice(request)
        .map_err(|e| e.to_string())
        .and_then(|request| make.map(|make| made(make, &request)).transpose())
        .and_then(|made| serde_json::to_vec(&made).map_err(|e| e.to_string()));
    let (status, bytes) = match made {
        Ok(json) => (0, json),
        Err(text) => (1, text.into_bytes()),
    };
    // SAFETY: the caller's.
    unsafe { sink(context, bytes.as_ptr(), bytes.len()) }
    status
}

/// What a function makes; a panic in it becomes an error.
///
/// # Errors
/// The panic's message.
pub fn made(make: Make, request: &Request) -> Result<Vec<Given>, String> {
    std::panic::catch_unwind(|| make(request)).map_err(|payload| {
        let words = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("no message");
        format!("the function that makes its inputs panicked: {words}")
    })
}

unsafe extern "C" fn collect(context: *mut c_void, bytes: *const u8, len: usize) {
    // SAFETY: `context` is the vector that this module passed; the bytes are the plug-in's.
    unsafe { (*context.cast::<Vec<u8>>()).extend_from_slice(slice::from_raw_parts(bytes, len)) }
}

/// Why a plug-in was not loaded.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct PluginError {
    /// The library.
    pub path: PathBuf,
    /// What is wrong with it.
    pub problem: String,
}

/// A loaded plug-in.
pub struct Plugin {
    exports: Exports,
    kernels: Vec<Kernel>,
    // Unloading would leave the pointers above dangling, and rayon's threads without code.
    _library: core::mem::ManuallyDrop<libloading::Library>,
}

impl core::fmt::Debug for Plugin {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Plugin")
            .field("kernels", &self.kernels.len())
            .finish_non_exhaustive()
    }
}

impl Plugin {
    /// Loads the library at `path`, which is trusted: its code runs in this process.
    ///
    /// # Errors
    /// It cannot be opened, is no kernel crate's, or follows another version of the interface.
    pub fn load(path: &Path) -> Result<Self, PluginError> {
        let fail = |problem: String| PluginError {
            path: path.to_path_buf(),
            problem,
        };
        // SAFETY: loading runs the library's initialisers; a kernel crate has none of its own.
        let library = unsafe { libloading::Library::new(path) }.map_err(|e| fail(e.to_string()))?;
        // SAFETY: the symbol, if it is there, was exported by `kernels!` with this signature.
        let exports = unsafe {
            let function = library
                .get::<unsafe extern "C" fn() -> Exports>(SYMBOL.as_bytes())
                .map_err(|_| {
                    fail("it exports no kernels: is `hankel_dsl::kernels![…]` at the root of the crate?".to_string())
                })?;
            function()
        };
        if exports.abi != ABI {
            return Err(fail(format!(
                "it follows version {} of the plug-in interface, this program version {ABI}: build both with the same release of hankel-dsl",
                exports.abi
            )));
        }
        let mut json = Vec::<u8>::new();
        // SAFETY: `collect` takes a vector as context.
        unsafe { (exports.describe)(collect, (&raw mut json).cast()) };
        let kernels = serde_json::from_slice(&json)
            .map_err(|e| fail(format!("its description cannot be read: {e}")))?;
        Ok(Self {
            exports,
            kernels,
            _library: core::mem::ManuallyDrop::new(library),
        })
    }

    /// The entry points, in the order of their indices.
    #[must_use]
    pub fn kernels(&self) -> &[Kernel] {
        &self.kernels
    }

    /// The inputs that entry point `index` has of its own; none without `inputs = …`.
    ///
    /// # Errors
    /// What the plug-in reports, as text.
    pub fn inputs(&self, index: usize, request: &Request) -> Result<Option<Vec<Given>>, String> {
        let request = serde_json::to_vec(request).map_err(|e| e.to_string())?;
        let mut bytes = Vec::<u8>::new();
        // SAFETY: the request outlives the call; `collect` takes a vector.
        let status = unsafe {
            (self.exports.inputs)(
                u32::try_from(index).unwrap_or(u32::MAX),
                request.as_ptr(),
                request.len(),
                collect,
                (&raw mut bytes).cast(),
            )
        };
        if status == 0 {
            serde_json::from_slice(&bytes).map_err(|e| e.to_string())
        } else {
            Err(String::from_utf8_lossy(&bytes).into_owned())
        }
    }

    /// Runs entry point `index`.
    ///
    /// # Errors
    /// What the entry point reports, as text.
    pub fn run(&self, index: usize, call: &mut Call<'_>) -> Result<(), CallError> {
        let args: Vec<RawArg> = call.args.iter_mut().map(RawArg::new).collect();
        let raw = RawCall {
            kernel: u32::try_from(index).unwrap_or(u32::MAX),
            lanes: call.mode.lanes.into(),
            parallel: call.mode.parallel.into(),
            sanitize: call.mode.sanitize.map_or(0, Order::code),
            subgroup_size: call.mode.subgroup_size,
            args: args.as_ptr(),
            arg_count: args.len(),
            constants: call.constants.as_ptr(),
            constant_count: call.constants.len(),
        };
        let mut text = Vec::<u8>::new();
        // SAFETY: `raw` and all it points to outlive the call; `collect` takes a vector.
        let status = unsafe { (self.exports.run)(&raw, collect, (&raw mut text).cast()) };
        if status == 0 {
            Ok(())
        } else {
            Err(CallError::Plugin {
                message: String::from_utf8_lossy(&text).into_owned(),
            })
        }
    }
}
