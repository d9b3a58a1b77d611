//! The USB task: packets from the port to the queue and back. It knows nothing of frames.

use super::queues::{Packet, UsbEnds};
use super::shared::{self, LINK_CONFIGURED, LINK_READY};
use crate::board::usb::{Bus, stop_interrupt};
use core::sync::atomic::Ordering::Relaxed;
use cortex_m::peripheral::DWT;
use firmware::supervision::Task;
use link::frames::Stage;
use stm32f4xx_hal::pac::Interrupt;
use usb_device::device::{UsbDevice, UsbDeviceState};
use usbd_serial::CdcAcmClass;

/// The USB task's own state.
pub(crate) struct Port {
    device: UsbDevice<'static, Bus>,
    class: CdcAcmClass<'static, Bus>,
    ends: UsbEnds,
    /// The last packet was full: the host waits for a shorter one to end the transfer.
    end_due: bool,
}

impl Port {
    /// Serves `class` on `device`.
    pub(crate) fn new(
        device: UsbDevice<'static, Bus>,
        class: CdcAcmClass<'static, Bus>,
        ends: UsbEnds,
    ) -> Self {
        Self { device, class, ends, end_due: false }
    }

    /// One look at the core. What remains keeps the interrupt up, which brings us back.
    pub(crate) fn run(&mut self) {
        let entered = DWT::cycle_count();
        self.device.poll(&mut [&mut self.class]);
        let is_configured = self.device.state() == UsbDeviceState::Configured;
        let link =
            if is_configured { LINK_CONFIGURED } else { 0 } | if self.class.dtr() { LINK_READY } else { 0 };
        shared::LINK.store(link, Relaxed);
        if shared::DISCARD.swap(false, Relaxed) || !is_configured {
            while self.ends.to_pc.dequeue().is_some() {}
            self.end_due = false;
        }
        self.receive();
        if is_configured {
            self.send();
        }
        shared::REPORTS.alive(Task::Usb);
        shared::STAGES.note(Stage::Usb, DWT::cycle_count().wrapping_sub(entered));
    }

    fn receive(&mut self) {
        if !self.ends.from_pc.ready() {
            // The packet stays with the core, which makes the PC wait, and keeps its interrupt up: without this it would
            // bring us back at once, and telemetry, which makes room, would never run.
            stop_interrupt();
            return;
        }
        let mut packet = Packet::new();
        // Room for any packet: resizing to the capacity cannot fail.
        let _ = packet.resize_default(packet.capacity());
        if let Ok(length) = self.class.read_packet(&mut packet) {
            packet.truncate(length);
            let _ = self.ends.from_pc.enqueue(packet);
            rtic::pend(Interrupt::USART2);
        }
    }

    fn send(&mut self) {
        while let Some(packet) = self.ends.to_pc.peek() {
            if self.class.write_packet(packet).is_err() {
                return;
            }
            self.end_due = packet.is_full();
            let _ = self.ends.to_pc.dequeue();
        }
        if self.end_due && self.class.write_packet(&[]).is_ok() {
            self.end_due = false;
        }
    }
}
