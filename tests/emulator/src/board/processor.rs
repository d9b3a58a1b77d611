//! The emulator's core with three things added: its accesses go over the board's own bus (`bus`),
//! the instructions of one interrupt handler can be counted, and a fault can be injected by moving
//! the program counter.
//!
//! Nothing here changes what the firmware sees: the bus answers at the addresses of the manual.

use std::collections::BTreeSet;

use rigless::emulator::{CoreBus, DataModel, Error, Exit, Processor, Queued};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use super::bus::Rerouted;
use super::cache::InstructionCache;
use super::flash::{Flash, WRITABLE};
use super::probe::{Effect, HandlerRun, Probe, ToCode};
use super::warm_core::WarmCore;

/// The number the architecture gives external interrupt 0.
pub const FIRST_EXTERNAL: u32 = 16;
const REGISTER_PC: usize = 15;
const REGISTER_XPSR: usize = 16;

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
            let upset = tally.upset.map(|upset| upset.entry);
            counted.chain(tally.masks.keys().copied()).chain(upset).collect()
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

    /// Runs like the core from breakpoint to breakpoint, and an instruction at a time where an
    /// upset is near.
    fn run_watched(&mut self, budget: u32, bus: &mut Rerouted<'_>) -> (Exit, u64) {
        let mut retired = 0;
        while retired < u64::from(budget) {
            bus.stepping = self.is_near_upset() || self.is_counting_lines();
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

    /// Returns true in the exception that an upset waits for, and from there on until it comes.
    fn is_near_upset(&self) -> bool {
        let waiting = {
            let tally = self.probe.tally();
            tally.upset.map(|upset| (upset.exception, tally.upset_progress > 0))
        };
        waiting.is_some_and(|(exception, has_begun)| has_begun || exception == self.exception())
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

    /// Ends the run of the counted handler once the exception has changed, which the instruction
    /// that just ran at a breakpoint, `place`, does.
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

    /// Notes that the instruction at `place` has masked interrupts or let them come again, if it is
    /// one of those.
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

    /// True if the program has ended, as its host has been told.
    fn has_ended(&self) -> bool {
        self.probe.tally().host.as_ref().is_some_and(|host| host.status.is_some())
    }

    /// Has the host serve the call at which the core stands, if there is a host. How the stretch
    /// ends, and the instruction that was done.
    fn host_call(&mut self, bus: &mut Rerouted<'_>) -> (Exit, u64) {
        let host = self.probe.tally().host.clone();
        let Some(mut host) = host else {
            self.core.answer_host_call(None);
            return (Exit::Returned, 0);
        };
        let answer = host.serve(self.register(0), self.register(1), bus);
        self.probe.tally().host = Some(host);
        // Also a call that never returns: the core is for the next board, too.
        self.core.answer_host_call(Some(answer.into()));
        (Exit::Returned, 1)
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
        if self.has_ended() {
            return (Exit::Waiting, 0);
        }
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
        let watched = !self.breakpoints.is_empty();
        let (exit, retired) =
            if watched { self.run_watched(budget, &mut bus) } else { self.core.run(budget, &mut bus) };
        let (exit, of_it) = if exit == Exit::HostCall { self.host_call(&mut bus) } else { (exit, 0) };
        let retired = retired + of_it;
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
        self.has_ended() || self.core.waiting()
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

    /// The time that passed without instructions, the lines that are high, and the core's own
    /// state.
    fn save(&self) -> Vec<u8> {
        let mut bytes = self.stalled.to_le_bytes().to_vec();
        bytes.extend(self.core.save_lines());
        bytes.extend(self.core.save());
        bytes
    }

    fn load(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let (stalled, rest) = bytes.split_first_chunk().ok_or(Error::State)?;
        let rest = self.core.load_lines(rest).ok_or(Error::State)?;
        self.core.load(rest)?;
        (self.stalled, self.counting) = (u64::from_le_bytes(*stalled), None);
        Ok(())
    }
}
