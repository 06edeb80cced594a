//! Everything that reads files of others, on files that were damaged at random: whatever they say,
//! the answer is a result or an error in words, soon, without a panic and without a trace outside
//! of where it works.
//!
//! ```sh
//! cargo test --release -p hankel-tests --test fuzz                              # 5 targets, 1 s each
//! HANKEL_FUZZ_SECONDS=30 cargo test --release -p hankel-tests --test fuzz       # as in CI
//! HANKEL_FUZZ_SECONDS=36000 cargo test --release -p hankel-tests --test fuzz spirv
//! ```
//!
//! A failure prints its input and the seed that makes it again, `BOLERO_RANDOM_SEED=…`; what ends the
//! process is in `target/tmp/fuzz-NAME`. `cargo bolero test -p hankel-tests spirv` (from
//! `cargo install cargo-bolero`) follows the code's branches instead, for as long as it is let, keeps
//! what it finds in `tests/__fuzz__` and goes on from there.

mod archives;
mod damage;
mod manifests;
mod scenes;
mod spirv;
mod tables;
