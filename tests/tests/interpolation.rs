//! How values are interpolated and which samples are written, seen in a target with several samples: in parity's
//! targets, which have one, all ways give the same.

use hankel_codegen::build::Generated;
use hankel_codegen::spirv::words;
use hankel_dsl::native::describe::{Kernel, Output, TexelFormat, Type};
use hankel_host::device::{
    Bind, Blend, Colour, Cull, Device, Draw, Pass, Program, Shader, TextureShape, Topology,
    VulkanDevice,
};
use hankel_tests::Crate;

const SIZE: u32 = 8;

struct Made {
    of: Crate,
    generated: Generated,
}

fn made() -> Made {
    let of = Crate::conformance();
    Made {
        generated: of.generate(),
        of,
    }
}

/// A stage as it is generated, in WGSL and in SPIR-V.
struct Stage {
    kernel: Kernel,
    wgsl: String,
    spirv: Vec<u32>,
}

impl Stage {
    fn of(made: &Made, name: &str) -> Self {
        let entries = made.of.entries.iter();
        let entry = entries
            .map(|entry| &entry.kernel)
            .find(|kernel| kernel.name == name);
        let wanted = format!("/{name}.wgsl");
        let mut files = made.generated.files.iter();
        let (_, text) = files
            .find(|(path, _)| path.ends_with(&wanted))
            .unwrap_or_else(|| panic!("no {wanted}"));
        Self {
            kernel: entry.expect("it is listed").clone(),
            wgsl: String::from_utf8(text.clone()).expect("it is text"),
            spirv: words(&made.of.bundle.modules[name], name).expect("it is SPIR-V"),
        }
    }

    fn program(&self, is_spirv: bool) -> Program<'_> {
        let shader = if is_spirv {
            Shader::SpirvPassthrough(&self.spirv)
        } else {
            Shader::Wgsl {
                text: &self.wgsl,
                entry_point: &self.kernel.name,
            }
        };
        Program {
            kernel: &self.kernel,
            constants: &[],
            native: None,
            shader: Some(shader),
        }
    }
}

/// What is drawn: attributes of three vertices.
type Attributes<'a> = [&'a [u8]];

/// The means of each pixel's four samples, of the first target; as many targets as the fragment kernel has.
fn drawn(stages: [&Stage; 2], is_spirv: bool, attributes: &Attributes<'_>) -> Vec<[f32; 4]> {
    let mut gpu = VulkanDevice::new().expect("a Vulkan driver is there");
    let [vertex, fragment] = stages;
    let is_pair = |output: &Output| {
        matches!(
            output,
            Output::Target {
                ty: Type::Vector { size: 2, .. },
                ..
            }
        )
    };
    let format = if fragment.kernel.outputs.iter().any(is_pair) {
        TexelFormat::Rg16Float
    } else {
        TexelFormat::Rgba16Float
    };
    let shape = TextureShape::d2(SIZE, SIZE, format);
    let mut colours = Vec::new();
    let mut resolved = Vec::new();
    for _ in 0..fragment.kernel.stored_outputs() {
        let many = gpu.texture("samples", &shape.multisampled(4)).unwrap();
        let one = gpu.texture("resolved", &shape).unwrap();
        resolved.push(one);
        colours.push(Colour {
            texture: many,
            resolve: Some(one),
            clear: Some([0.0; 4]),
            blend: Blend::Off,
        });
    }
    let buffers: Vec<_> = attributes
        .iter()
        .map(|bytes| Bind::Buffer(gpu.buffer_from("attribute", bytes).unwrap()))
        .collect();
    gpu.draw(&Pass {
        label: "a triangle",
        colours: &colours,
        depth: None,
        draws: &[Draw {
            vertex: vertex.program(is_spirv),
            vertex_args: &buffers,
            fragment: Some(fragment.program(is_spirv)),
            fragment_args: &[],
            indices: None,
            count: 3,
            topology: Topology::Triangles,
            cull: Cull::None,
        }],
    })
    .unwrap();
    let bytes = gpu.read_texture(resolved[0]).unwrap();
    bytes
        .chunks(format.bytes())
        .map(|texel| format.load(texel).to_array())
        .collect()
}

