//! The board at work: plant steps, encoder edges, and the logs, on the emulator's thread.

use std::sync::mpsc::{Receiver, Sender};

use rigless::device::Level;
use rigless::emulator::{AccessKind, Driver, Host, Settled, Stop};
use rigless::session::{Reset, Session};
use rigless::soc::Width;
use rigless::soc::stm32f427::peripherals::tim::Channel;
use rigless::time::VirtualNanos;

use super::machine::{Machine, pin};
use super::plant::{Drive, Encoder, Nanos, PlantSide};
use super::processor::DAC;
use super::tilt::Accelerometer;
use super::usb_port::UsbPort;
use super::{SetValue, Timer, Wiring, rtt};

/// A code on its way to the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output {
    /// When.
    pub at: Nanos,
    /// The code.
    pub code: u16,
    /// Nanoseconds since the tick's timer last came round, where the wiring names one.
    pub since_tick: Option<Nanos>,
}

/// A read of the encoder's counter by the firmware.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EncoderRead {
    /// When.
    pub at: Nanos,
    /// The counter.
    pub value: u32,
}

/// What the pins did.
#[derive(Debug, Clone, Default)]
pub struct Log {
    /// Every write of a code to DAC channel 1.
    pub written: Vec<Output>,
    /// Every change of the code at its pin, which a trigger may delay.
    pub put_out: Vec<Output>,
    /// Every read of the encoder's counter.
    pub encoder: Vec<EncoderRead>,
    /// Every change of the amplifier's enable line, with what it became.
    pub enable: Vec<(Nanos, bool)>,
    /// What came out of the RTT terminal.
    pub rtt: Vec<u8>,
}

/// Where to find things in the image.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Symbols {
    pub(super) rtt: Option<u64>,
    /// The stack's lowest address and its top.
    pub(super) stack: Option<(u64, u64)>,
}

/// A visit of the test to the stopped board.
pub(super) type Visit = Box<dyn FnOnce(&mut Stopped<'_>) + Send>;

/// What a test asks of the emulator's thread.
pub(super) enum Order {
    Until(Nanos),
    Visit(Visit),
    End,
}

/// What the emulator's thread answers once the order is done.
pub(super) struct Done;

/// The board between two instructions.
pub struct Stopped<'a> {
    /// Now.
    pub at: Nanos,
    pub(super) instruction: u64,
    pub(super) world: &'a mut World,
    pub(super) session: &'a mut Session<Machine>,
    pub(super) host: &'a mut dyn Host,
}

impl Stopped<'_> {
    /// The USB core and the host on its cable.
    pub fn usb(&mut self) -> &mut UsbPort {
        self.session.board_mut().usb()
    }

    /// The accelerometer, where the board has one.
    pub fn tilt(&mut self) -> Option<&mut Accelerometer> {
        self.session.board_mut().part().spi[0].chip_mut::<Accelerometer>(0)
    }

    /// The plant, to be exchanged.
    pub fn set_plant(&mut self, plant: Box<dyn PlantSide>) {
        self.world.plant = plant;
    }

    /// The logs so far; a test may empty them.
    pub fn log(&mut self) -> &mut Log {
        &mut self.world.log
    }

    /// What drives the plant.
    #[must_use]
    pub fn drive(&self) -> Drive {
        Drive { code: self.world.code, enabled: self.world.enabled }
    }

    /// Every restart of the part, with its cause.
    #[must_use]
    pub fn resets(&self) -> Vec<Reset> {
        self.session.resets().to_vec()
    }

    /// Sets the part's supply, which its voltage detector watches.
    pub fn set_supply(&mut self, millivolts: u32) {
        use rigless::mcu::Operate;
        const PWR_CSR: u64 = 0x4000_7004;
        const PVDO: u64 = 1 << 2;
        let machine = self.session.board_mut();
        machine.part().set_supply(millivolts);
        let status = machine.mcu.peek(VirtualNanos(self.at), PWR_CSR, Width::W32).unwrap_or(0);
        machine.exti().drive_detector(status & PVDO != 0);
    }

    /// Pulls the reset pin low for a moment, as a supply supervisor does in a dip.
    pub fn reset_by_pin(&mut self) {
        self.session.reset_by_pin(VirtualNanos(self.at), self.instruction, self.host);
    }

    /// Puts `millivolts` on channel `channel` of every converter.
    pub fn set_analogue(&mut self, channel: u8, millivolts: u32) {
        use rigless::soc::stm32f427::peripherals::adc;
        let channel = adc::Channel::new(channel).expect("a converter has sixteen pins");
        for converter in &mut self.session.board_mut().part().adc {
            converter.set_input(channel, millivolts);
        }
    }

    /// The word at `address` of the firmware's memory.
    #[must_use]
    pub fn word(&mut self, address: u64) -> Option<u32> {
        self.host.read(address, Width::W32).ok().map(|word| word as u32)
    }

    /// Overwrites the word at `address` of the firmware's RAM, as a stray write or an upset would.
    pub fn set_word(&mut self, address: u64, value: u32) -> bool {
        self.host.write(address, Width::W32, value.into()).is_ok()
    }

    /// Accesses that no register answered, and accesses refused because a clock was off: each with
    /// the program counter of the first.
    #[must_use]
    pub fn stray_accesses(&self) -> Vec<String> {
        let mut all: Vec<String> = self.session.unmapped().iter().map(ToString::to_string).collect();
        all.extend(self.session.refused().iter().map(|(at, fault)| format!("{at:#010x}: {fault}")));
        all
    }
}

