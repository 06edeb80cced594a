//! Every generated text is under review: a change shows as a difference in `snapshots/text`.

use hankel_codegen::files::sha256;
use hankel_tests::{Crate, root};

/// A shader of more bytes is read by nobody: 10 000 lines or so. Its hash is under review instead, and `hankel diff` shows
/// what has changed in it.
const MOST_READ: usize = 512 << 10;

#[test]
fn every_text_in_every_language() {
    let generated = Crate::shadows().generate();
    let mut settings = insta::Settings::clone_current();
    settings.set_snapshot_path(root().join("snapshots/text"));
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| {
        for (path, bytes) in &generated.files {
            if path.ends_with(".spv") {
                continue;
            }
            let text = String::from_utf8(bytes.clone()).expect("texts are UTF-8");
            let text = if path == "manifest.json" {
                without_hashes(&text)
            } else if bytes.len() > MOST_READ && !path.starts_with("include/") {
                format!("{} lines, SHA-256 {}", text.lines().count(), sha256(bytes))
            } else {
                text
            };
            insta::assert_snapshot!(path.replace('/', "."), text);
        }
    });
}

/// Structures with the same members are one type to rust-gpu; the texts tell them apart again.
#[test]
fn an_output_has_its_own_names() {
    let files = Crate::shadows().generate().files;
    let text = |path: &str| String::from_utf8(files[path].clone()).expect("texts are UTF-8");
    let (there, back) = (
        text("wgsl/quantize_4_unit.wgsl"),
        text("wgsl/dequantize_4_unit.wgsl"),
    );
    assert!(there.contains("moments: array<Moments4>") && there.contains("out: array<Quantized4>"));
    assert!(back.contains("quantized: array<Quantized4>") && back.contains("out: array<Moments4>"));
}

/// The manifest's hash of all that it follows from changes with every comment in a kernel, and hashes and sizes of
/// texts with the texts, which are under review themselves.
fn without_hashes(manifest: &str) -> String {
    let mut lines: Vec<&str> = manifest.lines().collect();
    lines.retain(|line| {
        let key = line.trim_start();
        !["\"inputs_sha256\"", "\"sha256\"", "\"bytes\""]
            .iter()
            .any(|hash| key.starts_with(hash))
    });
    lines.join("\n")
}

#[test]
fn twice_gives_the_same_bytes() {
    let (a, b) = (Crate::shadows().generate(), Crate::shadows().generate());
    assert_eq!(a.files, b.files);
    assert!(a.files.len() > 100, "{}", a.files.len());
}
