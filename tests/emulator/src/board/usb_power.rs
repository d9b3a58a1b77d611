//! The switch of the 5 V that the board gives to a device on its USB connector.

use rigless::mcu::Operate;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use super::machine::Machine;
use super::pins::register;
use super::plant::Nanos;
use super::world::World;

impl World {
    /// UM1472, UM1974: the switch puts the board's 5 V on the cable, against the PC that feeds it.
    /// Looks at it where the firmware has written to `address`, a register of its port.
    pub(super) fn watch_usb_power(&mut self, session: &mut Session<Machine>, at: Nanos, address: u64) {
        let (place, on) = self.wiring.pins.usb_power;
        if !(place.register(0)..place.register(0x400)).contains(&address) {
            return;
        }
        let mut bits = |offset, shift: u8| {
            let word = session.board_mut().mcu.peek(VirtualNanos(at), place.register(offset), Width::W32);
            word.unwrap_or_default() >> shift
        };
        let is_output = bits(register::MODE, 2 * place.index) & 0b11 == 0b01;
        if is_output && (bits(register::OUTPUT, place.index) & 1 != 0) == on {
            self.violations.push(format!("the USB connector's 5 V are on at {at} ns"));
        }
    }
}
