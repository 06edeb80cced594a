//! TSL: what three.js makes of the module, for its WebGPU renderer and for WebGL 2, in the stubs of WGSL and
//! of GLSL ES, of the built-in library and of the sample.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use hankel_codegen::Language;
use hankel_codegen::functions::ir::Library;
use hankel_dsl::native::describe::{Scalar, Type};
use hankel_dsl::native::function::Function;
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;

use super::{PREFIX, beside, glsl, in_form, library, natives, sample, text, tools, wgsl};

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

/// The sample's functions, and the host's.
fn samples() -> Vec<Function> {
    let scalar = |scalar| Type::Scalar { scalar };
    let mut all = sample::functions();
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

/// The types of a library's module in TypeScript.
fn types(library: &Library) -> String {
    beside(library, "tsl").expect("types").1
}

/// Lays the modules into a folder from which three.js can be imported.
fn lay(folder: &Path, tools: &Tools) {
    link_node_modules(folder, tools, "three");
    let write = |name: &str, text: &str| {
        std::fs::write(folder.join(name), text).expect("a file");
    };
    write("hankel_sample.tsl.js", &sample::text("tsl"));
    write("hankel_sample.tsl.d.ts", &types(&sample::library()));
    write("hankel_shadows.tsl.js", &text("tsl"));
    write("hankel_shadows.tsl.d.ts", &types(library()));
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
    assert_eq!(module, names(&types(library())));
}
