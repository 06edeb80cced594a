//! Bevy's shaders with Hankel's functions: they are valid, call the bound, and draw what the page shows.

use std::path::{Path, PathBuf};

use hankel_codegen::functions::print::Naming;
use hankel_codegen::functions::{self, FORMS, crates};

fn here() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Bevy's sources, as `xtask/setup.sh` puts them there.
fn bevy() -> PathBuf {
    let variable = |name| std::env::var_os(name).map(PathBuf::from);
    let cache = variable("XDG_CACHE_HOME").or_else(|| Some(variable("HOME")?.join(".cache")));
    let tools = variable("HANKEL_TOOLS").or_else(|| Some(cache?.join("hankel/tools")));
    let tools = tools.expect("HANKEL_TOOLS or HOME is set");
    let folder = tools.join("bevy");
    assert!(
        folder.join("bevy_pbr/src/render/shadows.wgsl").is_file(),
        "{}: Bevy's shaders are not here; ./check installs them",
        folder.display()
    );
    folder
}

/// The library as `hankel build --form functions` writes it for naga_oil.
fn library() -> String {
    let manifest = here().join("../../kernels/shadows/Cargo.toml");
    let texts = crates::sources(&manifest).expect("the sources").texts;
    let libraries = functions::read(&texts).unwrap_or_else(|e| panic!("{e}"));
    let form = FORMS
        .iter()
        .find(|form| form.name == "naga-oil")
        .expect("a form");
    let naming = Naming {
        prefix: "hankel".into(),
        library: libraries[0].name.clone(),
    };
    form.text(&libraries[0], &naming, &crates::hash(&texts))
}

#[test]
fn bevys_lookup_calls_the_bound() {
    let module =
        hankel_example_bevy::compose(&bevy(), &library()).unwrap_or_else(|e| panic!("{e}"));
    let mut validator = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::all(),
    );
    validator
        .validate(&module)
        .unwrap_or_else(|e| panic!("{e:?}"));

    // From Bevy's function, through calls, to ours; and no longer to the filter that Bevy has.
    let named = |part: &str| {
        let found = module.functions.iter().find(|(_, function)| {
            function
                .name
                .as_deref()
                .is_some_and(|name| name.starts_with(part))
        });
        found.map(|(handle, _)| handle)
    };
    let start = named("fetch_directional_shadow").expect("Bevy's function");
    let mut reached = vec![start];
    let mut next = 0;
    while let Some(&function) = reached.get(next) {
        let mut calls = Vec::new();
        calls_of(&module.functions[function].body, &mut calls);
        calls.retain(|call| !reached.contains(call));
        reached.extend(calls);
        next += 1;
    }
    let bound = named("hankel_hamburger_bound").expect("Hankel's function");
    assert!(reached.contains(&bound));
    let names: Vec<&str> = reached
        .iter()
        .filter_map(|function| module.functions[*function].name.as_deref())
        .collect();
    assert!(
        !names
            .iter()
            .any(|name| name.starts_with("sample_shadow_map_castano")),
        "Bevy's filter is still called: {names:?}"
    );
}

/// The functions that a block calls.
fn calls_of(block: &naga::Block, calls: &mut Vec<naga::Handle<naga::Function>>) {
    use naga::Statement as S;
    for statement in block {
        match statement {
            S::Call { function, .. } => calls.push(*function),
            S::Block(block) => calls_of(block, calls),
            S::If { accept, reject, .. } => {
                calls_of(accept, calls);
                calls_of(reject, calls);
            }
            S::Switch { cases, .. } => {
                for case in cases {
                    calls_of(&case.body, calls);
                }
            }
            S::Loop {
                body, continuing, ..
            } => {
                calls_of(body, calls);
                calls_of(continuing, calls);
            }
            _ => {}
        }
    }
}

#[test]
fn bevys_shaders_draw_what_the_page_shows() {
    let drawn = hankel_example_bevy::draw(&bevy(), &library()).unwrap_or_else(|e| panic!("{e}"));
    let picture = here().join("picture.png");
    hankel_example_renderer::check::picture(&drawn, &picture);
    hankel_example_renderer::check::shadows(&drawn);
}
