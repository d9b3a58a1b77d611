//! A needle held in skin with torque on it, and what has to follow when something goes wrong.

use control_core::event::Fault;
use link::Command;
use link::frames::{CommandRefusal, EventKind};

use crate::pc::Pc;
use crate::scenario::{COUNTS_PER_MM, board_wired};
use crate::start::Start;
use emulator::board::processor::FIRST_EXTERNAL;
use emulator::board::{Board, Drive, Effect, MILLISECOND, Nanos, PlantSide, Wiring, plant};
use emulator::usb_host::Port;

/// Zero torque of the 12-bit converter.
pub const ZERO_TORQUE: u16 = 2048;
/// 2.5 mm into skin that gives way at 3 mm.
pub const PRESSED: i64 = 5 * COUNTS_PER_MM / 2;

/// The exceptions the firmware's tasks run in, by its table of interrupts.
pub mod task {
    use super::FIRST_EXTERNAL;

    /// The control tick, on TIM4.
    pub const TICK: u32 = FIRST_EXTERNAL + 30;
    /// The supervisor, on SysTick.
    pub const SUPERVISOR: u32 = 15;
    /// USB, on OTG_FS.
    pub const USB: u32 = FIRST_EXTERNAL + 67;
    /// Telemetry, on USART2.
    pub const TELEMETRY: u32 = FIRST_EXTERNAL + 38;
    /// Tilt, on USART3.
    pub const TILT: u32 = FIRST_EXTERNAL + 39;
}

/// A board with a PC on its cable.
#[derive(Debug)]
pub struct Rig {
    /// The board.
    pub board: Board,
    /// The PC.
    pub pc: Pc,
}

/// The hand that presses it in.
fn pressing() -> impl PlantSide {
    plant::by_hand(plant::path(vec![(400 * MILLISECOND, 0), (700 * MILLISECOND, PRESSED)]))
}

/// True if the motor cannot move: the amplifier off and no torque requested.
fn is_safe(drive: Drive) -> bool {
    !drive.enabled && drive.code.is_none_or(|code| code == ZERO_TORQUE)
}

impl Rig {
    /// A board wired as `wiring` and a PC that has said hello, with `plant` on the shaft from then
    /// on. Until then it was held still.
    ///
    /// # Panics
    ///
    /// When the PC finds no device.
    #[must_use]
    pub fn connected(wiring: Wiring, plant: impl PlantSide + 'static) -> Self {
        let begin = |wiring| {
            let (mut board, mut pc) = (board_wired(wiring, plant::held()), Pc::new());
            pc.connect(&mut board);
            (board, pc, ())
        };
        let (board, pc) = Start::of("connected", wiring, begin).on(plant);
        Self { board, pc }
    }

    /// The same, held still, on the skin: it knows its depth.
    ///
    /// # Panics
    ///
    /// When the device refuses.
    #[must_use]
    pub fn zeroed(wiring: Wiring) -> Self {
        let begin = |wiring| {
            let Self { mut board, mut pc } = Self::connected(wiring, plant::held());
            pc.must(&mut board, Command::Zero);
            (board, pc, ())
        };
        let (board, pc) = Start::of("zeroed", wiring, begin).on(plant::held());
        Self { board, pc }
    }

    /// A needle pressed into skin, started by a person, with torque on it.
    ///
    /// # Panics
    ///
    /// When there is no torque.
    #[must_use]
    pub fn pressed() -> Self {
        Self::pressed_on(Wiring::default())
    }

    /// The same, on a board wired as `wiring`.
    ///
    /// # Panics
    ///
    /// When there is no torque.
    #[must_use]
    pub fn pressed_on(wiring: Wiring) -> Self {
        let begin = |wiring| {
            let Self { board, pc } = Self::pressed_afresh(wiring);
            (board, pc, ())
        };
        let (board, pc) = Start::of("pressed", wiring, begin).on(pressing());
        Self { board, pc }
    }

    /// The same on a board that is switched on for it.
    ///
    /// # Panics
    ///
    /// When there is no torque.
    #[must_use]
    pub fn pressed_afresh(wiring: Wiring) -> Self {
        let mut rig = Self { board: board_wired(wiring, pressing()), pc: Pc::new() };
        rig.pc.connect(&mut rig.board);
        rig.pc.must(&mut rig.board, Command::Start);
        rig.run_to(900);
        let drive = rig.board.at_stop(|stopped| stopped.drive());
        let code = drive.code.expect("the DAC drives its pin");
        assert!(drive.enabled && code.abs_diff(ZERO_TORQUE) > 100, "torque is on: {drive:?}");
        rig
    }

    fn run_to(&mut self, milliseconds: u64) {
        let left = (milliseconds * MILLISECOND).saturating_sub(self.board.now()) / MILLISECOND;
        self.pc.run_ms(&mut self.board, left);
    }

