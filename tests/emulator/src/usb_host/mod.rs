//! A USB host with a CDC serial driver, as a state machine over [`wire::Device`].
//!
//! It does what a PC does when the plug goes in: debounce, reset, read the descriptors, set an
//! address and a configuration, set the line; then it carries two byte streams. An application may
//! open and close the port, stop reading, suspend the bus, pull the plug and put it back. It knows
//! neither the emulator nor the device at the far end.

mod control;
pub mod descriptors;
mod enumeration;
mod state;
pub mod wire;

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use control::{Ended, Transfer};
use descriptors::{CdcPort, Identity};
use wire::{Device, Handshake};

pub use state::{Counts, Port};

/// Virtual time, in nanoseconds.
type Nanos = u64;

const MILLISECOND: Nanos = 1_000_000;
/// The wait of a host between seeing a device and resetting it; USB 2.0 section 7.1.7.3.
const DEBOUNCE: Nanos = 100 * MILLISECOND;
/// The length of a reset, and of the device's recovery; section 7.1.7.5.
const RESET: Nanos = 50 * MILLISECOND;
const RECOVERY: Nanos = 10 * MILLISECOND;
/// The length of a resume, with the recovery after it; section 7.1.7.7.
const RESUME: Nanos = 30 * MILLISECOND;
/// A bus without a start of frame for this long is suspended; section 7.1.7.6.
const IDLE: Nanos = 3 * MILLISECOND;
/// A host gives a control transfer this long.
const PATIENCE: Nanos = 5_000 * MILLISECOND;
/// A NAK is followed by the next token after this long.
const NAK_WAIT: Nanos = 25_000;
/// The period in which the interrupt endpoint is polled.
const NOTIFY_EVERY: Nanos = 16 * MILLISECOND;

/// The most endpoint 0 of a full-speed device may take at once, in bytes; a host assumes it until
/// it has read the first eight bytes of the device descriptor.
const CONTROL_PACKET: usize = 64;

/// The wire time of a transaction with `bytes` of payload: 12 Mbit/s, three packets' overhead.
fn wire_time(bytes: usize) -> Nanos {
    (bytes as u64 + 16) * 8 * 1_000 / 12
}

#[derive(Debug, Serialize, Deserialize)]
enum Phase {
    Absent,
    Debounce(Nanos),
    Reset(Nanos),
    Recovery(Nanos),
    Enumerating(usize, Transfer, Nanos),
    Configured,
    Suspended,
    Resuming(Nanos),
    Failed(String),
}

/// The host.
#[derive(Debug, Serialize, Deserialize)]
pub struct Host {
    cable: bool,
    sleep: bool,
    line_state: Option<bool>,
    open: bool,
    reading: bool,
    phase: Phase,
    address: u8,
    /// The packet size of endpoint 0, in bytes.
    control_packet: usize,
    identity: Identity,
    string_indices: [u8; 3],
    port: CdcPort,
    request: Option<(Transfer, Nanos)>,
    frame: u16,
    frame_at: Nanos,
    idle_at: Option<Nanos>,
    notify_at: Nanos,
    in_toggle: bool,
    out_toggle: bool,
    notify_toggle: bool,
    in_turn: bool,
    output: VecDeque<u8>,
    input: VecDeque<u8>,
    counts: Counts,
}

impl Default for Host {
    fn default() -> Self {
        Self {
            cable: false,
            sleep: false,
            line_state: None,
            open: false,
            reading: true,
            phase: Phase::Absent,
            address: 0,
            control_packet: CONTROL_PACKET,
            identity: Identity::default(),
            string_indices: [0; 3],
            port: CdcPort::default(),
            request: None,
            frame: 0,
            frame_at: 0,
            idle_at: None,
            notify_at: 0,
            in_toggle: false,
            out_toggle: false,
            notify_toggle: false,
            in_turn: false,
            output: VecDeque::new(),
            input: VecDeque::new(),
            counts: Counts::default(),
        }
    }
}

impl Host {
    /// Puts the plug in.
    pub fn plug(&mut self) {
        self.cable = true;
        self.sleep = false;
    }

