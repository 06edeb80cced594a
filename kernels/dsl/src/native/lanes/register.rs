//! What lanes need of a SIMD register, and which registers there are.

use bytemuck::Pod;

/// A SIMD register of floating point numbers, on processors that have it.
///
/// The vectors of `fearless_simd` would do the same, but each of their operations is a dozen functions for the compiler to
/// inline: kernels took more than one and a half times as long to compile with them, and twice the memory.
///
/// A register consists of blocks of 128 bits. Columns of tables are moved by blocks: see [`super::transpose`].
pub trait Register: Copy {
    /// What it holds.
    type Number: Pod;
    /// A truth value for each number.
    type Mask: Copy;
    /// Numbers in the register.
    const LANES: usize;
    /// Numbers in a block.
    const PER_BLOCK: usize;

    /// `f64::from_bits(BITS)`, rounded, in every lane.
    fn literal<const BITS: u64>() -> Self;
    /// These bits in every lane, cut to the size of a number.
    fn bits<const BITS: u64>() -> Self;
    /// The number in every lane.
    fn splat(number: Self::Number) -> Self;

    /// `a + b`
    fn add(a: Self, b: Self) -> Self;
    /// `a - b`
    fn sub(a: Self, b: Self) -> Self;
    /// `a * b`
    fn mul(a: Self, b: Self) -> Self;
    /// `a / b`
    fn div(a: Self, b: Self) -> Self;
    /// `a * b - c`, rounded once.
    fn multiply_subtract(a: Self, b: Self, c: Self) -> Self;
    /// The sum, and what rounding it lost.
    #[inline(always)]
    fn two_sum(a: Self, b: Self) -> (Self, Self) {
        let sum = Self::add(a, b);
        let of_b = Self::sub(sum, a);
        let of_a = Self::sub(sum, of_b);
        (sum, Self::add(Self::sub(a, of_a), Self::sub(b, of_b)))
    }
    /// The product, and what rounding it lost.
    #[inline(always)]
    fn two_product(a: Self, b: Self) -> (Self, Self) {
        let product = Self::mul(a, b);
        (product, Self::multiply_subtract(a, b, product))
    }
    /// Square roots.
    fn sqrt(a: Self) -> Self;
    /// The next whole numbers below.
    fn floor(a: Self) -> Self;
    /// Magnitudes.
    fn abs(a: Self) -> Self;
    /// The other sign.
    fn neg(a: Self) -> Self;
    /// `a` where it is less, else `b`: also where one of them is NaN, or both are zero.
    fn min(a: Self, b: Self) -> Self;
    /// `a` where it is greater, else `b`: also where one of them is NaN, or both are zero.
    fn max(a: Self, b: Self) -> Self;
    /// `a < b`
    fn lt(a: Self, b: Self) -> Self::Mask;
    /// `a <= b`
    fn le(a: Self, b: Self) -> Self::Mask;
    /// `a == b`
    fn eq(a: Self, b: Self) -> Self::Mask;
    /// `a` where the mask is true, else `b`.
    fn select(mask: Self::Mask, a: Self, b: Self) -> Self;

