//! The meaning of a reset: from the microcontroller's flags and the words that survive in RAM to
//! the fault that is reported when the PC comes back. Torque is off after any reset until a person
//! starts the device.

use control_core::event::Fault;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use link::crash::FILE_BYTES;
pub use link::crash::{Crash, CrashKind};

/// Flags that the microcontroller keeps of its last reset.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ResetFlags {
    /// One of the watchdogs.
    pub watchdog: bool,
    /// The program asked for it.
    pub software: bool,
    /// The supply came up from nothing.
    pub power_on: bool,
    /// The supply dipped below the brown-out level, or came up.
    pub brownout: bool,
}

/// Words that no start-up code clears. After a power-up they hold anything: each says itself
/// whether it means something. The heat is last: the emulated board finds it there.
#[repr(C)]
pub struct LastWords {
    /// The check of the others, then what [`words_of`] makes.
    crash: [AtomicU32; 1 + CRASH_WORDS],
    torque: [AtomicU32; 2],
    heat: [AtomicU32; 2],
}

/// The last words before a reset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Said {
    /// Why the program gave up, if it did.
    pub crash: Option<Crash>,
    /// True if torque was on.
    pub torque: bool,
    /// The winding's heat as `Controller::heat` gave it; `None` where nobody knows, as after a loss
    /// of power.
    pub heat: Option<u32>,
}

/// Words of a crash: six numbers, then the bytes of the file's name.
const CRASH_WORDS: usize = 6 + FILE_BYTES / 4;
const CRASH_MARK: u32 = 0x5AFE_C4A5;
const TORQUE_MARK: u32 = 0x700D_0E0F;
/// CRC-32 as in Ethernet, without a table: a handler of a fault would have it on its stack.
const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// The check of the words of a crash.
fn check(words: &[u32; CRASH_WORDS]) -> u32 {
    let mut digest = CRC.digest();
    words.iter().for_each(|word| digest.update(&word.to_le_bytes()));
    CRASH_MARK ^ digest.finalize()
}

fn words_of(crash: &Crash) -> [u32; CRASH_WORDS] {
    let mut words = [0; CRASH_WORDS];
    let Crash { kind, detail, pc, lr, fault_status, bus_address, file } = crash;
    let numbers = [*kind as u32, *detail, *pc, *lr, *fault_status, *bus_address];
    let pieces = file.as_bytes().chunks(4).map(|piece| {
        let mut bytes = [0; 4];
        bytes.iter_mut().zip(piece).for_each(|(place, &byte)| *place = byte);
        u32::from_le_bytes(bytes)
    });
    words.iter_mut().zip(numbers.into_iter().chain(pieces)).for_each(|(place, word)| *place = word);
    words
}

/// Returns the crash that these words hold, if its kind is one.
fn crash_of(words: &[u32; CRASH_WORDS]) -> Option<Crash> {
    let [kind, detail, pc, lr, fault_status, bus_address, name @ ..] = words;
    let kind = CrashKind::from_code(*kind)?;
    let mut crash = Crash {
        pc: *pc,
        lr: *lr,
        fault_status: *fault_status,
        bus_address: *bus_address,
        ..Crash::new(kind, *detail)
    };
    let bytes = name.iter().flat_map(|word| word.to_le_bytes()).take_while(|&byte| byte != 0);
    let mut name = heapless::Vec::<u8, FILE_BYTES>::new();
    name.extend(bytes);
    // Its check held, so it is what was written: text.
    crash.file = heapless::String::from_utf8(name).unwrap_or_default();
    Some(crash)
}

impl Default for LastWords {
    fn default() -> Self {
        Self::new()
    }
}

impl LastWords {
    /// Nothing said.
    pub const fn new() -> Self {
        Self {
            crash: [const { AtomicU32::new(0) }; 1 + CRASH_WORDS],
            torque: [const { AtomicU32::new(0) }; 2],
            heat: [const { AtomicU32::new(0) }; 2],
        }
    }

    /// Leaves word of a crash. The first one counts: what follows is a consequence.
    pub fn crash(&self, crash: &Crash) {
        if self.crash_words().is_some() {
            return;
        }
        let words = words_of(crash);
        let [mark, places @ ..] = &self.crash;
        places.iter().zip(words).for_each(|(place, word)| place.store(word, Relaxed));
        mark.store(check(&words), Relaxed);
    }

    /// Returns the words of a crash if they are whole.
    fn crash_words(&self) -> Option<[u32; CRASH_WORDS]> {
        let [mark, places @ ..] = &self.crash;
        let words = places.each_ref().map(|word| word.load(Relaxed));
        (mark.load(Relaxed) == check(&words)).then_some(words)
    }

    fn crashed(&self) -> Option<Crash> {
        crash_of(&self.crash_words()?)
    }

    /// Notes if torque is on, from now on.
    pub fn torque(&self, on: bool) {
        let mark = if on { TORQUE_MARK } else { 0 };
        let [word, inverse] = &self.torque;
        word.store(mark, Relaxed);
        inverse.store(!mark, Relaxed);
    }

    fn torque_was_on(&self) -> bool {
        let [word, inverse] = &self.torque;
        word.load(Relaxed) == TORQUE_MARK && inverse.load(Relaxed) == !TORQUE_MARK
    }

    /// Sets the heat of the motor's winding from now on. A motor does not cool in a reset.
    pub fn heat(&self, heat: u32) {
        let [word, inverse] = &self.heat;
        word.store(heat, Relaxed);
        inverse.store(!heat, Relaxed);
    }

