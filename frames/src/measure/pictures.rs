//! Pictures of the light of many configurations, each part drawn once.

use std::collections::HashMap;

use hankel_host::device::Device;

use super::Configuration;
use crate::error::Result;
use crate::executor::Shaders;
use crate::scene::{Mesh, Scene, Shadow};
use crate::truth::scattering::{behind, transmittance};
use crate::truth::{Arriving, by_technique_on, scattered_by_technique_on};

/// Bytes of pictures that are kept.
const KEPT: usize = 256 << 20;

/// What configurations draw of a scene's light: what arrives at the surfaces; where there is a medium, that as it is
/// seen through it, with what the medium scatters. The one is the same with every way to make the other.
#[derive(Default)]
pub struct Pictures {
    through: Option<Arriving>,
    kept: HashMap<String, Arriving>,
}

impl Pictures {
    /// The light of a configuration.
    ///
    /// # Errors
    /// See [`crate::FrameError`].
    pub fn light(
        &mut self,
        device: &mut dyn Device,
        shaders: &dyn Shaders,
        scene: &Scene,
        mesh: &Mesh,
        configuration: &Configuration,
    ) -> Result<Arriving> {
        let name = configuration.without_scattering().to_string();
        let configured = configuration.on(scene);
        if scene.medium.is_none() {
            return by_technique_on(device, shaders, &configured, mesh);
        }
        let surfaces = match self.kept.get(&name) {
            Some(kept) => kept.clone(),
            None => {
                let surfaces = by_technique_on(device, shaders, &configured, mesh)?;
                self.keep(name, &surfaces);
                surfaces
            }
        };
        let scattered = self.scattered(device, shaders, scene, mesh, configuration)?;
        let through = match &self.through {
            Some(through) => through,
            None => self.through.insert(transmittance(scene, mesh)),
        };
        Ok(behind(&surfaces, through, &scattered))
    }

    /// What the medium scatters, by a configuration: its technique of shadows has no part in it.
    ///
    /// # Errors
    /// See [`crate::FrameError`].
    pub fn scattered(
        &mut self,
        device: &mut dyn Device,
        shaders: &dyn Shaders,
        scene: &Scene,
        mesh: &Mesh,
        configuration: &Configuration,
    ) -> Result<Arriving> {
        let any = Shadow::default();
        let of = Configuration {
            technique: any.technique,
            map: any.map,
            multisampling: any.multisampling,
            ..*configuration
        };
        let name = format!("scattered: {of}");
        if let Some(kept) = self.kept.get(&name) {
            return Ok(kept.clone());
        }
        let scattered = scattered_by_technique_on(device, shaders, &of.on(scene), mesh)?;
        self.keep(name, &scattered);
        Ok(scattered)
    }

    fn keep(&mut self, name: String, picture: &Arriving) {
        let bytes = size_of_val(picture.values.as_slice());
        if (self.kept.len() + 1) * bytes <= KEPT {
            self.kept.insert(name, picture.clone());
        }
    }
}
