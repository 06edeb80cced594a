//! Texts that are kept from one build to the next are those that translation makes.

mod support;

use std::path::{Path, PathBuf};

use hankel_codegen::build::{Generated, Modules, generate, generate_kept};
use hankel_codegen::files::sha256;
use hankel_codegen::finished::finish_all;

fn modules() -> Modules {
    let Modules::Raw(raw) = support::modules() else {
        unreachable!("the fixture has raw modules")
    };
    Modules::Final(finish_all(&raw, &support::all(), None).unwrap())
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap();
    let inner = entries.flat_map(|entry| std::fs::read_dir(entry.unwrap().path()).unwrap());
    let mut all: Vec<PathBuf> = inner.map(|entry| entry.unwrap().path()).collect();
    all.sort();
    all
}

fn same(one: &Generated, other: &Generated) {
    assert_eq!(one.manifest, other.manifest);
    assert_eq!(one.files, other.files);
}

#[test]
fn what_is_kept_is_what_would_be_made() {
    let folder = tempfile::tempdir().unwrap();
    let (request, modules) = (support::request(), modules());
    let plain = generate(&request, &modules).unwrap();
    for _ in 0..2 {
        same(
            &plain,
            &generate_kept(&request, &modules, folder.path()).unwrap(),
        );
        assert_eq!(files(folder.path()).len(), request.kernels.len());
    }

    // Damaged: made again, and whole again.
    let all = files(folder.path());
    let kept = std::fs::read(&all[0]).unwrap();
    for bytes in [&kept[..kept.len() - 4], &kept[..10], &[]] {
        std::fs::write(&all[0], bytes).unwrap();
        same(
            &plain,
            &generate_kept(&request, &modules, folder.path()).unwrap(),
        );
        assert_eq!(std::fs::read(&all[0]).unwrap(), kept);
    }

    // It is taken: another text under the same name comes out.
    let mut body = kept[64..].to_vec();
    if let Some(last) = body.last_mut() {
        *last ^= 1;
    }
    std::fs::write(&all[0], [sha256(&body).as_bytes(), &body].concat()).unwrap();
    let other = generate_kept(&request, &modules, folder.path()).unwrap();
    assert_ne!(plain.files, other.files);
}

#[test]
fn what_it_follows_from_makes_it_anew() {
    let folder = tempfile::tempdir().unwrap();
    let (request, modules) = (support::request(), modules());
    generate_kept(&request, &modules, folder.path()).unwrap();

    // Options, descriptions and modules.
    let mut other = request.clone();
    other.options.bounds_checks = "unchecked".parse().unwrap();
    other.options.placement.hlsl_space = 3;
    same(
        &generate(&other, &modules).unwrap(),
        &generate_kept(&other, &modules, folder.path()).unwrap(),
    );
    let mut other = request.clone();
    for kernel in &mut other.kernels {
        kernel.summary.push_str(" More.");
    }
    same(
        &generate(&other, &modules).unwrap(),
        &generate_kept(&other, &modules, folder.path()).unwrap(),
    );
    let raw = support::modules();
    same(
        &generate(&request, &raw).unwrap(),
        &generate_kept(&request, &raw, folder.path()).unwrap(),
    );

    // A line above a kernel makes nothing anew, and the manifest has the new one.
    let before = files(folder.path());
    let mut moved = request.clone();
    for kernel in &mut moved.kernels {
        kernel.line += 7;
    }
    generate_kept(&request, &modules, folder.path()).unwrap();
    let present = files(folder.path());
    assert_ne!(before, present, "the last build had raw modules");
    same(
        &generate(&moved, &modules).unwrap(),
        &generate_kept(&moved, &modules, folder.path()).unwrap(),
    );
    assert_eq!(files(folder.path()), present);
}

#[test]
fn a_build_of_some_kernels_leaves_the_texts_of_others() {
    let folder = tempfile::tempdir().unwrap();
    let (request, modules) = (support::request(), modules());
    generate_kept(&request, &modules, folder.path()).unwrap();
    let all = files(folder.path());
    let mut one = request.clone();
    one.filter = vec![request.kernels[0].name.clone()];
    generate_kept(&one, &modules, folder.path()).unwrap();
    let with_one = files(folder.path());
    assert!(all.iter().all(|file| with_one.contains(file)));
    // So does one in other languages.
    let mut wgsl = request.clone();
    wgsl.targets = vec![hankel_codegen::Language::Wgsl];
    generate_kept(&wgsl, &modules, folder.path()).unwrap();
    assert!(with_one.iter().all(|file| file.is_file()));
    // One of all kernels removes what it has not used.
    generate_kept(&request, &modules, folder.path()).unwrap();
    assert!(all.iter().all(|file| file.is_file()));
    assert_eq!(
        files(folder.path()).len(),
        all.len() + request.kernels.len()
    );
}
