//! The board's surroundings: plant steps, encoder edges, and the logs.

use rigless::device::Level;
use rigless::emulator::{AccessKind, Host, Settled};
use rigless::session::Session;
use rigless::soc::Width;
use rigless::soc::stm32f427::peripherals::adc;
use rigless::time::VirtualNanos;
use serde::{Deserialize, Serialize};

use super::amplifier::{Amplifier, Contact};
use super::bus::DAC;
use super::machine::{Machine, RAIL_MILLIVOLTS, pin};
use super::monostable::Monostable;
use super::pins::register;
use super::plant::{Drive, Nanos, PlantSide};
use super::tracks::{PULL_SETTLES, Tracks};
use super::{SetValue, Timer, Wiring, rtt};

/// A code on its way to the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Output {
    /// Its time.
    pub at: Nanos,
    /// The code.
    pub code: u16,
    /// Nanoseconds since the tick's timer last came round, where the wiring names one.
    pub since_tick: Option<Nanos>,
}

/// A read of the encoder's counter by the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct EncoderRead {
    /// Its time.
    pub at: Nanos,
    /// The counter.
    pub value: u32,
}

/// The log of the pins.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Log {
    /// Every write of a code to DAC channel 1.
    pub written: Vec<Output>,
    /// Every change of the code at its pin, which a trigger may delay.
    pub put_out: Vec<Output>,
    /// Every read of the encoder's counter.
    pub encoder: Vec<EncoderRead>,
    /// Every change of the amplifier's enable input, behind the monostable, with what it became.
    pub enable: Vec<(Nanos, bool)>,
    /// The output of the RTT terminal.
    pub rtt: Vec<u8>,
}

/// The addresses of symbols in the image.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Symbols {
    pub(super) rtt: Option<u64>,
    /// The stack's lowest address and its top.
    pub(super) stack: Option<(u64, u64)>,
}

/// The surroundings of the part.
pub(super) struct World {
    pub(super) wiring: Wiring,
    pub(super) symbols: Symbols,
    pub(super) plant: Box<dyn PlantSide>,
    pub(super) tracks: Tracks,
    next_step: Nanos,
    next_drain: Nanos,
    /// The time to which the board runs.
    pub(super) target: Nanos,
    /// The board's enable line, and the amplifier's enable input behind the monostable.
    pub(super) line: bool,
    pub(super) enabled: bool,
    monostable: Monostable,
    pub(super) code: Option<u16>,
    latch_at: Option<Nanos>,
    /// The time at which the pull-down has drained the strap's pin.
    strap_settles: Option<Nanos>,
    pub(super) amplifier: Amplifier,
    /// The connection of each of the drive's lines.
    pub(super) contacts: [Contact; 3],
    /// The firmware's actions that a data sheet forbids.
    pub(super) violations: Vec<String>,
    painted: bool,
    pub(super) log: Log,
}

// A plant does not keep its state: one that has any would go on from nowhere.
rigless::store!(World {
    values: [
        next_step,
        next_drain,
        target,
        line,
        enabled,
        monostable,
        code,
        latch_at,
        strap_settles,
        amplifier,
        contacts,
        violations,
        painted,
        log,
    ],
    parts: [tracks],
    built: [wiring, symbols, plant],
});

/// The period in which the RTT terminal is emptied.
const DRAIN_EVERY: Nanos = 1_000_000;
/// The content of an unused word of the stack.
pub(super) const PAINT: u32 = 0xC5C5_C5C5;

impl World {
    pub(super) fn new(wiring: Wiring, symbols: Symbols, plant: Box<dyn PlantSide>) -> Self {
        Self {
            wiring,
            symbols,
            plant,
            tracks: Tracks::new(&wiring),
            next_step: 0,
            next_drain: 0,
            target: 0,
            line: false,
            enabled: false,
            monostable: Monostable::default(),
            code: None,
            latch_at: None,
            strap_settles: None,
            amplifier: Amplifier::default(),
            contacts: [true, true, wiring.current_monitor || wiring.loopback].map(Contact::closed_if),
            violations: Vec::new(),
            painted: false,
            log: Log::default(),
        }
    }

    /// Connects the drive's lines, and the wire that senses the encoder's supply.
    pub(super) fn drive_lines(&self, session: &mut Session<Machine>, at: Nanos) {
        for (place, contact) in self.wiring.pins.drive_lines.into_iter().zip(self.contacts) {
            session.board_mut().drive(at, place, contact.level());
        }
        let has_supply = !self.tracks.wires.supply_off;
        let sensed = self.wiring.supply_sense.then(|| Level::from(has_supply));
        session.board_mut().drive(at, self.wiring.pins.encoder_supply, sensed);
    }

    fn paint_stack(&mut self, host: &mut dyn Host) {
        self.painted = true;
        if let Some((low, high)) = self.symbols.stack {
            for word in (low..high).step_by(4) {
                let _ = host.write(word, Width::W32, PAINT.into());
            }
        }
    }

    /// The next instant the world itself needs.
    pub(super) fn due(&self) -> Nanos {
        let next = self.next_step.min(self.next_drain).min(self.target);
        self.tracks.due().map_or(next, |due| next.min(due))
    }

