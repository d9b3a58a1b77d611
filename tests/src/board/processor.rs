//! The emulator's core with three things added: addresses of peripherals it has no model for lead
//! to windows where the board has one, the instructions of one interrupt handler can be counted, and
//! a fault can be injected by moving the program counter.
//!
//! Nothing here changes what the firmware sees: the windows answer at the addresses of the manual.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::emulator::{
    Access, AccessKind, Checked, CoreBus, DataModel, Error, Exit, InterruptLine, Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use super::cache::InstructionCache;
use super::flash::{FLASH_OPTCR, Flash, WRITABLE};
use super::pins::{PartPin, register};
use super::warm_core::WarmCore;

/// One instruction a cycle at 168 MHz. The emulator has no cycles, so this makes an instruction
/// count a time.
pub const INSTRUCTIONS_PER_SECOND: u64 = 168_000_000;
/// The address of the USB core in the manual, its size, and the address of its window.
pub(super) const OTG: (u64, u64, u64) = (0x5000_0000, 0x4_0000, 0x5010_0000);
/// The same for the DAC.
pub(super) const DAC: (u64, u64, u64) = (0x4000_7400, 0x400, 0x4010_0000);
/// The same for the external interrupt controller.
pub(super) const EXTI: (u64, u64, u64) = (0x4001_3C00, 0x400, 0x4011_0000);

fn window(address: u64) -> u64 {
    for (base, size, window) in [OTG, DAC, EXTI] {
        if (base..base + size).contains(&address) {
            return address - base + window;
        }
    }
    address
}

/// The converter's holding register for twelve bits, right aligned (RM0090 14.5.3).
const CONVERTER_CODE: u64 = 0x4000_7408;

/// The part's reserved space between its RAM with the RAM's bits and its peripherals (RM0090 2.3): an access fails on the bus, and the
/// core takes a fault (ARMv7-M B3.2.15, `PRECISERR`). The emulator answers zero by itself.
const RESERVED: [std::ops::Range<u64>; 2] = [0x2010_0000..0x2200_0000, 0x2400_0000..0x4000_0000];

/// The part's identity.
const DBGMCU_IDCODE: u64 = 0xE004_2000;

/// The number the architecture gives external interrupt 0.
pub const FIRST_EXTERNAL: u32 = 16;
const REGISTER_PC: usize = 15;
const REGISTER_XPSR: usize = 16;

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
    /// The number of lines of code that came from the flash, with an empty cache at the first instruction.
    pub lines: u32,
}

/// Something that goes wrong inside the core, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Upset {
    /// The exception that has to be running; 0 is thread mode.
    pub exception: u32,
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
    /// The addresses at which the image masks all interrupts (PRIMASK, `true`) and restores the previous state.
    pub masks: BTreeMap<u32, bool>,
    /// The instruction count at which interrupts were masked, and how many times one in the other.
    masked_since: u64,
    masked_depth: u32,
    /// The most instructions between the two, and where they began.
    pub longest_masked: (u64, u32),
    masked_at: u32,
    /// The output that is shorted to the supply, which the part reads back.
    pub(super) shorted: Option<PartPin>,
    /// The part's identity, if it is to be another one (`DBGMCU_IDCODE`, RM0090 38.6.1).
    pub identity: Option<u32>,
    /// An upset still to come.
    pub upset: Option<Upset>,
    /// Instructions done in the exception the upset waits for.
    upset_progress: u32,
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

/// The emulator's core, wrapped.
#[derive(Debug)]
pub(super) struct Probed {
    core: WarmCore,
    probe: Probe,
    flash: Flash,
    /// Instructions' time in which nothing ran, and that of the instructions before a reset.
    stalled: u64,
    /// The addresses of breakpoints that stop the core.
    breakpoints: BTreeSet<u32>,
    /// The run of the counted handler that is under way.
    counting: Option<Run>,
}

/// A run of the counted handler that is under way.
#[derive(Debug)]
struct Run {
    /// The exception that it runs in.
    exception: u32,
    /// The instruction count at its first instruction, with the time in which nothing ran.
    from: u64,
    /// The same without that time.
    retired: u64,
    /// The flash's cache, if lines are counted.
    cache: Option<InstructionCache>,
    to_code: Option<ToCode>,
}

