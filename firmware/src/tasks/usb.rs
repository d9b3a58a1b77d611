//! The USB task: packets from the port to the queue and back. It knows nothing of frames.

use super::queues::{Packet, UsbEnds};
use super::shared::{LINK_CONFIGURED, LINK_READY, Shared};
use crate::port::{Board, SerialPort};
use crate::supervision::Task;
use core::sync::atomic::Ordering::Relaxed;
use link::frames::Stage;

/// The USB task's own state.
pub struct Port<B: Board> {
    shared: &'static Shared,
    serial: B::Serial,
    ends: UsbEnds,
    /// The last packet was full: the host waits for a shorter one to end the transfer.
    end_due: bool,
}

impl<B: Board> Port<B> {
    /// Serves `serial`.
    pub fn new(shared: &'static Shared, serial: B::Serial, ends: UsbEnds) -> Self {
        Self { shared, serial, ends, end_due: false }
    }

    /// One look at the core. What remains keeps the interrupt up, which brings us back.
    pub fn run(&mut self) {
        let entered = B::cycles();
        self.serial.poll();
        let is_configured = self.serial.is_configured();
        let link = if is_configured { LINK_CONFIGURED } else { 0 }
            | if self.serial.is_open() { LINK_READY } else { 0 };
        self.shared.link.store(link, Relaxed);
        if self.shared.discard.swap(false, Relaxed) || !is_configured {
            while self.ends.to_pc.dequeue().is_some() {}
            self.end_due = false;
        }
        self.receive();
        if is_configured {
            self.send();
        }
        self.shared.reports.alive(Task::Usb);
        self.shared.stages.note(Stage::Usb, B::cycles().wrapping_sub(entered));
    }

    fn receive(&mut self) {
        if !self.ends.from_pc.ready() {
            // The packet stays with the core, which makes the PC wait, and keeps its interrupt up:
            // without this it would bring us back at once, and telemetry, which makes room, would
            // never run.
            B::allow_usb(false);
            return;
        }
        let mut packet = Packet::new();
        // Room for any packet: resizing to the capacity cannot fail.
        let _ = packet.resize_default(packet.capacity());
        if let Ok(length) = self.serial.read(&mut packet) {
            packet.truncate(length);
            let _ = self.ends.from_pc.enqueue(packet);
            B::wake_telemetry();
        }
    }

    fn send(&mut self) {
        while let Some(packet) = self.ends.to_pc.peek() {
            if self.serial.write(packet).is_err() {
                return;
            }
            self.end_due = packet.is_full();
            let _ = self.ends.to_pc.dequeue();
        }
        if self.end_due && self.serial.write(&[]).is_ok() {
            self.end_due = false;
        }
    }
}
