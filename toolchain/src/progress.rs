//! How long work reports itself.

/// Receives the progress of an installation. All calls come from the thread that
/// called [`crate::install()`] or [`crate::ensure`].
pub trait Progress {
    /// Step `index` of `count` begins; the first one has index 1.
    fn step(&mut self, name: &str, index: usize, count: usize);

    /// `done` of `total` units of the current step are done: bytes or crates,
    /// whichever the step works in. Called often.
    fn advance(&mut self, done: u64, total: Option<u64>);

    /// Something worth a line of its own.
    fn line(&mut self, text: &str);
}

/// Reports to nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn step(&mut self, _: &str, _: usize, _: usize) {}
    fn advance(&mut self, _: u64, _: Option<u64>) {}
    fn line(&mut self, _: &str) {}
}