impl Probed {
    pub(super) fn new(core: WarmCore, probe: Probe, flash: Flash) -> Self {
        Self { core, probe, flash, stalled: 0, breakpoints: BTreeSet::new(), counting: None }
    }

    /// Has every access to the sectors the firmware writes to go over the bus.
    fn route_flash(&mut self) {
        for page in WRITABLE.step_by(self.core.page_size() as usize) {
            self.core.ask(Queued::Route(page));
        }
    }

    fn register(&self, number: usize) -> u32 {
        let bytes = self.core.gdb_register(number).unwrap_or_default();
        bytes.try_into().map_or(0, u32::from_le_bytes)
    }

    fn exception(&self) -> u32 {
        self.register(REGISTER_XPSR) & 0x1FF
    }

    /// Sets the breakpoints that the test asks for.
    fn settle_breakpoints(&mut self) {
        let wanted: BTreeSet<u32> = {
            let tally = self.probe.tally();
            let counted = tally.counted.iter().flat_map(|it| it.exits.iter().copied().chain([it.entry]));
            counted.chain(tally.masks.keys().copied()).collect()
        };
        if wanted == self.breakpoints {
            return;
        }
        for old in std::mem::take(&mut self.breakpoints) {
            self.core.remove_breakpoint(old.into());
        }
        self.counting = None;
        self.breakpoints = wanted.into_iter().filter(|&new| self.core.add_breakpoint(new.into())).collect();
    }

    /// Runs like the core from breakpoint to breakpoint, and an instruction at a time while an upset is to come.
    fn run_watched(&mut self, budget: u32, bus: &mut Rerouted<'_>) -> (Exit, u64) {
        let mut retired = 0;
        while retired < u64::from(budget) {
            bus.stepping = self.probe.tally().upset.is_some() || self.is_counting_lines();
            self.note_fetch();
            let left = if bus.stepping { 1 } else { budget - retired as u32 };
            let (mut exit, mut did) = self.core.run(left, bus);
            let place = self.core.pc() as u32;
            let stopped = exit == Exit::Breakpoint && self.breakpoints.contains(&place);
            if stopped {
                self.enter(place);
                self.core.pass_breakpoint(place.into());
                // The instruction itself, so that what it changed can be seen.
                bus.stepping = true;
                let (after, of_it) = self.core.run(1, bus);
                (exit, did) = (after, did + of_it);
                self.note_mask(place);
            }
            retired += did;
            if std::mem::take(&mut bus.code_written) {
                self.note_code();
            }
            self.leave(stopped.then_some(place));
            if bus.standstill > 0 {
                return (Exit::Returned, retired);
            }
            if did > 0 && bus.stepping {
                let stalled = self.upset();
                if stalled > 0 {
                    // Time has passed: the run looks at what is due.
                    return (Exit::Returned, retired + stalled);
                }
            }
            if exit != Exit::Budget && !(stopped && exit == Exit::Breakpoint) {
                return (exit, retired);
            }
        }
        (Exit::Budget, retired)
    }

    /// Returns true while the lines of a handler's code are counted.
    fn is_counting_lines(&self) -> bool {
        self.counting.as_ref().is_some_and(|run| run.cache.is_some())
    }

    /// Takes note of the instruction that comes next, where its lines are counted.
    fn note_fetch(&mut self) {
        let address = self.core.pc() as u32;
        if let Some(cache) = self.counting.as_mut().and_then(|run| run.cache.as_mut()) {
            cache.fetch(address);
        }
    }

    /// Notes that the counted handler has written a code to the converter, if lines are counted.
    fn note_code(&mut self) {
        let retired = self.core.retired();
        if let Some(Run { to_code: to_code @ None, cache: Some(cache), retired: from, .. }) =
            &mut self.counting
        {
            *to_code = Some(ToCode { instructions: (retired - *from) as u32, lines: cache.misses() });
        }
    }

    /// Begins a run of the counted handler where it begins at `place`.
    fn enter(&mut self, place: u32) {
        if self.probe.tally().counted.as_ref().is_some_and(|counted| counted.entry == place) {
            let exception = self.exception();
            let cache = self.probe.tally().count_lines.then(InstructionCache::default);
            let (from, retired) = (self.retired(), self.core.retired());
            self.counting = Some(Run { exception, from, retired, cache, to_code: None });
        }
    }

