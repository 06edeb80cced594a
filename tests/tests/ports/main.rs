//! The ports of `examples/ports`: each computes what its paper says, natively, as generated WGSL and as
//! WGSL by hand, and what it costs stands in their README.

mod buffers;
mod cost;
mod light;
mod pictures;
mod run;
mod surfaces;

use std::path::PathBuf;
use std::time::Duration;

use hankel_dsl::native::describe::{Param, Role};
use hankel_host::crates::KernelEntry;
use hankel_matrix::column::Column;
use hankel_matrix::known::Known;
use hankel_matrix::run::Request;
use hankel_matrix::subject::Subject;
use hankel_matrix::tools::Tools;
use hankel_tests::Crate;
use run::Port;

/// The ports in the order of the table.
const PORTS: [Port; 14] = [
    buffers::MATRIX,
    buffers::SORT,
    buffers::HISTOGRAM,
    buffers::COMPACTION,
    buffers::PARTICLES,
    surfaces::MARCHING_CUBES,
    light::PATH,
    light::SKY,
    pictures::FXAA,
    pictures::SSAO,
    pictures::BLOOM,
    surfaces::GBUFFER,
    light::REFLECTION,
    light::SHADOW,
];

#[test]
fn every_port_is_right_every_way() {
    let ports = run::Ports::new();
    let wrong: Vec<String> = PORTS.iter().flat_map(|port| ports.check(port)).collect();
    assert!(wrong.is_empty(), "wrong: {}", wrong.join("; "));
}

/// The languages that the other tests do not run. (`hankel parity --matrix` with the crate's manifest runs
/// all columns: that takes a processor three minutes.)
const COLUMNS: [Column; 4] = [Column::Native, Column::Glsl, Column::HlslDxc, Column::Msl];

/// Ordinary, edge and hostile inputs of the kernels that sample textures, or of those that do not, in
/// every language.
fn agree(samples: bool) {
    let krate = Crate::ports();
    let entries: Vec<KernelEntry> = krate.entries.iter().cloned().map(Into::into).collect();
    let mut subjects = Subject::with_constants(
        &krate.generate(),
        &krate.request(),
        &krate.modules(),
        &entries,
    )
    .unwrap_or_else(|e| panic!("{e}"));
    let is_sampler = |p: &Param| matches!(p.role, Role::Sampler { .. });
    subjects.retain(|s| s.entry.kernel.params.iter().any(is_sampler) == samples);
    let cache = hankel_toolchain::Options::from_env().cache_folder().ok();
    let request = Request {
        columns: COLUMNS.into(),
        seed: 1,
        limit: Duration::from_secs(120),
        tools: Tools::of_cache(cache.as_deref()),
        runner: vec![PathBuf::from(env!("CARGO_BIN_EXE_hankel-tests-runner")).into()],
        cache: None,
        known: Known::default(),
        absent: None,
        whole: false,
        required: COLUMNS.into(),
    };
    let report =
        hankel_matrix::run::run(&request, &subjects, &|_| ()).unwrap_or_else(|e| panic!("{e}"));
    println!("{report}");
    assert!(report.passed, "{report}");
}

#[test]
fn ports_agree_in_every_language() {
    agree(false);
}

#[test]
#[ignore = "a minute of a processor: what a sampler may round is found by many native runs"]
fn ports_that_sample_agree_in_every_language() {
    agree(true);
}

#[test]
fn the_table_of_costs_is_current() {
    cost::check(&PORTS);
}
