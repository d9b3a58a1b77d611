//! The board at work: plant steps, encoder edges, and the logs, on the emulator's thread.

use std::sync::mpsc::{Receiver, Sender};

use rigless::device::Level;
use rigless::emulator::{AccessKind, Driver, Host, Settled, Stop};
use rigless::session::{Reset, Session};
use rigless::soc::Width;
use rigless::soc::stm32f427::peripherals::adc;
use rigless::soc::stm32f427::peripherals::tim::Channel;
use rigless::time::VirtualNanos;

use super::amplifier::Amplifier;
use super::machine::{DRIVE_LINES, Machine, RAIL_MILLIVOLTS, pin};
use super::plant::{Drive, Encoder, Nanos, PlantSide};
use super::processor::DAC;
use super::tilt::Accelerometer;
use super::usb_port::UsbPort;
use super::wires::Wires;
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

    /// Opens or closes the emergency stop's loop.
    pub fn set_emergency_stop(&mut self, open: bool) {
        self.drive_line(0, open);
    }

    /// Has the amplifier say that it is ready or not.
    pub fn set_amplifier_ready(&mut self, ready: bool) {
        self.drive_line(1, !ready);
    }

    fn drive_line(&mut self, line: usize, open: bool) {
        self.world.closed[line] = !open;
        self.world.drive_lines(self.session, self.at);
    }

    /// Changes what is wrong with the amplifier.
    pub fn set_amplifier(&mut self, amplifier: Amplifier) {
        self.world.amplifier = amplifier;
        self.session.board_mut().short_enable(amplifier == Amplifier::LineHigh);
        self.world.watch_enable(self.session, self.at);
    }

    /// Changes what becomes of the encoder's wires, from now on.
    pub fn set_wires(&mut self, wires: Wires) {
        self.world.wires = wires;
        let levels = self.world.encoder.levels();
        self.world.drive_encoder(self.session, self.at, levels);
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

    /// The register at `address`, without the effects that a read by the firmware may have.
    #[must_use]
    pub fn register(&mut self, address: u64) -> Option<u32> {
        use rigless::mcu::Operate;
        let at = VirtualNanos(self.at);
        self.session.board_mut().mcu.peek(at, address, Width::W32).ok().map(|word| word as u32)
    }

    /// Overwrites the word at `address` of the firmware's RAM, as a stray write or an upset would.
    pub fn set_word(&mut self, address: u64, value: u32) -> bool {
        self.host.write(address, Width::W32, value.into()).is_ok()
    }

    /// What the firmware did that the manual does not describe.
    #[must_use]
    pub fn violations(&self) -> Vec<String> {
        let machine = self.session.board();
        let flash = machine.flash.array().violations.clone();
        let dac = machine.dac().violations().iter().cloned();
        dac.chain(flash).chain(self.world.violations.iter().cloned()).collect()
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
    /// When the charge on the strap's pin has gone, which its pull-down takes away.
    strap_settles: Option<Nanos>,
    amplifier: Amplifier,
    /// Which of the drive's lines are connected to ground.
    closed: [bool; 3],
    /// What the firmware did that a data sheet forbids.
    violations: Vec<String>,
    wires: Wires,
    /// While a glitch is on the encoder's pins: until when.
    glitch_ends: Option<Nanos>,
    /// The charge that a pin without a wire still keeps, and until when.
    floating: [Option<bool>; 2],
    floating_until: Option<Nanos>,
    /// Where pins without a wire have been pulled to.
    settled: [bool; 2],
    busy: bool,
    painted: bool,
    log: Log,
}

/// The port and the pins of the encoder's tracks A and B: PA15 and PA1.
const TRACK_PINS: (usize, [u8; 2]) = (0, [15, 1]);
/// `GPIOA_PUPDR`.
const TRACK_PULLS: u64 = 0x4002_000C;

/// How long a pull of 40 kΩ (data sheet DS8626, I/O static characteristics) takes to empty a pin with a wire on it: 100 pF
/// through the level at which the input changes, with a margin.
const STRAP_SETTLES: Nanos = 10_000;
/// The strap's pull: `GPIOB_PUPDR`, pin 1, and its pull-down.
const STRAP_PULL: (u64, u32, u64) = (0x4002_040C, 2, 0b10);

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
            strap_settles: None,
            amplifier: Amplifier::default(),
            closed: [true, true, wiring.current_monitor],
            violations: Vec::new(),
            wires: Wires::default(),
            glitch_ends: None,
            floating: [None; 2],
            floating_until: None,
            settled: [true; 2],
            busy: false,
            painted: false,
            log: Log::default(),
        }
    }

    /// Connects the drive's lines to ground or lets them go.
    fn drive_lines(&self, session: &mut Session<Machine>, at: Nanos) {
        for (index, closed) in DRIVE_LINES.1.into_iter().zip(self.closed) {
            let level = closed.then_some(Level::Low);
            let part = session.board_mut().part();
            part.drive_port(VirtualNanos(at), DRIVE_LINES.0, |gpio, registers, context| {
                gpio.drive(pin(index), level, registers, context);
            });
        }
    }

    /// Puts the tracks' levels on the pins, as the wires bring them, and the pins' levels on the timer.
    fn drive_encoder(&mut self, session: &mut Session<Machine>, at: Nanos, levels: (bool, bool)) {
        let (at, part) = (VirtualNanos(at), session.board_mut().part());
        let drive = self.wires.drive(levels, self.glitch_ends.is_some());
        for (channel, level, held, index) in [
            (1, drive[0], self.floating[0], TRACK_PINS.1[0]),
            (2, drive[1], self.floating[1], TRACK_PINS.1[1]),
        ] {
            let channel = Channel::new(channel).expect("a channel");
            // A pin without a wire keeps its charge until its pull has taken it away.
            let driven = level.or(held).map(Level::from);
            part.drive_port(at, TRACK_PINS.0, |gpio, registers, context| {
                gpio.drive(pin(index), driven, registers, context);
            });
            let level = driven.unwrap_or_else(|| {
                let (gpio, registers) = part.port(TRACK_PINS.0);
                gpio.level(pin(index), registers)
            });
            match self.wiring.encoder {
                Timer::Advanced(n) => part
                    .drive_advanced_timer(at, n, |tim, regs, ctx| tim.drive_input(channel, level, regs, ctx)),
                Timer::General(n) => {
                    part.drive_timer(at, n, |tim, regs, ctx| tim.drive_input(channel, level, regs, ctx));
                }
            }
        }
    }

    /// The pulls of the encoder's pins have changed: what floats follows in a while.
    fn hold_floating(&mut self, session: &mut Session<Machine>, at: Nanos) {
        let drive = self.wires.drive(self.encoder.levels(), false);
        if drive.iter().all(Option::is_some) {
            return;
        }
        for (track, level) in drive.into_iter().enumerate() {
            self.floating[track] = level.is_none().then_some(self.settled[track]);
        }
        self.floating_until = Some(at + STRAP_SETTLES);
        self.drive_encoder(session, at, self.encoder.levels());
        self.pause(session);
    }

    /// What floats has gone where it is pulled.
    fn settle_floating(&mut self, session: &mut Session<Machine>, at: Nanos) {
        (self.floating_until, self.floating) = (None, [None; 2]);
        self.drive_encoder(session, at, self.encoder.levels());
        let (gpio, registers) = session.board_mut().part().port(TRACK_PINS.0);
        self.settled = TRACK_PINS.1.map(|index| gpio.level(pin(index), registers) == Level::High);
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
        let next = self.glitch_ends.map_or(next, |ends| next.min(ends));
        self.encoder.due().map_or(next, |edge| next.min(edge))
    }

    /// Does everything due at `at`.
    fn step(&mut self, session: &mut Session<Machine>, host: &mut dyn Host, at: Nanos) {
        while self.encoder.due().is_some_and(|due| due <= at) {
            let levels = self.encoder.edge();
            self.drive_encoder(session, at, levels);
        }
        if self.glitch_ends.is_some_and(|ends| ends <= at) {
            self.glitch_ends = None;
            self.drive_encoder(session, at, self.encoder.levels());
        }
        if self.next_step <= at {
            if let Some(width) = self.wires.glitches {
                self.glitch_ends = Some(at + width);
                self.drive_encoder(session, at, self.encoder.levels());
            }
            self.next_step = at + self.wiring.plant_period;
            let asked = Drive { code: self.code, enabled: self.enabled };
            let drive = self.amplifier.drive(asked);
            if self.wiring.current_monitor {
                let millivolts = self.amplifier.monitor(asked, RAIL_MILLIVOLTS);
                let channel = adc::Channel::new(MONITOR_CHANNEL).expect("a converter has sixteen pins");
                session.board_mut().part().adc[1].set_input(channel, millivolts);
            }
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
        let level = self.amplifier.line(level);
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
/// The first two analogue-to-digital converters' second control registers, and their prescaler.
const ADC_CR2: u64 = 0x4001_2008;
const ADC2_CR2: u64 = 0x4001_2108;
const ADC_CCR: u64 = 0x4001_2304;
/// PC2 on the second one: the amplifier's current monitor.
const MONITOR_CHANNEL: u8 = 12;
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
                        self.pause(session);
                    }
                    address
                        if write
                            && address == STRAP_PULL.0
                            && !self.wiring.inclinometer
                            && (value >> STRAP_PULL.1) & 0b11 == STRAP_PULL.2 =>
                    {
                        self.strap_settles = Some(at + STRAP_SETTLES);
                        self.pause(session);
                    }
                    TRACK_PULLS if write => self.hold_floating(session, at),
                    GPIO_FIRST..=GPIO_LAST if write => {
                        self.watch_enable(session, at);
                        self.watch_output(session, at);
                    }
                    address if !write && address == self.wiring.encoder.count_address() => {
                        self.log.encoder.push(EncoderRead { at, value: value as u32 });
                    }
                    ADC_CR2 | ADC2_CR2 if write && value & 1 != 0 => self.watch_converter(session, at),
                    RCC_AHB2RSTR if write && value & OTGFSRST != 0 => {
                        session.board_mut().usb().core = super::otg::Core::default();
                    }
                    _ => {}
                }
            }
            Settled::Stop(stop) => {
                if !self.painted {
                    self.paint_stack(host);
                    self.drive_encoder(session, stop.at.0, self.encoder.levels());
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
                if self.floating_until.is_some_and(|due| due <= stop.at.0) {
                    self.settle_floating(session, stop.at.0);
                }
                self.pause(session);
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
    /// DS8626, ADC characteristics: at most 36 MHz, the second bus's clock by 2, 4, 6 or 8 (RM0090 13.13.16).
    fn watch_converter(&mut self, session: &mut Session<Machine>, at: Nanos) {
        use rigless::mcu::Operate;
        let common = session.board_mut().mcu.peek(VirtualNanos(at), ADC_CCR, Width::W32).unwrap_or(0);
        let megahertz = 84 / (2 * (common >> 16 & 0b11) + 2);
        if megahertz > 36 {
            self.violations.push(format!("an analogue-to-digital converter on {megahertz} MHz"));
        }
    }

    /// Stops the core at the next instant that a register has set.
    fn pause(&self, session: &mut Session<Machine>) {
        let due = self.latch_at.into_iter().chain(self.strap_settles).chain(self.floating_until).min();
        session.pause_at(due.map(VirtualNanos));
    }

    /// A restart leaves every pin floating; the encoder's tracks stay where the shaft is.
    fn after_reset(&mut self, session: &mut Session<Machine>, at: Nanos) {
        self.watch_enable(session, at);
        self.watch_output(session, at);
        self.latch_at = None;
        let levels = self.encoder.levels();
        self.drive_encoder(session, at, levels);
        self.drive_lines(session, at);
    }
}
