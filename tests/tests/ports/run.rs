//! Running a port natively, as generated WGSL and as WGSL by hand, with one and the same host code.

use std::collections::BTreeMap;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use hankel_dsl::bytemuck::{self, Pod};
use hankel_dsl::native::describe::TexelFormat;
use hankel_dsl::native::{Address, Compare, Filter, Sampler};
use hankel_host::crates::KernelEntry;
use hankel_host::device::{
    self, Backend, Bind, Blend, BufferId, Colour, Cull, Depth, DepthTest, Device, Draw,
    NativeDevice, Pass, Program, Shader, TextureId, TextureShape, Topology,
};
use hankel_tests::{Crate, root};

/// Which way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// On this machine's processor.
    Native,
    /// As the WGSL that is generated.
    Generated,
    /// As the WGSL by hand.
    Hand,
}

/// How large a run is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// To be checked.
    Small,
    /// To be timed.
    Large,
}

impl Scale {
    /// One of two numbers.
    pub const fn of(self, small: u32, large: u32) -> u32 {
        match self {
            Self::Small => small,
            Self::Large => large,
        }
    }
}

/// A port.
pub struct Port {
    /// Its file in `examples/ports/src`.
    pub file: &'static str,
    /// What it is.
    pub what: &'static str,
    /// Its kernels.
    pub kernels: &'static [&'static str],
    /// Makes its inputs.
    pub prepare: fn(&mut Runner<'_>, Scale) -> Prepared,
}

/// A port with its inputs on a device.
pub struct Prepared {
    /// Runs it once.
    pub work: Box<dyn Fn(&mut Runner<'_>)>,
    /// Whether what it made is right. Only after a small run.
    pub check: Box<dyn Fn(&mut Runner<'_>)>,
}

/// The texts of all kernels.
pub struct Ports {
    /// The crate.
    pub krate: Crate,
    entries: BTreeMap<String, KernelEntry>,
    /// WGSL by kernel, generated.
    pub generated: BTreeMap<String, String>,
    /// WGSL by kernel, by hand.
    pub hand: BTreeMap<String, String>,
}

/// The folder of the ports.
pub fn folder() -> PathBuf {
    root().join("examples/ports")
}

impl Ports {
    /// Generates and reads them.
    pub fn new() -> Self {
        let krate = Crate::ports();
        let files = krate.generate().files;
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).expect("WGSL is UTF-8");
        let mut ports = Self {
            entries: BTreeMap::new(),
            generated: BTreeMap::new(),
            hand: BTreeMap::new(),
            krate,
        };
        for entry in &ports.krate.entries {
            let name = entry.kernel.name.clone();
            // The function's name: a kernel of one format has it in its own name.
            let hand = folder().join(format!("hand/{}.wgsl", entry.kernel.function));
            let hand =
                fs::read_to_string(&hand).unwrap_or_else(|e| panic!("{}: {e}", hand.display()));
            let generated = text(&files[&format!("wgsl/{name}.wgsl")]);
            ports.generated.insert(name.clone(), generated);
            ports.hand.insert(name.clone(), hand);
            ports.entries.insert(name, entry.clone().into());
        }
        ports
    }

    /// A runner.
    pub fn runner(&self, way: Way) -> Runner<'_> {
        let backend = match way {
            Way::Native => Backend::Native,
            Way::Generated | Way::Hand => Backend::Vulkan,
        };
        Runner {
            ports: self,
            way,
            device: device::open(backend).unwrap_or_else(|e| panic!("{e}")),
        }
    }

    /// Runs and checks a port every way. Gives those that are wrong; what is wrong with them is printed.
    pub fn check(&self, port: &Port) -> Vec<String> {
        let is_wrong = |way| {
            let run = || {
                let mut runner = self.runner(way);
                let prepared = (port.prepare)(&mut runner, Scale::Small);
                (prepared.work)(&mut runner);
                (prepared.check)(&mut runner);
            };
            catch_unwind(AssertUnwindSafe(run)).is_err()
        };
        let ways = [Way::Native, Way::Generated, Way::Hand].into_iter();
        ways.filter(|way| is_wrong(*way))
            .map(|way| format!("{}, {way:?}", port.file))
            .collect()
    }
}

