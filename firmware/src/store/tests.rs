//! The power is cut at every single write and erasure; every single bit of a stored configuration
//! is flipped.

use super::*;
use control_core::config::Sensors;
use control_core::units::Millimetres;
use std::vec;
use std::vec::Vec;

const CELLS: usize = 5;
const SLOT_WORDS: usize = CELLS * CELL_WORDS;

/// Flash that loses its power after a number of operations, in the middle of the next one.
#[derive(Clone)]
struct Flash {
    words: [Vec<u32>; 2],
    operations_left: usize,
    noise: u64,
}

impl Flash {
    fn new() -> Self {
        Self {
            words: [vec![BLANK; SLOT_WORDS], vec![BLANK; SLOT_WORDS]],
            operations_left: usize::MAX,
            noise: 0x9E37_79B9_7F4A_7C15,
        }
    }

    fn random(&mut self) -> u32 {
        self.noise ^= self.noise << 13;
        self.noise ^= self.noise >> 7;
        self.noise ^= self.noise << 17;
        self.noise as u32
    }

    /// True if the next operation is carried out whole.
    fn spend(&mut self) -> Result<bool, StoreError> {
        match self.operations_left {
            usize::MAX => Ok(true),
            0 => Ok(false),
            _ => {
                self.operations_left -= 1;
                Ok(true)
            }
        }
    }
}

impl ConfigFlash for &mut Flash {
    const CELLS: usize = CELLS;

    fn word(&mut self, slot: Slot, index: usize) -> u32 {
        self.words[slot as usize][index]
    }

    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
        assert_eq!(self.words[slot as usize][index], BLANK, "a word is programmed once");
        if self.spend()? {
            self.words[slot as usize][index] = word;
            Ok(())
        } else {
            // Some of the bits have fallen.
            let fallen = self.random();
            self.words[slot as usize][index] = word | fallen;
            Err(StoreError::Flash)
        }
    }

    fn erase(&mut self, slot: Slot) -> Result<(), StoreError> {
        if self.spend()? {
            self.words[slot as usize].fill(BLANK);
            Ok(())
        } else {
            // Some of the bits have risen.
            for index in 0..SLOT_WORDS {
                let risen = self.random();
                self.words[slot as usize][index] |= risen;
            }
            Err(StoreError::Flash)
        }
    }
}

/// A device that is distinguished from others by its travel.
fn device(travel: i16) -> Device {
    let mut device = Device::commissioned_virtual();
    device.limits.travel = Millimetres(travel.into());
    device
}

/// A patient who is distinguished from others by where the outermost layer begins.
fn patient(top: i16) -> Patient {
    let mut patient = Patient::default();
    patient.layers[0].depth = Millimetres(top.into());
    patient
}

/// A writer that stops after so many words.
fn piece(words: usize) -> impl FnMut() -> bool {
    let mut left = words;
    move || {
        left -= 1;
        left > 0
    }
}

/// Saves a device in pieces of so many words.
fn save_in_pieces(store: &mut Store<&mut Flash>, travel: i16, words: usize) -> Result<(), StoreError> {
    loop {
        match store.save_device(&device(travel), piece(words)) {
            Err(StoreError::Unfinished) => {}
            ended => return ended,
        }
    }
}

fn load(flash: &mut Flash) -> Stored<Device> {
    Store::open(flash).1
}

fn load_both(flash: &mut Flash) -> (Stored<Device>, Stored<Patient>) {
    let (_, device, patient) = Store::open(flash);
    (device, patient)
}

fn saved(travels: impl IntoIterator<Item = i16>) -> Flash {
    let mut flash = Flash::new();
    for travel in travels {
        assert_eq!(Store::open(&mut flash).0.save_device(&device(travel), || true), Ok(()));
    }
    flash
}

#[test]
fn the_last_of_many_is_found_again() {
    let mut flash = Flash::new();
    assert_eq!(load(&mut flash), Stored::None);
    for travel in 10..60 {
        assert_eq!(Store::open(&mut flash).0.save_device(&device(travel), || true), Ok(()));
        assert_eq!(load(&mut flash), Stored::Found(device(travel)));
    }
}

#[test]
fn the_same_configuration_costs_no_flash() {
    let mut flash = saved([20]);
    let before = flash.words.clone();
    let (mut store, ..) = Store::open(&mut flash);
    assert_eq!((0..100).try_for_each(|_| store.save_device(&device(20), || true)), Ok(()));
    assert_eq!(flash.words, before);
}

