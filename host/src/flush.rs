//! Running native code as a device that flushes subnormal numbers: such operands count as zero,
//! and such results become zero. Vulkan and WebGPU let every device do so, and it is no matter of
//! a tolerance: a subnormal number may decide a comparison. So devices that do are compared with a
//! reference that does, and to the bit. Kernels that run in a process of their own flush there, too
//! ([`crate::worker`]).

use std::thread;

/// Runs `work` in a thread that flushes; none on processors whose switch is not known here, or if
/// it panics.
pub fn flushed<T: Send>(work: impl FnOnce() -> T + Send) -> Option<T> {
    thread::scope(|s| s.spawn(|| switch().then(work)).join().ok().flatten())
}

/// Whether this thread flushes.
#[must_use]
pub fn is_on() -> bool {
    let least = std::hint::black_box(f32::MIN_POSITIVE);
    std::hint::black_box(least * 0.5) == 0.0
}

/// Makes this thread flush; whether it does.
#[cfg(target_arch = "x86_64")]
fn switch() -> bool {
    /// Results are flushed to zero, and operands count as zero.
    const FLUSH: u32 = 1 << 15 | 1 << 6;
    let mut control = 0u32;
    // SAFETY: both instructions only move the thread's own SSE control register to and from a
    // local variable; the masks of exceptions stay as they are. The compiler takes it for granted
    // that arithmetic is as by default: it may compute with subnormal constants beforehand, and
    // then not flush them. The thread's results are only compared with a device's, and memory is
    // addressed by none of them beyond what kernels check.
    unsafe {
        std::arch::asm!("stmxcsr [{}]", in(reg) &raw mut control, options(nostack));
        control |= FLUSH;
        std::arch::asm!("ldmxcsr [{}]", in(reg) &raw const control, options(nostack));
    }
    true
}

/// Makes this thread flush; whether it does.
#[cfg(target_arch = "aarch64")]
fn switch() -> bool {
    /// FPCR.FZ: operands and results.
    const FLUSH: u64 = 1 << 24;
    // SAFETY: the instructions only change the thread's own floating-point control register; what
    // follows from that is said on the other processor's version.
    unsafe {
        let mut control: u64;
        std::arch::asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack));
        control |= FLUSH;
        std::arch::asm!("msr fpcr, {}", in(reg) control, options(nomem, nostack));
    }
    true
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn switch() -> bool {
    false
}

#[cfg(test)]
mod tests {
    use std::hint::black_box;

    use super::{flushed, is_on};

    #[test]
    fn only_its_own_thread_flushes() {
        let least = black_box(f32::MIN_POSITIVE);
        let half = || black_box(least) * black_box(0.5);
        assert!(half() > 0.0 && !is_on());
        if let Some((result, operand, is_on)) = flushed(|| {
            let subnormal = black_box(f32::from_bits(1));
            (half(), black_box(subnormal) * black_box(1e20), is_on())
        }) {
            assert_eq!((result, operand, is_on), (0.0, 0.0, true));
        }
        assert!(half() > 0.0);
        assert_eq!(flushed(|| panic!("on purpose")), None::<()>);
    }
}
