//! The USB on-the-go full-speed core of RM0090 chapter 34 as a device sees it: registers and FIFOs
//! towards the firmware, transactions towards the cable.
//!
//! It knows no emulator: [`Core::read`] and [`Core::write`] take an offset from 0x5000_0000, and
//! [`Core::line`] is the level of interrupt 67. Left out: host mode, isochronous endpoints, the
//! session request protocol, VBUS sensing, timing inside a transaction. `AHBIDL` is always set and
//! every flush and reset ends at once, which the manual allows.

mod device;
mod endpoint;
mod fifo;
mod registers;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::usb_host::wire::Device;
use endpoint::{InEndpoint, OutEndpoint};
use fifo::{Announced, ReceiveFifo, TransmitFifo};
use registers::*;
use registers::{device::*, global::*};

pub use fifo::PACKET_WORDS;

/// Endpoints in each direction, section 34.1.
pub const ENDPOINTS: usize = 4;
/// `OTG_FS_CID` of the STM32F407.
const CORE_ID: u32 = 0x0000_1200;
/// The depth of every FIFO out of reset, in words.
const RESET_DEPTH: u32 = 0x200;
/// `DSTS.ENUMSPD`: full speed on the internal transceiver.
const FULL_SPEED: u32 = 0b11 << 1;

/// The core, out of reset.
#[derive(Debug, Serialize, Deserialize)]
pub struct Core {
    /// Registers that only hold what was written.
    stored: BTreeMap<u64, u32>,
    interrupts: u32,
    interrupt_mask: u32,
    in_endpoints: [InEndpoint; ENDPOINTS],
    out_endpoints: [OutEndpoint; ENDPOINTS],
    receive: ReceiveFifo,
    transmit: [TransmitFifo; ENDPOINTS],
    /// `DAD`, and what it was before the firmware last wrote it: a SET_ADDRESS still ends at the
    /// old one, and the firmware may write the new one before that.
    address: u8,
    address_before: u8,
    suspended: bool,
    frame: u16,
    /// True if the end of endpoint 0's SETUP stage has not been announced yet.
    setup_open: bool,
    /// True if a soft reset never ends, as where the transceiver brings no clock.
    pub hangs_in_reset: bool,
    /// The firmware's actions that the manual does not describe.
    pub(super) violations: Vec<String>,
}

impl Default for Core {
    fn default() -> Self {
        Self {
            stored: BTreeMap::new(),
            interrupts: 0,
            interrupt_mask: 0,
            in_endpoints: std::array::from_fn(InEndpoint::new),
            out_endpoints: std::array::from_fn(OutEndpoint::new),
            receive: ReceiveFifo::of(RESET_DEPTH),
            transmit: std::array::from_fn(|_| TransmitFifo::of(RESET_DEPTH)),
            address: 0,
            address_before: 0,
            suspended: false,
            frame: 0,
            setup_open: false,
            hangs_in_reset: false,
            violations: Vec::new(),
        }
    }
}

impl Core {
    /// As out of reset; what is wrong with the part stays.
    pub(super) fn restart(&mut self) {
        let violations = std::mem::take(&mut self.violations);
        *self = Self { hangs_in_reset: self.hangs_in_reset, violations, ..Self::default() };
    }

    fn stored(&self, offset: u64) -> u32 {
        self.stored.get(&offset).copied().unwrap_or(match offset {
            CID => CORE_ID,
            DCFG => 0x0220_0000,
            _ => 0,
        })
    }

    /// Words the firmware wrote into a full transmit FIFO, and packet memory it claimed beyond the
    /// 320 words there are. Both are zero for a firmware that does it right.
    #[must_use]
    pub fn misuse(&self) -> (u64, u32) {
        let overruns = self.transmit.iter().map(|fifo| fifo.overruns).sum();
        let claimed = self.receive.depth + self.transmit.iter().map(|fifo| fifo.depth).sum::<u32>();
        let configured = self.stored.contains_key(&GRXFSIZ);
        (overruns, if configured { claimed.saturating_sub(PACKET_WORDS) } else { 0 })
    }