    /// Ends the run of the counted handler once the exception has changed, which the instruction that just ran at a
    /// breakpoint, `place`, does.
    ///
    /// # Panics
    ///
    /// When the handler returned elsewhere: more than the handler was counted then.
    fn leave(&mut self, place: Option<u32>) {
        let exception = self.exception();
        let Some(run) = self.counting.take_if(|run| run.exception != exception) else { return };
        let mut tally = self.probe.tally();
        let Some(counted) = &tally.counted else { return };
        let is_exit = place.is_some_and(|place| counted.exits.contains(&place));
        assert!(is_exit, "the handler at {:#x} returned by an instruction that is not known", counted.entry);
        let instructions = (self.core.retired() - run.retired) as u32;
        tally.runs.push(HandlerRun { from: run.from, instructions, to_code: run.to_code });
    }

    /// Notes that the instruction at `place` has masked interrupts or let them come again, if it is one of those.
    fn note_mask(&mut self, place: u32) {
        let now = self.retired();
        let mut tally = self.probe.tally();
        match tally.masks.get(&place) {
            Some(true) => {
                tally.masked_depth += 1;
                if tally.masked_depth == 1 {
                    (tally.masked_since, tally.masked_at) = (now, place);
                }
            }
            Some(false) if tally.masked_depth > 0 => {
                tally.masked_depth -= 1;
                if tally.masked_depth == 0 {
                    let masked = (now - tally.masked_since, tally.masked_at);
                    tally.longest_masked = tally.longest_masked.max(masked);
                }
            }
            _ => {}
        }
    }

    /// Does what goes wrong now; the instructions' time that it took.
    fn upset(&mut self) -> u64 {
        let exception = self.exception();
        let effect = {
            let mut tally = self.probe.tally();
            let Some(upset) = tally.upset.filter(|upset| upset.exception == exception) else { return 0 };
            tally.upset_progress += 1;
            if tally.upset_progress <= upset.after {
                return 0;
            }
            (tally.upset, tally.upset_progress) = (None, 0);
            upset.effect
        };
        match effect {
            Effect::Jump(to) => {
                self.core.set_gdb_register(REGISTER_PC, &(to & !1).to_le_bytes());
                0
            }
            Effect::Stall(instructions) => {
                self.stalled += instructions;
                instructions
            }
        }
    }
}

impl Processor for Probed {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        let flash = self.flash.clone();
        let (shorted, identity) = {
            let tally = self.probe.tally();
            (tally.shorted, tally.identity)
        };
        let mut bus = Rerouted {
            bus,
            flash: &flash,
            stalled: self.stalled,
            standstill: 0,
            shorted,
            identity,
            code_written: false,
            stepping: false,
            asked: Vec::new(),
        };
        self.settle_breakpoints();
        let watched = !self.breakpoints.is_empty() || self.probe.tally().upset.is_some();
        let (exit, retired) =
            if watched { self.run_watched(budget, &mut bus) } else { self.core.run(budget, &mut bus) };
        // What kept the core from its instructions is time that has passed.
        let standstill = bus.standstill;
        self.stalled += standstill;
        for queued in bus.asked {
            self.core.must_know(queued);
        }
        (exit, retired + standstill)
    }

    fn reset(&mut self) {
        self.counting = None;
        self.flash.array().restarted();
        // The time that has passed goes on where the core's own count does not.
        self.stalled += self.core.reset();
    }

    fn retired(&self) -> u64 {
        self.core.retired() + self.stalled
    }

    fn ask(&mut self, queued: Queued) {
        self.core.ask(queued);
    }

    fn maps(&self, start: u64, length: u64) -> bool {
        self.core.maps(start, length)
    }

    fn page_size(&self) -> u64 {
        self.core.page_size()
    }

    #[allow(unsafe_code, reason = "hands on what the runner promised, unchanged")]
    unsafe fn map(&mut self, start: u64, length: u64, host: *mut u8, writable: bool) {
        // SAFETY: the caller's promise is passed on as it is.
        unsafe { self.core.map(start, length, host, writable) }
    }

    fn boot(&mut self, table: u64, read: &dyn Fn(u64, Width) -> Option<u64>) {
        self.core.boot(table, read);
        self.route_flash();
    }

    fn take_reset_request(&mut self) -> bool {
        self.core.take_reset_request() || std::mem::take(&mut self.flash.array().cut)
    }

    fn next_event(&self) -> Option<VirtualNanos> {
        self.core.next_event()
    }

    fn on_event(&mut self, now: VirtualNanos) {
        self.core.on_event(now);
    }

    fn waiting(&self) -> bool {
        self.core.waiting()
    }

    fn pc(&self) -> u64 {
        self.core.pc()
    }

    fn add_breakpoint(&mut self, address: u64) -> bool {
        self.core.add_breakpoint(address)
    }

    fn remove_breakpoint(&mut self, address: u64) {
        self.core.remove_breakpoint(address);
    }

    fn pass_breakpoint(&mut self, address: u64) {
        self.core.pass_breakpoint(address);
    }

    fn gdb_register(&self, number: usize) -> Option<Vec<u8>> {
        self.core.gdb_register(number)
    }

    fn set_gdb_register(&mut self, number: usize, bytes: &[u8]) -> bool {
        self.core.set_gdb_register(number, bytes)
    }

    fn data_model(&self) -> DataModel {
        self.core.data_model()
    }

    fn byte_order(&self, address: u64) -> Endian {
        self.core.byte_order(address)
    }

    fn save(&self) -> Vec<u8> {
        self.core.save()
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        self.core.load(bytes)
    }
}

