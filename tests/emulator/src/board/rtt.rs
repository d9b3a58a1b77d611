//! The firmware's real-time-transfer terminal, read out of its memory as a debug probe does.

use rigless::emulator::Host;
use rigless::soc::Width;

/// The first up-channel's descriptor, past the identifier and the two channel counts.
const CHANNEL: u64 = 24;
const BUFFER: u64 = 4;
const SIZE: u64 = 8;
const WRITE: u64 = 12;
const READ: u64 = 16;

/// Takes what the firmware wrote to channel 0 of the control block at `block`, and makes room.
pub(super) fn drain(block: u64, host: &mut dyn Host) -> Vec<u8> {
    let mut word = |offset: u64| host.read(block + CHANNEL + offset, Width::W32).unwrap_or(0);
    let (buffer, size, write, mut read) = (word(BUFFER), word(SIZE), word(WRITE), word(READ));
    // Before the firmware has set the block up there is nothing sensible in it.
    if buffer == 0 || size == 0 || write >= size || read >= size {
        return Vec::new();
    }
    let mut bytes = Vec::new();
    while read != write {
        let Ok(byte) = host.read(buffer + read, Width::W8) else { break };
        bytes.push(byte as u8);
        read = (read + 1) % size;
    }
    if !bytes.is_empty() {
        let _ = host.write(block + CHANNEL + READ, Width::W32, read);
    }
    bytes
}
