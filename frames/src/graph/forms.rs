//! The forms of image passes: compute, as techniques add them, or fragment.

use std::fmt;
use std::str::FromStr;

use hankel_dsl::native::describe::Stage;
use hankel_host::device::slots;

use super::check::{Place, stage_name};
use super::{Call, Graph, Result, Work};

/// How image passes run: those that give a texel for each index, from a function that has both forms.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ImagePasses {
    /// By compute kernels, which write storage textures.
    #[default]
    Compute,
    /// By fragment kernels, which draw into render targets, as far as there are such.
    Fragment,
}

impl ImagePasses {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Compute, Self::Fragment];

    /// The name on the command line and in `frame.json`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Compute => "compute",
            Self::Fragment => "fragment",
        }
    }
}

impl fmt::Display for ImagePasses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for ImagePasses {
    type Err = String;

    fn from_str(name: &str) -> std::result::Result<Self, String> {
        let found = Self::ALL.into_iter().find(|it| it.name() == name);
        found.ok_or_else(|| format!("image passes run as `compute` or `fragment`, not as `{name}`"))
    }
}

/// The vertex kernel of a triangle that covers the target.
const FULL_SCREEN: &str = "full_screen";

/// Vertices of that triangle.
pub const FULL_SCREEN_VERTICES: u32 = 3;

impl Graph {
    /// Makes all image passes run in this form from now on. Compute passes whose kernels have no fragment form stay
    /// as they are, and are noted as left out.
    ///
    /// # Errors
    /// [`super::GraphError::Kernel`] for a fragment form, or the kernel of the triangle, that is not among the
    /// graph's kernels, or that does not take what its compute form takes.
    pub fn set_image_passes(&mut self, form: ImagePasses) -> Result<()> {
        if form == ImagePasses::Compute {
            return Ok(());
        }
        let mut others = Vec::new();
        let mut drawn = Vec::new();
        for (number, pass) in self.passes.iter().enumerate() {
            let Work::Compute(call) = &pass.work else {
                continue;
            };
            let kernel = &self.kernels[call.kernel].kernel;
            match kernel.fragment_form() {
                Some(fragment) => drawn.push((number, self.drawn(&pass.label, call, fragment)?)),
                None => others.push(kernel.name.clone()),
            }
        }
        for (number, work) in drawn {
            self.passes[number].work = work;
        }
        for kernel in others {
            self.omit(
                format!("fragment form of `{kernel}`"),
                "its kernel has none: it stays a compute pass",
            );
        }
        Ok(())
    }

    /// A compute pass as a draw.
    fn drawn(&self, pass: &str, call: &Call, fragment: &str) -> Result<Work> {
        let place = |kernel| Place { pass, kernel };
        let compute = &self.kernels[call.kernel].kernel;
        let wanted = slots::slots(compute);
        let takes = &wanted[..wanted.len() - compute.outputs.len()];
        let number = self.find(place(fragment))?;
        let kernel = &self.kernels[number].kernel;
        if !kernel.is_fragment_form()
            || slots::drawn_slots(kernel) != takes
            || kernel.outputs.len() != compute.outputs.len()
        {
            return Err(place(fragment).kernel(format!(
                "it is not a fragment form of `{}`: both have the same parameters, and as many outputs",
                compute.name
            )));
        }
        let fragment_call = Call {
            kernel: number,
            args: call.args[..takes.len()].to_vec(),
            constants: call.constants.clone(),
            most: None,
        };
        self.check(place(fragment), &fragment_call)?;
        let number = self.find(place(FULL_SCREEN))?;
        let vertex = &self.kernels[number].kernel;
        if vertex.stage != Stage::Vertex || !slots::drawn_slots(vertex).is_empty() {
            return Err(place(FULL_SCREEN).kernel(format!(
                "it is a {} kernel, but a vertex kernel without arguments is wanted",
                stage_name(&vertex.stage)
            )));
        }
        Ok(Work::FullScreen {
            vertex: Call {
                kernel: number,
                args: Vec::new(),
                constants: Vec::new(),
                most: None,
            },
            fragment: fragment_call,
        })
    }
}
