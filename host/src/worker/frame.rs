//! What goes through the pipes: a length, a header in JSON, and the bytes that the header counts.

use std::io::{self, Read, Write};

use hankel_dsl::native::describe::{Kernel, TexelFormat};
use hankel_dsl::native::inputs;
use hankel_dsl::native::sanitize::Order;
use hankel_dsl::native::{Arg, Call, Mode, Sampler, TextureMut, TextureRef};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::flush;

/// Bytes at an address that fits every layout.
type Words = Vec<u128>;

/// What a worker is asked for.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Asked {
    /// A call, whose bytes follow.
    Call(Request),
    /// The inputs that an entry point has of its own.
    Inputs {
        kernel: usize,
        request: inputs::Request,
    },
}

/// A call.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Request {
    pub kernel: usize,
    lanes: bool,
    parallel: bool,
    sanitize: Option<Order>,
    subgroup_size: u32,
    /// The caller's thread flushes subnormal numbers ([`crate::flush`]); the kernel's is to do so, too.
    pub flushes: bool,
    constants: Vec<u32>,
    shapes: Vec<Shape>,
}

/// An argument, whose bytes follow the header in turn.
#[derive(Debug, Serialize, Deserialize)]
enum Shape {
    Bytes(usize),
    BytesMut(usize),
    Texture {
        size: [u32; 3],
        levels: u32,
        layers: u32,
        samples: u32,
        format: TexelFormat,
        bytes: usize,
    },
    TextureMut {
        size: [u32; 3],
        format: TexelFormat,
        bytes: usize,
    },
    Sampler(Sampler),
}

impl Shape {
    fn bytes(&self) -> usize {
        match self {
            Self::Bytes(n) | Self::BytesMut(n) => *n,
            Self::Texture { bytes, .. } | Self::TextureMut { bytes, .. } => *bytes,
            Self::Sampler(_) => 0,
        }
    }
}

/// What the worker says: first [`Answer::Kernels`] or [`Answer::Failed`], then one for each question.
#[derive(Debug, Serialize, Deserialize)]
pub(super) enum Answer {
    /// The plug-in is loaded.
    Kernels(Vec<Kernel>),
    /// The call is done; the bytes of what it writes follow in turn.
    Done,
    /// The inputs, or none where the kernel names no function that makes them.
    Inputs(Option<Vec<inputs::Given>>),
    /// What went wrong, in words.
    Failed(String),
}

/// The most bytes of a header: descriptions of all kernels are some hundred kilobytes.
const MAX_HEADER: u32 = 256 << 20;

pub(super) fn write_header(to: &mut impl Write, header: &impl Serialize) -> io::Result<()> {
    let text = serde_json::to_vec(header)?;
    let length = u32::try_from(text.len()).map_err(io::Error::other)?;
    to.write_all(&length.to_le_bytes())?;
    to.write_all(&text)
}

/// `None` at the end.
pub(super) fn read_header<T: DeserializeOwned>(from: &mut impl Read) -> io::Result<Option<T>> {
    let mut length = [0; 4];
    match from.read_exact(&mut length) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => return Ok(None),
        other => other?,
    }
    let length = u32::from_le_bytes(length);
    if length > MAX_HEADER {
        return Err(io::Error::other("the header is too long"));
    }
    let mut text = vec![0; length as usize];
    from.read_exact(&mut text)?;
    Ok(Some(serde_json::from_slice(&text)?))
}

/// Sends a call.
pub(super) fn write_call(to: &mut impl Write, kernel: usize, call: &Call<'_>) -> io::Result<()> {
    let shapes = call.args.iter().map(|arg| match arg {
        Arg::Bytes(b) => Shape::Bytes(b.len()),
        Arg::BytesMut(b) => Shape::BytesMut(b.len()),
        Arg::Texture(t) => Shape::Texture {
            size: t.size,
            levels: t.levels,
            layers: t.layers,
            samples: t.samples,
            format: t.format,
            bytes: t.bytes.len(),
        },
        Arg::TextureMut(t) => Shape::TextureMut {
            size: t.size,
            format: t.format,
            bytes: t.bytes.len(),
        },
        Arg::Sampler(s) => Shape::Sampler(*s),
    });
    let request = Request {
        kernel,
        lanes: call.mode.lanes,
        parallel: call.mode.parallel,
        sanitize: call.mode.sanitize,
        subgroup_size: call.mode.subgroup_size,
        flushes: flush::is_on(),
        constants: call.constants.clone(),
        shapes: shapes.collect(),
    };
    write_header(to, &Asked::Call(request))?;
    for arg in &call.args {
        match arg {
            Arg::Bytes(b) => to.write_all(b)?,
            Arg::BytesMut(b) => to.write_all(b)?,
            Arg::Texture(t) => to.write_all(t.bytes)?,
            Arg::TextureMut(t) => to.write_all(t.bytes)?,
            Arg::Sampler(_) => {}
        }
    }
    to.flush()
}

