//! Tables of rows, through a kernel.

use std::panic::AssertUnwindSafe;

use bolero::check;
use hankel_host::crates::KernelCrate;
use hankel_host::device::NativeDevice;
use hankel_host::eval::{Job, run};

use crate::damage::{Damage, keep, says, time};

const TABLES: [&str; 2] = [
    "b1,b2,depth\n0.5,0.3,0.2\n0.25,0.125,0.5\n",
    "depth, b2 ,\"b1\"\r\n\r\n1e-30,-0.5,\"0.5\"\r\n0,0,0\r\n",
];

#[test]
fn tables() {
    let kernels = KernelCrate::from_entries("hankel-shadows", hankel_shadows::entries());
    let entry = kernels.entry("vsm").unwrap_or_else(|e| panic!("{e}"));
    let folder = tempfile::tempdir().expect("a folder");
    let output = folder.path().join("out.csv");
    let mut device = NativeDevice::new();
    let mut eval = |input: &std::path::Path| {
        let job = Job {
            entry,
            shader: None,
            settings: &[],
            input,
            output: &output,
        };
        let result = run(&mut device, &job, &mut |_| {});
        // The output is there whole or not at all, and nothing else.
        let there = std::fs::read_dir(folder.path()).expect("a folder").count();
        assert_eq!(there, usize::from(result.is_ok()));
        if result.is_ok() {
            std::fs::remove_file(&output).expect("the output");
        }
        result
    };
    for table in TABLES {
        let input = keep("table", table.as_bytes());
        assert_eq!(eval(&input).unwrap_or_else(|e| panic!("{e}")), 2);
    }
    // What a panic leaves behind is looked at by nobody.
    let mut eval = AssertUnwindSafe(eval);
    check!()
        .with_type::<Damage>()
        .with_test_time(time())
        .for_each(move |damage| {
            let (_, bytes) = damage.of(&TABLES);
            let input = keep("table", &bytes);
            if let Err(error) = (*eval)(&input) {
                assert!(error.to_string().contains("fuzz-table"), "{error}");
                says(&error);
            }
        });
}