fn bytes(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Corners in clip space, of which two are farther away.
const CORNERS: [[f32; 4]; 3] = [
    [-0.8, -0.75, 0.5, 1.0],
    [3.6, -2.4, 2.0, 4.0],
    [-0.2, 1.7, 1.0, 2.0],
];
const TINTS: [[f32; 3]; 3] = [[0.0, 4.0, 0.0], [2.0, 0.0, 16.0], [1.0, 1.0, 4.0]];

fn triangle(fragment: &str, is_spirv: bool, made: &Made) -> Vec<[f32; 4]> {
    let corners = bytes(CORNERS.as_flattened());
    // Two of the barycentric coordinates: from 0 to 1 in the triangle.
    let uv = bytes(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let tints = bytes(TINTS.as_flattened());
    let stages = ["interpolated", fragment].map(|name| Stage::of(made, name));
    drawn([&stages[0], &stages[1]], is_spirv, &[&corners, &uv, &tints])
}

/// Weights of the three corners on the screen, at a pixel's centre.
fn weights(pixel: usize) -> [f32; 3] {
    let place = |at: [f32; 4]| [at[0] / at[3], at[1] / at[3]];
    let [a, b, c] = CORNERS.map(place);
    let (column, row) = (pixel % SIZE as usize, pixel / SIZE as usize);
    let p = [
        (column as f32 + 0.5) * 2.0 / SIZE as f32 - 1.0,
        1.0 - (row as f32 + 0.5) * 2.0 / SIZE as f32,
    ];
    let cross = |a: [f32; 2], b: [f32; 2], c: [f32; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let whole = cross(a, b, c);
    [
        cross(p, b, c) / whole,
        cross(a, p, c) / whole,
        cross(a, b, p) / whole,
    ]
}

/// Pixels all of which, and all next to which, the triangle covers.
fn inner() -> Vec<usize> {
    (0..(SIZE * SIZE) as usize)
        .filter(|&pixel| weights(pixel).iter().all(|w| *w > 0.12))
        .collect()
}

#[test]
fn centroids_lie_within_the_triangle() {
    let made = made();
    for is_spirv in [true, false] {
        let pixels = triangle("covered_place", is_spirv, &made);
        let least = |channel: usize| {
            let channel = pixels.iter().map(|texel| texel[channel]);
            channel.fold(f32::INFINITY, f32::min)
        };
        let [centre, within] = [least(0).min(least(1)), least(2).min(least(3))];
        // Beyond an edge, the centre's value is extrapolated.
        assert!(centre < -0.005, "{centre}, SPIR-V: {is_spirv}");
        assert!(within > -0.001, "{within}, SPIR-V: {is_spirv}");
    }
}

#[test]
fn values_are_linear_on_the_screen() {
    let made = made();
    assert!(inner().len() > 6);
    for is_spirv in [true, false] {
        let pixels = triangle("screen_linear", is_spirv, &made);
        for pixel in inner() {
            let weights = weights(pixel);
            let on_screen: f32 = weights.iter().zip(TINTS).map(|(w, t)| w * t[0]).sum();
            let per_w = |i: usize| weights[i] / CORNERS[i][3];
            let whole: f32 = (0..3).map(per_w).sum();
            let in_space: f32 = (0..3).map(|i| per_w(i) * TINTS[i][0] / whole).sum();
            let found = pixels[pixel][0];
            let problem = format!("pixel {pixel}, SPIR-V: {is_spirv}: {found}");
            assert!((found - on_screen).abs() < 2e-3, "{problem}, {on_screen}");
            assert!((found - in_space).abs() > 0.05, "{problem}, {in_space}");
        }
    }
}

#[test]
fn samples_have_values_of_their_own() {
    let made = made();
    for is_spirv in [true, false] {
        let pixels = triangle("at_samples", is_spirv, &made);
        for pixel in inner() {
            let [mean, of_squares, linear, of_linear_squares] = pixels[pixel];
            // The variance of the samples' values. One value for all would leave the rounding of 16 bits: a 2000th of the
            // square, twice.
            let variance = of_squares - mean * mean;
            let linear_variance = of_linear_squares - linear * linear;
            let problem = format!("pixel {pixel}, SPIR-V: {is_spirv}: {:?}", pixels[pixel]);
            assert!(variance > of_squares * 0.002, "{problem}");
            assert!(linear_variance > of_linear_squares * 0.002, "{problem}");
        }
    }
}

#[test]
fn a_mask_says_which_samples_are_written() {
    let made = made();
    let stages = ["numbered", "coverage"].map(|name| Stage::of(&made, name));
    let whole: [f32; 12] = [
        -1.0, -1.0, 0.0, 1.0, 3.0, -1.0, 0.0, 1.0, -1.0, 3.0, 0.0, 1.0,
    ];
    let turns = [0_u8; 36];
    // Odd, and two samples; of the first vertex, which has no number of its own.
    for (id, share) in [(11_u32, 0.5), (3, 0.25), (31, 1.0), (33, 0.0), (32, 1.0)] {
        let ids: Vec<u8> = [id; 3].iter().flat_map(|id| id.to_le_bytes()).collect();
        for is_spirv in [true, false] {
            let pixels = drawn(
                [&stages[0], &stages[1]],
                is_spirv,
                &[&bytes(&whole), &ids, &turns],
            );
            for texel in pixels {
                let problem = format!("id {id}, SPIR-V: {is_spirv}: {texel:?}");
                assert_eq!(texel[1], id as f32 * share, "{problem}");
                // The first number is not looked at: lavapipe 22.3.6 finds other samples covered than the four that are.
            }
        }
    }
}