    /// The level of the core's interrupt line.
    #[must_use]
    pub fn line(&self) -> bool {
        self.stored(GAHBCFG) & GAHBCFG_GINT != 0 && self.pending() & self.interrupt_mask != 0
    }

    fn endpoint_interrupts(&self) -> u32 {
        let masks = (self.stored(DIEPMSK), self.stored(DOEPMSK), self.stored(DIEPEMPMSK));
        let mut bits = 0;
        for (n, endpoint) in self.in_endpoints.iter().enumerate() {
            let empty = self.in_interrupts(n) & TXFE != 0 && masks.2 & (1 << n) != 0;
            if endpoint.interrupts & masks.0 != 0 || empty {
                bits |= 1 << n;
            }
        }
        for (n, endpoint) in self.out_endpoints.iter().enumerate() {
            if endpoint.interrupts & masks.1 != 0 {
                bits |= 1 << (16 + n);
            }
        }
        bits
    }

    fn in_interrupts(&self, n: usize) -> u32 {
        let empty = if self.transmit[self.in_endpoints[n].fifo()].is_empty() { TXFE } else { 0 };
        self.in_endpoints[n].interrupts | empty
    }

    fn pending(&self) -> u32 {
        let raised = self.endpoint_interrupts() & self.stored(DAINTMSK);
        let mut bits = self.interrupts | NPTXFE;
        if !self.receive.is_empty() {
            bits |= RXFLVL;
        }
        if raised & 0xFFFF != 0 {
            bits |= IEPINT;
        }
        if raised >> 16 != 0 {
            bits |= OEPINT;
        }
        bits
    }

    /// A firmware read of the word at `offset`.
    pub fn read(&mut self, offset: u64) -> u32 {
        match offset {
            GRSTCTL => self.stored(GRSTCTL) | GRSTCTL_AHBIDL | u32::from(self.hangs_in_reset),
            GINTSTS => self.pending(),
            GINTMSK => self.interrupt_mask,
            GRXSTSR => self.receive.look(),
            GRXSTSP => self.take_received(),
            DSTS => u32::from(self.suspended) | FULL_SPEED | u32::from(self.frame) << 8,
            DAINT => self.endpoint_interrupts(),
            DIEPCTL0..DOEPCTL0 => self.read_in(offset - DIEPCTL0),
            DOEPCTL0..PCGCCTL => self.read_out(offset - DOEPCTL0),
            // Every window reads the one receive FIFO.
            FIFO0.. => self.take_received(),
            _ => self.stored(offset),
        }
    }

    fn take_received(&mut self) -> u32 {
        let (word, announced) = self.receive.take();
        match announced {
            Announced::Packet => {}
            Announced::OutComplete(n) => self.out_endpoints[n % ENDPOINTS].interrupts |= XFRC,
            Announced::SetupComplete(n) => self.out_endpoints[n % ENDPOINTS].interrupts |= STUP,
        }
        word
    }

    fn read_in(&self, offset: u64) -> u32 {
        let Some((n, register)) = endpoint_of(offset) else { return 0 };
        let endpoint = &self.in_endpoints[n];
        match register {
            EP_CTL => endpoint.control,
            EP_INT => self.in_interrupts(n),
            EP_TSIZ => endpoint.size(),
            EP_TXFSTS => self.transmit[endpoint.fifo()].room(),
            _ => 0,
        }
    }

    fn read_out(&self, offset: u64) -> u32 {
        let Some((n, register)) = endpoint_of(offset) else { return 0 };
        let endpoint = &self.out_endpoints[n];
        match register {
            EP_CTL => endpoint.control,
            EP_INT => endpoint.interrupts,
            EP_TSIZ => endpoint.size,
            _ => 0,
        }
    }

