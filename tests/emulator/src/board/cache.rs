//! The instruction cache of the flash (RM0090 3.5.2, adaptive real-time memory accelerator): 64
//! lines of 128 bits, the one that was used longest ago exchanged first. Counts the lines that have
//! to come from the flash.
//!
//! The emulator takes the same time for each instruction. This says what it leaves out: how often
//! the core waits for the flash when an interrupt finds none of its code in the cache.

/// Bytes of a line.
const LINE_BYTES: u32 = 16;
/// Lines.
const LINES: usize = 64;
/// Cycles that the core waits for a line at 168 MHz on a supply of less than 2.7 V (RM0090 3.5.1,
/// table 10). Without prefetch; with it, lines that follow one another wait for less.
pub const WAIT_CYCLES: u32 = 6;

/// The cache's content, and a count of what it lacked.
#[derive(Debug, Default)]
pub(super) struct InstructionCache {
    /// Lines by their number in the address space, the one used longest ago first.
    lines: Vec<u32>,
    misses: u32,
}

impl InstructionCache {
    /// Takes the fetch of the instruction at `address`. The second half of one that ends in the
    /// next line is left out: what follows it fetches that line, unless it branches.
    pub(super) fn fetch(&mut self, address: u32) {
        let line = address / LINE_BYTES;
        if let Some(place) = self.lines.iter().rposition(|&held| held == line) {
            self.lines.remove(place);
        } else {
            self.misses += 1;
            if self.lines.len() == LINES {
                self.lines.remove(0);
            }
        }
        self.lines.push(line);
    }

    /// Returns the lines that had to come from the flash.
    pub(super) fn misses(&self) -> u32 {
        self.misses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_comes_once_while_it_is_held() {
        let mut cache = InstructionCache::default();
        for address in (0x0800_0000..0x0800_0100).step_by(2) {
            cache.fetch(address);
        }
        assert_eq!(cache.misses(), 16);
        cache.fetch(0x0800_00FE);
        assert_eq!(cache.misses(), 16);
        cache.fetch(0x0800_0100);
        assert_eq!(cache.misses(), 17);
    }

    #[test]
    fn the_line_used_longest_ago_goes_first() {
        let mut cache = InstructionCache::default();
        (0..64).for_each(|line| cache.fetch(16 * line));
        cache.fetch(0);
        cache.fetch(16 * 64);
        assert_eq!(cache.misses(), 65);
        cache.fetch(0);
        assert_eq!(cache.misses(), 65, "it was used just before");
        cache.fetch(16);
        assert_eq!(cache.misses(), 66, "it was not");
    }
}
