//! The core against a driver and a host written out by hand, register by register.

use super::*;
use crate::usb_host::wire::Handshake;
use crate::usb_host::{Host, Port};

const SETUP: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 64, 0];

/// A core as a driver leaves it after a bus reset: FIFOs cut, endpoints 0 and 1 on.
fn ready() -> Core {
    let mut core = Core::default();
    core.write(GCCFG, GCCFG_PWRDWN | GCCFG_NOVBUSSENS);
    core.write(GAHBCFG, GAHBCFG_GINT);
    core.write(GRXFSIZ, 64);
    core.write(DIEPTXF0, 16 << 16 | 64);
    core.write(DIEPTXF1, 32 << 16 | 80);
    core.write(DIEPCTL0, SNAK);
    core.write(DOEPCTL0 + EP_TSIZ, 1 << 29 | 1 << 19 | 64);
    core.write(DOEPCTL0, EPENA | CNAK);
    let bulk = USBAEP | 0b10 << 18 | SD0PID | 64;
    core.write(DIEPCTL0 + ENDPOINT_STRIDE, bulk | SNAK | 1 << 22);
    core.write(DOEPCTL0 + ENDPOINT_STRIDE, bulk | CNAK | EPENA);
    core
}

#[test]
fn a_setup_packet_comes_out_of_the_fifo_with_its_status() {
    let mut core = ready();
    core.write(GINTMSK, RXFLVL);
    assert!(!core.line());
    assert_eq!(core.setup(0, 0, SETUP), Handshake::Ack);
    assert!(core.line(), "the receive FIFO is not empty");
    assert_eq!(core.read(GRXSTSR) >> 17 & 0xF, PKTSTS_SETUP_DATA);
    assert_eq!(core.read(GRXSTSP) >> 4 & 0x7FF, 8);
    assert_eq!(core.read(FIFO0).to_le_bytes(), SETUP[..4]);
    assert_eq!(core.read(FIFO0 + FIFO_STRIDE).to_le_bytes(), SETUP[4..]);
    assert!(!core.line());
    // The SETUP stage is over with the first token that isn't another SETUP.
    assert_eq!(core.input(0, 0), Handshake::Nak);
    assert_eq!(core.read(GRXSTSP) >> 17 & 0xF, PKTSTS_SETUP_COMPLETE);
    assert_eq!(core.read(DOEPCTL0 + EP_INT) & STUP, STUP);
}

#[test]
fn an_in_packet_goes_out_once_it_is_whole() {
    let mut core = ready();
    let endpoint = DIEPCTL0 + ENDPOINT_STRIDE;
    assert_eq!(core.read(endpoint + EP_TXFSTS), 32);
    core.write(endpoint + EP_TSIZ, 1 << 19 | 6);
    core.write(endpoint, core.in_endpoints[1].control | EPENA | CNAK);
    core.write(FIFO0 + FIFO_STRIDE, 0x0403_0201);
    assert_eq!(core.input(0, 1), Handshake::Nak, "two bytes are missing");
    core.write(FIFO0 + FIFO_STRIDE, 0x0000_0605);
    assert_eq!(core.read(endpoint + EP_TXFSTS), 30);
    assert_eq!(core.input(0, 1), Handshake::Data(vec![1, 2, 3, 4, 5, 6], false));
    assert_eq!(core.read(endpoint + EP_INT) & XFRC, XFRC);
    assert_eq!(core.read(endpoint) & EPENA, 0);
    assert_eq!(core.input(0, 1), Handshake::Nak);
}

#[test]
fn an_out_endpoint_takes_one_transfer_until_it_is_enabled_again() {
    let mut core = ready();
    assert_eq!(core.out(0, 1, &[7; 64], false), Handshake::Ack);
    assert_eq!(core.out(0, 1, &[7; 64], false), Handshake::Ack, "a repeated packet is taken and dropped");
    assert_eq!(core.out(0, 1, &[8; 3], true), Handshake::Nak);
    assert_eq!(core.read(GRXSTSP) >> 4 & 0x7FF, 64);
    (0..16).for_each(|_| assert_eq!(core.read(FIFO0), 0x0707_0707));
    assert_eq!(core.read(GRXSTSP) >> 17 & 0xF, PKTSTS_OUT_COMPLETE);
    let endpoint = DOEPCTL0 + ENDPOINT_STRIDE;
    core.write(endpoint, core.out_endpoints[1].control | EPENA | CNAK);
    assert_eq!(core.out(0, 1, &[8; 3], true), Handshake::Ack);
}

