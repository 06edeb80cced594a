//! What several tests need.
#![allow(dead_code, reason = "each test file uses some of it")]

use std::cell::Cell;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use hankel_dsl::glam::Vec4;
use hankel_host::device::{
    Backend, Bind, BufferId, Device, Pass, Program, Result, TextureId, TextureShape,
};

/// The committed SPIR-V of the built-in kernels.
pub fn shaders() -> BTreeMap<String, Vec<u32>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../snapshots/spirv");
    let modules: Vec<PathBuf> = std::fs::read_dir(&folder)
        .unwrap_or_else(|e| panic!("{}: {e}", folder.display()))
        .map(|entry| entry.unwrap_or_else(|e| panic!("{e}")).path())
        .filter(|path| path.extension().is_some_and(|e| e == "spv"))
        .collect();
    assert!(
        !modules.is_empty(),
        "there are no modules in {}",
        folder.display()
    );
    modules
        .iter()
        .map(|path| {
            let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
            let name = path
                .file_stem()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            (name, bytemuck::pod_collect_to_vec(&bytes))
        })
        .collect()
}

/// What a device was asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    pub dispatches: usize,
    pub draws: usize,
    pub made: usize,
    pub freed: usize,
    pub bytes: usize,
}

/// A device that counts.
pub struct Counting<D> {
    device: D,
    counts: Rc<Cell<Counts>>,
}

impl<D> Counting<D> {
    /// The device, and what it was asked for so far.
    pub fn new(device: D) -> (Self, Rc<Cell<Counts>>) {
        let counts = Rc::new(Cell::new(Counts::default()));
        let this = Self {
            device,
            counts: Rc::clone(&counts),
        };
        (this, counts)
    }

    fn count(&self, change: impl FnOnce(&mut Counts)) {
        let mut counts = self.counts.get();
        change(&mut counts);
        self.counts.set(counts);
    }
}

/// The same for devices and boxes of them.
pub trait Inner {
    fn device(&mut self) -> &mut dyn Device;
    fn shared(&self) -> &dyn Device;
}

impl Inner for hankel_host::device::NativeDevice {
    fn device(&mut self) -> &mut dyn Device {
        self
    }
    fn shared(&self) -> &dyn Device {
        self
    }
}

impl Inner for Box<dyn Device> {
    fn device(&mut self) -> &mut dyn Device {
        &mut **self
    }
    fn shared(&self) -> &dyn Device {
        &**self
    }
}

impl<D: Inner> Device for Counting<D> {
    fn name(&self) -> &str {
        self.device.shared().name()
    }
    fn backend(&self) -> Backend {
        self.device.shared().backend()
    }
    fn buffer(&mut self, label: &str, bytes: usize) -> Result<BufferId> {
        self.count(|c| (c.made, c.bytes) = (c.made + 1, c.bytes + bytes));
        self.device.device().buffer(label, bytes)
    }
    fn texture(&mut self, label: &str, shape: &TextureShape) -> Result<TextureId> {
        self.count(|c| (c.made, c.bytes) = (c.made + 1, c.bytes + shape.bytes()));
        self.device.device().texture(label, shape)
    }
    fn write_buffer(&mut self, buffer: BufferId, bytes: &[u8]) -> Result<()> {
        self.device.device().write_buffer(buffer, bytes)
    }
    fn write_texture(&mut self, texture: TextureId, bytes: &[u8]) -> Result<()> {
        self.device.device().write_texture(texture, bytes)
    }
    fn clear_buffer(&mut self, buffer: BufferId) -> Result<()> {
        self.device.device().clear_buffer(buffer)
    }
    fn clear_texture(&mut self, texture: TextureId, value: Vec4) -> Result<()> {
        self.device.device().clear_texture(texture, value)
    }
    fn copy_to_level(&mut self, from: TextureId, to: TextureId, level: u32) -> Result<()> {
        self.device.device().copy_to_level(from, to, level)
    }
    fn read_buffer(&mut self, buffer: BufferId) -> Result<Vec<u8>> {
        self.device.device().read_buffer(buffer)
    }
    fn read_texture(&mut self, texture: TextureId) -> Result<Vec<u8>> {
        self.device.device().read_texture(texture)
    }
    fn free_buffer(&mut self, buffer: BufferId) -> Result<()> {
        self.count(|c| c.freed += 1);
        self.device.device().free_buffer(buffer)
    }
    fn free_texture(&mut self, texture: TextureId) -> Result<()> {
        self.count(|c| c.freed += 1);
        self.device.device().free_texture(texture)
    }
    fn dispatch(&mut self, program: &Program<'_>, args: &[Bind<'_>]) -> Result<()> {
        self.count(|c| c.dispatches += 1);
        self.device.device().dispatch(program, args)
    }
    fn draw(&mut self, pass: &Pass<'_>) -> Result<()> {
        self.count(|c| c.draws += 1);
        self.device.device().draw(pass)
    }
    fn wait(&mut self) -> Result<()> {
        self.device.device().wait()
    }
}
