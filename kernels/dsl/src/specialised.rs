//! Types of specialisation constants.

/// A type that a specialisation constant may have: `u32`, `i32`, `f32` or `bool`.
pub trait Specialised: Copy {
    /// The value of a constant's 32 bits.
    #[doc(hidden)]
    fn of_word(word: u32) -> Self;
}

impl Specialised for u32 {
    #[inline(always)]
    fn of_word(word: u32) -> Self {
        word
    }
}

impl Specialised for i32 {
    #[inline(always)]
    fn of_word(word: u32) -> Self {
        word.cast_signed()
    }
}

impl Specialised for f32 {
    #[inline(always)]
    fn of_word(word: u32) -> Self {
        Self::from_bits(word)
    }
}

impl Specialised for bool {
    #[inline(always)]
    fn of_word(word: u32) -> Self {
        word != 0
    }
}
