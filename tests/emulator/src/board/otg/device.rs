//! The core as the host on the other end of the cable meets it.

use super::Core;
use super::registers::*;
use super::registers::{device::*, global::*};
use crate::usb_host::wire::{Device, Handshake};

impl Device for Core {
    fn pulls_up(&self) -> bool {
        // The transceiver is on, VBUS is not looked for on a pin that this board does not wire to
        // the core (34.16.3, NOVBUSSENS), the firmware configured the core, and it isn't
        // disconnected.
        self.stored(GCCFG) & (GCCFG_PWRDWN | GCCFG_NOVBUSSENS) == GCCFG_PWRDWN | GCCFG_NOVBUSSENS
            && self.stored(GAHBCFG) & GAHBCFG_GINT != 0
            && self.stored(DCTL) & DCTL_SDIS == 0
    }

    fn bus_reset(&mut self) {
        self.interrupts |= USBRST;
        self.suspended = false;
        self.setup_open = false;
        for endpoint in &mut self.in_endpoints[1..] {
            endpoint.control &= !USBAEP;
        }
        for endpoint in &mut self.out_endpoints[1..] {
            endpoint.control &= !USBAEP;
        }
    }

    fn reset_over(&mut self) {
        self.interrupts |= ENUMDNE;
    }

    fn start_of_frame(&mut self, frame: u16) {
        self.frame = frame & 0x3FFF;
        self.interrupts |= SOF;
    }

    fn bus_idle(&mut self) {
        self.suspended = true;
        self.interrupts |= ESUSP | USBSUSP;
    }

    fn resume(&mut self) {
        self.suspended = false;
        self.interrupts |= WKUPINT;
    }

    fn setup(&mut self, address: u8, endpoint: u8, request: [u8; 8]) -> Handshake {
        if address != self.address || endpoint != 0 || !self.pulls_up() {
            return Handshake::Silence;
        }
        if !self.receive.fits(8) {
            return Handshake::Silence;
        }
        self.address_before = self.address;
        // 34.17.5: a SETUP packet is taken whatever NAK says, sets NAK, and ends a halt.
        for control in [&mut self.in_endpoints[0].control, &mut self.out_endpoints[0].control] {
            *control = (*control & !STALL) | NAKSTS;
        }
        self.in_endpoints[0].toggle = true;
        self.out_endpoints[0].toggle = true;
        self.receive.push_setup(0, request);
        self.setup_open = true;
        Handshake::Ack
    }

    fn out(&mut self, address: u8, endpoint: u8, packet: &[u8], toggle: bool) -> Handshake {
        let Some(n) = self.addressed(address, endpoint) else { return Handshake::Silence };
        if n == 0 {
            self.end_setup();
        }
        let fits = self.receive.fits(packet.len());
        let endpoint = &mut self.out_endpoints[n];
        if n != 0 && endpoint.control & USBAEP == 0 {
            return Handshake::Silence;
        }
        if endpoint.control & STALL != 0 {
            return Handshake::Stall;
        }
        if toggle != endpoint.toggle {
            // The host missed our handshake and repeats a packet we have.
            return Handshake::Ack;
        }
        if endpoint.control & NAKSTS != 0 || endpoint.control & EPENA == 0 || !fits {
            return Handshake::Nak;
        }
        endpoint.toggle = !endpoint.toggle;
        let complete = endpoint.took(packet.len());
        self.receive.push_out(n, packet, toggle);
        if complete {
            self.receive.push_out_complete(n);
        }
        Handshake::Ack
    }

    fn input(&mut self, address: u8, endpoint: u8) -> Handshake {
        let Some(n) = self.addressed(address, endpoint) else { return Handshake::Silence };
        if n == 0 {
            self.end_setup();
        }
        let endpoint = &mut self.in_endpoints[n];
        if n != 0 && endpoint.control & USBAEP == 0 {
            return Handshake::Silence;
        }
        if endpoint.control & STALL != 0 {
            return Handshake::Stall;
        }
        if endpoint.control & NAKSTS != 0 || endpoint.control & EPENA == 0 {
            return Handshake::Nak;
        }
        let fifo = &mut self.transmit[endpoint.fifo()];
        let Some(packet) = fifo.packet(endpoint.next_packet()) else {
            endpoint.interrupts |= ITTXFE;
            return Handshake::Nak;
        };
        let toggle = endpoint.toggle;
        endpoint.sent(packet.len());
        Handshake::Data(packet, toggle)
    }
}
