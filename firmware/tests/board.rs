//! The board itself: `cargo xtask board-test [--board NAME]`, with a debug probe and a board
//! connected; the emulated boards run the same program (`tests/tests/board/own_test.rs`). A test
//! starts of the board what it uses, and nothing of it programs option bytes or the configuration's
//! sectors. Wire PA4 to PC2, the emergency stop, the amplifier's ready line and the strap of the
//! current monitor to 3 V (PE4, PE5, PE6; on the NUCLEO-F429ZI PF14, PF15, PF12), plug the board's
//! own USB connector (CN5; CN13) into a PC, and leave the amplifier off.
#![cfg_attr(target_os = "none", no_std, no_main)]
#![allow(unexpected_cfgs, reason = "the macro of embedded-test asks for one of its own")]

#[cfg(target_os = "none")]
use defmt_rtt as _;

#[cfg(target_os = "none")]
#[allow(dead_code, reason = "the image's own, of which a test uses a part")]
#[path = "../src/board/mod.rs"]
mod board;
#[cfg(target_os = "none")]
#[allow(dead_code, unused_imports, reason = "the image's own, of which a test uses a part")]
#[path = "../src/chip/mod.rs"]
mod chip;
#[cfg(target_os = "none")]
#[path = "../src/crash.rs"]
mod crash;
#[cfg(target_os = "none")]
#[path = "../src/last_words.rs"]
mod last_words;

/// Which board this image is for, to be found in its bytes.
#[cfg(target_os = "none")]
#[used]
static BOARD: &str =
    if cfg!(feature = "discovery") { "own test: discovery" } else { "own test: nucleo-f429zi" };

/// The words that the tasks would share.
#[cfg(target_os = "none")]
static SHARED: firmware::tasks::shared::Shared =
    firmware::tasks::shared::Shared::new(&last_words::LAST_WORDS);

/// The end of a crash, with the motor safe: the words of it, and the test has failed.
#[cfg(target_os = "none")]
fn give_up(crash: &firmware::reset::Crash, info: Option<&core::panic::PanicInfo<'_>>) -> ! {
    match info {
        Some(info) => defmt::error!("{}", defmt::Display2Format(info)),
        None => defmt::error!(
            "crash of kind {}, detail {:#x}, PC {:#x}, CFSR {:#x}",
            crash.kind as u8,
            crash.detail,
            crash.pc,
            crash.fault_status
        ),
    }
    embedded_test::export::hosting::abort()
}

#[cfg(target_os = "none")]
#[embedded_test::tests]
mod tests {
    use super::board::Wires;
    use super::chip::{self, Statics, TickTimer, Watchdog, Wiring};
    use control_core::controller::TickInput;
    use control_core::event::State;
    use control_core::units::{Counts, DacCode};
    use control_core::{Controller, Device, Order, Patient, Plan};
    use core::cell::RefCell;
    use cortex_m::peripheral::DWT;
    use firmware::port::{ReadDrive, SerialPort, SupplyLevel, TickTimer as _, Watchdog as _};
    use firmware::store::{ConfigFlash, Nor, Slot, Store, StoreError, Stored};
    use firmware::timing;

    type Parts = chip::Parts<Wires>;

    /// Flash that feeds the watchdog with every word that is read: looking through two sectors
    /// takes longer than it waits.
    struct Fed<F> {
        flash: F,
        watchdog: RefCell<Watchdog>,
    }

    impl<F: ConfigFlash> ConfigFlash for Fed<F> {
        const CELLS: usize = F::CELLS;

        fn word(&mut self, slot: Slot, index: usize) -> u32 {
            self.watchdog.borrow_mut().feed();
            self.flash.word(slot, index)
        }

        fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
            self.flash.program(slot, index, word)
        }

