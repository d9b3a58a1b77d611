//! The clock of the part: the oscillator that swings, and the flash's wait states for it.

use rigless::mcu::Operate;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::machine::{CLOCK_HZ, Machine};
use super::pins::Clock;
use super::plant::Nanos;
use super::world::{FLASH_ACR, RCC_CFGR, World};

const HSEBYP: u64 = 1 << 18;
const RCC_PLLCFGR: u64 = 0x4002_3804;
/// `SW` that selects the PLL.
const SW_PLL: u64 = 0b10;
const PREFETCH: u64 = 1 << 8;

impl World {
    /// The oscillator is switched on: it swings only where it is what the board's clock needs
    /// (RM0090 7.2.1). One that does not gives the PLL nothing.
    pub(super) fn start_clock(&self, session: &mut Session<Machine>, control: u64) {
        let is_bypassed = control & HSEBYP != 0;
        let fits = is_bypassed == (self.wiring.pins.clock == Clock::Elsewhere);
        session.board_mut().part().rcc.attach_crystals(if fits { CLOCK_HZ } else { 0 }, 0);
    }

    /// RM0090 3.5.1: a wait state for every 24 MHz on the 2.4 to 2.7 V at which the part still
    /// runs, before the clock rises. The part's first revision does not prefetch (errata sheet).
    pub(super) fn watch_wait_states(&mut self, session: &mut Session<Machine>, at: Nanos) {
        let mut register =
            |address| session.board_mut().mcu.peek(VirtualNanos(at), address, Width::W32).unwrap_or(0);
        let (clock, pll, access) = (register(RCC_CFGR), register(RCC_PLLCFGR), register(FLASH_ACR));
        if clock & 0b11 != SW_PLL {
            return;
        }
        let multiplied = CLOCK_HZ / (pll & 0x3F).max(1) * (pll >> 6 & 0x1FF);
        let core = multiplied / (2 * (pll >> 16 & 0b11) + 2);
        // By 2, 4, 8, 16, then 64 to 512.
        let divided = match clock >> 4 & 0xF {
            0..8 => core,
            by @ 8..12 => core >> (by - 7),
            by => core >> (by - 6),
        };
        let (waits, needed) = (access & 0xF, divided.div_ceil(24_000_000).saturating_sub(1));
        if waits < needed {
            self.violations.push(format!("{waits} wait states at {divided} Hz, and {needed} are needed"));
        }
        if session.board().is_first_revision() && access & PREFETCH != 0 {
            self.violations.push(format!("the first revision prefetches at {divided} Hz"));
        }
    }
}
