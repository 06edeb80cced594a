//! Inputs that a kernel's author makes: what `#[kernel(…, inputs = path::to::function)]` names.
//!
//! The function gets a [`Request`] and gives [`Given`] arguments for any number of runs, by the
//! names of the kernel's parameters. What it leaves out is made from the attributes, as for any
//! kernel. The same request makes the same arguments: chance comes from a [`Source`].
//!
//! ```
//! use hankel_dsl::native::inputs::{Given, Request, Source};
//!
//! fn sorted(request: &Request) -> Vec<Given> {
//!     let mut chance = Source::new(request.seed);
//!     let mut keys: Vec<f32> = (0..1000).map(|_| chance.between(0.0, 1.0) as f32).collect();
//!     keys.sort_by(f32::total_cmp);
//!     vec![Given::new("sorted keys").buffer("keys", &keys)]
//! }
//! # let request = Request { seed: 7, constants: Vec::new(), multisampled: Vec::new() };
//! # assert_eq!(sorted(&request), sorted(&request));
//! ```

use std::string::String;
use std::vec::Vec;

use bytemuck::Pod;
use serde::{Deserialize, Serialize};

use super::call::Sampler;
use super::describe::TexelFormat;
use crate::Real;

/// What inputs are asked for.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Request {
    /// Where chance begins.
    pub seed: u64,
    /// Names and values of the kernel's specialisation constants.
    pub constants: Vec<(String, u32)>,
    /// Names of the kernel's multisampled textures.
    pub multisampled: Vec<String>,
}

impl Request {
    /// How many samples each texel of a texture has to have: 4 if it is multisampled, else 1. For functions that make the
    /// inputs of kernels of both kinds.
    #[must_use]
    pub fn samples(&self, texture: &str) -> u32 {
        if self.multisampled.iter().any(|name| name == texture) {
            4
        } else {
            1
        }
    }

    /// The value of a specialisation constant.
    #[must_use]
    pub fn constant(&self, name: &str) -> Option<u32> {
        let found = self.constants.iter().find(|(n, _)| n == name);
        found.map(|(_, value)| *value)
    }
}

/// Makes inputs.
pub type Make = fn(&Request) -> Vec<Given>;

/// The arguments of one run, as far as their author gives them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Given {
    /// What they are, in a few words: reports name them.
    pub what: String,
    /// Parameters and what they get.
    pub args: Vec<(String, Value)>,
}

/// What a parameter gets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Value {
    /// A uniform, or the elements of a buffer, attributes or varyings.
    Bytes(Vec<u8>),
    /// A texture.
    Texture {
        /// Width, height, depth of level 0 in texels.
        size: [u32; 3],
        /// Mip levels.
        levels: u32,
        /// Layers, of a cube its 6 faces.
        layers: u32,
        /// Samples of a texel, 1 or 4.
        samples: u32,
        /// The format; of a depth [`TexelFormat::R32Float`].
        format: TexelFormat,
        /// Texels as in a [`TextureRef`](super::TextureRef).
        bytes: Vec<u8>,
    },
    /// A sampler.
    Sampler(Sampler),
}

/// Texels as they lie in memory.
fn stored(format: TexelFormat, texels: impl IntoIterator<Item = glam::Vec4>) -> Vec<u8> {
    let mut bytes = Vec::new();
    for texel in texels {
        let at = bytes.len();
        bytes.resize(at + format.bytes(), 0);
        format.store(&mut bytes[at..], texel);
    }
    bytes
}

impl Given {
    /// Nothing yet.
    #[must_use]
    pub fn new(what: &str) -> Self {
        Self {
            what: what.into(),
            args: Vec::new(),
        }
    }

    fn with(mut self, name: &str, value: Value) -> Self {
        self.args.push((name.into(), value));
        self
    }

    /// Gives a uniform its value.
    #[must_use]
    pub fn uniform<T: Pod>(self, name: &str, value: &T) -> Self {
        self.with(name, Value::Bytes(bytemuck::bytes_of(value).to_vec()))
    }

    /// Gives a buffer its elements, or an attribute or varying its value for each vertex or
    /// fragment. All that are read element by element, one for each invocation, have the same
    /// length.
    #[must_use]
    pub fn buffer<T: Pod>(self, name: &str, elements: &[T]) -> Self {
        self.with(name, Value::Bytes(bytemuck::cast_slice(elements).to_vec()))
    }

    /// Gives a two-dimensional texture its texels, row by row; `samples` of them in each, together.
    #[must_use]
    pub fn texture(
        self,
        name: &str,
        [width, height]: [u32; 2],
        samples: u32,
        format: TexelFormat,
        texels: impl IntoIterator<Item = glam::Vec4>,
    ) -> Self {
        self.with(
            name,
            Value::Texture {
                size: [width, height, 1],
                levels: 1,
                layers: 1,
                samples,
                format,
                bytes: stored(format, texels),
            },
        )
    }

    /// Gives a texture of any shape its texels: level after level, in each layer after layer, slice
    /// after slice, row after row.
    #[must_use]
    pub fn levels(
        self,
        name: &str,
        size: [u32; 3],
        levels: u32,
        layers: u32,
        format: TexelFormat,
        texels: impl IntoIterator<Item = glam::Vec4>,
    ) -> Self {
        self.with(
            name,
            Value::Texture {
                size,
                levels,
                layers,
                samples: 1,
                format,
                bytes: stored(format, texels),
            },
        )
    }

    /// Says how a texture is sampled.
    #[must_use]
    pub fn sampler(self, name: &str, sampler: Sampler) -> Self {
        self.with(name, Value::Sampler(sampler))
    }
}

/// A number of the precision that a kernel is asked in: `f32` or `f64`.
pub trait Float: Real + Pod {
    /// The nearest one.
    fn of(x: f64) -> Self;
}

impl Float for f32 {
    fn of(x: f64) -> Self {
        x as Self
    }
}

impl Float for f64 {
    fn of(x: f64) -> Self {
        x
    }
}

/// Random numbers, the same for the same seed on every machine (SplitMix64: Steele, Lea and Flood,
/// Fast splittable pseudorandom number generators, 2014).
#[derive(Clone, Debug)]
pub struct Source(u64);

impl Source {
    /// The numbers of a seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Any 64 bits.
    pub const fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From 0 to 1, 1 excluded.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// From `low` to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// From 10 to the power of `low` to 10 to the power of `high`, every order of magnitude alike.
    pub fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10.0_f64.powf(self.between(low, high))
    }

    /// A whole number, both ends included.
    pub fn count(&mut self, low: u32, high: u32) -> u32 {
        let n = u64::from(high.saturating_sub(low)) + 1;
        low + (self.bits() % n) as u32
    }

    /// 1 or -1.
    pub fn sign(&mut self) -> f64 {
        if self.bits() & 1 == 0 { 1.0 } else { -1.0 }
    }

    /// Standard normal (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        // 1 - [0, 1) is never 0.
        let radius = (-2.0 * (1.0 - self.unit()).ln()).sqrt();
        radius * (core::f64::consts::TAU * self.unit()).cos()
    }

    /// One of some, of which there must be at least one.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[(self.bits() % from.len() as u64) as usize]
    }
}
