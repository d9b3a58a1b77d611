//! The USB core of the part with the cable of a virtual host in it.

use rigless::chip::parallel::Peer;
use rigless::device::{DeviceContext, Level};
use rigless::soc::Width;
use rigless::time::{EventId, VirtualNanos};
use serde::{Deserialize, Serialize};

use super::otg::Core;
use crate::usb_host::Host;

/// The one interrupt of the window: `OTG_FS`, line 67.
pub(super) const INTERRUPTS: [u16; 1] = [67];

/// Core and host.
#[derive(Debug, Default, Serialize, Deserialize)]
pub struct UsbPort {
    /// The device side, which the firmware programs.
    pub core: Core,
    /// The host side, which the test drives.
    pub host: Host,
    next: Option<EventId>,
    line: bool,
}

impl UsbPort {
    fn settle(&mut self, context: &mut DeviceContext<'_>) {
        let line = self.core.line();
        if line != self.line {
            self.line = line;
            context.interrupt(0, Level::from(line));
        }
    }
}

rigless::store!(UsbPort);

impl Peer for UsbPort {
    fn read(&mut self, offset: u64, _width: Width, context: &mut DeviceContext<'_>) -> u64 {
        let value = self.core.read(offset).into();
        self.settle(context);
        value
    }

    fn write(&mut self, offset: u64, _width: Width, value: u64, context: &mut DeviceContext<'_>) {
        self.core.write(offset, value as u32);
        self.settle(context);
    }

    fn on_event(&mut self, event: EventId, context: &mut DeviceContext<'_>) {
        if self.next == Some(event) {
            let next = self.host.advance(context.now().0, &mut self.core);
            self.next = Some(context.schedule(VirtualNanos(next)));
            self.settle(context);
        }
    }

    fn poll(&mut self, context: &mut DeviceContext<'_>) {
        // A reset of the part drops every event; the host on the cable goes on.
        if self.next.is_none() {
            self.next = Some(context.schedule(context.now()));
        }
    }

    fn reset(&mut self) {
        self.core.restart();
        self.next = None;
        self.line = false;
    }
}