#[test]
fn a_full_slot_moves_over_while_it_is_in_use() {
    let mut flash = Flash::new();
    let (mut store, ..) = Store::open(&mut flash);
    for travel in 10..10 + 4 * CELLS as i16 {
        assert_eq!(store.save_device(&device(travel), || true), Ok(()));
    }
    assert_eq!(load(&mut flash), Stored::Found(device(9 + 4 * CELLS as i16)));
}

#[test]
fn a_save_in_pieces_writes_what_a_whole_one_does() {
    for fill in 1..3 * CELLS as i16 {
        let before = saved_with_patient(fill);
        let mut whole = before.clone();
        assert_eq!(save_in_pieces(&mut Store::open(&mut whole).0, 50, usize::MAX), Ok(()));
        for words in [1, 2, 7, CELL_WORDS] {
            let mut flash = before.clone();
            assert_eq!(save_in_pieces(&mut Store::open(&mut flash).0, 50, words), Ok(()));
            assert!(flash.words == whole.words, "{fill}, {words} words at a time");
        }
    }
}

/// An order that is withdrawn while it is being saved.
#[test]
fn a_save_that_is_left_unfinished_changes_nothing() {
    for fill in 1..3 * CELLS as i16 {
        for words in 1.. {
            let mut flash = saved_with_patient(fill);
            let (mut store, ..) = Store::open(&mut flash);
            if store.save_device(&device(50), piece(words)).is_ok() {
                assert!(words > 20, "it takes more than a word");
                break;
            }
            assert_eq!(store.save_patient(&patient(2), || true), Ok(()), "{fill}, after {words} words");
            let old = Stored::Found(device(9 + fill));
            assert_eq!(
                load_both(&mut flash),
                (old, Stored::Found(patient(2))),
                "{fill}, after {words} words"
            );
        }
    }
}

/// From every fill of the slot: power lost in the middle of every write of saving, in pieces as
/// telemetry does, and in every write and erasure of the start that follows, which is then
/// repeated.
#[test]
fn losing_power_anywhere_leaves_the_old_or_the_new() {
    let mut cuts = 0;
    for fill in 0..3 * CELLS as i16 {
        let before = saved(10..10 + fill);
        let old = if fill == 0 { Stored::None } else { Stored::Found(device(9 + fill)) };
        for operations in 0.. {
            let mut flash = before.clone();
            let (mut store, ..) = Store::open(&mut flash);
            store.flash.operations_left = operations;
            let done = save_in_pieces(&mut store, 50, 3);
            if done.is_ok() {
                break;
            }
            cuts += 1;
            flash.operations_left = usize::MAX;
            let torn = flash.clone();
            let found = load(&mut flash);
            assert!(found == old || found == Stored::Found(device(50)), "{fill} {operations}: {found:?}");
            // The start after it loses its power too, at every point.
            for operations in 0..4 * CELL_WORDS {
                let mut flash = torn.clone();
                flash.operations_left = operations;
                assert_eq!(load(&mut flash), found);
                let is_finished = flash.operations_left > 0;
                flash.operations_left = usize::MAX;
                assert_eq!(load(&mut flash), found, "{fill} {operations}");
                let (mut store, ..) = Store::open(&mut flash);
                assert_eq!(store.save_device(&device(51), || true), Ok(()));
                assert_eq!(load(&mut flash), Stored::Found(device(51)));
                if is_finished {
                    break;
                }
            }
        }
    }
    assert!(cuts > 200, "{cuts} cuts");
}

/// A flipped bit is noticed, and never becomes another configuration.
#[test]
fn every_flipped_bit_is_noticed() {
    let flash = saved([20, 30]);
    let length = flash.words[0][CELL_WORDS] as usize & 0x3FF;
    for word in 0..HEADER_WORDS + length.div_ceil(4) {
        for bit in 0..32 {
            let is_padding = word == HEADER_WORDS + length / 4 && bit >= 8 * (length % 4);
            let mut flash = flash.clone();
            flash.words[0][CELL_WORDS + word] ^= 1 << bit;
            let expected = if is_padding { Stored::Found(device(30)) } else { Stored::Damaged };
            assert_eq!(load(&mut flash), expected, "word {word} bit {bit}");
        }
    }
}

#[test]
fn a_damaged_configuration_is_replaced_by_the_next_one() {
    let mut flash = saved([20]);
    flash.words[0][5] ^= 4;
    let (mut store, stored, _) = Store::open(&mut flash);
    assert_eq!(stored, Stored::Damaged);
    assert_eq!(store.save_device(&device(40), || true), Ok(()));
    assert_eq!(load(&mut flash), Stored::Found(device(40)));
}

