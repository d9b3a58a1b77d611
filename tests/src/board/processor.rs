//! The emulator's core with three things added: addresses of peripherals it has no model for lead
//! to windows where the board has one, every instruction can be put down to the interrupt that ran
//! it, and a fault can be injected by moving the program counter.
//!
//! Nothing here changes what the firmware sees: the windows answer at the addresses of the manual.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::emulator::{
    Access, AccessKind, Checked, CoreBus, DataModel, Error, Exit, InterruptLine, Processor, Queued,
};
use rigless::soc::{Endian, Width};
use rigless::time::VirtualNanos;

use super::flash::{Flash, WRITABLE};

/// Where the manual puts the USB core, how much of it there is, and where its window is.
pub(super) const OTG: (u64, u64, u64) = (0x5000_0000, 0x4_0000, 0x5010_0000);
/// The same for the DAC.
pub(super) const DAC: (u64, u64, u64) = (0x4000_7400, 0x400, 0x4010_0000);

fn window(address: u64) -> u64 {
    for (base, size, window) in [OTG, DAC] {
        if (base..base + size).contains(&address) {
            return address - base + window;
        }
    }
    address
}

/// The number the architecture gives external interrupt 0.
pub const FIRST_EXTERNAL: u32 = 16;
const REGISTER_SP: usize = 13;
const REGISTER_PC: usize = 15;
const REGISTER_XPSR: usize = 16;

/// One run of an interrupt handler, from the first instruction to the last, preemption excluded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HandlerRun {
    /// The instruction count of the run at its first instruction.
    pub from: u64,
    /// How many instructions it took.
    pub instructions: u32,
}

/// Something that goes wrong inside the core, and when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Upset {
    /// The exception that has to be running; 0 is thread mode.
    pub exception: u32,
    /// How many of its instructions it may do first.
    pub after: u32,
    /// What happens then.
    pub effect: Effect,
}

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// The program goes on at this address. Bit 0 is ignored.
    Jump(u32),
    /// The core does nothing for this many instructions' time, interrupts included.
    Stall(u64),
}

/// What a probe counts and does.
#[derive(Debug, Default)]
pub struct Tally {
    /// Count instructions by exception: exact, and about a hundred times slower.
    pub profile: bool,
    /// Every completed run of every exception handler, by exception number.
    pub runs: BTreeMap<u32, Vec<HandlerRun>>,
    /// Instructions in thread mode.
    pub thread: u64,
    /// The lowest main stack pointer seen while profiling.
    pub lowest_sp: Option<u32>,
    /// An upset still to come.
    pub upset: Option<Upset>,
    /// Instructions done in the exception the upset waits for.
    upset_progress: u32,
}

/// Shared between the test and the core.
#[derive(Debug, Clone, Default)]
pub struct Probe(Arc<Mutex<Tally>>);

impl Probe {
    /// What was counted, to read or to change.
    pub fn tally(&self) -> MutexGuard<'_, Tally> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A handler under way.
#[derive(Debug)]
struct Active {
    exception: u32,
    /// The stack pointer when it was first seen.
    sp: u32,
    run: HandlerRun,
}

/// The emulator's core, wrapped.
#[derive(Debug)]
pub(super) struct Probed {
    core: Box<dyn Processor>,
    probe: Probe,
    flash: Flash,
    /// Instructions' time in which nothing ran.
    stalled: u64,
    /// The handlers under way, innermost last.
    active: Vec<Active>,
}

impl Probed {
    pub(super) fn new(core: Box<dyn Processor>, probe: Probe, flash: Flash) -> Self {
        Self { core, probe, flash, stalled: 0, active: Vec::new() }
    }

    /// Has every access to the sectors the firmware writes to go over the bus.
    fn route_flash(&mut self) {
        for page in WRITABLE.step_by(self.core.page_size() as usize) {
            self.core.ask(Queued::Route(page));
        }
    }

    /// Whether the core has to be looked at after every instruction.
    fn steps(&self) -> bool {
        let tally = self.probe.tally();
        tally.profile || tally.upset.is_some()
    }

    fn register(&self, number: usize) -> u32 {
        let bytes = self.core.gdb_register(number).unwrap_or_default();
        bytes.try_into().map_or(0, u32::from_le_bytes)
    }

    fn exception(&self) -> u32 {
        self.register(REGISTER_XPSR) & 0x1FF
    }

