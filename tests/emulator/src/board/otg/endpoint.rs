//! The registers of one endpoint in one direction, RM0090 sections 34.16.4 and 34.17.

use serde::{Deserialize, Serialize};

use super::registers::device::*;

/// The bits of a control register that a write sets as written; the others act or are read only.
const STORED: u32 = 0x7FF | USBAEP | 0b11 << 18 | STALL | 0xF << 22;

/// Applies a write to a control register, for both directions: the stored bits, NAK, data toggle,
/// enable and disable. Answers whether a disable took effect.
fn write_control(control: &mut u32, toggle: &mut bool, value: u32, kept: u32) -> bool {
    let mut next = (*control & !STORED) | (value & STORED) | kept;
    if value & SNAK != 0 {
        next |= NAKSTS;
    }
    if value & CNAK != 0 {
        next &= !NAKSTS;
    }
    if value & SD0PID != 0 {
        *toggle = false;
    }
    if value & SODDFRM != 0 {
        *toggle = true;
    }
    if value & EPENA != 0 {
        next |= EPENA;
    }
    let disabled = value & EPDIS != 0 && *control & EPENA != 0;
    if disabled {
        next &= !EPENA;
    }
    *control = next;
    disabled
}

/// Endpoint 0 spells its packet size as a code, 34.16.4.
fn packet_size(number: usize, control: u32) -> usize {
    if number == 0 { 64 >> (control & 0b11) } else { (control & 0x7FF) as usize }
}

/// An IN endpoint.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct InEndpoint {
    number: usize,
    pub(super) control: u32,
    pub(super) interrupts: u32,
    /// True if the next packet is sent as DATA1.
    pub(super) toggle: bool,
    bytes_left: u32,
    packets_left: u32,
}

impl InEndpoint {
    pub(super) fn new(number: usize) -> Self {
        // Endpoint 0 is active in every configuration.
        let control = if number == 0 { USBAEP } else { 0 };
        Self { number, control, interrupts: 0, toggle: false, bytes_left: 0, packets_left: 0 }
    }

    /// The transmit FIFO it draws from.
    pub(super) fn fifo(&self) -> usize {
        if self.number == 0 { 0 } else { (self.control >> 22 & 0xF) as usize % super::ENDPOINTS }
    }

    pub(super) fn write_control(&mut self, value: u32) {
        let kept = if self.number == 0 { USBAEP } else { 0 };
        if write_control(&mut self.control, &mut self.toggle, value, kept) {
            self.interrupts |= EPDISD;
        }
    }

    pub(super) fn write_size(&mut self, value: u32) {
        self.bytes_left = value & 0x7_FFFF;
        self.packets_left = value >> 19 & 0x3FF;
    }

    pub(super) fn size(&self) -> u32 {
        self.bytes_left | self.packets_left << 19
    }

    /// The bytes of the packet that goes out next.
    pub(super) fn next_packet(&self) -> usize {
        packet_size(self.number, self.control).min(self.bytes_left as usize)
    }

    /// A packet of `bytes` went out and was acknowledged.
    pub(super) fn sent(&mut self, bytes: usize) {
        self.toggle = !self.toggle;
        self.bytes_left -= bytes as u32;
        self.packets_left = self.packets_left.saturating_sub(1);
        if self.packets_left == 0 {
            self.control &= !EPENA;
            self.interrupts |= XFRC;
        }
    }
}

/// An OUT endpoint.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct OutEndpoint {
    number: usize,
    pub(super) control: u32,
    pub(super) interrupts: u32,
    /// True if the next packet must be DATA1.
    pub(super) toggle: bool,
    pub(super) size: u32,
}

impl OutEndpoint {
    pub(super) fn new(number: usize) -> Self {
        let control = if number == 0 { USBAEP } else { 0 };
        Self { number, control, interrupts: 0, toggle: false, size: 0 }
    }

    pub(super) fn write_control(&mut self, value: u32) {
        // 34.16.4: endpoint 0 can't be disabled.
        let (value, kept) = if self.number == 0 { (value & !EPDIS, USBAEP) } else { (value, 0) };
        if write_control(&mut self.control, &mut self.toggle, value, kept) {
            self.interrupts |= EPDISD;
        }
    }

    /// A packet of `bytes` came in. Answers whether it ends the transfer, which leaves the endpoint
    /// disabled until the firmware enables it again.
    pub(super) fn took(&mut self, bytes: usize) -> bool {
        let packets = (self.size >> 19 & 0x3FF).saturating_sub(1);
        let left = (self.size & 0x7_FFFF).saturating_sub(bytes as u32);
        self.size = (self.size & (0b11 << 29)) | packets << 19 | left;
        let complete = packets == 0 || bytes < packet_size(self.number, self.control);
        if complete {
            self.control = (self.control & !EPENA) | NAKSTS;
        }
        complete
    }
}
