//! What is done against weak light leaking.

use hankel_dsl::{Real, lit};

/// Takes a shadow of `1 - leak` for full shadow and scales the rest, so that weak light leaking
/// disappears (the lecture divides by 0.98). `shadow` and the result are in [0, 1]; `leak` is in
/// [0, 0.5], and what is beyond counts as 0.5: a cut that takes hardly any shadow for full would
/// only show the moments' noise.
#[inline(always)]
pub fn cut_leak<R: Real>(shadow: R, leak: R) -> R {
    let one: R = lit!(1.0);
    (shadow / (one - leak).max(lit!(0.5))).saturate()
}
