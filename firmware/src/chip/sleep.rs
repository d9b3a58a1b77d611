//! Sleep between interrupts.
#![allow(unsafe_code, reason = "an instruction of the core, and a place for it")]

/// Sleeps until an interrupt.
///
/// ES0182 2.1.3, "Debugging Sleep/Stop mode with WFE/WFI entry": with `DBG_SLEEP` set, which the
/// cycle counter needs, a core that wakes may carry out instructions that it never fetched, where
/// the flash has wait states and does not prefetch. Its remedies are three `NOP`s behind the
/// instruction, which were seen to fail (mynewt-core 2058), and the instruction in RAM: here both.
// SAFETY: start-up copies `.data` from the flash, code among it (`cortex-m-rt`), before this runs.
#[inline(never)]
#[unsafe(link_section = ".data.sleep")]
pub(crate) fn sleep() {
    // SAFETY: neither touches memory or a register.
    unsafe { core::arch::asm!("wfi", "nop", "nop", "nop", options(nomem, nostack, preserves_flags)) };
}
