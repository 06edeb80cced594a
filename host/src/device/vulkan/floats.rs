//! How the device computes with 32-bit floats. Sums and products round as IEEE 754 says everywhere, if the driver may
//! not fuse them; what Vulkan leaves to a device, and what makes it do as IEEE 754 says, is measured and asked here.

use std::fmt;

use ash::vk;

use super::super::error::Result;
use super::{VulkanDevice, own, words};

const SHADER: &str = "
@group(0) @binding(0) var<storage, read> pairs: array<vec2<f32>>;
@group(0) @binding(1) var<storage, read_write> results: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let pair = pairs[id.x];
    results[id.x] = vec4<f32>(pair.x / pair.y, sqrt(pair.y), pair.x * 0x1p-126f, 0.0);
}
";

/// Invocations of a workgroup of the shader.
const WORKGROUP: usize = 64;
/// How many pairs are computed. A device whose quotients are off for one in a hundred passes once in 10^17 times.
const PAIRS: usize = 64 * WORKGROUP;
/// Bytes of a pair's results.
const RESULT: usize = 16;

/// How a device computes with 32-bit floats, where Vulkan leaves it a choice, and what it offers to compute as IEEE 754
/// says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Floats {
    /// The most that a quotient was off, in units in the last place; Vulkan allows 2.5.
    pub quotient: u32,
    /// The most that a square root was off.
    pub root: u32,
    /// Whether subnormal results become zero.
    pub flushes: bool,
    /// Whether there are 64-bit floats, in which quotients and roots can be computed and rounded.
    pub has_f64: bool,
    /// Whether a shader can forbid to flush (`DenormPreserve`).
    pub keeps_subnormals: bool,
    /// Whether a shader can ask for infinities, NaNs and the sign of zero (`SignedZeroInfNanPreserve`).
    pub keeps_specials: bool,
}

impl Floats {
    /// Computes as IEEE 754 says without being asked.
    pub const IEEE_754: Self = Self {
        quotient: 0,
        root: 0,
        flushes: false,
        has_f64: false,
        keeps_subnormals: false,
        keeps_specials: false,
    };

    /// Whether a shader need not ask for anything.
    #[must_use]
    pub const fn are_ieee_754(&self) -> bool {
        self.quotient == 0 && self.root == 0 && !self.flushes
    }

    /// SPIR-V that has the device compute as IEEE 754 says as far as it can: nothing is fused or reordered, subnormal
    /// numbers are kept, quotients and square roots are computed in 64 bits. None where it does so anyway.
    ///
    /// # Errors
    /// In words: what is not SPIR-V.
    pub fn as_ieee_754(&self, code: &[u32]) -> Option<std::result::Result<Vec<u32>, String>> {
        if self.are_ieee_754() {
            return None;
        }
        let mut modes = Vec::new();
        if self.keeps_subnormals {
            modes.push(words::DENORM_PRESERVE);
        }
        if self.keeps_specials {
            modes.push(words::SIGNED_ZERO_INF_NAN_PRESERVE);
        }
        let mut rewritten = words::forbid_reordering(code);
        if !modes.is_empty() {
            rewritten = rewritten.and_then(|code| words::with_modes(&code, &modes));
        }
        if self.has_f64 && (self.quotient, self.root) != (0, 0) {
            rewritten = rewritten.and_then(|code| words::round_quotients(&code));
        }
        Some(rewritten)
    }
}

impl fmt::Display for Floats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { quotient, root, .. } = self;
        let rounds = (*quotient, *root) == (0, 0);
        let mut left = Vec::new();
        if rounds {
            f.write_str("quotients and square roots of IEEE 754")?;
        } else {
            write!(
                f,
                "own quotients off by up to {quotient} ulp, square roots by {root}"
            )?;
            if !self.has_f64 {
                left.push("quotients and roots");
            }
        }
        if self.flushes {
            f.write_str(", subnormal numbers flushed")?;
            if !self.keeps_subnormals {
                left.push("flushing");
            }
        }
        if self.are_ieee_754() {
            return Ok(());
        }
        f.write_str("; parity computes as IEEE 754 says")?;
        match left.as_slice() {
            [] => Ok(()),
            left => write!(f, ", except for {}", left.join(" and ")),
        }
    }
}

