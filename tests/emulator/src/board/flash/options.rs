//! The option bytes of the flash. They are programmed by both of their keys and `OPTSTRT` (RM0090
//! 3.7.2), which keeps the flash from being read meanwhile. `OPTCR` is a register that a write
//! changes at once; what a reset loads is what the option bytes took.

use serde::{Deserialize, Serialize};

use super::Array;

/// The option bytes' control and key registers (RM0090 3.9.10, 3.9.4).
pub(in super::super) const FLASH_OPTCR: u64 = 0x4002_3C14;
pub(super) const FLASH_OPTKEYR: u64 = 0x4002_3C08;
const OPTKEY1: u32 = 0x0819_2A3B;
const OPTKEY2: u32 = 0x4C5D_6E7F;
const OPTLOCK: u32 = 1;
const OPTSTRT: u32 = 1 << 1;
/// The status register, and what option bytes show in it (3.9.6): an error, and busy.
pub(in super::super) const FLASH_SR: u64 = 0x4002_3C0C;
const OPERR: u32 = 1 << 1;
const BSY: u32 = 1 << 16;
/// The read protection's byte and its value while there is none (3.7.3): any other stays in
/// flash, or erases everything when it is taken back.
const RDP: u32 = 0xFF << 8;
const RDP_NONE: u32 = 0xAA << 8;
/// Time in which option bytes are programmed: that of the shortest sector, 16 bits at a time (data
/// sheet DS8626, typical).
const OPTION_NANOS: u64 = 300_000_000;
/// The option bytes as the factory leaves them: `BOR_LEV` is 0b11, which is off.
pub const FACTORY_OPTIONS: u32 = 0x0FFF_AAEC;
/// The same with brown-out level 2.
pub const GUARDED_OPTIONS: u32 = FACTORY_OPTIONS & !(0b11 << 2) | 0b01 << 2;

/// The fault of option bytes that are programmed.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum OptionFault {
    /// None.
    #[default]
    None,
    /// They stay as they were, and nothing says so.
    Worn,
    /// They stay as they were, and an error flag says so.
    Refused,
    /// The flash stays busy.
    Busy,
}

impl Array {
    /// Returns the option bytes' control register as it reads.
    pub(in super::super) fn option_register(&self) -> u32 {
        self.option_control | if self.options_unlocked { 0 } else { OPTLOCK }
    }

    /// Returns the flags that it adds to the status register.
    pub(in super::super) fn status(&self) -> u32 {
        self.status
    }

    /// Returns the time for which the core then stalls, in nanoseconds.
    fn options_written(&mut self, value: u32) -> u64 {
        if !self.options_unlocked {
            return 0;
        }
        self.option_control = value & !(OPTLOCK | OPTSTRT);
        self.options_unlocked = value & OPTLOCK == 0;
        if value & OPTSTRT == 0 {
            return 0;
        }
        self.option_writes += 1;
        if self.option_control & RDP != RDP_NONE {
            self.violations.push(format!("option bytes {:#x} protect the flash", self.option_control));
        }
        match self.option_fault {
            OptionFault::None => self.options = self.option_control,
            OptionFault::Worn => {}
            OptionFault::Refused => self.status |= OPERR,
            OptionFault::Busy => self.status |= BSY,
        }
        OPTION_NANOS
    }

    /// A write to one of their registers. Returns the time for which the core then stalls, in
    /// nanoseconds.
    pub(super) fn option_register_written(&mut self, address: u64, value: u32) -> u64 {
        match address {
            FLASH_OPTKEYR => {
                self.options_unlocked |= value == OPTKEY2 && self.option_key == OPTKEY1;
                self.option_key = value;
            }
            FLASH_SR => self.status &= !value | BSY,
            _ => return self.options_written(value),
        }
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn option_bytes_want_both_keys_and_a_start() {
        let mut array = Array { options: FACTORY_OPTIONS, ..Array::default() };
        array.restarted();
        array.register_written(FLASH_OPTCR, GUARDED_OPTIONS | OPTSTRT, 0);
        assert_eq!((array.options, array.option_register() & OPTLOCK), (FACTORY_OPTIONS, OPTLOCK));
        array.register_written(FLASH_OPTKEYR, OPTKEY1, 0);
        array.register_written(FLASH_OPTKEYR, OPTKEY2, 0);
        array.register_written(FLASH_OPTCR, GUARDED_OPTIONS, 0);
        assert_eq!((array.options, array.option_register()), (FACTORY_OPTIONS, GUARDED_OPTIONS));
        array.register_written(FLASH_OPTCR, GUARDED_OPTIONS | OPTSTRT, 0);
        array.register_written(FLASH_OPTCR, GUARDED_OPTIONS | OPTLOCK, 0);
        assert_eq!((array.options, array.option_writes), (GUARDED_OPTIONS, 1));
    }
}