/// The runner's bus, with the windows in place.
struct Rerouted<'a> {
    bus: &'a mut dyn CoreBus,
    flash: &'a Flash,
    stalled: u64,
    /// Instructions' time for which the flash, being erased, has kept the core waiting in this stretch.
    standstill: u64,
    shorted: Option<PartPin>,
    identity: Option<u32>,
    /// True if a code was written to the converter since somebody asked.
    code_written: bool,
    /// True if the core is inspected after every instruction.
    stepping: bool,
    /// What the run asked of the core in this stretch.
    asked: Vec<Queued>,
}

impl CoreBus for Rerouted<'_> {
    fn access(&mut self, mut access: Access, from_code: bool) -> Option<u64> {
        let written = access.kind == AccessKind::Write;
        if from_code && RESERVED.iter().any(|space| space.contains(&access.address)) {
            return None;
        }
        if WRITABLE.contains(&access.address) {
            let (address, value) = (access.address, access.value as u32);
            let mut array = self.flash.array();
            if written {
                array.store(address, access.width.bytes(), value);
                return Some(access.value);
            }
            let word = u64::from(array.word(address)) | u64::from(array.word(address + 4)) << 32;
            return Some(word >> (8 * (address & 3)) & access.width.mask());
        }
        if !written && access.address == FLASH_OPTCR {
            return Some(self.flash.array().option_register().into());
        }
        if written {
            let at = self.bus.time(access.instruction_count + self.stalled).0;
            let stall = self.flash.array().register_written(access.address, access.value as u32, at);
            self.standstill += stall * (INSTRUCTIONS_PER_SECOND / 1_000_000) / 1_000;
        }
        let address = access.address;
        self.code_written |= written && address == CONVERTER_CODE;
        access.address = window(access.address);
        if self.stalled > 0 {
            access.instruction_count += self.stalled;
            access.virtual_time = self.bus.time(access.instruction_count);
        }
        let value = self.bus.access(access, from_code)?;
        if let Some(identity) = self.identity.filter(|_| !written && address == DBGMCU_IDCODE) {
            return Some(identity.into());
        }
        let high = self.shorted.filter(|place| !written && access.address == place.register(register::INPUT));
        Some(high.map_or(value, |place| value | 1 << place.index))
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(instructions + self.stalled)
    }

    fn queued(&mut self) -> Vec<Queued> {
        let queued = self.bus.queued();
        self.asked.extend_from_slice(&queued);
        queued
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        if self.stepping || self.standstill > 0 {
            return None;
        }
        self.bus.carry_on(instructions + self.stalled, event)
    }

    fn acknowledge(&mut self, line: InterruptLine, instructions: u64) -> Option<u64> {
        self.bus.acknowledge(line, instructions + self.stalled)
    }

    fn read_checked(&mut self, access: Access, report: bool) -> Option<Checked> {
        self.bus.read_checked(access, report)
    }

    fn write_checked(&mut self, access: Access) -> Option<bool> {
        self.bus.write_checked(access)
    }

    fn stops_before(&mut self, access: &Access) -> bool {
        self.bus.stops_before(access)
    }

    fn send_trace(&mut self, bytes: &[u8]) {
        self.bus.send_trace(bytes);
    }
}
