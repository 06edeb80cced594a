//! How a kernel's SPIR-V reaches a Vulkan driver. What the kernel's description says of rounding
//! decides, here and nowhere else: whoever runs a kernel on Vulkan asks [`Arithmetic::of`].

use std::borrow::Cow;

use hankel_dsl::native::describe::{Kernel, Rounding};

use super::Shader;

/// What a driver may do with float arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arithmetic {
    /// Contract, factor and reorder it.
    Free,
    /// Nothing of that. Only SPIR-V that reaches the driver as it is can ask for it: naga drops
    /// `NoContraction`.
    Pinned,
}

impl Arithmetic {
    /// What `kernels`, which are part of one pipeline, allow: the strictest of them decides, since
    /// wgpu wants both stages of a draw by the same way.
    pub fn of<'a>(kernels: impl IntoIterator<Item = &'a Kernel>) -> Self {
        let free = |kernel: &Kernel| kernel.rounding == Rounding::Free;
        if !kernels.into_iter().all(free) {
            Self::Pinned
        } else {
            Self::Free
        }
    }

    /// The way that keeps it.
    #[must_use]
    pub const fn shader(self, spirv: &[u32]) -> Shader<'_> {
        match self {
            Self::Free => Shader::SpirvThroughNaga(spirv),
            Self::Pinned => Shader::SpirvPassthrough(spirv),
        }
    }
}

/// WGSL as naga 30 reads it, which has the operations of subgroups and refuses the line that WGSL asks
/// for before them.
#[must_use]
pub fn for_naga(wgsl: &str) -> Cow<'_, str> {
    const LINE: &str = "enable subgroups;";
    match wgsl.split_once(LINE) {
        Some((before, after)) => Cow::Owned([before, after].concat()),
        None => Cow::Borrowed(wgsl),
    }
}

#[cfg(test)]
mod tests {
    use super::for_naga;

    #[test]
    fn one_line_is_taken_out() {
        let text = "// Generated.\nenable subgroups;\n\nfn main() {}\n";
        assert_eq!(for_naga(text), "// Generated.\n\n\nfn main() {}\n");
        assert_eq!(for_naga("fn main() {}"), "fn main() {}");
    }
}
