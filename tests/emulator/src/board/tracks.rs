//! The encoder at the part: what its wires bring to the pins, what the pins' pulls make of a wire
//! that is off, and what of it the timer hears. A timer hears a pin only where the port's
//! multiplexer leads there (RM0090 8.3.2); else its input is low.

use rigless::device::Level;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::soc::stm32f427::peripherals::tim::Channel;
use rigless::time::VirtualNanos;

use super::machine::{Machine, pin};
use super::pins::{PartPin, register};
use super::plant::{Encoder, Nanos};
use super::wires::Wires;
use super::{Timer, Wiring};

/// The time that a pull of 40 kΩ (data sheet DS8626, I/O static characteristics) takes to empty a
/// pin with a wire on it: 100 pF through the level at which the input changes, with a margin.
pub(super) const PULL_SETTLES: Nanos = 10_000;

/// Both tracks.
#[derive(Debug)]
pub(super) struct Tracks {
    timer: Timer,
    pins: [PartPin; 2],
    pub(super) encoder: Encoder,
    pub(super) wires: Wires,
    /// While a glitch is on the pins: until when.
    glitch_ends: Option<Nanos>,
    /// The charge that a pin without a wire still keeps, and until when.
    floating: [Option<bool>; 2],
    pub(super) floating_until: Option<Nanos>,
    /// The levels to which pins without a wire have been pulled.
    settled: [bool; 2],
    /// True for each pin that the timer receives.
    heard: [bool; 2],
}

rigless::store!(Tracks {
    values: [encoder, wires, glitch_ends, floating, floating_until, settled, heard],
    parts: [],
    built: [timer, pins],
});

impl Tracks {
    pub(super) fn new(wiring: &Wiring) -> Self {
        Self {
            timer: wiring.encoder,
            pins: wiring.pins.tracks,
            encoder: Encoder::new(),
            wires: Wires::default(),
            glitch_ends: None,
            floating: [None; 2],
            floating_until: None,
            settled: [true; 2],
            heard: [false; 2],
        }
    }

    /// Puts the tracks' levels on the pins, as the wires bring them, and the pins' levels on the
    /// timer.
    pub(super) fn drive(&self, session: &mut Session<Machine>, at: Nanos) {
        let (at, part) = (VirtualNanos(at), session.board_mut().part());
        let drive = self.wires.drive(self.encoder.levels(), self.glitch_ends.is_some());
        for (track, (of_wire, place)) in drive.into_iter().zip(self.pins).enumerate() {
            // A pin without a wire keeps its charge until its pull has taken it away.
            let driven = of_wire.or(self.floating[track]).map(Level::from);
            part.drive_port(at, place.port, |gpio, registers, context| {
                gpio.drive(pin(place.index), driven, registers, context);
            });
            let level = driven.unwrap_or_else(|| {
                let (gpio, registers) = part.port(place.port);
                gpio.level(pin(place.index), registers)
            });
            let level = if self.heard[track] { level } else { Level::Low };
            let channel = Channel::new(track as u8 + 1).expect("a channel");
            match self.timer {
                Timer::Advanced(n) => part
                    .drive_advanced_timer(at, n, |tim, regs, ctx| tim.drive_input(channel, level, regs, ctx)),
                Timer::General(n) => {
                    part.drive_timer(at, n, |tim, regs, ctx| tim.drive_input(channel, level, regs, ctx));
                }
            }
        }
    }

    /// Returns the time of the next change by itself.
    pub(super) fn due(&self) -> Option<Nanos> {
        self.encoder.due().into_iter().chain(self.glitch_ends).min()
    }

    /// Does what is due at `at`.
    pub(super) fn step(&mut self, session: &mut Session<Machine>, at: Nanos) {
        while self.encoder.due().is_some_and(|due| due <= at) {
            self.encoder.edge();
            self.drive(session, at);
        }
        if self.glitch_ends.is_some_and(|ends| ends <= at) {
            self.glitch_ends = None;
            self.drive(session, at);
        }
    }

    /// A pulse on both pins, where the wires bring any.
    pub(super) fn glitch(&mut self, session: &mut Session<Machine>, at: Nanos) {
        if let Some(width) = self.wires.glitches {
            self.glitch_ends = Some(at + width);
            self.drive(session, at);
        }
    }

    /// The firmware has written to the register at `address`, which may be one of the pins' ports.
    pub(super) fn register_written(&mut self, session: &mut Session<Machine>, at: Nanos, address: u64) {
        let is = |offset: u64| self.pins.iter().any(|place| place.register(offset) == address);
        let is_pull = is(register::PULLS);
        let is_multiplexer =
            [register::MODE, register::FUNCTION_LOW, register::FUNCTION_HIGH].into_iter().any(is);
        if is_pull {
            self.hold_floating(session, at);
        }
        if is_multiplexer {
            self.heard = self.pins.map(|place| self.hears(session, at, place));
            self.drive(session, at);
        }
    }

    /// True if the multiplexer connects a pin to the timer.
    fn hears(&self, session: &mut Session<Machine>, at: Nanos, place: PartPin) -> bool {
        use rigless::mcu::Operate;
        const ALTERNATE: u64 = 0b10;
        let mut read = |offset| {
            let address = place.register(offset);
            session.board_mut().mcu.peek(VirtualNanos(at), address, Width::W32).unwrap_or(0)
        };
        let functions = if place.index < 8 { register::FUNCTION_LOW } else { register::FUNCTION_HIGH };
        let mode = read(register::MODE) >> (2 * place.index) & 0b11;
        mode == ALTERNATE && read(functions) >> (4 * (place.index % 8)) & 0xF == self.timer.function()
    }

    /// The pulls of the pins have changed: what floats follows in a while.
    fn hold_floating(&mut self, session: &mut Session<Machine>, at: Nanos) {
        let drive = self.wires.drive(self.encoder.levels(), false);
        if drive.iter().all(Option::is_some) {
            return;
        }
        for (track, level) in drive.into_iter().enumerate() {
            self.floating[track] = level.is_none().then_some(self.settled[track]);
        }
        self.floating_until = Some(at + PULL_SETTLES);
        self.drive(session, at);
    }

    /// Moves floating pins to the level of their pull, if that is due.
    pub(super) fn settle(&mut self, session: &mut Session<Machine>, at: Nanos) {
        if self.floating_until.is_none_or(|due| due > at) {
            return;
        }
        (self.floating_until, self.floating) = (None, [None; 2]);
        self.drive(session, at);
        self.settled = self.pins.map(|place| {
            let (gpio, registers) = session.board_mut().part().port(place.port);
            gpio.level(pin(place.index), registers) == Level::High
        });
    }

    /// A restart of the part: every pin is an input again, the shaft is where it was.
    pub(super) fn restarted(&mut self, session: &mut Session<Machine>, at: Nanos) {
        self.heard = [false; 2];
        self.drive(session, at);
    }
}