    /// A firmware write of the word at `offset`.
    pub fn write(&mut self, offset: u64, value: u32) {
        match offset {
            GOTGINT => {}
            GRSTCTL => self.reset_or_flush(value),
            GINTSTS => self.interrupts &= !(value & GINTSTS_CLEARED_BY_ONE),
            GINTMSK => self.interrupt_mask = value,
            GRXFSIZ => {
                self.receive.depth = value & 0xFFFF;
                self.stored.insert(offset, value);
            }
            DIEPTXF0 => {
                self.transmit[0].depth = value >> 16;
                self.stored.insert(offset, value);
            }
            DIEPTXF1..=0x10C => {
                self.transmit[1 + ((offset - DIEPTXF1) / 4) as usize].depth = value >> 16;
                self.stored.insert(offset, value);
            }
            DCFG => {
                self.address_before = self.address;
                self.address = (value >> 4 & 0x7F) as u8;
                self.stored.insert(offset, value);
            }
            DIEPCTL0..DOEPCTL0 => self.write_in(offset - DIEPCTL0, value),
            DOEPCTL0..PCGCCTL => self.write_out(offset - DOEPCTL0, value),
            FIFO0.. => {
                let fifo = ((offset - FIFO0) / FIFO_STRIDE) as usize;
                if let Some(fifo) = self.transmit.get_mut(fifo) {
                    fifo.push(value);
                }
            }
            _ => {
                self.stored.insert(offset, value);
            }
        }
    }

    fn reset_or_flush(&mut self, value: u32) {
        if value & GRSTCTL_CSRST != 0 {
            // It ends some clocks of the transceiver later, which has to have power (34.16.2,
            // `CSRST` and `PWRDWN`).
            if self.stored(registers::GCCFG) & GCCFG_PWRDWN == 0 {
                self.violations.push("the USB core is reset with its transceiver powered down".into());
            }
            // The soft reset keeps the configuration registers, 34.16.2.
            let kept = [registers::GCCFG, registers::DCFG, registers::GAHBCFG, 0x00C]
                .map(|offset| (offset, self.stored.get(&offset).copied()));
            let frame = self.frame;
            self.restart();
            self.frame = frame;
            self.stored.extend(kept.into_iter().filter_map(|(offset, value)| Some((offset, value?))));
            return;
        }
        if value & GRSTCTL_RXFFLSH != 0 {
            self.receive.flush();
        }
        let number = value >> 6 & 0x1F;
        if value & GRSTCTL_TXFFLSH != 0 {
            for (n, fifo) in self.transmit.iter_mut().enumerate() {
                if number == TXFNUM_ALL || number as usize == n {
                    fifo.flush();
                }
            }
        }
        let flags = GRSTCTL_CSRST | GRSTCTL_RXFFLSH | GRSTCTL_TXFFLSH | 0b110;
        self.stored.insert(GRSTCTL, value & !flags & !GRSTCTL_AHBIDL);
    }

    fn write_in(&mut self, offset: u64, value: u32) {
        let Some((n, register)) = endpoint_of(offset) else { return };
        let endpoint = &mut self.in_endpoints[n];
        match register {
            EP_CTL => endpoint.write_control(value),
            EP_INT => endpoint.interrupts &= !value,
            EP_TSIZ => endpoint.write_size(value),
            _ => {}
        }
    }

    fn write_out(&mut self, offset: u64, value: u32) {
        let Some((n, register)) = endpoint_of(offset) else { return };
        let endpoint = &mut self.out_endpoints[n];
        match register {
            EP_CTL => endpoint.write_control(value),
            EP_INT => endpoint.interrupts &= !value,
            EP_TSIZ => endpoint.size = value,
            _ => {}
        }
    }

    /// The endpoint a token of the host addresses, if this core answers to it.
    fn addressed(&self, address: u8, endpoint: u8) -> Option<usize> {
        let ours = address == self.address || (endpoint == 0 && address == self.address_before);
        let n = usize::from(endpoint);
        (ours && n < ENDPOINTS && self.pulls_up()).then_some(n)
    }

    /// A token other than SETUP ends the SETUP stage.
    fn end_setup(&mut self) {
        if self.setup_open {
            self.setup_open = false;
            self.receive.push_setup_complete(0);
        }
    }
}

fn endpoint_of(offset: u64) -> Option<(usize, u64)> {
    let n = (offset / ENDPOINT_STRIDE) as usize;
    (n < ENDPOINTS).then_some((n, offset % ENDPOINT_STRIDE))
}

#[cfg(test)]
mod tests;