        fn erase(&mut self, slot: Slot) -> Result<(), StoreError> {
            self.flash.erase(slot)
        }
    }

    #[init]
    fn init() -> Parts {
        let (Some(core), Some(device)) =
            (cortex_m::Peripherals::take(), stm32f4xx_hal::pac::Peripherals::take())
        else {
            panic!("the peripherals are taken once")
        };
        Wires::init(core, device)
    }

    /// Waits for the next latch of the converter, and for what it puts out to settle.
    fn a_tick(timer: &TickTimer) {
        while !timer.edge_waits() {}
        timer.acknowledge();
        cortex_m::asm::delay(timing::TICK_CYCLES / 2);
    }

    /// PA4 on PC2: each code comes back as itself, to both ends, with the amplifier off all the
    /// time.
    #[test]
    fn the_converter_gives_code_for_code(parts: Parts) {
        let (mut wired, mut chip) = (parts.wired, parts.chip);
        let timer = TickTimer::start(chip.tick_timer, &mut chip.rcc);
        for code in (1..=4095).step_by(23) {
            wired.drive.put_while_off(DacCode(code));
            (0..3).for_each(|_| a_tick(&timer));
            let readings = wired.drive_lines.read();
            assert!(!readings.enable_line, "the enable line is high");
            let Some(DacCode(back)) = readings.current else {
                panic!("the strap of the current monitor is not wired to 3 V")
            };
            assert!(back.abs_diff(code) < 25, "code {code} came back as {back}");
        }
        wired.drive.off();
    }

    #[test]
    fn the_lines_are_closed(parts: Parts) {
        let readings = parts.wired.drive_lines.read();
        assert!(!readings.stop_open && readings.ready, "a line is not wired to 3 V");
        assert!(!readings.enable_line, "the enable line is high");
    }

    #[test]
    fn the_supply_is_high_enough_and_guarded(parts: Parts) {
        assert!(!chip::is_falling(), "the supply is below 2.66 V: see Power in docs/guide/hardware.md");
        assert!(
            !parts.supply_level.is_low(),
            "the brown-out reset is off, as on a new part: host-sim commission sets it"
        );
    }

    /// The most cycles of the control law by state, over an insertion and a withdrawal; `before` is
    /// done before each tick.
    fn law_cycles(mut before: impl FnMut()) -> [u32; 8] {
        let Ok(plan) = Plan::new(&Device::commissioned_virtual(), &Patient::default()) else {
            panic!("the default is sound")
        };
        let mut controller = Controller::new(plan);
        controller.order(Order::Start);
        let mut longest = [0_u32; 8];
        for tick in 0..20_000_i32 {
            controller.order(Order::Heartbeat);
            let count = if tick < 10_000 { tick / 16 - 60 } else { (20_000 - tick) / 16 - 60 };
            before();
            let entered = DWT::cycle_count();
            let output = controller.tick(TickInput { count: Counts(count), ..TickInput::default() });
            let cycles = DWT::cycle_count().wrapping_sub(entered);
            if let Some(place) = longest.get_mut(usize::from(output.sample.state)) {
                *place = cycles.max(*place);
            }
        }
        longest
    }

    /// With the tick's code in the flash's cache, and with none of it there: in the image it is
    /// somewhere between, for the tick's code is more than the cache holds. Prints both.
    #[test]
    fn the_law_takes_its_cycles(parts: Parts) {
        let mut flash = parts.chip.flash;
        let warm = law_cycles(|| ());
        let cold = law_cycles(|| flash.forget_code());
        for (state, (warm, cold)) in warm.iter().zip(cold).enumerate() {
            defmt::println!("state {}: at most {} cycles, {} without a cache", state, warm, cold);
        }
        assert!(warm[State::Elastic as usize] > 100, "it was pressed");
        assert!(
            warm.iter().chain(&cold).all(|&cycles| cycles < timing::OUTPUT_CYCLES),
            "later than the latch"
        );
    }

    /// Otherwise the measurement above is of a cache that was warm. The emulated boards have none:
    /// there this fails, and has to be reported.
    #[test]
    fn an_emptied_cache_costs_cycles(parts: Parts) {
        let mut flash = parts.chip.flash;
        let (warm, cold) = (law_cycles(|| ()), law_cycles(|| flash.forget_code()));
        let elastic = State::Elastic as usize;
        assert!(cold[elastic] > warm[elastic], "the cache was not emptied");
    }

    /// In sectors that hold nothing else, which are blank again afterwards; the device that is
    /// saved is not a commissioned one.
    #[test]
    #[timeout(20)]
    fn a_configuration_is_saved_and_found_again(parts: Parts) {
        let (timer, debug) = parts.chip.watchdog;
        let watchdog = RefCell::new(Watchdog::start(timer, debug, Wires::ALIVE));
        let mut scratch = Fed { flash: Nor(parts.chip.flash.scratch()), watchdog };
        for slot in [Slot::A, Slot::B] {
            assert!(scratch.erase(slot).is_ok(), "erased before");
        }
        let (mut store, device, patient) = Store::open(scratch);
        assert!(device == Stored::None && patient == Stored::None, "an erased sector holds nothing");
        let mut device = Device::default();
        for fade_in_ms in [301, 302] {
            device.limits.fade_in_ms = fade_in_ms;
            assert!(store.save_device(&device, || true).is_ok(), "saved");
        }
        let (store, found, _) = Store::open(store.close());
        assert!(found == Stored::Found(device), "the last one that was saved is found");
        assert!(!device.commissioned, "and nobody has commissioned it");
        let mut scratch = store.close();
        for slot in [Slot::A, Slot::B] {
            assert!(scratch.erase(slot).is_ok(), "erased after");
        }
    }

    /// In a PC: configured within five seconds. Prints the longest look at the core, which masks
    /// the tick at worst.
    #[test]
    #[timeout(10)]
    fn usb_enumerates(parts: Parts) {
        static mut STATICS: Statics = Statics::new();
        // SAFETY: a test begins with a reset, and this is the one that uses them.
        #[allow(unsafe_code, static_mut_refs)]
        let mut serial = chip::usb(parts.chip.usb, chip::serial_number(), unsafe { &mut STATICS });
        let (mut longest, mut configured_ms) = (0, 0_u32);
        for _ in 0..5_000 {
            let entered = DWT::cycle_count();
            serial.poll();
            longest = DWT::cycle_count().wrapping_sub(entered).max(longest);
            configured_ms += u32::from(serial.is_configured());
            if configured_ms > 500 {
                break;
            }
            cortex_m::asm::delay(timing::CORE_HZ / 1_000);
        }
        defmt::println!("longest look at the USB core: {} cycles", longest);
        assert!(configured_ms > 0, "no PC has configured the device: is it plugged in?");
        assert!(longest < timing::OUTPUT_CYCLES, "it masks the tick beyond its latch");
    }
}

#[cfg(not(target_os = "none"))]
fn main() {}