/// Tests that the next firmware reads the content of a device's flash: the layout is a promise.
#[test]
fn a_cell_is_laid_out_as_it_always_was() {
    assert_eq!(PAYLOAD_BYTES, 1024 - 4 * (HEADER_WORDS + 1), "all but header and the word that commits it");
    let mut flash = Flash::new();
    let (mut store, ..) = Store::open(&mut flash);
    let (device, patient) = (Device::commissioned_virtual(), Patient::default());
    store.save_device(&device, || true).unwrap();
    store.save_patient(&patient, || true).unwrap();
    let words = &flash.words[Slot::A as usize];
    let (mut bytes, mut patients) = ([0; PAYLOAD_BYTES], [0; PAYLOAD_BYTES]);
    let length = postcard::to_slice(&device, &mut bytes).unwrap().len();
    assert_eq!(words[0], 0xC0F1_6400 + length as u32);
    assert_eq!((words[1], words[255]), (0, COMMITTED));
    assert_eq!(words[3].to_le_bytes(), bytes[..4]);
    let length = postcard::to_slice(&patient, &mut patients).unwrap().len();
    assert_eq!((words[256], words[257]), (0xC0F1_6800 + length as u32, 1));
    assert_eq!(words[259].to_le_bytes(), patients[..4]);
}

/// A cell of slot A of one flash and one of another, as the two slots of a third.
fn composed(a: &Flash, b: &Flash) -> Flash {
    let mut flash = Flash::new();
    flash.words = [a.words[0].clone(), b.words[0].clone()];
    flash
}

#[test]
fn of_two_slots_the_one_with_the_later_number_counts() {
    let (earlier, later) = (saved([20]), saved([20, 30]));
    assert_eq!(load(&mut composed(&earlier, &later)), Stored::Found(device(30)));
    assert_eq!(load(&mut composed(&later, &earlier)), Stored::Found(device(30)));
    assert_eq!(load(&mut composed(&Flash::new(), &later)), Stored::Found(device(30)));
}

#[test]
fn damage_is_reported_whichever_slot_has_it() {
    let mut damaged = saved([20]);
    damaged.words[0][5] ^= 4;
    let blank = Flash::new();
    assert_eq!(load(&mut composed(&damaged, &blank)), Stored::Damaged);
    assert_eq!(load(&mut composed(&blank, &damaged)), Stored::Damaged);
    assert_eq!(load(&mut composed(&damaged, &damaged)), Stored::Damaged);
    assert_eq!(load(&mut composed(&damaged, &saved([30]))), Stored::Found(device(30)));
}

/// Two blank cells are kept in reserve, no more: erasing wears flash out.
#[test]
fn a_start_that_finds_room_leaves_flash_alone() {
    for fill in 0..=CELLS - RESERVE_CELLS {
        let mut flash = saved(10..10 + fill as i16);
        flash.operations_left = 1_000;
        load(&mut flash);
        assert_eq!(flash.operations_left, 1_000, "{fill} cells used");
    }
    let mut flash = saved(10..11 + (CELLS - RESERVE_CELLS) as i16);
    flash.operations_left = 1_000;
    load(&mut flash);
    assert!(flash.operations_left < 1_000, "it moves over");
}

/// A store with a patient and then a number of devices.
fn saved_with_patient(fill: i16) -> Flash {
    let mut flash = Flash::new();
    assert_eq!(Store::open(&mut flash).0.save_patient(&patient(1), || true), Ok(()));
    for travel in 10..10 + fill {
        assert_eq!(Store::open(&mut flash).0.save_device(&device(travel), || true), Ok(()));
    }
    flash
}

#[test]
fn records_are_saved_apart_and_move_when_a_slot_is_full() {
    for fill in 1..4 * CELLS as i16 {
        let mut flash = saved_with_patient(fill);
        let both = (Stored::Found(device(9 + fill)), Stored::Found(patient(1)));
        assert_eq!(load_both(&mut flash), both, "{fill}");
        assert_eq!(Store::open(&mut flash).0.save_patient(&patient(2), || true), Ok(()));
        assert_eq!(load_both(&mut flash), (both.0, Stored::Found(patient(2))), "{fill}");
    }
}

#[test]
fn losing_power_during_a_save_leaves_the_other_record_intact() {
    for fill in 1..2 * CELLS as i16 {
        let before = saved_with_patient(fill);
        for operations in 0.. {
            let mut flash = before.clone();
            flash.operations_left = operations;
            let (mut store, ..) = Store::open(&mut flash);
            let done = store.save_device(&device(50), || true);
            flash.operations_left = usize::MAX;
            let (found, patient_found) = load_both(&mut flash);
            assert_eq!(patient_found, Stored::Found(patient(1)), "{fill} {operations}");
            let wanted = [9 + fill, 50].map(|travel| Stored::Found(device(travel)));
            assert!(wanted.contains(&found), "{fill} {operations}: {found:?}");
            if done.is_ok() {
                break;
            }
        }
    }
}

