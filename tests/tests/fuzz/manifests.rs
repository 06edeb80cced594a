//! `manifest.json` of a folder, budgets, and lists of known differences.

use bolero::check;
use hankel_codegen::manifest::Manifest;
use hankel_matrix::known::Known;
use hankel_tests::Crate;

use crate::damage::{Damage, keep, says, time};

#[test]
fn manifests() {
    let manifest = Crate::listing().generate().manifest.to_json();
    let known = include_str!("../../../snapshots/known-differences.toml").to_owned();
    let files = [manifest, known];
    check!()
        .with_type::<Damage>()
        .with_test_time(time())
        .for_each(|damage| {
            let (_, bytes) = damage.of(&files);
            keep("manifest", &bytes);
            if let Err(error) = Manifest::from_json(&bytes) {
                says(&error);
            }
            if let Ok(text) = std::str::from_utf8(&bytes)
                && let Err(error) = Known::parse(text)
            {
                says(&error);
            }
        });
}
