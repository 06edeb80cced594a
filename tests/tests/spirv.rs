//! Committed SPIR-V belongs to its sources. Where rust-gpu's compiler is there, it is made again
//! and compared byte for byte; where not, the hash of the sources is the guard.

use hankel_codegen::build::finish_all;
use hankel_codegen::compile::{Compiler, compile};
use hankel_tests::{Crate, root};
use hankel_toolchain::{Options, Silent};

#[test]
fn committed_spirv_follows_from_its_sources() {
    let crates = [Crate::shadows(), Crate::conformance(), Crate::listing()];
    let toolchain = match hankel_toolchain::ensure(&Options::from_env(), &mut Silent) {
        Ok(toolchain) => toolchain,
        Err(hankel_toolchain::Error::NotInstalled { .. }) => {
            eprintln!("SPIR-V: no rust-gpu compiler here; checked by the hash of its sources");
            return;
        }
        Err(error) => panic!("{error}"),
    };
    let compiler = Compiler {
        backend: toolchain.backend,
        bin: toolchain.bin,
        channel: toolchain.channel,
    };
    for one in crates {
        let kernels: Vec<_> = one.entries.iter().map(|e| e.kernel.clone()).collect();
        let names: Vec<&str> = kernels.iter().map(|k| k.name.as_str()).collect();
        let target = root().join("target");
        let raw = compile(&one.manifest, &compiler, &target, &names, &mut |_| {})
            .unwrap_or_else(|e| panic!("{e}"));
        let fresh = finish_all(&raw, &kernels).unwrap_or_else(|e| panic!("{e}"));
        for (name, bytes) in &fresh {
            assert_eq!(
                Some(bytes),
                one.bundle.modules.get(name),
                "{name}: run `cargo xtask spirv`"
            );
        }
        assert_eq!(fresh.len(), one.bundle.modules.len());
        eprintln!(
            "SPIR-V: {} modules of {} rebuilt from source, the same bytes as committed",
            fresh.len(),
            one.bundle.origin.crate_name
        );
    }
}
