//! The host of a program that was built as a test: probe-rs's side of `embedded-test`.
//!
//! The core calls by `BKPT 0xAB`, the operation in `r0` and its parameter in `r1` (Arm,
//! "Semihosting for AArch32 and AArch64"). `SYS_GET_CMDLINE` is given the test to run,
//! `SYS_EXIT_EXTENDED` ends it; a core whose program has ended runs nothing more.

use rigless::emulator::{Access, AccessKind, CoreBus};
use rigless::soc::Width;

use super::elf;

const SYS_GET_CMDLINE: u32 = 0x15;
const SYS_EXIT: u32 = 0x18;
const SYS_EXIT_EXTENDED: u32 = 0x20;
/// The reason of a program that ends by itself.
const APPLICATION_EXIT: u32 = 0x2_0026;

/// A host and the one program that it runs.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Host {
    command_line: String,
    /// The status that the program has ended with.
    pub status: Option<u32>,
}

impl Host {
    /// A host that has the program run the test at `address`.
    #[must_use]
    pub fn running(address: u32) -> Self {
        Self { command_line: format!("run_addr {address}"), status: None }
    }

    /// Serves the call of `operation`. Returns what the core finds in `r0`.
    pub(super) fn serve(&mut self, operation: u32, parameter: u32, bus: &mut dyn CoreBus) -> u32 {
        const FAILED: u32 = u32::MAX;
        let mut reach = |kind, address: u32, width, value: u32| {
            bus.access(Access::new(kind, address.into(), width, value.into()), false).unwrap_or(0) as u32
        };
        match operation {
            SYS_GET_CMDLINE => {
                let [place, room] =
                    [0, 4].map(|field| reach(AccessKind::Read, parameter + field, Width::W32, 0));
                if self.command_line.len() as u32 >= room {
                    return FAILED;
                }
                for (at, byte) in (place..).zip(self.command_line.bytes().chain([0])) {
                    reach(AccessKind::Write, at, Width::W8, byte.into());
                }
                let length = self.command_line.len() as u32;
                reach(AccessKind::Write, parameter + 4, Width::W32, length);
                0
            }
            SYS_EXIT | SYS_EXIT_EXTENDED => {
                let is_extended = operation == SYS_EXIT_EXTENDED;
                let mut field = |at| reach(AccessKind::Read, parameter + at, Width::W32, 0);
                let reason = if is_extended { field(0) } else { parameter };
                let status = if is_extended { field(4) } else { 0 };
                self.status = Some(if reason == APPLICATION_EXIT { status } else { FAILED });
                0
            }
            _ => FAILED,
        }
    }
}

/// Returns the tests of the program in `image`, each with the address to run it at. The name of a
/// test's symbol is a record of it, and its word the address (`embedded-test`, `export_sym`).
#[must_use]
pub fn tests(image: &[u8]) -> Vec<(String, u32)> {
    let tests = elf::objects(image).into_iter().filter_map(|(name, bytes)| {
        let record: serde_json::Value = serde_json::from_str(&name).ok()?;
        let name = record.get("name").filter(|_| record.get("should_panic").is_some())?.as_str()?;
        Some((name.to_string(), u32::from_le_bytes(bytes.get(..4)?.try_into().ok()?)))
    });
    tests.collect()
}
