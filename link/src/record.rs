//! The record of a commissioned device: its part of the configuration, sealed by the device itself.

use crate::codec::{self, MAX_FRAME};
use control_core::Device;
use serde::{Deserialize, Serialize};

/// The bytes of [`Device::sensors`] and [`Device::torque_uncertainty`] where nothing is known of
/// them, which no record had up to protocol 9.
const ADDED: [u8; 3] = [0; 3];

/// The device's part of the configuration, under the seal of the device that reported it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Record {
    /// The device's part.
    pub device: Device,
    /// CRC-32 of the device's part and the number of the device. It distinguishes a file of another
    /// device, and one that was edited, from this one's. It is no secret: a program that forges it
    /// gets past this check, but not past the board's ceilings.
    pub seal: u32,
}

impl Record {
    /// Returns the record that the device with this number sends.
    pub fn of(device: &Device, serial: [u8; 12]) -> Self {
        Self { device: *device, seal: seal(device, serial) }
    }

    /// True if the device with this number has sent it.
    pub fn is_of(&self, serial: [u8; 12]) -> bool {
        *self == Self::of(&self.device, serial)
    }
}

/// The seal of a device that knows nothing of the fields added since is the one that it had before:
/// an older record is still the device's own.
fn seal(device: &Device, serial: [u8; 12]) -> u32 {
    let mut plain = [0; MAX_FRAME];
    // A device always fits: a frame holds more than one.
    let bytes = postcard::to_slice(device, &mut plain).map_or(&[][..], |bytes| bytes);
    codec::check([bytes.strip_suffix(&ADDED).unwrap_or(bytes), &serial])
}

#[cfg(test)]
mod tests {
    use super::*;
    use control_core::config::Sensors;

    /// The seal of serial number 1, 1, … on the default device, as protocol 9 made it.
    #[test]
    fn a_seal_of_protocol_9_is_still_the_devices_own() {
        let old = Record { device: Device::commissioned_virtual(), seal: 0xE9B1_3168 };
        assert!(old.is_of([1; 12]), "{:#x}", Record::of(&old.device, [1; 12]).seal);
        let sensors = Sensors { encoder_supply: true, current: false };
        assert!(!Record { device: Device { sensors, ..old.device }, ..old }.is_of([1; 12]));
    }

    #[test]
    fn a_seal_is_of_one_device_and_one_record() {
        let record = Record::of(&Device::commissioned_virtual(), [1; 12]);
        assert!(record.is_of([1; 12]));
        assert!(!record.is_of([2; 12]));
        let edited = Device { dac_zero: 1, ..record.device };
        assert!(!Record { device: edited, ..record }.is_of([1; 12]));
    }
}