    fn heat_was(&self) -> Option<u32> {
        let [word, inverse] = self.heat.each_ref().map(|word| word.load(Relaxed));
        (inverse == !word).then_some(word)
    }

    /// Returns the last words before the reset and forgets them, but for the heat.
    pub fn take(&self) -> Said {
        let said = Said { crash: self.crashed(), torque: self.torque_was_on(), heat: self.heat_was() };
        self.crash[0].store(0, Relaxed);
        self.torque(false);
        said
    }
}

/// The fault to report for the last reset; `None` where it was a person's (power, the button, a
/// debugger).
pub fn cause(flags: ResetFlags, crash: Option<&Crash>, torque_was_on: bool) -> Option<Fault> {
    let hung = crash.is_some_and(|crash| crash.kind == CrashKind::HungTask);
    if hung || (flags.watchdog && crash.is_none()) {
        Some(Fault::Watchdog)
    } else if crash.is_some_and(|crash| crash.kind == CrashKind::Clock) {
        Some(Fault::Clock)
    } else if crash.is_some() {
        Some(Fault::Crash)
    } else if flags.software {
        None
    } else if torque_was_on || (flags.brownout && !flags.power_on) {
        // RAM that still knows of torque has not been without supply for long: the supply dipped.
        Some(Fault::Brownout)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOTHING: Said = Said { crash: None, torque: false, heat: None };
    const PANIC: Crash = Crash::new(CrashKind::Panic, 42);

    #[test]
    fn last_words_survive_and_are_said_once() {
        let words = LastWords::new();
        assert_eq!(words.take(), NOTHING);
        words.crash(&PANIC);
        words.torque(true);
        words.heat(77);
        words.crash(&Crash::new(CrashKind::HardFault, 1));
        assert_eq!(words.take(), Said { crash: Some(PANIC), torque: true, heat: Some(77) });
        assert_eq!(words.take(), Said { heat: Some(77), ..NOTHING }, "a motor does not cool by being asked");
        words.heat[1].fetch_xor(1, Relaxed);
        assert_eq!(words.take(), NOTHING);
    }

    #[test]
    fn every_kind_of_crash_survives_whole_or_not_at_all() {
        let kinds = [
            CrashKind::Panic,
            CrashKind::HardFault,
            CrashKind::StrayInterrupt,
            CrashKind::HungTask,
            CrashKind::Clock,
        ];
        for kind in kinds {
            let crash = Crash {
                kind,
                pc: 0x0800_1235,
                lr: 0x0800_0201,
                fault_status: 0x8200,
                bus_address: 0x6000_0000,
                ..Crash::panic("firmware/src/tasks/telemetry.rs", 77)
            };
            let words = LastWords::new();
            words.crash(&crash);
            assert_eq!(words.take(), Said { crash: Some(crash.clone()), ..NOTHING });
            for word in 0..1 + CRASH_WORDS {
                for bit in 0..32 {
                    words.crash(&crash);
                    words.crash[word].fetch_xor(1 << bit, Relaxed);
                    assert_eq!(words.take().crash, None, "{crash:?}, bit {bit} of word {word}");
                }
            }
        }
        let words = LastWords::new();
        words.torque(true);
        words.torque(false);
        assert_eq!(words.take(), NOTHING);
        for word in 0..2 {
            words.torque(true);
            words.torque[word].fetch_xor(1 << 9, Relaxed);
            assert_eq!(words.take(), NOTHING);
        }
    }

    /// RAM after a power-up holds anything.
    #[test]
    fn noise_in_ram_is_no_crash() {
        let words = LastWords::new();
        for noise in [u32::MAX, 0xAAAA_AAAA, 1, CRASH_MARK] {
            words.crash.iter().for_each(|word| word.store(noise, Relaxed));
            words.torque.iter().for_each(|word| word.store(noise, Relaxed));
            words.heat.iter().for_each(|word| word.store(noise, Relaxed));
            assert_eq!(words.take(), NOTHING, "{noise:#x}");
        }
    }

    #[test]
    fn every_reset_has_its_cause() {
        let flags = ResetFlags::default();
        let power_up = ResetFlags { power_on: true, brownout: true, ..flags };
        let watchdog = ResetFlags { watchdog: true, ..flags };
        let software = ResetFlags { software: true, ..flags };
        let dip = ResetFlags { brownout: true, ..flags };
        let hung = Crash::new(CrashKind::HungTask, 3);
        assert_eq!(cause(power_up, None, false), None);
        assert_eq!(cause(power_up, None, true), Some(Fault::Brownout));
        assert_eq!(cause(dip, None, false), Some(Fault::Brownout));
        assert_eq!(cause(watchdog, None, true), Some(Fault::Watchdog));
        assert_eq!(cause(watchdog, Some(&hung), true), Some(Fault::Watchdog));
        assert_eq!(cause(software, Some(&PANIC), true), Some(Fault::Crash));
        let clock = Crash::new(CrashKind::Clock, 0);
        assert_eq!(cause(software, Some(&clock), true), Some(Fault::Clock));
        // A crash whose own reset did not come and that the watchdog ended.
        assert_eq!(cause(watchdog, Some(&PANIC), true), Some(Fault::Crash));
        assert_eq!(cause(software, None, true), None);
        assert_eq!(cause(flags, None, false), None);
        assert_eq!(cause(flags, None, true), Some(Fault::Brownout));
    }
}
