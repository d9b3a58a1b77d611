//! Every timing constant of the firmware, each with its reason. Nothing else in this crate states a
//! frequency, a period, a timeout or a priority.

use control_core::TICK_HZ;

/// The frequency of the board's external clock: a crystal, or the clock of its debugger.
pub const EXTERNAL_CLOCK_HZ: u32 = 8_000_000;

/// The frequency of the part's own oscillator, on which it comes out of reset (RM0090 7.2.2).
pub const RESET_CLOCK_HZ: u32 = 16_000_000;

/// The frequency at the PLL's input, at which it jitters least (RM0090 7.3.2).
pub const PLL_INPUT_HZ: u32 = 2_000_000;

/// The clock of the USB core.
pub const USB_HZ: u32 = 48_000_000;

/// The most that an STM32F407 runs at, and an STM32F429 without over-drive; the cycle counter
/// counts it.
pub const CORE_HZ: u32 = 168_000_000;

/// The most that the APB1 bus allows.
pub const APB1_HZ: u32 = 42_000_000;

/// The most that the APB2 bus allows.
pub const APB2_HZ: u32 = 84_000_000;

/// Clock of the tick's timer: twice its bus, since that bus is divided.
pub const TICK_TIMER_HZ: u32 = 2 * APB1_HZ;

/// Cycles from one tick to the next: 16,800.
pub const TICK_CYCLES: u32 = CORE_HZ / TICK_HZ;

/// Counts of the tick's timer from one tick to the next: 8,400, which divides without a rest, so
/// that the rate is as exact as the crystal.
pub const TICK_TIMER_COUNTS: u32 = TICK_TIMER_HZ / TICK_HZ;

/// From the tick's edge to the instant at which the 12-bit converter takes the code, by hardware:
/// 20 µs. Whatever the tick computes and whatever masked it for a few microseconds, the motor is
/// driven at equal distances. Longer than the longest tick with the longest masking before it,
/// short against the tick's period.
pub const OUTPUT_CYCLES: u32 = CORE_HZ / 50_000;

/// Two ticks further apart than this are not neighbours: a period and a half.
pub(crate) const TICK_MISSED_CYCLES: u32 = TICK_CYCLES + TICK_CYCLES / 2;

/// Rate of the supervisor, and of everything that it sets off: often enough that its 1 ms is small
/// against the 20 ms in which a hung task must have lost its torque, seldom enough to cost nothing.
pub const SUPERVISOR_HZ: u32 = 1_000;

/// The tilt sensor is read at twice the 100 Hz at which it measures: no measurement is missed,
/// whatever its clock does.
pub(crate) const TILT_PERIOD_MS: u32 = 5;

/// The time for which the tick may be silent before the supervisor calls it hung: it runs ten times
/// in that time. A tick that never returns starves the supervisor too, and is left to the watchdog.
pub(crate) const TICK_SILENCE_MS: u32 = 2;

/// The time for which the USB and telemetry tasks may be silent: both run every millisecond, and
/// five of them are more than the longest of either ever measured, yet leave time to act within 20
/// ms.
pub(crate) const TASK_SILENCE_MS: u32 = 5;

/// The time for which the tilt task may be silent: two of its periods and a millisecond.
pub(crate) const TILT_SILENCE_MS: u32 = 2 * TILT_PERIOD_MS + 1;

/// Ticks without a sign of the supervisor after which the tick takes torque away by itself: 5 ms.
/// It is what catches a task that keeps the supervisor from running, for instance a USB stack that
/// waits for a flag with interrupts masked.
pub(crate) const SUPERVISOR_SILENCE_TICKS: u32 = 50;

/// The independent watchdog, nominal. Its oscillator runs at 17 to 47 kHz instead of 32: 10 ms lie
/// between 6.8 ms, still several periods of the supervisor, and 18.8 ms, still within the 20 ms for
/// a hung task.
pub const WATCHDOG_MS: u32 = 10;

/// The same while a sector of flash is erased, which stops the processor for up to 2.6 s: 5 s lie
/// between 3.4 and 9.4 s. Torque is off then.
pub const WATCHDOG_ERASE_MS: u32 = 5_000;

/// Longest wait for the watchdog to take another time, in turns of a loop that reads a register:
/// ten cycles of its clock take 0.6 ms at most. One that does not run has no clock and never takes
/// it: then it is not needed either.
pub const WATCHDOG_SETTLE_TURNS: u32 = 20_000;

/// A pull of 40 kΩ and a wire of 200 pF: 8 µs to the level at which an input changes. Wait this
/// long, in cycles: 20 µs.
pub const PULL_SETTLE_CYCLES: u32 = CORE_HZ / 50_000;

/// Filter of the encoder's inputs (RM0090 18.4.7, ICxF): eight samples at a quarter of the timer's
/// clock, 0.38 µs. A glitch from the motor's PWM leads is shorter; an edge of a needle at 1 m/s
/// lasts 31 µs.
pub const ENCODER_FILTER: u8 = 0b0111;

/// Readings that fail in a row before the tilt sensor counts as broken: 50 ms. One bad transfer is
/// no reason to drop torque.
pub(crate) const TILT_BAD_READINGS: u32 = 10;

