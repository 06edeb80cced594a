//! Modules that are kept from one build to the next are those that finishing makes.

mod support;

use hankel_codegen::build::Modules;
use hankel_codegen::finished::finish_all;

#[test]
fn kept_modules_are_taken_and_damaged_or_unused_ones_go() {
    let Modules::Raw(raw) = support::modules() else {
        unreachable!("the fixture has raw modules")
    };
    let kernels = support::all();
    let folder = tempfile::tempdir().unwrap();
    let files = || -> Vec<std::path::PathBuf> {
        let entries = std::fs::read_dir(folder.path()).unwrap();
        let mut all: Vec<_> = entries.map(|e| e.unwrap().path()).collect();
        all.sort();
        all
    };
    let plain = finish_all(&raw, &kernels, None).unwrap();
    assert_eq!(
        finish_all(&raw, &kernels, Some(folder.path())).unwrap(),
        plain
    );
    assert_eq!(files().len(), kernels.len());
    assert_eq!(
        finish_all(&raw, &kernels, Some(folder.path())).unwrap(),
        plain
    );

    // Damaged: made again, and whole again.
    let kept = std::fs::read(&files()[0]).unwrap();
    for bytes in [&kept[..kept.len() - 4], &kept[..10], &[]] {
        std::fs::write(&files()[0], bytes).unwrap();
        assert_eq!(
            finish_all(&raw, &kernels, Some(folder.path())).unwrap(),
            plain
        );
        assert_eq!(std::fs::read(&files()[0]).unwrap(), kept);
    }

    // Another description is another module; what nobody asks for goes.
    let one = vec![kernels[0].clone()];
    finish_all(&raw, &one, Some(folder.path())).unwrap();
    assert_eq!(files().len(), 1);
}