    /// Runs one instruction at a time and looks at the core after each.
    fn run_stepping(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        let stalled_before = self.stalled;
        let mut retired = 0;
        while retired < u64::from(budget) {
            let (exit, did) = self.core.run(1, bus);
            retired += did;
            if did > 0 {
                self.account(did as u32);
            }
            let stalled = self.stalled - stalled_before;
            if stalled > 0 {
                // Time has passed: the run looks at what is due.
                return (Exit::Returned, retired + stalled);
            }
            if exit != Exit::Budget || !self.steps() {
                return (exit, retired);
            }
        }
        (Exit::Budget, retired)
    }

    /// Puts `did` instructions down to the exception they ran in. The core looks for interrupts
    /// before an instruction, so one that is new belongs to the new handler; a return changes the
    /// exception after its last instruction, so that one belongs to the old.
    fn account(&mut self, did: u32) {
        let exception = self.exception();
        let sp = self.register(REGISTER_SP);
        let count = self.retired();
        let probe = self.probe.clone();
        let mut tally = probe.tally();
        if tally.profile {
            tally.lowest_sp = Some(tally.lowest_sp.map_or(sp, |lowest| lowest.min(sp)));
        }
        let current = self.active.last().map_or(0, |handler| handler.exception);
        if exception == current {
            self.count(did, &mut tally);
        } else if let Some(outer) = self.active.iter().rposition(|handler| handler.exception == exception) {
            self.count(did, &mut tally);
            self.end_from(outer + 1, &mut tally);
        } else if exception == 0 {
            self.count(did, &mut tally);
            self.end_from(0, &mut tally);
        } else {
            // A tail chain takes over the frame of the handler that ended, and none of its own
            // instructions has run; a preemption pushes a frame below it and has run one.
            let chained = self.active.last().is_some_and(|handler| sp >= handler.sp);
            if chained {
                self.count(did, &mut tally);
                self.end_from(self.active.len() - 1, &mut tally);
            }
            let instructions = if chained { 0 } else { did };
            let from = count - u64::from(instructions);
            self.active.push(Active { exception, sp, run: HandlerRun { from, instructions } });
        }
        if let Some(upset) = tally.upset
            && upset.exception == exception
        {
            tally.upset_progress += did;
            if tally.upset_progress > upset.after {
                tally.upset = None;
                tally.upset_progress = 0;
                match upset.effect {
                    Effect::Jump(to) => {
                        self.core.set_gdb_register(REGISTER_PC, &(to & !1).to_le_bytes());
                    }
                    Effect::Stall(instructions) => self.stalled += instructions,
                }
            }
        }
    }

    /// Counts `did` instructions for the innermost handler, or for thread mode.
    fn count(&mut self, did: u32, tally: &mut Tally) {
        match self.active.last_mut() {
            Some(handler) => handler.run.instructions += did,
            None => tally.thread += u64::from(did),
        }
    }

    /// Ends every handler from the `first`th inwards.
    fn end_from(&mut self, first: usize, tally: &mut Tally) {
        for handler in self.active.drain(first..) {
            if tally.profile {
                tally.runs.entry(handler.exception).or_default().push(handler.run);
            }
        }
    }
}

impl Processor for Probed {
    fn run(&mut self, budget: u32, bus: &mut dyn CoreBus) -> (Exit, u64) {
        let flash = self.flash.clone();
        let stepping = self.steps();
        let mut bus = Rerouted { bus, flash: &flash, stalled: self.stalled, stepping };
        if stepping { self.run_stepping(budget, &mut bus) } else { self.core.run(budget, &mut bus) }
    }

    fn reset(&mut self) {
        self.active.clear();
        self.flash.array().restarted();
        self.core.reset();
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
    /// Whether the core is looked at after every instruction.
    stepping: bool,
}

impl CoreBus for Rerouted<'_> {
    fn access(&mut self, mut access: Access, from_code: bool) -> Option<u64> {
        let written = access.kind == AccessKind::Write;
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
        if written {
            self.flash.array().register_written(access.address, access.value as u32);
        }
        access.address = window(access.address);
        if self.stalled > 0 {
            access.instruction_count += self.stalled;
            access.virtual_time = self.bus.time(access.instruction_count);
        }
        self.bus.access(access, from_code)
    }

    fn time(&self, instructions: u64) -> VirtualNanos {
        self.bus.time(instructions + self.stalled)
    }

    fn queued(&mut self) -> Vec<Queued> {
        self.bus.queued()
    }

    fn carry_on(&mut self, instructions: u64, event: Option<VirtualNanos>) -> Option<u32> {
        if self.stepping {
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