/// Readings without a new measurement before the tilt sensor counts as stuck: 100 ms, ten
/// measurements.
pub(crate) const TILT_STALE_READINGS: u32 = 20;

/// Equal measurements before a sensor that resolves its own noise (LIS3DSH, 0.06 mg) counts as
/// stuck: half a second.
pub(crate) const TILT_FROZEN_MEASUREMENTS: u32 = 50;

/// Clock of the tilt sensor's SPI, at most; both revisions allow 10 MHz, and a slow edge rings
/// less.
pub const TILT_SPI_HZ: u32 = 1_500_000;

/// The rate to ask the HAL for to get it: it takes the second bus to run as out of reset.
pub const TILT_SPI_ASKED_HZ: u32 = (TILT_SPI_HZ as u64 * RESET_CLOCK_HZ as u64 / APB2_HZ as u64) as u32;

/// After this time in a turn telemetry takes no further packet: 0.3 ms. The command under way may
/// end 2 ms later.
pub(crate) const COMMAND_CYCLES: u32 = CORE_HZ / 3_300;

/// Telemetry's share of a millisecond for a save: 0.4 ms. The word under way may end 0.2 ms later
/// (data sheet: half a word takes 16 µs, 100 µs at most), and a stop is answered in between.
pub(crate) const SAVE_CYCLES: u32 = CORE_HZ / 2_500;

/// While packets come less than this apart, a save has its share only every [`SAVE_APART_MS`].
pub(crate) const QUIET_MS: u32 = 3;

/// Longer than a stop may wait, so that at most one share comes before it.
pub(crate) const SAVE_APART_MS: u32 = 8;

/// Longest time in which the configuration's flash takes half a word (data sheet: 100 µs), in turns
/// of a loop that reads a register, with a wide margin; a flash that is busy for longer is broken.
pub const FLASH_WORD_TURNS: u32 = 100_000;

/// Longest time in which it erases a sector of 128 KiB, 16 bits at a time (data sheet: 2.6 s), in
/// the same turns.
pub const FLASH_ERASE_TURNS: u32 = 400_000_000;

/// Longest time in which option bytes are programmed, that of the shortest sector (data sheet: 0.8
/// s), in turns of at least six cycles: 1.1 s, well before the watchdog of an erasure.
pub const OPTION_TURNS: u32 = 30_000_000;

/// Priorities of the tasks, 1 the lowest. The tick is above everything; the supervisor is above
/// whatever it has to watch. No critical section of RTIC masks the tick. PRIMASK does: the USB core
/// polls its registers with all interrupts masked (`synopsys-usb-otg`), and the erasure's watchdog
/// is set so. The longest such stretch is measured on the image
/// (`nothing_masks_the_tick_for_longer_than_the_latch_waits`), and a code that comes after the
/// latch all the same is counted.
pub mod priority {
    /// The control tick. Only PRIMASK masks it.
    pub const TICK: u8 = 16;
    /// The supply's early warning.
    pub const SUPPLY: u8 = 15;
    /// The supervisor.
    pub const SUPERVISOR: u8 = 4;
    /// USB.
    pub const USB: u8 = 3;
    /// Tilt: 50 µs of every 5 ms.
    pub const TILT: u8 = 2;
    /// Telemetry, which works for as long as a PC gives it work.
    pub const TELEMETRY: u8 = 1;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clock_divides_into_ticks_without_a_rest() {
        assert_eq!(TICK_TIMER_COUNTS * TICK_HZ, TICK_TIMER_HZ);
        assert_eq!(TICK_CYCLES * TICK_HZ, CORE_HZ);
    }

    /// Tests of the figures in the comments above.
    #[test]
    fn the_derived_constants_are_what_their_reasons_say() {
        assert_eq!((TICK_TIMER_HZ, TICK_CYCLES, TICK_TIMER_COUNTS), (84_000_000, 16_800, 8_400));
        assert_eq!(1_000_000 * u64::from(OUTPUT_CYCLES) / u64::from(CORE_HZ), 20, "µs");
        assert_eq!(2 * TICK_MISSED_CYCLES, 3 * TICK_CYCLES);
        assert_eq!(TILT_SILENCE_MS, 11);
    }

    /// The slowest way to notice that a task hangs leaves time for the tick that takes torque away.
    #[test]
    fn a_hung_task_is_noticed_within_twenty_milliseconds() {
        let slowest_watchdog_ms = WATCHDOG_MS * 32 / 17 + 1;
        let supervisor_ms = SUPERVISOR_SILENCE_TICKS * 1_000 / TICK_HZ;
        for ms in [TICK_SILENCE_MS, TASK_SILENCE_MS, TILT_SILENCE_MS, supervisor_ms, slowest_watchdog_ms] {
            assert!(ms < 20, "{ms} ms");
        }
    }

    /// The fastest watchdog outlives the silence that is still regular.
    #[test]
    fn the_watchdog_never_bites_a_healthy_device() {
        let fastest_watchdog_ms = WATCHDOG_MS * 32 / 47;
        assert!(fastest_watchdog_ms > 2 * 1_000 / SUPERVISOR_HZ);
    }
}
