//! Panic, hard fault, stray interrupt: the amplifier goes off, then the converters to zero torque, by direct register
//! writes that need nothing to be in order, not even the stack. Then word is left for the next start, and the device
//! resets itself, so that a PC finds a device that answers and says what happened.
#![allow(unsafe_code, reason = "after a fault nothing that owns a register can be trusted")]

use control_core::config::DacWidth;
use core::panic::PanicInfo;
use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use firmware::reset::{Crash, CrashKind, LastWords};
use stm32f4xx_hal::pac::{DAC, GPIOD, GPIOE, RCC};

/// What survives a reset: start-up code leaves this section alone, any bits are valid in it, and it says itself which mean
/// something.
#[unsafe(link_section = ".uninit.last_words")]
pub(crate) static LAST_WORDS: LastWords = LastWords::new();

/// PD7, the amplifier's enable, off.
const ENABLE_OFF: u32 = 1 << (7 + 16);
/// PE8 to PE15 at mid-scale: the highest bit set, the others cleared.
const LINES_ZERO_TORQUE: u32 = 1 << 15 | 0x7F << (8 + 16);

/// Amplifier off, then zero torque.
fn safe_state() {
    cortex_m::interrupt::disable();
    // SAFETY: interrupts are off and whatever was interrupted never continues: nobody else uses these registers again. The
    // writes are valid whatever state the peripherals are in; to one without a clock they do nothing, and then its pins
    // are still inputs and the external pull-down holds the amplifier off.
    unsafe {
        (*GPIOD::ptr()).bsrr().write(|w| w.bits(ENABLE_OFF));
        // Off and on again, now without its trigger (RM0090 14.3.6): a code then goes straight out (14.3.4).
        let mid_scale = DacWidth::Bits12.mid_scale().into();
        (*DAC::ptr()).cr().write(|w| w.boff1().set_bit());
        (*DAC::ptr()).dhr12r1().write(|w| w.bits(mid_scale));
        (*DAC::ptr()).cr().write(|w| w.boff1().set_bit().en1().set_bit());
        (*DAC::ptr()).dhr12r1().write(|w| w.bits(mid_scale));
        (*GPIOE::ptr()).bsrr().write(|w| w.bits(LINES_ZERO_TORQUE));
    }
}

fn end(kind: CrashKind, detail: u32) -> ! {
    safe_state();
    LAST_WORDS.crash(Crash { kind, detail });
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    end(CrashKind::Panic, info.location().map_or(0, |place| place.line()))
}

/// The crystal has stopped while its clock security (RM0090 7.2.7) watched; the core goes on, on its own oscillator.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    // SAFETY: interrupts cannot mask this one; nobody else runs any more.
    let state = unsafe { &*RCC::ptr() }.cr().read().bits();
    end(CrashKind::Clock, state)
}

/// Has the clock security watch the crystal once it runs. One that never comes leaves the device here, its pins inputs and
/// the amplifier held off by its pull-down, until a person looks: without the crystal there is neither USB nor a tick.
pub(crate) fn wait_for_crystal(rcc: &RCC) {
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    while rcc.cr().read().hserdy().bit_is_clear() {}
    rcc.cr().modify(|_, w| w.csson().set_bit());
}

/// An interrupt that no task serves.
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    end(CrashKind::StrayInterrupt, number.unsigned_abs().into())
}

/// Takes a fresh stack, for the old one may be what broke, and keeps where the core says that it put its frame.
#[unsafe(naked)]
#[unsafe(no_mangle)]
#[unsafe(link_section = ".HardFault.user")]
unsafe extern "C" fn HardFault() -> ! {
    core::arch::naked_asm!(
        "mrs r0, msp",
        "movw r1, #:lower16:_stack_start",
        "movt r1, #:upper16:_stack_start",
        "msr msp, r1",
        "b {continued}",
        continued = sym hard_fault,
    )
}

extern "C" fn hard_fault(frame: *const u32) -> ! {
    unsafe extern "C" {
        static _stack_start: u32;
        static _stack_end: u32;
    }
    safe_state();
    const FRAME_WORDS: usize = 8;
    const RETURN_ADDRESS: usize = 6;
    let (bottom, top) = (&raw const _stack_end as usize, &raw const _stack_start as usize);
    let at = frame as usize;
    let is_on_stack = at >= bottom && at + 4 * FRAME_WORDS <= top && at.is_multiple_of(4);
    // SAFETY: eight words from `frame` lie in the memory that is the stack's, and any word there is a number.
    let address = if is_on_stack { unsafe { frame.add(RETURN_ADDRESS).read_volatile() } } else { 0 };
    end(CrashKind::HardFault, address)
}
