//! Visibility by the device's rasteriser.

use std::collections::HashMap;

use hankel_host::device::{
    Colour, Depth, Device, Draw as DeviceDraw, Pass, TextureId, TextureShape,
};

use super::{CULL, Draw, FAR, Onto, SAMPLES, SEEN, TOPOLOGY};
use crate::error::{Result, during};

/// What draws need beside their targets: one of each shape, since draws follow one another.
#[derive(Default)]
pub struct Raster {
    scratch: HashMap<TextureShape, TextureId>,
    pub bytes: usize,
}

impl Raster {
    fn scratch(
        &mut self,
        device: &mut dyn Device,
        label: &str,
        shape: TextureShape,
    ) -> Result<TextureId> {
        if let Some(texture) = self.scratch.get(&shape) {
            return Ok(*texture);
        }
        let texture = device.texture(label, &shape).map_err(during(label))?;
        self.scratch.insert(shape, texture);
        self.bytes += shape.bytes();
        Ok(texture)
    }

    pub fn draw(&mut self, device: &mut dyn Device, draw: &Draw<'_>) -> Result<()> {
        let mut colours = Vec::new();
        let depth = match draw.onto {
            Onto::Depth(texture) => texture,
            Onto::Colour {
                texture,
                background,
            } => {
                let shape = draw.shape.multisampled(SAMPLES);
                colours.push(Colour {
                    texture: self.scratch(device, draw.label, shape)?,
                    resolve: Some(texture),
                    clear: Some(background),
                });
                let [width, height, _] = shape.size;
                let depth = TextureShape::depth(width, height).multisampled(SAMPLES);
                self.scratch(device, draw.label, depth)?
            }
        };
        let pass = Pass {
            label: draw.label,
            colours: &colours,
            depth: Some(Depth {
                texture: depth,
                clear: Some(FAR),
                test: SEEN,
                write: true,
            }),
            draws: &[DeviceDraw {
                vertex: draw.vertex.program,
                vertex_args: &draw.vertex.args,
                fragment: draw.fragment.as_ref().map(|f| f.program),
                fragment_args: draw.fragment.as_ref().map_or(&[], |f| &f.args),
                indices: Some(draw.indices.buffer),
                count: draw.count,
                topology: TOPOLOGY,
                cull: CULL,
            }],
        };
        device.draw(&pass).map_err(during(draw.label))
    }

    pub fn free(&mut self, device: &mut dyn Device) {
        for (_, texture) in self.scratch.drain() {
            // The device is gone if it cannot free.
            let _ = device.free_texture(texture);
        }
        self.bytes = 0;
    }
}
