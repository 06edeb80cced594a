//! Finds, installs or builds rust-gpu's compiler.