    /// Both are true.
    fn both(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// At least one of both is true.
    fn either(a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// It is false.
    fn not(a: Self::Mask) -> Self::Mask;
    /// Some lane is true.
    fn any(a: Self::Mask) -> bool;
    /// Every lane is true.
    fn all(a: Self::Mask) -> bool;

    /// Bits of both.
    fn and(a: Self, b: Self) -> Self;
    /// Bits of one of both.
    fn or(a: Self, b: Self) -> Self;
    /// Bits of one of both alone.
    fn xor(a: Self, b: Self) -> Self;
    /// The sum of the bits as integers.
    fn add_bits(a: Self, b: Self) -> Self;
    /// The difference of the bits as integers.
    fn sub_bits(a: Self, b: Self) -> Self;
    /// The bits as unsigned integers, halved.
    fn half_bits(a: Self) -> Self;
    /// The bits as a signed integer, divided by the size of the significand and rounded down: as a number.
    fn exponent(a: Self) -> Self;
    /// Two to the power of a whole number, where that is normal.
    fn power(a: Self) -> Self;

    /// Numbers from `start` on.
    fn load(table: &[Self::Number], start: usize) -> Self;
    /// Blocks that start in `table` at `start` and every `step` from there.
    fn load_blocks(table: &[Self::Number], start: usize, step: usize) -> Self;
    /// Stores what [`Register::load`] loads.
    fn store(a: Self, table: &mut [Self::Number], start: usize);
    /// Stores what [`Register::load_blocks`] loads.
    fn store_blocks(a: Self, table: &mut [Self::Number], start: usize, step: usize);
    /// The numbers of `a` and `b` in turn: of each block's lower half, of the upper.
    fn unpack(a: Self, b: Self) -> (Self, Self);
    /// From the order in memory to the order of lanes.
    fn spread(a: Self) -> Self;
    /// And back.
    fn align(a: Self) -> Self;
    /// Of the numbers of `a` and then `b` each second one from the first on, and from the second on.
    fn deinterleave(a: Self, b: Self) -> (Self, Self);
    /// The numbers of `a` and `b` in turn.
    fn interleave(a: Self, b: Self) -> (Self, Self);
    /// The first number of each block becomes its last.
    fn rotate(a: Self) -> Self;
}

/// [`Register`] of a type, by the values of its functions.
macro_rules! register {
    (
        $register:ty: $lanes:literal of $number:ty as $integer:ty, masks: $mask:ty;
        load($all:ident) = $load:expr;
        store($all_stored:ident, $to:ident) = $store:expr;
        load_blocks($start:ident, $step:ident; spans: $spans:literal) = $load_blocks:expr;
        store_blocks($stored:ident) = $store_blocks:expr;
        $($name:ident($($argument:ident),+) -> $result:ident = $value:expr;)*
    ) => {
        impl super::register::Register for $register {
            type Number = $number;
            type Mask = $mask;
            const LANES: usize = $lanes;
            const PER_BLOCK: usize = 16 / size_of::<$number>();

            #[inline(always)]
            fn literal<const BITS: u64>() -> Self {
                const {
                    let all = [f64::from_bits(BITS) as $number; $lanes];
                    // SAFETY: as many numbers.
                    unsafe { core::mem::transmute::<[$number; $lanes], Self>(all) }
                }
            }
            #[inline(always)]
            fn bits<const BITS: u64>() -> Self {
                const {
                    let all = [BITS as $integer; $lanes];
                    // SAFETY: as many bits.
                    unsafe { core::mem::transmute::<[$integer; $lanes], Self>(all) }
                }
            }
            $(
                #[inline(always)]
                #[allow(unused_unsafe, reason = "some masks are integers")]
                fn $name($($argument: register!(@argument $name $argument)),+) -> register!(@result $result) {
                    // SAFETY: lanes are for `on_lanes` alone, which asks whether the processor has the instruction.
                    unsafe { $value }
                }
            )*
            #[inline(always)]
            fn load(table: &[$number], start: usize) -> Self {
                let $all = table[start..start + Self::LANES].as_ptr();
                // SAFETY: as above. So many numbers are within the slice.
                unsafe { $load }
            }
            #[inline(always)]
            fn store($all_stored: Self, table: &mut [$number], start: usize) {
                let $to = table[start..start + Self::LANES].as_mut_ptr();
                // SAFETY: as above. So many numbers are within the slice.
                unsafe { $store }
            }
            #[inline(always)]
            fn load_blocks(table: &[$number], start: usize, $step: usize) -> Self {
                let $start = table[start..start + $spans * $step + Self::PER_BLOCK].as_ptr();
                // SAFETY: as above. All blocks are within the slice.
                unsafe { $load_blocks }
            }
            #[inline(always)]
            fn store_blocks($stored: Self, table: &mut [$number], start: usize, $step: usize) {
                let $start = table[start..start + $spans * $step + Self::PER_BLOCK].as_mut_ptr();
                // SAFETY: as above. All blocks are within the slice.
                unsafe { $store_blocks }
            }
        }
    };
    (@argument splat $argument:ident) => { Self::Number };
    (@argument select mask) => { Self::Mask };
    (@argument both $argument:ident) => { Self::Mask };
    (@argument either $argument:ident) => { Self::Mask };
    (@argument not $argument:ident) => { Self::Mask };
    (@argument any $argument:ident) => { Self::Mask };
    (@argument all $argument:ident) => { Self::Mask };
    (@argument $name:ident $argument:ident) => { Self };
    (@result Number) => { Self };
    (@result Numbers) => { (Self, Self) };
    (@result Mask) => { Self::Mask };
    (@result Truth) => { bool };
}
pub(super) use register;