    /// Does everything due at `at`.
    pub(super) fn step(&mut self, session: &mut Session<Machine>, host: &mut dyn Host, at: Nanos) {
        self.tracks.step(session, at);
        if self.next_step <= at {
            self.tracks.glitch(session, at);
            self.next_step = at + self.wiring.plant_period;
            self.enable(at);
            let asked = Drive { code: self.code, enabled: self.enabled };
            let drive = self.amplifier.drive(asked);
            if self.wiring.current_monitor || self.wiring.loopback {
                let millivolts = if self.wiring.loopback {
                    u32::from(self.code.unwrap_or(0)) * RAIL_MILLIVOLTS / 4_096
                } else {
                    self.amplifier.monitor(asked, RAIL_MILLIVOLTS)
                };
                let channel =
                    adc::Channel::new(self.wiring.pins.monitor).expect("a converter has sixteen pins");
                session.board_mut().part().adc[1].set_input(channel, millivolts);
            }
            let angle = self.plant.step(at, drive);
            self.tracks.encoder.aim(at, angle, self.wiring.plant_period);
        }
        if self.next_drain <= at {
            self.next_drain = at + DRAIN_EVERY;
            if let Some(block) = self.symbols.rtt {
                self.log.rtt.extend(rtt::drain(block, host));
            }
        }
    }

    pub(super) fn watch_enable(&mut self, session: &mut Session<Machine>, at: Nanos) {
        let [line, alive] = [self.wiring.pins.enable, self.wiring.pins.alive].map(|place| {
            let (gpio, registers) = session.board_mut().part().port(place.port);
            // External pull-downs hold the lines while the pins don't drive them.
            gpio.level(pin(place.index), registers) == Level::High
        });
        self.monostable.see(alive, at);
        self.line = self.amplifier.line(line);
        self.enable(at);
    }

    /// The amplifier's enable input at `at`.
    fn enable(&mut self, at: Nanos) {
        let enabled = self.line && (!self.wiring.monostable || self.monostable.holds(at));
        if enabled != self.enabled {
            self.enabled = enabled;
            self.log.enable.push((at, enabled));
        }
    }

    fn since_tick(&self, session: &mut Session<Machine>, at: Nanos) -> Option<Nanos> {
        let (timer, hertz) = self.wiring.tick?;
        let count = timer_register(session, at, timer, COUNT)?;
        Some(count * 1_000_000_000 / hertz)
    }

    /// The code that the amplifier sees.
    fn set_value(&self, session: &mut Session<Machine>) -> Option<u16> {
        match self.wiring.set_value {
            SetValue::OnChip => session.board().dac().code(),
            SetValue::Lines => {
                let (gpio, registers) = session.board_mut().part().port(LINES.0);
                let bit = |index| u16::from(gpio.level(pin(index), registers) == Level::High);
                Some(LINES.1.clone().rev().fold(0, |code, index| code << 1 | bit(index)))
            }
        }
    }

    /// Notes a new code at the amplifier.
    fn watch_output(&mut self, session: &mut Session<Machine>, at: Nanos) {
        let code = self.set_value(session);
        if code != self.code {
            self.code = code;
            if let Some(code) = code {
                let since_tick = self.since_tick(session, at);
                self.log.put_out.push(Output { at, code, since_tick });
            }
        }
    }

    /// Returns the time of the trigger that a held code waits for: the compare of the tick's timer.
    fn trigger_due(&self, session: &mut Session<Machine>, at: Nanos) -> Option<Nanos> {
        const TIM4_TRGO: u32 = 0b101;
        let (timer, hertz) = self.wiring.tick?;
        if session.board().dac().waits_for()? != TIM4_TRGO || timer != Timer::General(2) {
            return None;
        }
        let mut register = |offset| timer_register(session, at, timer, offset);
        let (count, reload) = (register(COUNT)?, register(TIM_ARR)?);
        let (compare, control) = (register(TIM_CCR1)?, register(TIM_CR2)?);
        if control >> 4 & 0b111 != MMS_COMPARE_1 {
            return None;
        }
        let counts = if count < compare { compare - count } else { compare + reload + 1 - count };
        Some(at + counts * 1_000_000_000 / hertz)
    }
}

fn timer_register(session: &mut Session<Machine>, at: Nanos, timer: Timer, offset: u64) -> Option<u64> {
    use rigless::mcu::Operate;
    session.board_mut().mcu.peek(VirtualNanos(at), timer.base() + offset, Width::W32).ok()
}

