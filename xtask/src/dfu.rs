//! ST's DfuSe file (UM0391): an image with its address, which the bootloader's tools take without
//! further words.

/// The bootloader that the microcontroller has in ROM: its vendor and product on USB.
const VENDOR: u16 = 0x0483;
const PRODUCT: u16 = 0xDF11;
/// The version of the DFU file format that ST's extension has (UM0391, DFU suffix).
const FORMAT: u16 = 0x011A;

/// Returns a file with one image, of `bytes` from the address `start` on, for a target of this
/// name.
pub(crate) fn file(name: &str, start: u32, bytes: &[u8]) -> Vec<u8> {
    let element_bytes = 8 + bytes.len();
    let target_bytes = 274 + element_bytes;
    let mut file = Vec::with_capacity(11 + target_bytes + 16);
    // Prefix: signature, version, size of all but the suffix, one target.
    file.extend(b"DfuSe");
    file.push(1);
    file.extend(((11 + target_bytes) as u32).to_le_bytes());
    file.push(1);
    // Target: signature, alternate setting 0 (the internal flash), a name of 255 bytes, size, one
    // element.
    file.extend(b"Target");
    file.push(0);
    file.extend(1_u32.to_le_bytes());
    let mut padded = [0; 255];
    padded.iter_mut().zip(name.bytes().take(254)).for_each(|(place, byte)| *place = byte);
    file.extend(padded);
    file.extend((element_bytes as u32).to_le_bytes());
    file.extend(1_u32.to_le_bytes());
    // Element: address, size, the image.
    file.extend(start.to_le_bytes());
    file.extend((bytes.len() as u32).to_le_bytes());
    file.extend(bytes);
    // Suffix: device version (any), product, vendor, format, signature, its length, checksum of all
    // before.
    for number in [0xFFFF, PRODUCT, VENDOR, FORMAT] {
        file.extend(number.to_le_bytes());
    }
    file.extend(b"UFD");
    file.push(16);
    let checksum = crc(&file);
    file.extend(checksum.to_le_bytes());
    file
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

#[cfg(test)]
mod tests {
    use super::*;
    use board_wasm::dfu::file::Image;

    /// The check value that every catalogue gives for CRC-32/JAMCRC.
    #[test]
    fn the_checksum_is_jamcrc() {
        assert_eq!(crc(b"123456789"), 0x340B_C6D9);
    }

    /// Written and read by different hands: the page checks prefix, target, element and suffix by
    /// their place in UM0391.
    #[test]
    fn the_page_of_a_board_reads_the_file() {
        let bytes: Vec<u8> = (0..5_000_u32).map(|n| ((n * 7) >> 3) as u8).collect();
        let image = Image::parse(&file("BOARD", 0x0800_4000, &bytes)).expect("it is sound");
        assert_eq!(image, Image { target: "BOARD".into(), start: 0x0800_4000, bytes });
    }

    #[test]
    fn the_sizes_in_the_file_are_its_own() {
        let file = file("BOARD", 0x0800_0000, &[1, 2, 3]);
        assert_eq!(file.len(), 11 + 274 + 8 + 3 + 16);
        assert_eq!(file[6..10], ((file.len() - 16) as u32).to_le_bytes());
        assert_eq!(file[file.len() - 8..file.len() - 4], *b"UFD\x10");
    }
}