    /// Runs until the motor can't move and answers how long that took, in nanoseconds.
    ///
    /// # Panics
    ///
    /// When it can still move after `limit` nanoseconds.
    pub fn time_to_safe(&mut self, limit: Nanos) -> Nanos {
        let start = self.board.now();
        while self.board.now() < start + limit {
            let end = (self.board.now() + MILLISECOND).min(start + limit);
            if self.board.run_until_seen(end, 10_000, |stopped| is_safe(stopped.drive())) {
                return self.board.now() - start;
            }
            // The PC goes on meanwhile.
            self.pc.attend(&mut self.board);
        }
        let drive = self.board.at_stop(|stopped| stopped.drive());
        panic!("{drive:?} after {} us", limit / 1_000);
    }

    /// Something goes wrong in the exception of a task.
    pub fn upset(&mut self, exception: u32, effect: Effect) {
        self.board.upset(exception, 5, effect);
    }

    /// A jump that hangs whoever makes it: to an endless loop in memory that the part has and the
    /// firmware doesn't know of.
    #[must_use]
    pub fn hang(&mut self) -> Effect {
        const BEYOND: u32 = 0x2002_0000;
        // `b .`, twice.
        const LOOP: u32 = 0xE7FE_E7FE;
        assert!(self.board.at_stop(|stopped| stopped.set_word(BEYOND.into(), LOOP)), "memory to loop in");
        Effect::Jump(BEYOND)
    }

    /// The PC comes back, hears the cause, and finds torque off; a person starts the device, and
    /// torque fades in.
    ///
    /// # Panics
    ///
    /// When any of it does not happen.
    pub fn comes_back_after(&mut self, cause: Fault) {
        self.pc.set_silent(false);
        let since = self.board.now();
        self.board.at_stop(|stopped| {
            let host = &mut stopped.usb().host;
            host.set_reading(true);
            host.resume();
        });
        self.pc.run_ms(&mut self.board, 60);
        if self.board.at_stop(|stopped| stopped.usb().host.is_open()) {
            self.pc.hello(&mut self.board);
        } else {
            self.pc.connect(&mut self.board);
        }
        let hello = self.pc.heard.hello.clone().expect("a hello");
        assert_eq!(hello.fault, Some(cause), "the cause that is reported");
        self.pc.run_ms(&mut self.board, 300);
        let raised = self.enabled_since(since);
        assert!(raised.is_empty(), "the amplifier came on by itself at {raised:?}");

        if !self.board.at_stop(|stopped| stopped.resets()).is_empty() {
            // It counts from where it found the shaft: skin begins there now.
            self.pc.must(&mut self.board, Command::Zero);
            let now = self.board.now();
            let hand = plant::path(vec![(now, PRESSED), (now + 100 * MILLISECOND, 2 * PRESSED)]);
            self.board.at_stop(|stopped| stopped.set_plant(Box::new(plant::by_hand(hand))));
            self.pc.run_ms(&mut self.board, 200);
        }
        let start = self.board.now();
        let refused = self.pc.must_not(&mut self.board, Command::Start);
        assert_eq!(refused, CommandRefusal::Faulted(cause), "nobody has cleared it");
        self.pc.must(&mut self.board, Command::Start);
        self.pc.run_ms(&mut self.board, 500);
        assert!(self.pc.heard_event(|kind| *kind == EventKind::Started), "a person starts it again");
        assert_eq!(self.enabled_since(start).len(), 1, "the amplifier comes on once");
        let on = self.enabled_since(start)[0];
        let deviation = self.board.at_stop(move |stopped| {
            let put_out = &stopped.log().put_out;
            let largest = |from: Nanos, to: Nanos| {
                let within = put_out.iter().filter(|output| (from..to).contains(&output.at));
                within.map(|output| output.code.abs_diff(ZERO_TORQUE)).max().unwrap_or(0)
            };
            (largest(start, on + 10 * MILLISECOND), largest(on, on + 400 * MILLISECOND))
        });
        assert!(deviation.1 > 20, "torque comes back: {deviation:?}");
        assert!(10 * deviation.0 <= 2 * deviation.1, "torque fades in: {deviation:?} in 10 and 400 ms");
    }

    /// Returns the times at which the amplifier was switched on since `since`.
    pub fn enabled_since(&mut self, since: Nanos) -> Vec<Nanos> {
        self.board.at_stop(move |stopped| {
            let changes = stopped.log().enable.iter();
            changes.filter(|&&(at, on)| on && at >= since).map(|&(at, _)| at).collect()
        })
    }

    /// Waits until a device that was reset is on the cable again.
    ///
    /// # Panics
    ///
    /// When it does not come.
    pub fn wait_for_port(&mut self) {
        let configured =
            self.board.run_while_not(3_000, 1_000, |stopped| stopped.usb().host.port() == Port::Configured);
        assert!(configured, "the serial port comes back");
    }
}
