//! The floating-point environment. An FMU that changes the rounding mode, flushes denormal numbers or
//! enables traps does so for itself only: what it leaves behind is undone after each of its calls.

#[cfg(target_arch = "x86_64")]
use std::arch::asm;

/// Control bits of the SSE unit: round to nearest, denormal numbers kept, no traps.
#[cfg(target_arch = "x86_64")]
static SSE: u32 = 0x1f80;
/// Control word of the x87 unit: the same, with 64 bits of precision.
#[cfg(target_arch = "x86_64")]
static X87: u16 = 0x37f;

/// Sets the environment of this thread to the default. The SSE unit's is set whether it differs or not: reading
/// it would wait for all operations before (4.5 ns), setting it does not.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(super) fn restore() {
    let mut x87 = 0_u16;
    // SAFETY: the first instruction loads the value that Rust expects; the second stores a register.
    unsafe {
        asm!("ldmxcsr [{}]", in(reg) &raw const SSE, options(nostack, preserves_flags));
        asm!("fnstcw [{}]", in(reg) &raw mut x87, options(nostack, preserves_flags));
    }
    if x87 != X87 {
        reset();
    }
}

#[cfg(target_arch = "x86_64")]
#[cold]
fn reset() {
    // SAFETY: this is the value that a thread begins with; pending exceptions are cleared before their masks
    // change.
    unsafe {
        asm!(
            "fnclex",
            "fldcw [{x87}]",
            x87 = in(reg) &raw const X87,
            options(nostack, preserves_flags)
        );
    }
}

/// Sets the environment of this thread to the default where it differs.
#[cfg(target_arch = "aarch64")]
#[inline]
pub(super) fn restore() {
    let control: u64;
    // SAFETY: it reads and writes the control register, whose default is 0.
    unsafe {
        std::arch::asm!("mrs {}, fpcr", out(reg) control, options(nomem, nostack, preserves_flags));
        if control != 0 {
            std::arch::asm!("msr fpcr, xzr", options(nomem, nostack, preserves_flags));
        }
    }
}

/// Nothing is known of other processors.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
pub(super) fn restore() {}
