//! The connections of the part's pins: one value for each board that there is an image for, read
//! from its manual and from `docs/guide/hardware.md`, not from the firmware.

/// A pin of the part: its port, 0 for A, and its number in the port.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PartPin {
    /// The port.
    pub port: usize,
    /// The number.
    pub index: u8,
}

/// Registers of a port, by their offsets (RM0090 8.4.11).
pub(super) mod register {
    pub(in super::super) const MODE: u64 = 0x00;
    pub(in super::super) const PULLS: u64 = 0x0C;
    pub(in super::super) const INPUT: u64 = 0x10;
    pub(in super::super) const OUTPUT: u64 = 0x14;
    pub(in super::super) const FUNCTION_LOW: u64 = 0x20;
    pub(in super::super) const FUNCTION_HIGH: u64 = 0x24;
}

impl PartPin {
    /// The pin by its name in the manuals.
    const fn new(port: char, index: u8) -> Self {
        Self { port: port as usize - 'A' as usize, index }
    }

    /// The address of a register of its port.
    pub(super) fn register(self, offset: u64) -> u64 {
        0x4002_0000 + 0x400 * self.port as u64 + offset
    }
}

/// The source at the part's clock input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Clock {
    /// A crystal, which needs the oscillator (RM0090 7.2.1: `HSEBYP` clear).
    Crystal,
    /// A clock from elsewhere, which needs the oscillator bypassed (`HSEBYP` set).
    Elsewhere,
}

/// A board's pins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Pins {
    /// The name of the board's image in cargo's folder.
    pub image: &'static str,
    /// The name that the image of the board's own test prints.
    pub own_test: &'static str,
    /// 8 MHz, and from where.
    pub clock: Clock,
    /// The amplifier's enable line, high is on.
    pub enable: PartPin,
    /// The pin whose edges retrigger the monostable in the amplifier's enable path.
    pub alive: PartPin,
    /// Tracks A and B of the encoder.
    pub tracks: [PartPin; 2],
    /// The pin that senses the encoder's supply.
    pub encoder_supply: PartPin,
    /// The emergency stop's loop, the amplifier's ready output, and the strap of its current
    /// monitor: closed to the supply.
    pub drive_lines: [PartPin; 3],
    /// The lamps: running, torque is on, a fault.
    pub lamps: [PartPin; 3],
    /// The switch of the 5 V of the board's USB connector, for a host, and the level that switches
    /// them on.
    pub usb_power: (PartPin, bool),
    /// The strap that says that an analogue inclinometer is fitted, where it is a matter of choice.
    pub strap: Option<PartPin>,
    /// The inclinometer's channel of the converters.
    pub inclinometer: u8,
    /// The current monitor's channel of the second converter.
    pub monitor: u8,
}

/// STM32F4DISCOVERY.
pub const DISCOVERY: Pins = Pins {
    image: "firmware",
    own_test: "own test: discovery",
    clock: Clock::Crystal,
    enable: PartPin::new('D', 7),
    alive: PartPin::new('D', 6),
    tracks: [PartPin::new('A', 15), PartPin::new('A', 1)],
    encoder_supply: PartPin::new('E', 7),
    drive_lines: [PartPin::new('E', 4), PartPin::new('E', 5), PartPin::new('E', 6)],
    lamps: [PartPin::new('D', 12), PartPin::new('D', 13), PartPin::new('D', 14)],
    usb_power: (PartPin::new('C', 0), false),
    strap: Some(PartPin::new('B', 1)),
    inclinometer: 11,
    monitor: 12,
};

/// NUCLEO-F429ZI.
pub const NUCLEO_F429ZI: Pins = Pins {
    image: "nucleo-f429zi",
    own_test: "own test: nucleo-f429zi",
    clock: Clock::Elsewhere,
    enable: PartPin::new('F', 13),
    alive: PartPin::new('G', 9),
    tracks: [PartPin::new('A', 15), PartPin::new('B', 3)],
    encoder_supply: PartPin::new('E', 7),
    drive_lines: [PartPin::new('F', 14), PartPin::new('F', 15), PartPin::new('F', 12)],
    lamps: [PartPin::new('B', 0), PartPin::new('B', 7), PartPin::new('B', 14)],
    usb_power: (PartPin::new('G', 6), true),
    strap: None,
    inclinometer: 10,
    monitor: 12,
};