/// Positive numbers of any mantissa, with exponents whose quotients are far from the ends of the range. The first
/// numbers of the first pairs are from 1/2 to 2: times the least normal number, half of them are subnormal.
fn pairs() -> Vec<[f32; 2]> {
    let mut rng = fastrand::Rng::with_seed(1);
    let mut number = |exponents| f32::from_bits((rng.u32(exponents) << 23) | rng.u32(..1 << 23));
    (0..PAIRS)
        .map(|i| match i {
            0..WORKGROUP => [number(126..128), number(95..160)],
            _ => [number(95..160), number(95..160)],
        })
        .collect()
}

impl VulkanDevice {
    /// How it computes with 32-bit floats, measured once.
    ///
    /// # Errors
    /// The driver's.
    pub fn floats(&mut self) -> Result<Floats> {
        if let Some(known) = self.floats {
            return Ok(known);
        }
        let pairs = pairs();
        let computed = self.computed(&pairs)?;
        let mut floats = Floats {
            has_f64: self.has_f64(),
            ..self.float_controls()
        };
        for ([x, y], computed) in pairs.iter().zip(computed.as_chunks::<RESULT>().0) {
            let [quotient, root, product] = [0, 4, 8].map(|at| {
                let bits = computed[at..].first_chunk().copied().unwrap_or_default();
                u32::from_le_bytes(bits)
            });
            let off = |computed: u32, exact: f32| computed.abs_diff(exact.to_bits());
            floats.quotient = floats.quotient.max(off(quotient, x / y));
            floats.root = floats.root.max(off(root, y.sqrt()));
            let exact = x * f32::MIN_POSITIVE;
            floats.flushes |= exact.is_subnormal() && product == 0;
        }
        self.floats = Some(floats);
        Ok(floats)
    }

    /// What shaders can ask for.
    fn float_controls(&self) -> Floats {
        let mut controls = vk::PhysicalDeviceFloatControlsProperties::default();
        let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut controls);
        // SAFETY: the adapter is only asked for its handles, which are not destroyed.
        let adapter = unsafe { self.adapter.as_hal::<wgpu::hal::api::Vulkan>() };
        // The structure is part of Vulkan 1.2.
        let adapter = adapter.filter(|it| {
            let limits = it.physical_device_capabilities().properties();
            limits.api_version >= vk::API_VERSION_1_2
        });
        if let Some(adapter) = adapter {
            let instance = adapter.shared_instance().raw_instance();
            let device = adapter.raw_physical_device();
            // SAFETY: the physical device is of this instance and has Vulkan 1.2; the structures outlive the call.
            unsafe { instance.get_physical_device_properties2(device, &mut properties) };
        }
        Floats {
            keeps_subnormals: controls.shader_denorm_preserve_float32 == vk::TRUE,
            keeps_specials: controls.shader_signed_zero_inf_nan_preserve_float32 == vk::TRUE,
            ..Floats::IEEE_754
        }
    }

    /// What the shader computes of them.
    fn computed(&self, pairs: &[[f32; 2]]) -> Result<Vec<u8>> {
        let during = || "measuring how floats are computed".to_owned();
        let given: &[u8] = bytemuck::cast_slice(pairs);
        let size = (pairs.len() * RESULT) as u64;
        let results = self.guarded(&during, |device| {
            let buffer = |label, size, usage| {
                device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some(label),
                    size,
                    usage: usage | wgpu::BufferUsages::STORAGE,
                    mapped_at_creation: false,
                })
            };
            let pairs = buffer("pairs", given.len() as u64, wgpu::BufferUsages::COPY_DST);
            let results = buffer("results", size, wgpu::BufferUsages::COPY_SRC);
            self.queue.write_buffer(&pairs, 0, given);
            let resources = [&pairs, &results].map(|buffer| buffer.as_entire_binding());
            let pipeline = own::pipeline(device, "floats", SHADER.into());
            let groups = [(PAIRS / WORKGROUP) as u32, 1, 1];
            self.run_own(device, "floats", &pipeline, resources, groups);
            results
        })?;
        self.download(&results, size, "measured floats")
    }
}
