//! The record of a commissioned device: its part of the configuration, sealed by the device itself.

use crate::codec;
use control_core::Device;
use serde::{Deserialize, Serialize};

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
        Self { device: *device, seal: codec::hash(&(device, serial)) }
    }

    /// True if the device with this number has sent it.
    pub fn is_of(&self, serial: [u8; 12]) -> bool {
        *self == Self::of(&self.device, serial)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seal_is_of_one_device_and_one_record() {
        let record = Record::of(&Device::commissioned_virtual(), [1; 12]);
        assert!(record.is_of([1; 12]));
        assert!(!record.is_of([2; 12]));
        let edited = Device { dac_zero: 1, ..record.device };
        assert!(!Record { device: edited, ..record }.is_of([1; 12]));
    }
}