/// What surrounds the part.
pub(super) struct World {
    pub(super) wiring: Wiring,
    pub(super) symbols: Symbols,
    pub(super) plant: Box<dyn PlantSide>,
    pub(super) orders: Receiver<Order>,
    pub(super) done: Sender<Done>,
    encoder: Encoder,
    next_step: Nanos,
    next_drain: Nanos,
    target: Nanos,
    enabled: bool,
    code: Option<u16>,
    latch_at: Option<Nanos>,
    busy: bool,
    painted: bool,
    log: Log,
}

/// How often the RTT terminal is emptied.
const DRAIN_EVERY: Nanos = 1_000_000;
/// What an untouched word of the stack holds.
pub(super) const PAINT: u32 = 0xC5C5_C5C5;

impl World {
    pub(super) fn new(
        wiring: Wiring,
        symbols: Symbols,
        plant: Box<dyn PlantSide>,
        orders: Receiver<Order>,
        done: Sender<Done>,
    ) -> Self {
        Self {
            wiring,
            symbols,
            plant,
            orders,
            done,
            encoder: Encoder::new(),
            next_step: 0,
            next_drain: 0,
            target: 0,
            enabled: false,
            code: None,
            latch_at: None,
            busy: false,
            painted: false,
            log: Log::default(),
        }
    }

    fn drive_encoder(&self, session: &mut Session<Machine>, at: Nanos, levels: (bool, bool)) {
        let (at, part) = (VirtualNanos(at), session.board_mut().part());
        for (channel, level) in [(1, levels.0), (2, levels.1)] {
            let channel = Channel::new(channel).expect("a channel");
            let level = Level::from(level);
            match self.wiring.encoder {
                Timer::Advanced(n) => part
                    .drive_advanced_timer(at, n, |tim, regs, ctx| tim.drive_input(channel, level, regs, ctx)),
                Timer::General(n) => {
                    part.drive_timer(at, n, |tim, regs, ctx| tim.drive_input(channel, level, regs, ctx));
                }
            }
        }
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
    fn due(&self) -> Nanos {
        let next = self.next_step.min(self.next_drain).min(self.target);
        self.encoder.due().map_or(next, |edge| next.min(edge))
    }

    /// Does everything due at `at`.
    fn step(&mut self, session: &mut Session<Machine>, host: &mut dyn Host, at: Nanos) {
        while self.encoder.due().is_some_and(|due| due <= at) {
            let levels = self.encoder.edge();
            self.drive_encoder(session, at, levels);
        }
        if self.next_step <= at {
            self.next_step = at + self.wiring.plant_period;
            let drive = Drive { code: self.code, enabled: self.enabled };
            let angle = self.plant.step(at, drive);
            self.encoder.aim(at, angle, self.wiring.plant_period);
        }
        if self.next_drain <= at {
            self.next_drain = at + DRAIN_EVERY;
            if let Some(block) = self.symbols.rtt {
                self.log.rtt.extend(rtt::drain(block, host));
            }
        }
    }

    fn watch_enable(&mut self, session: &mut Session<Machine>, at: Nanos) {
        let (port, index, active) = self.wiring.enable;
        let (gpio, registers) = session.board_mut().part().port(port);
        // The external pull-down holds the line while the pin doesn't drive it.
        let level = gpio.level(pin(index), registers) == Level::from(active);
        if level != self.enabled {
            self.enabled = level;
            self.log.enable.push((at, level));
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

    /// When the trigger comes that a held code waits for: the compare of the tick's timer.
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
const RCC_AHB2RSTR: u64 = 0x4002_3814;
const OTGFSRST: u64 = 1 << 7;

impl Driver<Machine> for World {
    fn on_settled(&mut self, session: &mut Session<Machine>, host: &mut dyn Host, settled: Settled) {
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
                        session.pause_at(self.latch_at.map(VirtualNanos));
                    }
                    GPIO_FIRST..=GPIO_LAST if write => {
                        self.watch_enable(session, at);
                        self.watch_output(session, at);
                    }
                    address if !write && address == self.wiring.encoder.count_address() => {
                        self.log.encoder.push(EncoderRead { at, value: value as u32 });
                    }
                    RCC_AHB2RSTR if write && value & OTGFSRST != 0 => {
                        session.board_mut().usb().core = super::otg::Core::default();
                    }
                    _ => {}
                }
            }
            Settled::Stop(stop) => {
                if !self.painted {
                    self.paint_stack(host);
                }
                if self.latch_at.is_some_and(|due| due <= stop.at.0) {
                    self.latch_at = None;
                    session.board_mut().dac_mut().trigger();
                    self.watch_output(session, stop.at.0);
                }
                let resets = session.resets();
                if resets.last().is_some_and(|reset| reset.at == stop.at) {
                    self.after_reset(session, stop.at.0);
                }
            }
            _ => {}
        }
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Machine>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let at = stop.at.0;
        self.step(session, host, at);
        while at >= self.target {
            if std::mem::take(&mut self.busy) && self.done.send(Done).is_err() {
                return None;
            }
            match self.orders.recv() {
                Ok(Order::Until(target)) => {
                    self.target = target;
                    self.busy = true;
                }
                Ok(Order::Visit(visit)) => {
                    let instruction = stop.instruction_count;
                    visit(&mut Stopped { at, instruction, world: self, session, host });
                    if self.done.send(Done).is_err() {
                        return None;
                    }
                }
                Ok(Order::End) | Err(_) => return None,
            }
        }
        Some(VirtualNanos(self.due()))
    }
}

impl World {
    /// A restart leaves every pin floating; the encoder's tracks stay where the shaft is.
    fn after_reset(&mut self, session: &mut Session<Machine>, at: Nanos) {
        self.watch_enable(session, at);
        self.watch_output(session, at);
        self.latch_at = None;
        let levels = self.encoder.levels();
        self.drive_encoder(session, at, levels);
    }
}
