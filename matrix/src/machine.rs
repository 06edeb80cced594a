//! What of this machine decides results beside the tools themselves: the processor, which drivers
//! compile for, and the environment variables that drivers, loaders and browsers read.

use std::collections::BTreeMap;
use std::env;
use std::fs;
use std::sync::OnceLock;

use serde::Serialize;

/// Beginnings of the names of variables that drivers, their compilers, loaders and browsers read.
const VARIABLES: [&str; 24] = [
    "CHROME",
    "CHROMIUM",
    "DAWN_",
    "DRAW_",
    "DRI_",
    "EGL_",
    "GALLIUM_",
    "GALLIVM_",
    "HANKEL_SIMD",
    "LD_",
    "LIBGL_",
    "LP_",
    "LVP_",
    "MESA_",
    "NIR_",
    "NODE_",
    "OMP_",
    "RUSTFLAGS",
    "SOFTPIPE_",
    "ST_",
    "SWIFTSHADER",
    "TINT_",
    "VK_",
    "WGPU_",
];

/// What decides.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Machine {
    /// The processor's name and instruction sets.
    processor: String,
    /// The variables that are set.
    variables: BTreeMap<String, String>,
}

impl Machine {
    /// This one.
    #[must_use]
    pub fn this() -> &'static Self {
        static THIS: OnceLock<Machine> = OnceLock::new();
        THIS.get_or_init(|| Self {
            processor: processor(),
            variables: decisive(env::vars_os().filter_map(|(name, value)| {
                let value = value.to_string_lossy().into_owned();
                Some((name.into_string().ok()?, value))
            })),
        })
    }
}

/// The variables that decide.
fn decisive(all: impl Iterator<Item = (String, String)>) -> BTreeMap<String, String> {
    all.filter(|(name, _)| VARIABLES.iter().any(|v| name.starts_with(v)))
        .collect()
}

/// The first processor's name and features, as the system says.
fn processor() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let first = text.split("\n\n").next().unwrap_or_default();
    let wanted = [
        "vendor_id",
        "model name",
        "stepping",
        "flags",
        "CPU part",
        "Features",
    ];
    let lines: Vec<&str> = first
        .lines()
        .filter(|line| wanted.iter().any(|w| line.starts_with(w)))
        .collect();
    format!("{} {}", env::consts::ARCH, lines.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_drivers_read_is_kept_and_the_rest_is_not() {
        let all = [
            ("LP_NUM_THREADS", "1"),
            ("VK_LAYER_PATH", "x"),
            ("LD_LIBRARY_PATH", "y"),
            ("HOME", "z"),
        ];
        let kept = decisive(all.iter().map(|(n, v)| ((*n).into(), (*v).into())));
        let names: Vec<&str> = kept.keys().map(String::as_str).collect();
        assert_eq!(
            names,
            ["LD_LIBRARY_PATH", "LP_NUM_THREADS", "VK_LAYER_PATH"]
        );
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_processor_has_a_name() {
        assert!(processor().len() > 20, "{}", processor());
    }
}