/// Takes in what a call has written.
pub(super) fn read_results(from: &mut impl Read, call: &mut Call<'_>) -> io::Result<()> {
    for arg in &mut call.args {
        match arg {
            Arg::BytesMut(b) => from.read_exact(b)?,
            Arg::TextureMut(t) => from.read_exact(t.bytes)?,
            Arg::Bytes(_) | Arg::Texture(_) | Arg::Sampler(_) => {}
        }
    }
    Ok(())
}

/// A call as it arrived: its arguments' memory.
pub(super) struct Arrived {
    pub request: Request,
    memory: Vec<Words>,
}

impl Arrived {
    /// Reads the bytes that follow a header.
    pub fn read(from: &mut impl Read, request: Request) -> io::Result<Self> {
        let mut memory = Vec::new();
        for shape in &request.shapes {
            let bytes = shape.bytes();
            let mut words: Words = vec![0; bytes.div_ceil(size_of::<u128>())];
            let all: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
            from.read_exact(&mut all[..bytes])?;
            memory.push(words);
        }
        Ok(Self { request, memory })
    }

    /// The call.
    pub fn call(&mut self) -> Call<'_> {
        let shapes = self.request.shapes.iter();
        let args = shapes.zip(&mut self.memory).map(|(shape, words)| {
            let all: &mut [u8] = bytemuck::cast_slice_mut(words);
            let bytes = &mut all[..shape.bytes()];
            match *shape {
                Shape::Bytes(_) => Arg::Bytes(bytes),
                Shape::BytesMut(_) => Arg::BytesMut(bytes),
                Shape::Texture {
                    size,
                    levels,
                    layers,
                    samples,
                    format,
                    ..
                } => Arg::Texture(TextureRef {
                    size,
                    levels,
                    layers,
                    samples,
                    number: 0,
                    format,
                    bytes,
                }),
                Shape::TextureMut { size, format, .. } => Arg::TextureMut(TextureMut {
                    size,
                    format,
                    bytes,
                }),
                Shape::Sampler(sampler) => Arg::Sampler(sampler),
            }
        });
        Call {
            args: args.collect(),
            constants: self.request.constants.clone(),
            mode: Mode {
                lanes: self.request.lanes,
                parallel: self.request.parallel,
                sanitize: self.request.sanitize,
                subgroup_size: self.request.subgroup_size,
            },
        }
    }

    /// Sends what the call has written.
    pub fn write_results(&mut self, to: &mut impl Write) -> io::Result<()> {
        for arg in &self.call().args {
            match arg {
                Arg::BytesMut(b) => to.write_all(b)?,
                Arg::TextureMut(t) => to.write_all(t.bytes)?,
                Arg::Bytes(_) | Arg::Texture(_) | Arg::Sampler(_) => {}
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hankel_dsl::native::{Address, Compare, Deviation, Filter, Levels};

    #[test]
    fn a_call_arrives_as_it_was_sent_and_comes_back() {
        let (read, texels) = ([1_u8, 2, 3, 4], [7_u8; 16]);
        let mut written = [5_u8; 8];
        let mut image = [9_u8; 4];
        let format = TexelFormat::R32Float;
        let size = [2, 2, 1];
        let mut call = Call {
            args: vec![
                Arg::Bytes(&read),
                Arg::Texture(TextureRef {
                    size,
                    levels: 1,
                    layers: 1,
                    samples: 1,
                    number: 0,
                    format,
                    bytes: &texels,
                }),
                Arg::Sampler(Sampler {
                    compare: Some(Compare::Greater),
                    deviation: Deviation {
                        levels: Levels::Odd,
                        offset: [-4, 3, 0],
                        level: 2,
                        twist: -1,
                        channels: [1, -2, 3, -4],
                        texture: 2,
                    },
                    ..Sampler::new(Filter::Linear, Address::MirrorRepeat)
                }),
                Arg::BytesMut(&mut written),
                Arg::TextureMut(TextureMut {
                    size: [1, 1, 1],
                    format,
                    bytes: &mut image,
                }),
            ],
            constants: vec![42],
            mode: Mode::REFERENCE,
        };
        let mut pipe = Vec::new();
        write_call(&mut pipe, 6, &call).unwrap();
        let mut from = &pipe[..];
        let asked: Asked = read_header(&mut from).unwrap().unwrap();
        let Asked::Call(request) = asked else {
            panic!("a call")
        };
        assert_eq!(request.kernel, 6);
        let mut arrived = Arrived::read(&mut from, request).unwrap();
        assert!(from.is_empty());
        {
            let mut there = arrived.call();
            assert_eq!((there.constants[0], there.mode), (42, Mode::REFERENCE));
            assert_eq!(format!("{:?}", there.args), format!("{:?}", call.args));
            let Arg::BytesMut(bytes) = &mut there.args[3] else {
                panic!("bytes")
            };
            bytes[0] = 77;
        }
        let mut back = Vec::new();
        arrived.write_results(&mut back).unwrap();
        read_results(&mut &back[..], &mut call).unwrap();
        drop(call);
        assert_eq!(written, [77, 5, 5, 5, 5, 5, 5, 5]);
        assert!(read_header::<Asked>(&mut &[][..]).unwrap().is_none());
        assert!(read_header::<Asked>(&mut &[255; 8][..]).is_err());
    }
}
