//! Visibility by the device's rasteriser.

use std::collections::HashMap;

use hankel_host::device::{
    Blend, Colour, Depth, Device, Draw as DeviceDraw, Pass, TextureId, TextureShape,
};

use super::{CULL, Draw, FAR, FullScreen, Onto, SEEN, TOPOLOGY};
use crate::error::{Result, during};
use crate::graph::FULL_SCREEN_VERTICES;

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
        let cleared = |texture| Depth {
            texture,
            clear: Some(FAR),
            test: SEEN,
            write: true,
        };
        let depth = match draw.onto {
            Onto::Depth(texture) => Some(cleared(texture)),
            Onto::Colour {
                texture,
                samples,
                background,
                blend,
                before,
            } => {
                let shape = draw.shape.multisampled(samples);
                let (texture, resolve) = if draw.shape.samples < samples {
                    (self.scratch(device, draw.label, shape)?, Some(texture))
                } else {
                    (texture, None)
                };
                colours.push(Colour {
                    texture,
                    resolve,
                    clear: Some(background),
                    blend,
                });
                let [width, height, _] = shape.size;
                match before {
                    Some(texture) => Some(Depth {
                        clear: None,
                        write: false,
                        ..cleared(texture)
                    }),
                    None if blend == Blend::Off => {
                        let depth = TextureShape::depth(width, height).multisampled(samples);
                        Some(cleared(self.scratch(device, draw.label, depth)?))
                    }
                    None => None,
                }
            }
        };
        let pass = Pass {
            label: draw.label,
            colours: &colours,
            depth,
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

/// Draws a triangle that covers the targets.
pub fn cover(device: &mut dyn Device, drawn: &FullScreen<'_>) -> Result<()> {
    let colour = |texture: &TextureId| Colour {
        texture: *texture,
        resolve: None,
        // Nothing that was there is wanted.
        clear: Some([0.0; 4]),
        blend: Blend::Off,
    };
    let colours: Vec<Colour> = drawn.targets.iter().map(colour).collect();
    let pass = Pass {
        label: drawn.label,
        colours: &colours,
        depth: None,
        draws: &[DeviceDraw {
            vertex: drawn.vertex.program,
            vertex_args: &drawn.vertex.args,
            fragment: Some(drawn.fragment.program),
            fragment_args: &drawn.fragment.args,
            indices: None,
            count: FULL_SCREEN_VERTICES,
            topology: TOPOLOGY,
            cull: CULL,
        }],
    };
    device.draw(&pass).map_err(during(drawn.label))
}
