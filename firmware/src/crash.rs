//! Panic, hard fault, stray interrupt: the amplifier goes off, then the converters to zero torque,
//! by direct register writes that need nothing to be in order, not even the stack. What comes then
//! is the program's (`give_up`): the image leaves word for the next start and resets itself, so
//! that a PC finds a device that answers and says what happened. It names no pin: those are the
//! board's.
#![allow(unsafe_code, reason = "after a fault nothing that owns a register can be trusted")]

use crate::board::Wires;
use crate::chip::{self, Wiring};
use crate::give_up;
use core::panic::PanicInfo;
use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use firmware::reset::{Crash, CrashKind};
use stm32f4xx_hal::pac::RCC;

/// Amplifier off, then zero torque.
fn safe_state() {
    cortex_m::interrupt::disable();
    // Interrupts are off and whatever was interrupted never continues: nobody else uses these
    // registers again. The writes are valid whatever state the peripherals are in; to one without a
    // clock they do nothing, and then its pins are still inputs and the external pull-down holds
    // the amplifier off.
    Wires::ENABLE.set_low();
    chip::outputs_to_zero_torque();
}

fn end(crash: &Crash) -> ! {
    safe_state();
    give_up(crash, None)
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    // The motor before anything else.
    safe_state();
    let place = info.location();
    let crash =
        place.map_or(Crash::new(CrashKind::Panic, 0), |place| Crash::panic(place.file(), place.line()));
    give_up(&crash, Some(info))
}

/// The clock from outside has stopped while the clock security (RM0090 7.2.7) watched it; the core
/// goes on, on its own oscillator.
#[exception]
unsafe fn NonMaskableInt() -> ! {
    // SAFETY: interrupts cannot mask this one; nobody else runs any more.
    let state = unsafe { &*RCC::ptr() }.cr().read().bits();
    end(&Crash::new(CrashKind::Clock, state))
}

/// An exception that no task serves: interrupts are counted from 0, the core's own exceptions lie
/// below (ARMv7-M B1.5.2).
#[exception]
unsafe fn DefaultHandler(number: i16) -> ! {
    let exception = i32::from(number) + 16;
    end(&Crash::new(CrashKind::StrayInterrupt, exception.unsigned_abs()))
}

/// Takes a fresh stack, for the old one may be what broke, and keeps where the core says that it
/// put its frame.
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
    /// Places in the frame (ARMv7-M B1.5.7).
    const LINK: usize = 5;
    const RETURN_ADDRESS: usize = 6;
    let (bottom, top) = (&raw const _stack_end as usize, &raw const _stack_start as usize);
    let at = frame as usize;
    let is_on_stack = at >= bottom && at + 4 * FRAME_WORDS <= top && at.is_multiple_of(4);
    // SAFETY: eight words from `frame` lie in the memory that is the stack's, and any word there is
    // a number.
    let word = |place| if is_on_stack { unsafe { frame.add(place).read_volatile() } } else { 0 };
    // SAFETY: reads without a side effect; nobody else runs any more. The address comes before the
    // status that says whether it is valid: another fault would end here anew.
    let (bus_address, fault_status, hard) = unsafe {
        let scb = &*SCB::PTR;
        (scb.bfar.read(), scb.cfsr.read(), scb.hfsr.read())
    };
    let (pc, lr) = (word(RETURN_ADDRESS), word(LINK));
    end(&Crash { pc, lr, fault_status, bus_address, ..Crash::new(CrashKind::HardFault, hard) })
}
