//! What lies before a receiver, for the width of a penumbra.

use hankel_dsl::{Element, Real};

/// The part of a distribution of depths that is nearer than a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Element)]
#[repr(C)]
pub struct Blockers<R> {
    /// Its share, in [0, 1].
    pub share: R,
    /// Its share times its mean distance from the receiver, from 0 to 3; it is in units of depth in [-1, 1].
    pub moment: R,
}

impl<R: Real> Blockers<R> {
    /// The mean distance of the receiver from what is nearer, after a share `epsilon` of depths at the
    /// receiver has been added: where hardly anything is nearer, the distance goes to 0 (\[BHS\],
    /// lecture, "Moment-based blocker search", which has 1e-3).
    #[inline(always)]
    #[must_use]
    pub fn distance(self, epsilon: R) -> R {
        self.moment / (self.share + epsilon.max(R::epsilon() * R::epsilon()))
    }
}
