//! The board between two instructions: what a test looks at, and what it does to the board.

use control_core::config::Sensors;
use rigless::device::Level;
use rigless::emulator::Host;
use rigless::session::{Reset, Session};
use rigless::soc::Width;
use rigless::soc::stm32f427::peripherals::adc;
use rigless::time::VirtualNanos;

use super::amplifier::{Amplifier, Contact};
use super::machine::{Machine, pin};
use super::plant::{Drive, Nanos, PlantSide};
use super::tilt::Accelerometer;
use super::usb_port::UsbPort;
use super::wires::Wires;
use super::world::{Log, World};

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
        self.drive_line(0, if open { Contact::Open } else { Contact::Closed });
    }

    /// Shorts the wire of the emergency stop's loop to ground.
    pub fn short_emergency_stop(&mut self) {
        self.drive_line(0, Contact::Ground);
    }

    /// Has the amplifier say that it is ready or not.
    pub fn set_amplifier_ready(&mut self, ready: bool) {
        self.drive_line(1, if ready { Contact::Closed } else { Contact::Open });
    }

    /// Plugs the optional sensors in or off.
    pub fn set_fitted(&mut self, Sensors { encoder_supply, current }: Sensors) {
        (self.world.wiring.supply_sense, self.world.wiring.current_monitor) = (encoder_supply, current);
        self.drive_line(2, Contact::closed_if(current));
    }

    fn drive_line(&mut self, line: usize, contact: Contact) {
        self.world.contacts[line] = contact;
        self.world.drive_lines(self.session, self.at);
    }

    /// Changes what is wrong with the amplifier.
    pub fn set_amplifier(&mut self, amplifier: Amplifier) {
        self.world.amplifier = amplifier;
        let enable = self.world.wiring.pins.enable;
        self.session.board_mut().short(enable, amplifier == Amplifier::LineHigh);
        self.world.watch_enable(self.session, self.at);
    }

    /// Changes what becomes of the encoder's wires, from now on.
    pub fn set_wires(&mut self, wires: Wires) {
        self.world.tracks.wires = wires;
        self.world.drive_lines(self.session, self.at);
        self.world.tracks.drive(self.session, self.at);
    }

    /// The plant, to be exchanged.
    pub fn set_plant(&mut self, plant: Box<dyn PlantSide>) {
        self.world.plant = plant;
    }

    /// The logs so far; a test may empty them.
    pub fn log(&mut self) -> &mut Log {
        &mut self.world.log
    }

    /// Returns the input of the plant.
    #[must_use]
    pub fn drive(&self) -> Drive {
        Drive { code: self.world.code, enabled: self.world.enabled }
    }

    /// True if the board's enable line is high, before the monostable.
    #[must_use]
    pub fn enable_line(&self) -> bool {
        self.world.line
    }

    /// Returns true for each lamp that shines: running, torque is on, a fault.
    pub fn lamps(&mut self) -> [bool; 3] {
        self.world.wiring.pins.lamps.map(|place| {
            let (gpio, registers) = self.session.board_mut().part().port(place.port);
            gpio.level(pin(place.index), registers) == Level::High
        })
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
        machine.flash.array().supply = millivolts;
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

    /// Returns the firmware's actions that the manual does not describe.
    #[must_use]
    pub fn violations(&mut self) -> Vec<String> {
        let machine = self.session.board_mut();
        let mut all = machine.usb().core.violations.clone();
        all.extend(machine.flash.array().violations.iter().cloned());
        all.extend(machine.dac().violations().iter().cloned());
        all.extend(self.world.violations.iter().cloned());
        all
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
