//! The update over USB, on a bootloader with the rules of AN3156: the order of its transfers, and
//! what it refuses.

use board_wasm::dfu::{Next, Update};
use emulator::bootloader::{Bootloader, FLASH, MEMORY, OLD};

/// An image that ends within a block and within a sector.
pub(crate) fn image() -> Vec<u8> {
    (0..70_001_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect()
}

/// A file as UM0391 has it, written apart from `cargo xtask dist`.
pub(crate) fn dfuse(start: u32, bytes: &[u8]) -> Vec<u8> {
    let mut element = [start, bytes.len() as u32].map(u32::to_le_bytes).concat();
    element.extend(bytes);
    let mut target = b"Target\0\x01\0\0\0".to_vec();
    target.extend([0; 255]);
    target[11..15].copy_from_slice(b"TEST");
    target.extend([element.len() as u32, 1].map(u32::to_le_bytes).concat());
    let mut file = b"DfuSe\x01".to_vec();
    file.extend((11 + target.len() as u32 + element.len() as u32).to_le_bytes());
    file.push(1);
    file.extend(target);
    file.extend(element);
    file.extend(b"\xFF\xFF\x11\xDF\x83\x04\x1A\x01UFD\x10");
    let sum = file.iter().fold(u32::MAX, |mut crc, byte| {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = crc >> 1 ^ if crc & 1 == 1 { 0xEDB8_8320 } else { 0 };
        }
        crc
    });
    file.extend(sum.to_le_bytes());
    file
}

/// Carries one transfer out; `None` where it has ended.
pub(crate) fn carry_out(bootloader: &mut Bootloader, next: &Next) -> Option<Result<Vec<u8>, String>> {
    Some(match next {
        Next::Out { request, value, data } => bootloader.out(*request, *value, data).map(|()| Vec::new()),
        Next::In { request, value, length } => bootloader.read(*request, *value, *length),
        Next::Wait { ms } => {
            bootloader.wait(*ms);
            Ok(Vec::new())
        }
        Next::Done | Next::Failed { .. } => return None,
    })
}

/// Runs an update to its end; why it failed where it did.
fn run(bootloader: &mut Bootloader, file: &[u8]) -> Result<(), String> {
    let mut update = Update::new(file, MEMORY).map_err(|error| error.to_string())?;
    loop {
        let next = update.advance();
        match carry_out(bootloader, &next) {
            Some(answer) => update.answer(answer),
            None => {
                return match next {
                    Next::Failed { why } => Err(why),
                    _ => Ok(()),
                };
            }
        }
    }
}

/// True if the flash holds the image, 0xFF behind it in its last sector, and what was there before
/// in all others.
fn holds(bootloader: &Bootloader, image: &[u8]) -> bool {
    // 70,001 bytes: the four sectors of 16 KiB, and one of 64.
    let (touched, others) = bootloader.flash.split_at(128 << 10);
    let (written, erased) = touched.split_at(image.len());
    written == image && erased.iter().all(|byte| *byte == 0xFF) && others.iter().all(|byte| *byte == OLD)
}

#[test]
fn an_update_writes_the_image_and_nothing_else() {
    let mut bootloader = Bootloader::default();
    assert_eq!(run(&mut bootloader, &dfuse(FLASH, &image())), Ok(()));
    assert!(holds(&bootloader, &image()));
    assert_eq!(bootloader.started, Some(FLASH));
}

#[test]
fn an_update_that_was_cut_off_is_done_again() {
    let whole = {
        let mut bootloader = Bootloader::default();
        run(&mut bootloader, &dfuse(FLASH, &image())).expect("it passes");
        bootloader.transfers
    };
    // Without its last look, at which the bootloader leaves anyway.
    for after in (0..whole - 1).step_by(7) {
        let mut bootloader = Bootloader::default();
        bootloader.pulled_after = Some(after);
        let why = run(&mut bootloader, &dfuse(FLASH, &image())).expect_err("the cable was pulled");
        assert!(why.contains("plug it in again"), "{why}");
        bootloader.plug_in_again();
        assert_eq!(run(&mut bootloader, &dfuse(FLASH, &image())), Ok(()), "after {after} transfers");
        assert!(holds(&bootloader, &image()));
    }
}

#[test]
fn an_update_goes_on_from_what_another_left() {
    // A page that was closed in the middle leaves the bootloader in one of these.
    for leave in [[0x21_u8, 0, 0, 0, 8].as_slice(), &[0x21, 0, 0, 0, 0x20]] {
        let mut bootloader = Bootloader::default();
        bootloader.out(1, 0, leave).expect("a command");
        for _ in 0..2 {
            bootloader.read(3, 0, 6).expect("a status");
            bootloader.wait(10);
        }
        assert_eq!(run(&mut bootloader, &dfuse(FLASH, &image())), Ok(()));
    }
}

#[test]
fn a_foreign_image_is_refused_before_anything_is_erased() {
    let good = dfuse(FLASH, &image());
    let mut damaged = good.clone();
    damaged[400] ^= 1;
    let short = good[..good.len() - 100].to_vec();
    let elsewhere = dfuse(FLASH + (1 << 20) - 4, &image());
    for wrong in [damaged, short, elsewhere, Vec::new(), vec![0; 1_000]] {
        let mut bootloader = Bootloader::default();
        assert!(run(&mut bootloader, &wrong).is_err());
        assert_eq!(bootloader.transfers, 0);
    }
    assert!(Update::new(&good, "@Option Bytes  /0x1FFFC000/01*016 e").is_err());
}

#[test]
fn flash_that_does_not_keep_the_image_is_reported() {
    let mut bootloader = Bootloader::default();
    bootloader.stuck = Some(5_000);
    let why = run(&mut bootloader, &dfuse(FLASH, &image())).expect_err("a byte is another");
    assert!(why.contains("0x08001000"), "{why}");
    assert_eq!(bootloader.started, None, "it is not started");
    let mut bootloader = Bootloader::default();
    bootloader.protected = Some(FLASH + 0x4000);
    let why = run(&mut bootloader, &dfuse(FLASH, &image())).expect_err("it is protected");
    assert!(why.contains("protected"), "{why}");
    assert_eq!(bootloader.started, None);
}