#[test]
fn a_flipped_bit_costs_the_record_that_it_is_in_and_no_other() {
    let flash = saved_with_patient(1);
    for (cell, kind) in [(0, Kind::Patient), (1, Kind::Device)] {
        for bit in 0..32 {
            let mut flash = flash.clone();
            flash.words[0][cell * CELL_WORDS + HEADER_WORDS] ^= 1 << bit;
            let (found_device, found_patient) = load_both(&mut flash);
            let lost = (found_device == Stored::Damaged, found_patient == Stored::Damaged);
            assert_eq!(lost, (kind == Kind::Device, kind == Kind::Patient), "bit {bit}");
        }
        for bit in [10, 11] {
            let mut flash = flash.clone();
            flash.words[0][cell * CELL_WORDS] ^= 1 << bit;
            let (found_device, found_patient) = load_both(&mut flash);
            // Whose it was cannot be said: neither is the other's.
            let told = if kind == Kind::Device {
                found_device == Stored::Damaged
            } else {
                found_patient == Stored::Damaged
            };
            assert!(told, "a record without a name is lost: bit {bit}");
        }
    }
}

/// Flash whose first cell has this header, but for its length, and this payload.
fn left_by_another(header: u32, payload: &[u8]) -> Flash {
    let header = header | payload.len() as u32;
    let mut flash = Flash::new();
    flash.words[0][..3].copy_from_slice(&[header, 4, checksum(header, 4, payload)]);
    for (word, bytes) in flash.words[0][HEADER_WORDS..].iter_mut().zip(payload.chunks(4)) {
        let mut padded = [0xFF; 4];
        padded[..bytes.len()].copy_from_slice(bytes);
        *word = u32::from_le_bytes(padded);
    }
    flash.words[0][CELL_WORDS - 1] = COMMITTED;
    flash
}

/// The default device, commissioned, as firmware of protocol 9 saved it, which knew of no sensors.
#[test]
fn a_device_saved_before_sensors_were_known_is_read_and_moved() {
    let mut payload = [0; 105];
    let known = [
        (0, &[0x80, 0x80, 0x50, 0xA0, 0x1F, 0, 0x9A, 0xB3, 0xE6, 1, 1][..]),
        (14, &[0x9A, 0xB3, 0xE6, 1, 0x9A, 0xB3, 0xE6, 1, 12, 0x80, 0x80, 8, 0xAC, 2, 16]),
        (29, &[0x80, 0x80, 0xE0, 3, 0x80, 0x80, 16, 0xC8, 1, 0, 0, 0xDC, 0x9E, 10]),
        (43, &[0x80, 0x80, 0xF0, 1, 0xB8, 0x3D, 100, 1]),
        (91, &[0x80, 0x80, 16, 0x80, 0x80, 48]),
        (104, &[1]),
    ];
    for (at, bytes) in known {
        payload[at..at + bytes.len()].copy_from_slice(bytes);
    }
    let mut flash = left_by_another(0xC0F1_6400, &payload);
    let found = Stored::Found(Device::commissioned_virtual());
    assert_eq!(load(&mut flash), found);
    // It moves to the other slot as it is.
    for top in 1..2 * CELLS as i16 {
        assert_eq!(Store::open(&mut flash).0.save_patient(&patient(top), || true), Ok(()));
        assert_eq!(load(&mut flash), found);
    }
    let sensors = Sensors { encoder_supply: true, current: false };
    let known = Device { sensors, ..Device::commissioned_virtual() };
    assert_eq!(Store::open(&mut flash).0.save_device(&known, || true), Ok(()));
    assert_eq!(load(&mut flash), Stored::Found(known));
}

/// A firmware of the time when both parts were one record left this.
#[test]
fn a_cell_of_an_earlier_layout_is_not_read_and_not_damage() {
    let mut flash = left_by_another(MAGIC | 1 << 12, &[7; 200]);
    assert_eq!(load_both(&mut flash), (Stored::None, Stored::None));
    let (mut store, ..) = Store::open(&mut flash);
    store.save_device(&device(20), || true).unwrap();
    assert_eq!(load_both(&mut flash), (Stored::Found(device(20)), Stored::None));
    for travel in 21..40 {
        Store::open(&mut flash).0.save_device(&device(travel), || true).unwrap();
        assert_eq!(load(&mut flash), Stored::Found(device(travel)));
    }
}