    /// Pulls the plug. What the application had not yet sent or read is gone.
    pub fn unplug(&mut self) {
        self.cable = false;
    }

    /// Stops the frames, as a laptop does when its lid is closed.
    pub fn suspend(&mut self) {
        self.sleep = true;
    }

    /// Wakes the bus.
    pub fn resume(&mut self) {
        self.sleep = false;
    }

    /// The application opens the port: DTR and RTS rise and it starts to read.
    pub fn open(&mut self) {
        self.line_state = Some(true);
    }

    /// The application closes the port.
    pub fn close(&mut self) {
        self.line_state = Some(false);
    }

    /// Sets whether an open application also reads; one that hangs does not.
    pub fn set_reading(&mut self, reading: bool) {
        self.reading = reading;
    }

    /// Queues bytes for the device.
    pub fn write(&mut self, bytes: &[u8]) {
        self.output.extend(bytes);
    }

    /// The bytes still queued for the device.
    #[must_use]
    pub fn unsent(&self) -> usize {
        self.output.len()
    }

    /// Takes every byte the device has sent.
    pub fn read(&mut self) -> Vec<u8> {
        self.input.drain(..).collect()
    }

    /// Returns the state of the port.
    #[must_use]
    pub fn port(&self) -> Port {
        match &self.phase {
            Phase::Absent => Port::Absent,
            Phase::Configured => Port::Configured,
            Phase::Suspended | Phase::Resuming(_) => Port::Suspended,
            Phase::Failed(why) => Port::Failed(why.clone()),
            _ => Port::Enumerating,
        }
    }

    /// True if the port is present, open, and the device knows it.
    #[must_use]
    pub fn is_open(&self) -> bool {
        self.open && self.port() == Port::Configured
    }

    /// Returns the device's description of itself at the last enumeration.
    #[must_use]
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Returns the counts.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Does what is due at `now` and answers when the next thing is.
    pub fn advance(&mut self, now: Nanos, device: &mut dyn Device) -> Nanos {
        if let Some(idle) = self.idle_at
            && now >= idle
        {
            self.idle_at = None;
            device.bus_idle();
        }
        let gone = !self.cable || !device.pulls_up();
        if gone && !matches!(self.phase, Phase::Absent) {
            if self.cable {
                self.counts.disconnects += 1;
            } else {
                self.idle_at = Some(now + IDLE);
            }
            self.drop_port();
        }
        let next = match &self.phase {
            Phase::Absent if gone => now + MILLISECOND,
            Phase::Absent => self.wait(Phase::Debounce, now + DEBOUNCE),
            Phase::Debounce(at) if now >= *at => {
                self.idle_at = None;
                device.bus_reset();
                self.wait(Phase::Reset, now + RESET)
            }
            Phase::Reset(at) if now >= *at => {
                device.reset_over();
                self.frame_at = now;
                self.address = 0;
                self.control_packet = CONTROL_PACKET;
                self.wait(Phase::Recovery, now + RECOVERY)
            }
            Phase::Recovery(at) if now >= *at => self.enumerate(0, now),
            Phase::Debounce(at) | Phase::Reset(at) | Phase::Recovery(at) => *at,
            Phase::Enumerating(..) => self.enumeration(now, device),
            Phase::Configured if self.sleep => {
                self.phase = Phase::Suspended;
                self.idle_at = Some(now + IDLE);
                now + IDLE
            }
            Phase::Configured => self.transact(now, device),
            Phase::Suspended if self.sleep => now + MILLISECOND,
            Phase::Suspended => {
                if self.idle_at.take().is_none() {
                    device.resume();
                }
                self.wait(Phase::Resuming, now + RESUME)
            }
            Phase::Resuming(at) if now >= *at => {
                self.phase = Phase::Configured;
                self.frame_at = now;
                now
            }
            Phase::Resuming(at) => *at,
            Phase::Failed(_) => now + MILLISECOND,
        };
        let next = self.frames(now, device, next);
        self.idle_at.map_or(next, |idle| next.min(idle)).max(now + 1)
    }

