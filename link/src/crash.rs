//! The record of a crash: what the firmware leaves in RAM when it gives up, and sends after the
//! hello of its next start.

use core::fmt;
use heapless::String;
use serde::{Deserialize, Serialize};

/// Bytes of the end of a source file's path that a record keeps: enough for its folder and its
/// name.
pub const FILE_BYTES: usize = 40;

/// `BFARVALID` of the fault status (ARMv7-M B3.2.15): [`Crash::bus_address`] is the address whose
/// access failed.
const BUS_ADDRESS_VALID: u32 = 1 << 15;

/// The exception that is the microcontroller's interrupt 0 (ARMv7-M B1.5.2).
const FIRST_INTERRUPT: u32 = 16;

/// The reason why the program gave up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u32)]
pub enum CrashKind {
    /// A panic; the detail is its line.
    Panic = 1,
    /// A fault of the core; the detail is the core's `HFSR`.
    HardFault = 2,
    /// An exception that nothing serves; the detail is its number (ARMv7-M B1.5.2): below 16 the
    /// core's own, from there on the microcontroller's interrupts.
    StrayInterrupt = 3,
    /// A task hung; the detail is its number.
    HungTask = 4,
    /// The crystal stopped; the detail is the state of its clock.
    Clock = 5,
}

impl CrashKind {
    /// The kind with this number.
    pub fn from_code(code: u32) -> Option<Self> {
        [Self::Panic, Self::HardFault, Self::StrayInterrupt, Self::HungTask, Self::Clock]
            .into_iter()
            .find(|kind| *kind as u32 == code)
    }
}

/// A crash. What does not belong to its kind is zero or empty.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Crash {
    /// The reason.
    pub kind: CrashKind,
    /// More about it; see [`CrashKind`].
    pub detail: u32,
    /// The address of the instruction that failed.
    pub pc: u32,
    /// The address to which its function would have returned, plus 1 (`LR` of the core).
    pub lr: u32,
    /// The core's fault status (`CFSR`, ARMv7-M B3.2.15).
    pub fault_status: u32,
    /// The address whose access failed (`BFAR`), if the fault status says that it is valid.
    pub bus_address: u32,
    /// The end of the path of the source file of a panic.
    pub file: String<FILE_BYTES>,
}

impl Crash {
    /// A crash of which only the kind and a detail are known.
    pub const fn new(kind: CrashKind, detail: u32) -> Self {
        let file = String::new();
        Self { kind, detail, pc: 0, lr: 0, fault_status: 0, bus_address: 0, file }
    }

    /// A panic at a line of a source file.
    pub fn panic(file: &str, line: u32) -> Self {
        Self { file: tail(file), ..Self::new(CrashKind::Panic, line) }
    }

    /// The address whose access failed, if the core knows it.
    pub fn failed_address(&self) -> Option<u32> {
        (self.fault_status & BUS_ADDRESS_VALID != 0).then_some(self.bus_address)
    }
}

/// Returns the end of `path` that a record has room for.
fn tail(path: &str) -> String<FILE_BYTES> {
    let from = path.len().saturating_sub(FILE_BYTES);
    // Within a character of several bytes there is no string; the next one begins at most three
    // bytes later.
    let end = (from..path.len()).find_map(|at| path.get(at..)).unwrap_or_default();
    let mut file = String::new();
    // It fits: no more than FILE_BYTES are left.
    let _ = file.push_str(end);
    file
}

impl fmt::Display for Crash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { detail, pc, lr, fault_status, .. } = self;
        f.write_str("before its last reset, the firmware ")?;
        match self.kind {
            CrashKind::Panic => {
                let file = if self.file.is_empty() { "an unknown file" } else { &self.file };
                write!(f, "panicked at line {detail} of {file}")?;
            }
            CrashKind::HardFault => {
                write!(
                    f,
                    "stopped with a hard fault at {pc:#010x} (LR {lr:#010x}, CFSR {fault_status:#010x}"
                )?;
                if let Some(address) = self.failed_address() {
                    write!(f, ", no access to {address:#010x}")?;
                }
                f.write_str(")")?;
            }
            CrashKind::StrayInterrupt => {
                match detail.checked_sub(FIRST_INTERRUPT) {
                    Some(interrupt) => write!(f, "received interrupt {interrupt}")?,
                    None => write!(f, "received exception {detail} of the core")?,
                }
                f.write_str(", which no task serves")?;
            }
            CrashKind::HungTask => write!(f, "stopped because task {detail} hung")?,
            CrashKind::Clock => f.write_str("lost its crystal: check the board")?,
        }
        if self.kind == CrashKind::Clock {
            return Ok(());
        }
        f.write_str("; report this sentence with the firmware's commit")
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;
    use std::string::ToString;

    #[test]
    fn a_long_path_keeps_its_end() {
        let crash = Crash::panic("/root/.cargo/registry/src/index.crates.io/heapless-0.8.0/src/vec.rs", 77);
        assert!(crash.file.ends_with("heapless-0.8.0/src/vec.rs") && crash.file.len() == FILE_BYTES);
        assert_eq!(Crash::panic("src/é.rs", 1).file, "src/é.rs");
        let wide = "é".repeat(FILE_BYTES);
        assert_eq!(Crash::panic(&wide[..], 1).file.len(), FILE_BYTES);
        assert_eq!(
            Crash::panic(&std::format!("{wide}x"), 1).file.len(),
            FILE_BYTES - 1,
            "half a letter is left out"
        );
    }

    #[test]
    fn every_kind_is_one_sentence() {
        let fault = Crash {
            pc: 0x0800_1234,
            lr: 0x0800_0201,
            fault_status: 1 << 15 | 1 << 9,
            bus_address: 0x6000_0000,
            ..Crash::new(CrashKind::HardFault, 1 << 30)
        };
        assert_eq!(
            fault.to_string(),
            "before its last reset, the firmware stopped with a hard fault at 0x08001234 (LR 0x08000201, CFSR \
             0x00008200, no access to 0x60000000); report this sentence with the firmware's commit"
        );
        let without = Crash { fault_status: 1 << 8, ..fault };
        assert!(!without.to_string().contains("0x60000000"), "BFAR holds anything until it is valid");
        let panic = Crash::panic("firmware/src/app.rs", 12).to_string();
        assert!(panic.contains("panicked at line 12 of firmware/src/app.rs"), "{panic}");
        for (exception, name) in [(15, "exception 15 of the core"), (17, "interrupt 1"), (87, "interrupt 71")]
        {
            let stray = Crash::new(CrashKind::StrayInterrupt, exception).to_string();
            assert!(stray.contains(&std::format!("received {name}, which no task serves")), "{stray}");
        }
        assert!(Crash::new(CrashKind::HungTask, 3).to_string().contains("task 3"));
    }
}
