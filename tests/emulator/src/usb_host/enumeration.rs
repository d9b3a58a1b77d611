//! Enumeration: what a host asks a new device for, one control transfer after another.

use super::control::{Ended, Transfer};
use super::descriptors::{Identity, cdc_port, text};
use super::wire::Device;
use super::{Host, MILLISECOND, NAK_WAIT, Nanos, PATIENCE, Phase, wire_time};

impl Host {
    /// Starts step `step` of the enumeration.
    pub(super) fn enumerate(&mut self, step: usize, now: Nanos) -> Nanos {
        let get = |kind: u8, index: u8, length: u16| {
            let [low, high] = length.to_le_bytes();
            let language = if kind == 3 && index != 0 { 0x0409_u16 } else { 0 }.to_le_bytes();
            [0x80, 6, index, kind, language[0], language[1], low, high]
        };
        let interface = self.port.interface;
        let line_coding = [0x00, 0xC2, 0x01, 0x00, 0, 0, 8];
        let (request, data): ([u8; 8], &[u8]) = match step {
            0 => (get(1, 0, 64), &[]),
            1 => ([0, 5, 1, 0, 0, 0, 0, 0], &[]),
            2 => (get(1, 0, 18), &[]),
            3..=5 => {
                let index = self.string_indices[step - 3];
                if index == 0 {
                    return self.enumerate(step + 1, now);
                }
                (get(3, index, 255), &[])
            }
            6 => (get(2, 0, 9), &[]),
            7 => (get(2, 0, self.port.packet as u16), &[]),
            8 => ([0, 9, self.port.configuration, 0, 0, 0, 0, 0], &[]),
            _ => ([0x21, 0x20, 0, 0, interface, 0, 7, 0], &line_coding),
        };
        let transfer = Transfer::new(request, data, self.control_packet);
        self.phase = Phase::Enumerating(step, transfer, now + PATIENCE);
        now
    }

    pub(super) fn enumeration(&mut self, now: Nanos, device: &mut dyn Device) -> Nanos {
        let address = self.address;
        let Phase::Enumerating(step, transfer, until) = &mut self.phase else { return now };
        let step = *step;
        if now >= *until {
            self.fail(format!("no answer to step {step} of the enumeration within five seconds"));
            return now + MILLISECOND;
        }
        match transfer.step(device, address) {
            Ended::Running { nak } => now + if nak { NAK_WAIT } else { wire_time(64) },
            Ended::Stalled => {
                self.fail(format!("the device refused step {step} of the enumeration"));
                now + MILLISECOND
            }
            Ended::Dead => {
                self.fail(format!("the device is silent at step {step} of the enumeration"));
                now + MILLISECOND
            }
            Ended::Done(bytes) => self.learnt(step, &bytes, now),
        }
    }

    fn learnt(&mut self, step: usize, bytes: &[u8], now: Nanos) -> Nanos {
        match step {
            0 => match bytes.get(7) {
                Some(&size @ (8 | 16 | 32 | 64)) => self.control_packet = usize::from(size),
                other => {
                    self.fail(format!("endpoint 0 takes {other:?} bytes at once"));
                    return now + MILLISECOND;
                }
            },
            1 => {
                self.address = 1;
                // Section 9.2.6.3: the device has two milliseconds to take its address.
                self.enumerate(2, now);
                return now + 2 * MILLISECOND;
            }
            2 if bytes.len() >= 18 => {
                self.identity = Identity {
                    vendor: u16::from_le_bytes([bytes[8], bytes[9]]),
                    product: u16::from_le_bytes([bytes[10], bytes[11]]),
                    strings: [None, None, None],
                };
                self.string_indices = [bytes[14], bytes[15], bytes[16]];
            }
            2 => {
                self.fail(format!("a device descriptor of {} bytes", bytes.len()));
                return now + MILLISECOND;
            }
            3..=5 => self.identity.strings[step - 3] = Some(text(bytes)),
            6 if bytes.len() >= 9 => {
                self.port.packet = usize::from(u16::from_le_bytes([bytes[2], bytes[3]]));
            }
            7 => match cdc_port(bytes) {
                Ok(port) => self.port = port,
                Err(why) => {
                    self.fail(why);
                    return now + MILLISECOND;
                }
            },
            9 => {
                self.phase = Phase::Configured;
                (self.in_toggle, self.out_toggle, self.notify_toggle) = (false, false, false);
                self.counts.enumerations += 1;
                return now;
            }
            _ => {}
        }
        self.enumerate(step + 1, now)
    }
}