    fn wait(&mut self, phase: fn(Nanos) -> Phase, until: Nanos) -> Nanos {
        self.phase = phase(until);
        until
    }

    /// Starts of frame, while the bus is awake.
    fn frames(&mut self, now: Nanos, device: &mut dyn Device, next: Nanos) -> Nanos {
        let awake = matches!(self.phase, Phase::Recovery(_) | Phase::Enumerating(..) | Phase::Configured);
        if !awake {
            return next;
        }
        if now >= self.frame_at {
            self.frame = self.frame.wrapping_add(1) & 0x7FF;
            self.frame_at += MILLISECOND;
            device.start_of_frame(self.frame);
        }
        next.min(self.frame_at)
    }

    fn drop_port(&mut self) {
        self.phase = Phase::Absent;
        self.open = false;
        self.line_state = None;
        self.request = None;
        self.output.clear();
    }

    fn fail(&mut self, why: String) {
        self.phase = Phase::Failed(why);
    }

    /// One transaction of a configured port.
    fn transact(&mut self, now: Nanos, device: &mut dyn Device) -> Nanos {
        if let Some(state) = self.line_state.take() {
            let interface = self.port.interface;
            let request = [0x21, 0x22, if state { 3 } else { 0 }, 0, interface, 0, 0, 0];
            self.request = Some((Transfer::new(request, &[], self.control_packet), now + PATIENCE));
            self.open = state;
        }
        if let Some((transfer, until)) = &mut self.request {
            let ended = if now >= *until { Ended::Dead } else { transfer.step(device, self.address) };
            return match ended {
                Ended::Running { nak } => now + if nak { NAK_WAIT } else { wire_time(8) },
                Ended::Done(_) | Ended::Stalled => {
                    self.request = None;
                    now + wire_time(0)
                }
                Ended::Dead => {
                    self.fail("the device did not answer a control request".to_owned());
                    now + MILLISECOND
                }
            };
        }
        if !self.open {
            return self.frame_at;
        }
        if now >= self.notify_at {
            self.notify_at = now + NOTIFY_EVERY;
            if let Handshake::Data(_, toggle) = device.input(self.address, self.port.notify) {
                self.notify_toggle = !toggle;
            }
            return now + wire_time(8);
        }
        // Both streams get their turn; a turn with nothing to do passes to the other.
        self.in_turn = !self.in_turn;
        let first = if self.in_turn { self.bulk_in(device) } else { self.bulk_out(device) };
        let moved = first.or_else(|| if self.in_turn { self.bulk_out(device) } else { self.bulk_in(device) });
        now + moved.map_or(NAK_WAIT, wire_time)
    }

    /// Asks for a packet; answers its bytes when one came.
    fn bulk_in(&mut self, device: &mut dyn Device) -> Option<usize> {
        if !self.reading {
            return None;
        }
        match device.input(self.address, self.port.input) {
            Handshake::Data(packet, toggle) => {
                if toggle == self.in_toggle {
                    self.in_toggle = !self.in_toggle;
                    self.counts.bytes_in += packet.len() as u64;
                    self.input.extend(&packet);
                } else {
                    self.counts.toggle_errors += 1;
                }
                Some(packet.len())
            }
            other => self.note(&other),
        }
    }

    /// Sends a packet; answers its bytes when the device took it.
    fn bulk_out(&mut self, device: &mut dyn Device) -> Option<usize> {
        let bytes = self.output.len().min(self.port.packet);
        if bytes == 0 {
            return None;
        }
        let packet: Vec<u8> = self.output.iter().take(bytes).copied().collect();
        match device.out(self.address, self.port.output, &packet, self.out_toggle) {
            Handshake::Ack => {
                self.out_toggle = !self.out_toggle;
                self.output.drain(..bytes);
                self.counts.bytes_out += bytes as u64;
                Some(bytes)
            }
            other => self.note(&other),
        }
    }

    fn note(&mut self, answer: &Handshake) -> Option<usize> {
        match answer {
            Handshake::Silence => self.counts.silences += 1,
            Handshake::Stall => self.counts.stalls += 1,
            _ => {}
        }
        None
    }
}