/// A device, and which texts it runs.
pub struct Runner<'a> {
    ports: &'a Ports,
    /// Which.
    pub way: Way,
    /// On what.
    pub device: Box<dyn Device>,
}

/// A draw call over the whole of its targets.
pub struct Drawn<'a> {
    /// The vertex kernel, and its arguments.
    pub vertex: (&'a str, &'a [Bind<'a>]),
    /// The fragment kernel, and its arguments.
    pub fragment: (&'a str, &'a [Bind<'a>]),
    /// How many vertices.
    pub count: u32,
    /// Targets.
    pub targets: &'a [TextureId],
    /// Depths.
    pub depth: Option<TextureId>,
}

impl Runner<'_> {
    fn program(&self, kernel: &str) -> Program<'_> {
        let entry = self
            .ports
            .entries
            .get(kernel)
            .unwrap_or_else(|| panic!("there is no kernel `{kernel}`"));
        let text = match self.way {
            Way::Native => return entry.program(None, &[]),
            Way::Generated => &self.ports.generated[kernel],
            Way::Hand => &self.ports.hand[kernel],
        };
        let entry_point = match self.way {
            Way::Hand => &entry.kernel.function,
            _ => &entry.kernel.name,
        };
        let shader = Shader::Wgsl { text, entry_point };
        entry.program(Some(shader), &[])
    }

    /// Runs a kernel.
    pub fn dispatch(&mut self, kernel: &str, args: &[Bind<'_>]) {
        // The device is borrowed apart from the texts.
        let mut device = std::mem::replace(&mut self.device, Box::new(NativeDevice::new()));
        let result = device.dispatch(&self.program(kernel), args);
        self.device = device;
        result.unwrap_or_else(|e| panic!("{kernel}, {:?}: {e}", self.way));
    }

    /// Draws.
    pub fn draw(&mut self, drawn: &Drawn<'_>) {
        let mut device = std::mem::replace(&mut self.device, Box::new(NativeDevice::new()));
        let colours: Vec<Colour> = drawn
            .targets
            .iter()
            .map(|&texture| Colour {
                texture,
                resolve: None,
                clear: Some([0.0; 4]),
                blend: Blend::Off,
            })
            .collect();
        let result = device.draw(&Pass {
            label: drawn.fragment.0,
            colours: &colours,
            depth: drawn.depth.map(|texture| Depth {
                texture,
                clear: Some(1.0),
                test: DepthTest::Less,
                write: true,
            }),
            draws: &[Draw {
                vertex: self.program(drawn.vertex.0),
                vertex_args: drawn.vertex.1,
                fragment: Some(self.program(drawn.fragment.0)),
                fragment_args: drawn.fragment.1,
                indices: None,
                count: drawn.count,
                topology: Topology::Triangles,
                cull: Cull::None,
            }],
        });
        self.device = device;
        result.unwrap_or_else(|e| panic!("{}, {:?}: {e}", drawn.fragment.0, self.way));
    }

    /// A buffer of some values.
    pub fn buffer<T: Pod>(&mut self, values: &[T]) -> BufferId {
        let bytes = bytemuck::cast_slice(values);
        self.device
            .buffer_from("buffer", bytes)
            .unwrap_or_else(|e| panic!("{e}"))
    }

    /// A buffer of zeros.
    pub fn zeros(&mut self, bytes: usize) -> BufferId {
        self.device
            .buffer("zeros", bytes)
            .unwrap_or_else(|e| panic!("{e}"))
    }

    /// Fills a buffer with zeros.
    pub fn clear(&mut self, buffer: BufferId) {
        self.device
            .clear_buffer(buffer)
            .unwrap_or_else(|e| panic!("{e}"));
    }

    /// What is in a buffer.
    pub fn read<T: Pod>(&mut self, buffer: BufferId) -> Vec<T> {
        let bytes = self
            .device
            .read_buffer(buffer)
            .unwrap_or_else(|e| panic!("{e}"));
        bytemuck::pod_collect_to_vec(&bytes)
    }

    /// A texture, empty.
    pub fn texture(&mut self, shape: &TextureShape) -> TextureId {
        self.device
            .texture("texture", shape)
            .unwrap_or_else(|e| panic!("{e}"))
    }

    /// A texture of four floats a texel, in any format.
    pub fn texels(&mut self, shape: &TextureShape, texels: &[[f32; 4]]) -> TextureId {
        let format = shape.format.texel();
        let mut bytes = vec![0; shape.bytes()];
        assert_eq!(bytes.len(), texels.len() * format.bytes());
        for (to, texel) in bytes.chunks_mut(format.bytes()).zip(texels) {
            format.store(to, (*texel).into());
        }
        self.device
            .texture_from("texels", shape, &bytes)
            .unwrap_or_else(|e| panic!("{e}"))
    }

    /// What is in a texture of floats.
    pub fn read_texels(&mut self, texture: TextureId, format: TexelFormat) -> Vec<[f32; 4]> {
        let bytes = self
            .device
            .read_texture(texture)
            .unwrap_or_else(|e| panic!("{e}"));
        bytes
            .chunks(format.bytes())
            .map(|texel| format.load(texel).to_array())
            .collect()
    }

    /// What is in a texture of unsigned integers.
    pub fn read_integers(&mut self, texture: TextureId) -> Vec<u32> {
        let bytes = self
            .device
            .read_texture(texture)
            .unwrap_or_else(|e| panic!("{e}"));
        bytemuck::pod_collect_to_vec(&bytes)
    }
}

/// Filters linearly, and clamps to the edge.
pub const LINEAR: Bind<'static> = Bind::Sampler(Sampler::new(Filter::Linear, Address::ClampToEdge));

/// Filters linearly, and repeats.
pub const REPEATED: Bind<'static> = Bind::Sampler(Sampler::new(Filter::Linear, Address::Repeat));

/// Compares, and filters what holds.
pub fn comparing() -> Bind<'static> {
    Bind::Sampler(Sampler {
        compare: Some(Compare::LessEqual),
        ..Sampler::new(Filter::Linear, Address::ClampToEdge)
    })
}

/// Compares a picture with the committed one: at most two steps of 255 anywhere. `INSTA_UPDATE=always`
/// writes it anew from the native run, or from the first that draws.
pub fn picture(name: &str, way: Way, width: u32, pixels: &[[f32; 4]]) {
    let path = folder().join(format!("pictures/{name}.png"));
    let bytes: Vec<u8> = pixels
        .iter()
        .flat_map(|p| [p[0], p[1], p[2]])
        .map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)
        .collect();
    let height = pixels.len() as u32 / width;
    if way != Way::Hand && std::env::var("INSTA_UPDATE").is_ok_and(|v| v == "always") {
        let mut encoded = Vec::new();
        let mut encoder = png::Encoder::new(&mut encoded, width, height);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header().expect("a header can be written");
        writer.write_image_data(&bytes).expect("the size is right");
        writer.finish().expect("a buffer is not full");
        fs::write(&path, encoded).expect("the picture can be written");
        return;
    }
    let file = fs::File::open(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut reader = png::Decoder::new(std::io::BufReader::new(file))
        .read_info()
        .expect("a PNG");
    let mut there = vec![0; reader.output_buffer_size().expect("it fits into memory")];
    let info = reader.next_frame(&mut there).expect("a whole picture");
    assert_eq!((info.width, info.height), (width, height), "{name}");
    for (i, (a, b)) in bytes.iter().zip(&there).enumerate() {
        assert!(
            a.abs_diff(*b) <= 2,
            "{name}, {way:?}, pixel ({}, {}): {a}, not {b}",
            i as u32 / 3 % width,
            i as u32 / 3 / width
        );
    }
}
