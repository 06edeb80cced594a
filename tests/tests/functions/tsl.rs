//! TSL: what three.js makes of the module, for its WebGPU renderer and for WebGL 2, in the stubs of WGSL and
//! of GLSL ES. Besides the built-in library a sample of what that has none of: structures at interfaces,
//! branches, bits, and what the host looks up.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use hankel_codegen::Language;
use hankel_codegen::functions::print::Naming;
use hankel_codegen::functions::source::CrateText;
use hankel_codegen::functions::{self, FORMS};
use hankel_dsl::native::describe::{Scalar, Type};
use hankel_dsl::native::function::Function;
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;

use super::{PREFIX, beside, glsl, in_form, natives, text, tools, wgsl};

/// What the host of a sample looks up: twice, within itself, and with names of its own that a loop in a
/// shader may have. Counts are powers of two: no driver rounds such a quotient in a way of its own.
const HOST: &str = "\
import { Fn, float, uint } from 'three/tsl';
import { mean } from './hankel_sample.tsl.js';

export const meanOf = Fn(([x, turns]) => {
    const i = x.add(1).toVar('i');
    const first = mean(uint(4), (k) => float(k).mul(i));
    return first.add(mean(uint(1).shiftLeft(turns.bitAnd(uint(3))),
        (k) => mean(uint(2), (l) => float(k).mul(i).add(float(l)))));
}).setLayout({
    name: 'hankel_mean_of', type: 'float',
    inputs: [{ name: 'x', type: 'float' }, { name: 'turns', type: 'uint' }],
});
";

/// Functions, and their source.
macro_rules! both {
    ($($tokens:tt)*) => {
        $($tokens)*
        const SOURCE: &str = stringify!($($tokens)*);
    };
}

/// The sample.
#[allow(
    clippy::neg_cmp_op_on_partial_ord,
    reason = "the functions are what is translated, as somebody may write them"
)]
mod sample {
    use hankel_dsl::glam::{UVec2, Vec2};
    use hankel_dsl::native::describe::Type;
    use hankel_dsl::native::function::Words;
    use hankel_dsl::{Real, function, to_i32};

    both! {
        /// Two numbers.
        #[derive(Clone, Copy)]
        pub struct Pair {
            /// The smaller one.
            pub low: f32,
            /// The larger one.
            pub high: f32,
        }

        /// A pair in order.
        #[function]
        pub fn ordered(a: f32, b: f32) -> Pair {
            Pair { low: Real::min(a, b), high: Real::max(a, b) }
        }

        /// A pair's middle, and how far it is from an end.
        #[function]
        pub fn middle(pair: Pair) -> Vec2 {
            Vec2::new((pair.low + pair.high) * 0.5, (pair.high - pair.low) * 0.5)
        }

        /// Structures that functions give and take.
        #[function]
        pub fn structures(a: f32, b: f32) -> Vec2 {
            let pair = ordered(a, -b);
            middle(Pair { low: pair.low, high: pair.high + 1.0 }) - middle(pair) * 3.0
        }

        /// Branches with statements and without, and a loop whose count is not known.
        #[function]
        pub fn branches(x: f32, y: f32, turns: u32) -> f32 {
            let mut sign = 1.0;
            let size = if x < y {
                sign = -1.0;
                let d = y - x;
                d * d
            } else {
                x - y
            };
            let is_odd = (x > 0.5) & !(y > 0.5) | (x < -0.5 && y < -0.5 || x == y);
            let kind = if is_odd { 3_u32 } else { 5 };
            let mut sum = size * sign + kind as f32;
            let mut i = 0_u32;
            while i < turns & 15 {
                sum = sum * 0.5 + i as f32;
                i += 1;
            }
            sum
        }

        /// Bits and whole numbers.
        #[function]
        pub fn bits(word: u32, x: f32) -> UVec2 {
            let whole = to_i32(Real::clamp(x, -100.0, 100.0));
            let low = (word & 0xff) << 3 | word >> 29;
            let mixed = word.wrapping_mul(747_796_405).wrapping_add(whole as u32) ^ !low;
            UVec2::new(low | mixed & 0xf0f0, if whole < 1 { mixed } else { x.to_bits() })
        }

        /// The mean of what is looked up.
        #[function]
        pub fn mean(count: u32, depth_at: impl Fn(u32) -> f32) -> f32 {
            let mut sum = depth_at(0);
            let mut i = 1;
            while i < count {
                sum += depth_at(i);
                i += 1;
            }
            sum / count as f32
        }
    }

    /// The whole source.
    pub const TEXT: &str = SOURCE;

    hankel_dsl::library!(sample {
        api: 1,
        functions: [structures, branches, bits, mean]
    });

    /// The same as in `HOST`.
    pub fn mean_of(x: f32, turns: u32) -> f32 {
        let i = x + 1.0;
        let inner = |k: u32| mean(2, |l| k as f32 * i + l as f32);
        mean(4, |k| k as f32 * i) + mean(1 << (turns & 3), inner)
    }

    impl Words for Pair {
        const COUNT: usize = 2;

        fn describe() -> Type {
            panic!("a structure is not at the interface of a stub")
        }

        fn read(words: &[u32]) -> Self {
            Self {
                low: f32::read(words),
                high: f32::read(&words[1..]),
            }
        }

        fn write(self, words: &mut Vec<u32>) {
            self.low.write(words);
            self.high.write(words);
        }
    }
}

