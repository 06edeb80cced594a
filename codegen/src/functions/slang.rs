//! Slang: a module to import, whose functions are public. The text is that of HLSL otherwise.

use super::hlsl::Hlsl;
use super::ir::{Library, Type};
use super::print::{Dialect, Naming, components, documented, function, members, provenance};
use super::wgsl::looks_up;

/// The text of a library.
pub fn write(library: &Library, naming: &Naming, sha256: &str) -> String {
    let d = Hlsl(naming);
    let mut text = documented(&provenance(library, sha256), "//");
    text.push_str(&documented(&library.docs, "//"));
    text.push_str(&format!(
        "module {};\n\npublic static const int {}_API = {};\n",
        naming.function(&naming.library),
        naming.guard(),
        library.api
    ));
    for c in &library.constants {
        text.push('\n');
        text.push_str(&documented(&c.docs, "///"));
        text.push_str(&format!(
            "public static const {} {} = {};\n",
            d.ty(&c.ty),
            naming.constant(&c.name),
            components(&d, c).0
        ));
    }
    for s in &library.structs {
        text.push('\n');
        text.push_str(&documented(&s.docs, "///"));
        text.push_str(&format!(
            "public struct {}\n{{\n",
            naming.structure(&s.name)
        ));
        text.push_str(&members(s, "///", &|name, ty: &Type| {
            format!("public {} {name};", d.ty(ty))
        }));
        text.push_str("};\n");
    }
    // A module sees no macro of its host's, so what looks something up is left out.
    for f in library.functions.iter().filter(|f| !looks_up(f)) {
        text.push('\n');
        text.push_str(&documented(&f.docs, "///"));
        text.push_str("public ");
        text.push_str(&function(&d, f));
    }
    text
}
