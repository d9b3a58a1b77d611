//! The information in a device's descriptors: USB 2.0 chapter 9 and CDC 1.2 section 5.

use serde::{Deserialize, Serialize};

/// The communications interface class, and the data interface class.
const CLASS_COMMUNICATIONS: u8 = 0x02;
const CLASS_DATA: u8 = 0x0A;

/// The device's description of itself.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// The vendor's number.
    pub vendor: u16,
    /// The product's number.
    pub product: u16,
    /// Manufacturer, product and serial number, where the device has the string.
    pub strings: [Option<String>; 3],
}

/// The endpoints of one CDC serial port.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CdcPort {
    /// The number of the communications interface, which class requests name.
    pub interface: u8,
    /// The value that selects the configuration.
    pub configuration: u8,
    /// The interrupt IN endpoint.
    pub notify: u8,
    /// The bulk IN endpoint.
    pub input: u8,
    /// The bulk OUT endpoint.
    pub output: u8,
    /// The packet size of the bulk OUT endpoint, in bytes.
    pub packet: usize,
}

/// Finds the serial port in a configuration descriptor, or says what is wrong with it.
pub(super) fn cdc_port(bytes: &[u8]) -> Result<CdcPort, String> {
    let mut port = CdcPort::default();
    let mut class = 0;
    let mut rest = bytes;
    while let Some(&length) = rest.first() {
        let length = usize::from(length);
        if length < 2 || length > rest.len() {
            return Err(format!("a descriptor of {length} bytes where {} are left", rest.len()));
        }
        let (item, after) = rest.split_at(length);
        match (item[1], item.len()) {
            (2, 9..) => port.configuration = item[5],
            (4, 9..) => {
                class = item[5];
                if class == CLASS_COMMUNICATIONS {
                    port.interface = item[2];
                }
            }
            (5, 7..) => {
                let (address, kind) = (item[2], item[3] & 0b11);
                let number = address & 0x0F;
                match (class, address & 0x80 != 0, kind) {
                    (CLASS_COMMUNICATIONS, true, 3) => port.notify = number,
                    (CLASS_DATA, true, 2) => port.input = number,
                    (CLASS_DATA, false, 2) => {
                        port.output = number;
                        port.packet = usize::from(u16::from_le_bytes([item[4], item[5]]));
                    }
                    _ => {}
                }
            }
            _ => {}
        }
        rest = after;
    }
    if port.notify == 0 || port.input == 0 || port.output == 0 {
        return Err(format!("no CDC serial port in the configuration: {port:?}"));
    }
    Ok(port)
}

/// The text of a string descriptor.
pub(super) fn text(bytes: &[u8]) -> String {
    let units = bytes.get(2..).unwrap_or_default();
    let units: Vec<u16> = units.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
    String::from_utf16_lossy(&units)
}