#[test]
fn packets_beyond_the_receive_fifo_wait() {
    let mut core = ready();
    core.write(GRXFSIZ, 18);
    assert_eq!(core.out(0, 1, &[7; 64], false), Handshake::Ack);
    let endpoint = DOEPCTL0 + ENDPOINT_STRIDE;
    core.write(endpoint, core.out_endpoints[1].control | EPENA | CNAK);
    assert_eq!(core.out(0, 1, &[7; 64], true), Handshake::Nak);
}

#[test]
fn overfull_transmit_fifos_and_packet_memory_are_noted() {
    let mut core = ready();
    (0..33).for_each(|_| core.write(FIFO0 + FIFO_STRIDE, 0));
    core.write(GRXFSIZ, 320);
    let (overruns, excess) = core.misuse();
    assert_eq!(overruns, 1);
    assert!(excess > 0);
}

#[test]
fn a_new_address_is_answered_once_the_old_one_has_its_status() {
    let mut core = ready();
    assert_eq!(core.setup(0, 0, [0, 5, 9, 0, 0, 0, 0, 0]), Handshake::Ack);
    core.write(DCFG, 9 << 4);
    assert_eq!(core.input(0, 0), Handshake::Nak, "the status stage is asked for at the old address");
    assert_eq!(core.setup(0, 0, SETUP), Handshake::Silence);
    assert_eq!(core.setup(9, 0, SETUP), Handshake::Ack);
    assert_eq!(core.input(0, 0), Handshake::Silence);
}

#[test]
fn a_halted_endpoint_stalls_until_it_is_cleared() {
    let mut core = ready();
    let endpoint = DIEPCTL0 + ENDPOINT_STRIDE;
    core.write(endpoint, core.in_endpoints[1].control | STALL);
    assert_eq!(core.input(0, 1), Handshake::Stall);
    core.write(endpoint, core.in_endpoints[1].control & !STALL);
    assert_eq!(core.input(0, 1), Handshake::Nak);
}

#[test]
fn a_disconnected_core_is_not_on_the_bus() {
    let mut core = ready();
    assert!(core.pulls_up());
    core.write(DCTL, DCTL_SDIS);
    assert!(!core.pulls_up());
    assert_eq!(core.setup(0, 0, SETUP), Handshake::Silence);
}

#[test]
fn a_soft_reset_clears_interrupts_and_keeps_the_transceiver() {
    let mut core = ready();
    core.bus_reset();
    assert_eq!(core.read(GINTSTS) & USBRST, USBRST);
    core.write(GRSTCTL, GRSTCTL_CSRST);
    assert_eq!(core.read(GRSTCTL), GRSTCTL_AHBIDL);
    assert_eq!(core.read(GINTSTS) & USBRST, 0);
    assert!(core.pulls_up());
}

/// A device that only NAKs is given up after five seconds, with a reason a person can read.
#[test]
fn a_host_gives_up_on_a_device_that_never_answers() {
    let (mut host, mut core) = (Host::default(), ready());
    host.plug();
    let mut now = 0;
    while now < 6_000_000_000 {
        now = host.advance(now, &mut core);
        // The firmware that would answer empties the FIFO at least.
        while !core.receive.is_empty() {
            core.read(GRXSTSP);
        }
    }
    let Port::Failed(why) = host.port() else { panic!("{:?}", host.port()) };
    assert!(why.contains("five seconds"), "{why}");
}

#[test]
fn a_host_that_stops_its_frames_suspends_the_device() {
    let mut core = ready();
    core.bus_idle();
    assert_eq!(core.read(GINTSTS) & USBSUSP, USBSUSP);
    assert_eq!(core.read(DSTS) & 1, 1);
    core.write(GINTSTS, USBSUSP);
    core.resume();
    assert_eq!(core.read(GINTSTS) & (USBSUSP | WKUPINT), WKUPINT);
    assert_eq!(core.read(DSTS) & 1, 0);
}
