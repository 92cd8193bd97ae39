//! The floating-point modes of a thread: rounding, subnormal numbers (FTZ, DAZ), precision of x87, and which exceptions trap.
//!
//! Foreign code may change them: by `fesetround`, or by being loaded, where it was compiled with `-ffast-math`. They belong to the thread,
//! so without care the numbers of everything that runs after it in the same thread would change.

use std::sync::atomic::{AtomicU64, Ordering};

/// The control words of the CPU without its exception flags: on x86-64 MXCSR, and the x87 control word from bit 32 on; on AArch64 FPCR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct FloatModes(u64);

impl Default for FloatModes {
    /// Those with which a program starts, and for which Rust code is compiled.
    fn default() -> FloatModes {
        FloatModes(cpu::DEFAULT)
    }
}

impl FloatModes {
    /// The modes of this thread, which then has the default ones: for a program whose own start-up code, such as that of `-ffast-math`, has
    /// set them for its participant.
    pub fn take() -> FloatModes {
        let modes = FloatModes(cpu::read());
        FloatModes::default().replace(modes);
        modes
    }

    /// Sets these modes, where `current` are those of this thread. A write costs more than the comparison.
    #[inline]
    fn replace(self, current: FloatModes) {
        if self != current {
            cpu::write(self.0, current.0);
        }
    }
}

/// The modes of one instance of foreign code, from one call to the next.
#[derive(Debug)]
pub(crate) struct OwnModes(AtomicU64);

impl OwnModes {
    pub(crate) fn new() -> OwnModes {
        OwnModes(AtomicU64::new(cpu::DEFAULT))
    }

    pub(crate) fn get(&self) -> FloatModes {
        FloatModes(self.0.load(Ordering::Relaxed))
    }

    pub(crate) fn set(&self, modes: FloatModes) {
        self.0.store(modes.0, Ordering::Relaxed);
    }

    /// Sets these modes until the result is dropped, and keeps what the foreign code has made of them by then.
    #[inline]
    pub(crate) fn enter(&self) -> Entered<'_> {
        let callers = FloatModes(cpu::read());
        self.get().replace(callers);
        Entered { own: self, callers }
    }
}

/// The caller's modes, which are set again when this is dropped: also after a panic.
pub(crate) struct Entered<'a> {
    own: &'a OwnModes,
    callers: FloatModes,
}

impl Drop for Entered<'_> {
    #[inline]
    fn drop(&mut self) {
        let now = FloatModes(cpu::read());
        self.own.set(now);
        self.callers.replace(now);
    }
}

/// Does work of this program that foreign code asks for, with the default modes.
#[inline]
pub fn with_default_modes<T>(work: impl FnOnce() -> T) -> T {
    let default = OwnModes::new();
    let _entered = default.enter();
    work()
}

#[cfg(target_arch = "x86_64")]
mod cpu {
    use std::arch::asm;

    /// All exceptions are masked, rounding is to nearest, x87 has its full precision.
    pub(super) const DEFAULT: u64 = 0x037f << 32 | 0x1f80;
    /// The exception flags of MXCSR.
    const FLAGS: u32 = 0x3f;

    #[inline]
    pub(super) fn read() -> u64 {
        let (mut sse, mut x87) = (0_u32, 0_u16);
        // SAFETY: both instructions only write the control words to these places.
        unsafe { asm!("stmxcsr [{}]", "fnstcw [{}]", in(reg) &raw mut sse, in(reg) &raw mut x87, options(nostack)) };
        u64::from(x87) << 32 | u64::from(sse & !FLAGS)
    }

    pub(super) fn write(modes: u64, current: u64) {
        let (sse, x87) = (modes as u32, (modes >> 32) as u16);
        if sse != current as u32 {
            // SAFETY: the value is one that `read` gave, or the default, so it has no reserved bit. Rust code is compiled for the default modes:
            // others are set only around a call of foreign code, and the code between here and there computes no floating-point numbers. The
            // exception flags, which are cleared, are read by no code of this program.
            unsafe { asm!("ldmxcsr [{}]", in(reg) &raw const sse, options(nostack)) };
        }
        if x87 != (current >> 32) as u16 {
            // SAFETY: as above. The flags are cleared first, because a pending one would trap as soon as its exception is unmasked.
            unsafe { asm!("fnclex", "fldcw [{}]", in(reg) &raw const x87, options(nostack)) };
        }
    }
}

#[cfg(target_arch = "aarch64")]
mod cpu {
    use std::arch::asm;

    pub(super) const DEFAULT: u64 = 0;

    #[inline]
    pub(super) fn read() -> u64 {
        let modes: u64;
        // SAFETY: the instruction only reads the control register.
        unsafe { asm!("mrs {}, fpcr", out(reg) modes, options(nostack)) };
        modes
    }

    pub(super) fn write(modes: u64, _: u64) {
        // SAFETY: the value is one that `read` gave, or the default. Rust code is compiled for the default modes: others are set only around
        // a call of foreign code, and the code between here and there computes no floating-point numbers.
        unsafe { asm!("msr fpcr, {}", in(reg) modes, options(nostack)) };
    }
}

/// Machines whose control words this program does not know keep them as foreign code leaves them.
#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
mod cpu {
    pub(super) const DEFAULT: u64 = 0;

    pub(super) fn read() -> u64 {
        DEFAULT
    }

    pub(super) fn write(_: u64, _: u64) {}
}
