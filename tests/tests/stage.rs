//! What vertex and fragment kernels say is in the texts and in the manifest, or is refused.

use hankel_codegen::Language::{Essl300, Essl310, Hlsl, Msl, Wgsl};
use hankel_codegen::build::Generated;
use hankel_tests::Crate;

fn text(generated: &Generated, kernel: &str, extension: &str) -> String {
    let found = generated
        .files
        .iter()
        .find(|(path, _)| path.contains(&format!("{kernel}.")) && path.ends_with(extension));
    let (_, bytes) = found.unwrap_or_else(|| panic!("no {extension} of {kernel}"));
    String::from_utf8(bytes.clone()).expect("it is text")
}

#[test]
fn what_is_not_interpolated_is_said() {
    let generated = Crate::conformance().generate();
    let wgsl = text(&generated, "flat", ".wgsl");
    assert_eq!(wgsl.matches("@interpolate(flat").count(), 3, "{wgsl}");
    let hlsl = text(&generated, "flat", ".hlsl");
    assert_eq!(hlsl.matches("nointerpolation").count(), 3, "{hlsl}");
    let kernel = &generated.manifest.kernels["flat"];
    assert!(kernel.inputs.iter().all(|input| input.flat));
    let vertex = &generated.manifest.kernels["numbered"];
    let flat = vertex.outputs.iter().filter(|output| output.flat).count();
    assert_eq!(flat, 3);
}

#[test]
fn depths_and_dropped_fragments_are_said() {
    let generated = Crate::conformance().generate();
    let kernel = &generated.manifest.kernels["deep"];
    assert!(kernel.outputs.iter().any(|output| output.kind == "depth"));
    for (extension, depth, drop) in [
        (".wgsl", "frag_depth", "discard"),
        (".hlsl", "SV_Depth", "discard"),
        (".metal", "depth(any)", "discard_fragment"),
    ] {
        let text = text(&generated, "deep", extension);
        assert!(text.contains(depth) && text.contains(drop), "{text}");
    }
}

#[test]
fn what_a_language_cannot_ask_for_is_refused() {
    let generated = Crate::conformance().generate();
    let slopes = &generated.manifest.kernels["grained_slopes"];
    for language in [Msl, Essl310] {
        let reason = &slopes.unsupported[&language];
        assert!(reason.contains("no coarse and no fine"), "{reason}");
    }
    for language in [Wgsl, Hlsl] {
        assert!(slopes.languages.contains_key(&language));
    }
    let sample = &generated.manifest.kernels["sample"];
    assert!(sample.unsupported.contains_key(&Essl310));
    let gathered = &generated.manifest.kernels["gathered"];
    assert!(gathered.unsupported[&Essl300].contains("gather"));
    assert!(gathered.languages.contains_key(&Essl310));
}