const COUNT: u64 = 0x24;
/// The port and the pins of the 8-bit converter, the lowest bit first.
const LINES: (usize, std::ops::Range<u8>) = (4, 8..16);
const GPIO_FIRST: u64 = 0x4002_0000;
const GPIO_LAST: u64 = 0x4002_2BFF;
const DHR12R1: u64 = 0x08;
/// Offsets in a timer, and what makes its compare channel 1 its trigger output.
const TIM_CR2: u64 = 0x04;
const TIM_ARR: u64 = 0x2C;
const TIM_CCR1: u64 = 0x34;
const MMS_COMPARE_1: u64 = 0b100;
/// The first two analogue-to-digital converters' second control registers, and their prescaler.
const ADC_CR2: u64 = 0x4001_2008;
const ADC2_CR2: u64 = 0x4001_2108;
const ADC_CCR: u64 = 0x4001_2304;
const RCC_CR: u64 = 0x4002_3800;
pub(super) const RCC_CFGR: u64 = 0x4002_3808;
pub(super) const FLASH_ACR: u64 = 0x4002_3C00;
const HSEON: u64 = 1 << 16;
const RCC_AHB2RSTR: u64 = 0x4002_3814;
const OTGFSRST: u64 = 1 << 7;

impl World {
    /// Does what an access of the firmware or a stop brings about.
    pub(super) fn settle(&mut self, session: &mut Session<Machine>, host: &mut dyn Host, settled: Settled) {
        match settled {
            Settled::Access { access, value } => {
                let at = access.virtual_time.0;
                let write = access.kind == AccessKind::Write;
                match access.address {
                    address if write && (DAC.2..DAC.2 + DAC.1).contains(&address) => {
                        if address == DAC.2 + DHR12R1 {
                            let since_tick = self.since_tick(session, at);
                            self.log.written.push(Output { at, code: value as u16, since_tick });
                        }
                        self.watch_output(session, at);
                        self.latch_at = self.trigger_due(session, at);
                        self.pause(session);
                    }
                    address @ GPIO_FIRST..=GPIO_LAST if write => {
                        self.watch_strap(at, address, value);
                        self.tracks.register_written(session, at, address);
                        self.watch_enable(session, at);
                        self.watch_usb_power(session, at, address);
                        self.watch_output(session, at);
                        self.pause(session);
                    }
                    address if !write && address == self.wiring.encoder.count_address() => {
                        self.log.encoder.push(EncoderRead { at, value: value as u32 });
                    }
                    ADC_CR2 | ADC2_CR2 if write && value & 1 != 0 => self.watch_converter(session, at),
                    RCC_CR if write && value & HSEON != 0 => self.start_clock(session, value),
                    RCC_CFGR | FLASH_ACR if write => self.watch_wait_states(session, at),
                    RCC_AHB2RSTR if write && value & OTGFSRST != 0 => {
                        session.board_mut().usb().core.restart();
                    }
                    _ => {}
                }
            }
            Settled::Stop(stop) => {
                if !self.painted {
                    self.paint_stack(host);
                    self.tracks.drive(session, stop.at.0);
                    self.drive_lines(session, stop.at.0);
                }
                if self.latch_at.is_some_and(|due| due <= stop.at.0) {
                    self.latch_at = None;
                    session.board_mut().dac_mut().trigger();
                    self.watch_output(session, stop.at.0);
                }
                if self.strap_settles.is_some_and(|due| due <= stop.at.0) {
                    self.strap_settles = None;
                    session.board_mut().release_strap(stop.at.0);
                }
                self.tracks.settle(session, stop.at.0);
                self.pause(session);
                let resets = session.resets();
                if resets.last().is_some_and(|reset| reset.at == stop.at) {
                    self.after_reset(session, stop.at.0);
                }
            }
            _ => {}
        }
    }

    /// DS8626, ADC characteristics: at most 36 MHz, the second bus's clock by 2, 4, 6 or 8 (RM0090
    /// 13.13.16).
    fn watch_converter(&mut self, session: &mut Session<Machine>, at: Nanos) {
        use rigless::mcu::Operate;
        let common = session.board_mut().mcu.peek(VirtualNanos(at), ADC_CCR, Width::W32).unwrap_or(0);
        let megahertz = 84 / (2 * (common >> 16 & 0b11) + 2);
        if megahertz > 36 {
            self.violations.push(format!("an analogue-to-digital converter on {megahertz} MHz"));
        }
    }

    /// Starts to drain the strap's pin by its pull-down if no strap is fitted.
    fn watch_strap(&mut self, at: Nanos, address: u64, value: u64) {
        const PULL_DOWN: u64 = 0b10;
        let Some(strap) = self.wiring.pins.strap.filter(|_| !self.wiring.inclinometer) else { return };
        if address == strap.register(register::PULLS) && value >> (2 * strap.index) & 0b11 == PULL_DOWN {
            self.strap_settles = Some(at + PULL_SETTLES);
        }
    }

    /// Stops the core at the next instant that a register has set.
    fn pause(&self, session: &mut Session<Machine>) {
        let due = self.latch_at.into_iter().chain(self.strap_settles).chain(self.tracks.floating_until).min();
        session.pause_at(due.map(VirtualNanos));
    }

    /// A restart leaves every pin floating; the encoder's tracks stay where the shaft is.
    fn after_reset(&mut self, session: &mut Session<Machine>, at: Nanos) {
        self.watch_enable(session, at);
        self.watch_output(session, at);
        self.latch_at = None;
        self.tracks.restarted(session, at);
        self.drive_lines(session, at);
    }
}
