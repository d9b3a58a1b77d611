//! Control transfers on endpoint 0, USB 2.0 section 8.5.3, one transaction at a time.

use serde::{Deserialize, Serialize};

use super::wire::{Device, Handshake};

/// The end of a control transfer.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Ended {
    /// Not yet: the next transaction is due, at once or after the device asked for time.
    Running {
        /// The device answered with a NAK.
        nak: bool,
    },
    /// With the bytes of its data stage, empty for a request that sends or has none.
    Done(Vec<u8>),
    /// The device refused the request.
    Stalled,
    /// The device did not answer three times in a row.
    Dead,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum Stage {
    Setup,
    DataIn,
    DataOut,
    StatusIn,
    StatusOut,
}

/// One control transfer under way.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Transfer {
    request: [u8; 8],
    stage: Stage,
    data: Vec<u8>,
    sent: usize,
    /// The packet size of endpoint 0, in bytes.
    packet: usize,
    toggle: bool,
    silences: u8,
}

impl Transfer {
    /// A transfer of `request` that sends `data`, or reads as many bytes as the request asks for.
    /// Endpoint 0 takes packets of `packet` bytes.
    pub(super) fn new(request: [u8; 8], data: &[u8], packet: usize) -> Self {
        let data = data.to_vec();
        Self { request, stage: Stage::Setup, data, sent: 0, packet, toggle: true, silences: 0 }
    }

    fn reads(&self) -> bool {
        self.request[0] & 0x80 != 0
    }

    fn wanted(&self) -> usize {
        usize::from(u16::from_le_bytes([self.request[6], self.request[7]]))
    }

    /// Makes the next transaction with `device` at `address`.
    pub(super) fn step(&mut self, device: &mut dyn Device, address: u8) -> Ended {
        let answer = match self.stage {
            Stage::Setup => device.setup(address, 0, self.request),
            Stage::DataIn | Stage::StatusIn => device.input(address, 0),
            Stage::DataOut => {
                let end = (self.sent + self.packet).min(self.data.len());
                device.out(address, 0, &self.data[self.sent..end], self.toggle)
            }
            Stage::StatusOut => device.out(address, 0, &[], true),
        };
        match answer {
            Handshake::Nak => return Ended::Running { nak: true },
            Handshake::Stall => return Ended::Stalled,
            Handshake::Silence => {
                self.silences += 1;
                return if self.silences == 3 { Ended::Dead } else { Ended::Running { nak: true } };
            }
            Handshake::Ack | Handshake::Data(..) => self.silences = 0,
        }
        match (self.stage, answer) {
            (Stage::Setup, _) => {
                self.stage = match (self.reads(), self.wanted()) {
                    (true, 1..) => Stage::DataIn,
                    (false, 1..) => Stage::DataOut,
                    _ => Stage::StatusIn,
                };
            }
            (Stage::DataIn, Handshake::Data(packet, toggle)) => {
                if toggle == self.toggle {
                    self.toggle = !self.toggle;
                    self.data.extend_from_slice(&packet);
                    if packet.len() < self.packet || self.data.len() >= self.wanted() {
                        self.stage = Stage::StatusOut;
                    }
                }
            }
            (Stage::DataOut, _) => {
                self.toggle = !self.toggle;
                self.sent = (self.sent + self.packet).min(self.data.len());
                if self.sent == self.data.len() {
                    self.stage = Stage::StatusIn;
                }
            }
            (Stage::StatusIn, _) => return Ended::Done(Vec::new()),
            (Stage::StatusOut, _) => return Ended::Done(std::mem::take(&mut self.data)),
            (Stage::DataIn, _) => return Ended::Dead,
        }
        Ended::Running { nak: false }
    }
}
