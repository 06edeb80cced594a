//! SPIR-V, through every tool into every language.

use std::time::{Duration, Instant};

use bolero::check;
use hankel_codegen::build::{Modules, Request, generate};
use hankel_codegen::translate::Options;
use hankel_tests::Crate;

use crate::damage::{Damage, keep, says, time};

#[test]
fn spirv() {
    let crates = [Crate::conformance(), Crate::listing()];
    // Small ones, which are read soon and in which most bytes mean something.
    let mut files: Vec<Vec<u8>> = Vec::new();
    let mut kernels = Vec::new();
    for krate in &crates {
        for entry in &krate.entries {
            let module = &krate.bundle.modules[&entry.kernel.name];
            if module.len() < 6000 {
                files.push(module.clone());
                kernels.push((entry.kernel.clone(), &krate.bundle.origin));
            }
        }
    }
    assert!(files.len() > 10);
    check!()
        .with_type::<Damage>()
        .with_test_time(time())
        .for_each(|damage| {
            let (whole, bytes) = damage.of(&files);
            keep("spirv", &bytes);
            let which = files.iter().position(|f| std::ptr::eq(f, whole));
            let (kernel, origin) = &kernels[which.expect("one of them")];
            let request = Request {
                crate_name: origin.crate_name.clone(),
                kernels: vec![kernel.clone()],
                filter: Vec::new(),
                targets: Vec::new(),
                options: Options::default(),
                rust_gpu: origin.made_by.rust_gpu.clone(),
            };
            let began = Instant::now();
            for modules in [Modules::Raw, Modules::Final] {
                let module = [(kernel.name.clone(), bytes.clone())];
                if let Err(error) = generate(&request, &modules(module.into())) {
                    assert!(error.to_string().contains(&kernel.name), "{error}");
                    says(&error);
                }
            }
            assert!(
                began.elapsed() < Duration::from_secs(10),
                "{:?}",
                began.elapsed()
            );
        });
}
