//! ST's DfuSe file (UM0391), as `cargo xtask dist` writes it: one image with its address, under a
//! checksum.

use device_sim::error::Error;

const PREFIX: usize = 11;
const TARGET: usize = 274;
const ELEMENT: usize = 8;
const SUFFIX: usize = 16;
/// The bootloader's vendor and product on USB.
const VENDOR: u16 = 0x0483;
const PRODUCT: u16 = 0xDF11;

/// An image for the flash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// The board that it is for.
    pub target: String,
    /// Its first address.
    pub start: u32,
    /// Its bytes.
    pub bytes: Vec<u8>,
}

impl Image {
    /// Reads a file of one target with one element; what is wrong with it where something is.
    pub fn parse(file: &[u8]) -> Result<Self, Error> {
        let refuse = |what: &str| {
            Err(Error::input(format_args!(
                "the file is not one that cargo xtask dist writes: {what}; choose a .dfu file"
            )))
        };
        if file.len() <= PREFIX + TARGET + ELEMENT + SUFFIX || !file.starts_with(b"DfuSe\x01") {
            return refuse("it does not begin with DfuSe");
        }
        let (body, suffix) = file.split_at(file.len() - SUFFIX);
        if crc(&file[..file.len() - 4]) != number(&suffix[12..]) {
            return refuse("its checksum does not fit, so that it is damaged");
        }
        let half = |at: usize| u16::from_le_bytes([suffix[at], suffix[at + 1]]);
        if (half(2), half(4)) != (PRODUCT, VENDOR) {
            return refuse("it is for another bootloader");
        }
        let target = &body[PREFIX..];
        let has_one = body[10] == 1 && target.starts_with(b"Target") && number(&target[270..]) == 1;
        let element = &target[TARGET..];
        if !has_one || number(&element[4..]) as usize != element.len() - ELEMENT {
            return refuse("it does not hold one image");
        }
        let name = target[11..266].split(|byte| *byte == 0).next().unwrap_or_default();
        Ok(Self {
            target: String::from_utf8_lossy(name).into_owned(),
            start: number(element),
            bytes: element[ELEMENT..].to_vec(),
        })
    }

    /// The same image, filled up to whole blocks with what erased flash holds.
    #[must_use]
    pub fn in_blocks_of(mut self, bytes: usize) -> Self {
        self.bytes.resize(self.bytes.len().next_multiple_of(bytes), 0xFF);
        self
    }
}

/// The first four bytes as a number; the caller has looked that they are there.
fn number(bytes: &[u8]) -> u32 {
    bytes.iter().take(4).rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

/// The CRC-32 of Ethernet without its final inversion (USB DFU 1.1, appendix B).
fn crc(bytes: &[u8]) -> u32 {
    bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(
            crc ^ u32::from(*byte),
            |crc, _| if crc & 1 == 1 { crc >> 1 ^ 0xEDB8_8320 } else { crc >> 1 },
        )
    })
}
