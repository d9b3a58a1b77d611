//! The probe in the emulator's core: the counts and the upsets that a test asks for.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::pins::PartPin;
use super::semihosting::Host;

/// One run of an interrupt handler, from the first instruction to the last, preemption excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HandlerRun {
    /// The instruction count of the run at its first instruction.
    pub from: u64,
    /// The number of its instructions.
    pub instructions: u32,
    /// The part of the run up to its first write of a code to the converter, if lines are counted.
    pub to_code: Option<ToCode>,
}

/// A run up to the write of the converter's code.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ToCode {
    /// The number of instructions.
    pub instructions: u32,
    /// The number of lines of code that came from the flash, with an empty cache at the first
    /// instruction.
    pub lines: u32,
}

/// Something that goes wrong inside the core, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Upset {
    /// The exception that has to be running.
    pub exception: u32,
    /// The first instruction of its handler.
    pub entry: u32,
    /// The number of its instructions before the effect.
    pub after: u32,
    /// The effect.
    pub effect: Effect,
}

/// The kinds of effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// The program goes on at this address. Bit 0 is ignored.
    Jump(u32),
    /// The core does nothing for this many instructions' time, interrupts included.
    Stall(u64),
}

/// An interrupt handler whose instructions are counted. Nothing may preempt it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Counted {
    /// Its address.
    pub entry: u32,
    /// The instructions by which it may return.
    pub exits: Vec<u32>,
}

/// The counts and actions of a probe.
#[derive(Debug, Default)]
pub struct Tally {
    /// The handler that is counted, if any.
    pub counted: Option<Counted>,
    /// Every completed run of that handler.
    pub runs: Vec<HandlerRun>,
    /// True if the lines of its code are counted, too, which takes an instruction at a time.
    pub count_lines: bool,
    /// The addresses at which the image masks all interrupts (PRIMASK, `true`) and restores the
    /// previous state.
    pub masks: BTreeMap<u32, bool>,
    /// The instruction count at which interrupts were masked, and how many times one in the other.
    pub(super) masked_since: u64,
    pub(super) masked_depth: u32,
    /// The most instructions between the two, and where they began.
    pub longest_masked: (u64, u32),
    pub(super) masked_at: u32,
    /// The output that is shorted to the supply, which the part reads back.
    pub(super) shorted: Option<PartPin>,
    /// The part's identity, if it is to be another one (`DBGMCU_IDCODE`, RM0090 38.6.1).
    pub identity: Option<u32>,
    /// The host that the program calls, if there is one.
    pub host: Option<Host>,
    /// An upset still to come.
    pub upset: Option<Upset>,
    /// Instructions done in the exception the upset waits for.
    pub(super) upset_progress: u32,
}

impl Tally {
    /// True if a test has asked for nothing, so that nothing is lost where another board goes on.
    pub(super) fn is_idle(&self) -> bool {
        let counts = self.counted.is_some() || self.count_lines || !self.masks.is_empty();
        let meddles = self.shorted.is_some() || self.identity.is_some() || self.upset.is_some();
        !counts && !meddles && self.host.is_none()
    }
}

/// Shared between the test and the core.
#[derive(Debug, Clone, Default)]
pub struct Probe(Arc<Mutex<Tally>>);

impl Probe {
    /// Returns the counts, to read or to change.
    pub fn tally(&self) -> MutexGuard<'_, Tally> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
