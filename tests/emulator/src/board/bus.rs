//! The bus between the emulator's core and the rest of the board: addresses of peripherals that the
//! emulator has no model for lead to windows where the board has one, and the flash's sectors that
//! the firmware writes are the board's own.

use rigless::emulator::{Access, AccessKind, Checked, CoreBus, InterruptLine, Queued};
use rigless::time::VirtualNanos;

use super::flash::{FLASH_OPTCR, FLASH_SR, Flash, WRITABLE};
use super::pins::{PartPin, register};

/// One instruction a cycle at 168 MHz. The emulator has no cycles, so this makes an instruction
/// count a time.
pub const INSTRUCTIONS_PER_SECOND: u64 = 168_000_000;
/// The address of the USB core in the manual, its size, and the address of its window.
pub(super) const OTG: (u64, u64, u64) = (0x5000_0000, 0x4_0000, 0x5010_0000);
/// The same for the DAC.
pub(super) const DAC: (u64, u64, u64) = (0x4000_7400, 0x400, 0x4010_0000);
/// The same for the external interrupt controller.
pub(super) const EXTI: (u64, u64, u64) = (0x4001_3C00, 0x400, 0x4011_0000);

/// Returns the instructions for which there was time in so many nanoseconds.
fn stalled(nanos: u64) -> u64 {
    nanos * (INSTRUCTIONS_PER_SECOND / 1_000_000) / 1_000
}

fn window(address: u64) -> u64 {
    for (base, size, window) in [OTG, DAC, EXTI] {
        if (base..base + size).contains(&address) {
            return address - base + window;
        }
    }
    address
}

/// The converter's holding register for twelve bits, right aligned (RM0090 14.5.3).
const CONVERTER_CODE: u64 = 0x4000_7408;

/// The part's reserved space between its RAM with the RAM's bits and its peripherals (RM0090 2.3):
/// an access fails on the bus, and the core takes a fault (ARMv7-M B3.2.15, `PRECISERR`). The
/// emulator answers zero by itself.
const RESERVED: [std::ops::Range<u64>; 2] = [0x2010_0000..0x2200_0000, 0x2400_0000..0x4000_0000];

/// The part's identity.
const DBGMCU_IDCODE: u64 = 0xE004_2000;

/// The runner's bus, with the windows in place.
pub(super) struct Rerouted<'a> {
    pub(super) bus: &'a mut dyn CoreBus,
    pub(super) flash: &'a Flash,
    pub(super) stalled: u64,
    /// Instructions' time for which the flash, being erased or programmed, has kept the core
    /// waiting in this stretch.
    pub(super) standstill: u64,
    pub(super) shorted: Option<PartPin>,
    pub(super) identity: Option<u32>,
    /// True if a code was written to the converter since somebody asked.
    pub(super) code_written: bool,
    /// True if the core is inspected after every instruction.
    pub(super) stepping: bool,
    /// The run's request to the core in this stretch.
    pub(super) asked: Vec<Queued>,
}

impl CoreBus for Rerouted<'_> {
    fn access(&mut self, mut access: Access, from_code: bool) -> Option<u64> {
        let written = access.kind == AccessKind::Write;
        if from_code && RESERVED.iter().any(|space| space.contains(&access.address)) {
            return None;
        }
        if WRITABLE.contains(&access.address) {
            let (address, value) = (access.address, access.value as u32);
            let mut array = self.flash.array();
            if written {
                self.standstill += stalled(array.store(address, access.width.bytes(), value));
                return Some(access.value);
            }
            let word = u64::from(array.word(address)) | u64::from(array.word(address + 4)) << 32;
            return Some(word >> (8 * (address & 3)) & access.width.mask());
        }
        if !written && access.address == FLASH_OPTCR {
            return Some(self.flash.array().option_register().into());
        }
        if written {
            let at = self.bus.time(access.instruction_count + self.stalled).0;
            let stall = self.flash.array().register_written(access.address, access.value as u32, at);
            self.standstill += stalled(stall);
        }
        let address = access.address;
        self.code_written |= written && address == CONVERTER_CODE;
        access.address = window(access.address);
        if self.stalled > 0 {
            access.instruction_count += self.stalled;
            access.virtual_time = self.bus.time(access.instruction_count);
        }
        let value = self.bus.access(access, from_code)?;
        if let Some(identity) = self.identity.filter(|_| !written && address == DBGMCU_IDCODE) {
            return Some(identity.into());
        }
        if !written && address == FLASH_SR {
            return Some(value | u64::from(self.flash.array().status()));
        }
        let high = self.shorted.filter(|place| !written && access.address == place.register(register::INPUT));
        Some(high.map_or(value, |place| value | 1 << place.index))
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(instructions + self.stalled)
    }

    fn queued(&mut self) -> Vec<Queued> {
        let queued = self.bus.queued();
        self.asked.extend_from_slice(&queued);
        queued
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        if self.stepping || self.standstill > 0 {
            return None;
        }
        self.bus.carry_on(instructions + self.stalled, event)
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.bus.acknowledge(line, instructions + self.stalled)
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.bus.read_checked(access, report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.bus.write_checked(access)
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        self.bus.stops_before(access)
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.bus.send_trace(bytes);
    }
}
