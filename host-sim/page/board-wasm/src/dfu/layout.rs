//! The memory that a bootloader may write, as the name of its USB interface says it (UM0424):
//! `@Internal Flash  /0x08000000/04*016Kg,01*064Kg,07*128Kg`.

use super::file::Image;
use device_sim::error::Error;
use std::ops::Range;

/// The letter behind a size is 0x40 and these: erasable, writable.
const ERASABLE: u8 = 2;
const WRITABLE: u8 = 4;

/// The sectors of the flash, in the order of their addresses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    sectors: Vec<Sector>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Sector {
    range: Range<u64>,
    is_for_images: bool,
}

impl Layout {
    /// Reads the name of an interface.
    pub fn parse(name: &str) -> Result<Self, Error> {
        let refuse = || {
            Error::input(format_args!(
                "the device describes its memory as {name:?}, which is no STM32 in DFU mode; choose \"STM32 BOOTLOADER\""
            ))
        };
        let mut parts = name.strip_prefix('@').ok_or_else(refuse)?.split('/').skip(1);
        let mut sectors = Vec::new();
        while let Some(address) = parts.next() {
            let hex = address.trim().strip_prefix("0x").ok_or_else(refuse)?;
            let mut at = u64::from(u32::from_str_radix(hex, 16).map_err(|_| refuse())?);
            for group in parts.next().ok_or_else(refuse)?.split(',') {
                let (count, size, is_for_images) = read_group(group.trim()).ok_or_else(refuse)?;
                for _ in 0..count {
                    sectors.push(Sector { range: at..at + size, is_for_images });
                    at += size;
                }
            }
        }
        if sectors.is_empty() { Err(refuse()) } else { Ok(Self { sectors }) }
    }

    /// Returns the addresses of the sectors that hold an image, which are erased for it: no other
    /// is touched.
    pub fn sectors_of(&self, image: &Image) -> Result<Vec<u32>, Error> {
        let start = u64::from(image.start);
        let end = start + image.bytes.len() as u64;
        let touched =
            self.sectors.iter().filter(|sector| sector.range.start < end && start < sector.range.end);
        let touched: Vec<&Sector> = touched.collect();
        let held: u64 = touched
            .iter()
            .filter(|sector| sector.is_for_images)
            .map(|sector| sector.range.end.min(end) - sector.range.start.max(start))
            .sum();
        if held != end - start {
            return Err(Error::input(format_args!(
                "the image from {start:#010x} to {end:#010x} does not fit the memory of this device; choose the file of your board"
            )));
        }
        Ok(touched.iter().map(|sector| sector.range.start as u32).collect())
    }
}

/// `04*016Kg`: how many sectors, their size in bytes, and whether they are erased and written.
fn read_group(group: &str) -> Option<(u32, u64, bool)> {
    let (count, rest) = group.split_once('*')?;
    let unit_at = rest.find(|letter: char| !letter.is_ascii_digit())?;
    let (digits, unit) = rest.split_at(unit_at);
    let factor = match unit.as_bytes().first()? {
        b'K' => 1 << 10,
        b'M' => 1 << 20,
        b' ' | b'B' => 1,
        _ => return None,
    };
    let access = unit.as_bytes().get(1)? & 0x0F;
    let count = count.parse().ok().filter(|count| *count <= 4_096)?;
    let size = digits.parse::<u32>().ok().filter(|size| *size > 0)?;
    Some((count, u64::from(size) * factor, access & (ERASABLE | WRITABLE) == ERASABLE | WRITABLE))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DISCOVERY: &str = "@Internal Flash  /0x08000000/04*016Kg,01*064Kg,07*128Kg";

    fn image(start: u32, bytes: usize) -> Image {
        Image { target: String::new(), start, bytes: vec![0; bytes] }
    }

    #[test]
    fn an_image_is_in_the_sectors_that_it_touches() {
        let layout = Layout::parse(DISCOVERY).expect("as the bootloader of an F407 says it");
        let of = |start, bytes| layout.sectors_of(&image(start, bytes)).ok();
        assert_eq!(of(0x0800_0000, 1), Some(vec![0x0800_0000]));
        assert_eq!(of(0x0800_0000, 0x4001), Some(vec![0x0800_0000, 0x0800_4000]));
        assert_eq!(of(0x0801_0000, 0x2_0000), Some(vec![0x0801_0000, 0x0802_0000]));
        assert_eq!(of(0x0800_0000, 0x10_0000).map(|sectors| sectors.len()), Some(12));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let layout = Layout::parse(DISCOVERY).expect("sound");
        for wrong in [image(0x0800_0000, 0x10_0001), image(0x0810_0000, 4), image(0x2000_0000, 4)] {
            assert!(layout.sectors_of(&wrong).is_err());
        }
        let read_only = Layout::parse("@OTP /0x1FFF7800/01*512 a").expect("sound");
        assert!(read_only.sectors_of(&image(0x1FFF_7800, 4)).is_err());
    }

    #[test]
    fn another_device_is_named() {
        for wrong in
            ["", "DFU", "@Internal Flash", "@F /0x0800/x", "@F /zz/04*016Kg", "@F /0x08000000/04*016"]
        {
            let why = Layout::parse(wrong).expect_err(wrong).to_string();
            assert!(why.contains(&format!("{wrong:?}")), "{why}");
        }
    }
}