/// The sample's functions, and the host's.
fn samples() -> Vec<Function> {
    let scalar = |scalar| Type::Scalar { scalar };
    let mut all = sample::sample_library::functions();
    all.push(Function {
        name: "mean_of",
        params: vec![("x", scalar(Scalar::F32)), ("turns", scalar(Scalar::U32))],
        result: scalar(Scalar::F32),
        run: |words, out| {
            out.push(sample::mean_of(f32::from_bits(words[0]), words[1]).to_bits());
        },
    });
    all
}

/// The sample's module and its types.
fn sample_texts() -> [String; 2] {
    let list =
        "hankel_dsl::library!(sample { api: 1, functions: [structures, branches, bits, mean] });";
    let krate = CrateText {
        name: "sample".into(),
        version: "1.0.0".into(),
        licence: "MIT".into(),
        files: [("src/lib.rs".to_owned(), format!("{}\n{list}", sample::TEXT))].into(),
    };
    let libraries = functions::read(&[krate]).unwrap_or_else(|e| panic!("{e}"));
    let naming = Naming {
        prefix: PREFIX.into(),
        library: libraries[0].name.clone(),
    };
    let form = FORMS.iter().find(|f| f.name == "tsl").expect("a form");
    let (_, types) = form.beside(&libraries[0], &naming, "0").expect("types");
    [form.text(&libraries[0], &naming, "0"), types]
}

/// Links the folder of npm's packages into a folder, from which `package` can then be imported.
pub fn link_node_modules(folder: &Path, tools: &Tools, package: &str) {
    let modules = tools.node_modules();
    assert!(
        modules.join(package).is_dir(),
        "{package} is not in {}: `./check` installs it",
        modules.display()
    );
    std::os::unix::fs::symlink(modules, folder.join("node_modules")).expect("a link");
}

/// Lays the modules into a folder from which three.js can be imported.
fn lay(folder: &Path, tools: &Tools) {
    link_node_modules(folder, tools, "three");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).expect("a file");
    };
    let [module, types] = sample_texts();
    write("hankel_sample.tsl.js", &module);
    write("hankel_sample.tsl.d.ts", &types);
    write("hankel_shadows.tsl.js", &text("tsl"));
    write("hankel_shadows.tsl.d.ts", &beside("tsl").expect("types").1);
    write("host.mjs", HOST);
    write("tsl.mjs", include_str!("tsl.mjs"));
}

/// What a program said; it must succeed.
pub fn said(command: &mut Command) -> String {
    let done = command
        .output()
        .unwrap_or_else(|e| panic!("{command:?}: {e}"));
    assert!(
        done.status.success(),
        "{command:?}\n{}\n{}",
        String::from_utf8_lossy(&done.stdout),
        String::from_utf8_lossy(&done.stderr)
    );
    String::from_utf8_lossy(&done.stdout).into_owned()
}

/// Every function, in what three.js makes of it.
pub fn subjects(tools: &Tools) -> Vec<Subject> {
    let folder = tempfile::tempdir().expect("a folder");
    lay(folder.path(), tools);
    let node = tools.node().expect("Node.js");
    let given = said(
        Command::new(node)
            .arg("tsl.mjs")
            .args(["hankel_shadows.tsl.js", "hankel_sample.tsl.js", "host.mjs"])
            .current_dir(folder.path()),
    );
    let texts: BTreeMap<String, BTreeMap<String, String>> =
        serde_json::from_str(&given).expect("JSON");
    let high = "precision highp float;\nprecision highp int;";
    let subject = |f: &Function| {
        let texts = &texts[&format!("{PREFIX}_{}", f.name)];
        let codes = [
            (Language::Wgsl, wgsl(f, &texts["wgsl"])),
            (Language::Essl310, glsl(f, &texts["glsl"], "310 es", high)),
        ];
        in_form(f, "tsl", codes)
    };
    natives().iter().chain(&samples()).map(subject).collect()
}

#[test]
fn typescript_knows_what_the_modules_have() {
    let folder = tempfile::tempdir().expect("a folder");
    let tools = tools();
    lay(folder.path(), &tools);
    std::fs::write(folder.path().join("use.ts"), include_str!("use.ts")).expect("a file");
    let compiler = tools.node_modules().join("typescript/bin/tsc");
    said(
        Command::new(tools.node().expect("Node.js"))
            .arg(compiler)
            .args([
                "--noEmit",
                "--strict",
                "--skipLibCheck",
                "--target",
                "es2022",
            ])
            .args(["--module", "es2022", "--moduleResolution", "bundler"])
            .args(["--types", "webxr", "--lib", "es2022,dom", "use.ts"])
            .current_dir(folder.path()),
    );
    // All that the module has is in the types, and nothing else.
    let names = |text: &str| {
        let words = ["export const ", "export function "];
        let lines = text
            .lines()
            .filter_map(|line| words.iter().find_map(|w| line.strip_prefix(w)));
        let ends = |c: char| !c.is_ascii_alphanumeric() && c != '_';
        let mut names: Vec<String> = lines
            .filter_map(|line| line.split(ends).next().map(str::to_owned))
            .collect();
        names.sort();
        names
    };
    let module = names(&text("tsl"));
    assert!(module.len() > 60, "{module:?}");
    assert_eq!(module, names(&beside("tsl").expect("types").1));
}
