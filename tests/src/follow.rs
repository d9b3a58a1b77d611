//! The board and the control core side by side, tick for tick: what the pins show against what the
//! core computes from the same counts and angles.

use control_core::controller::{LargeOrder, Order, Sample, TickInput, TickOutput};
use control_core::event::Fault;
use control_core::units::{Counts, Milliradians};
use control_core::{Config, Controller, Plan};
use link::Command;
use link::frames::EventKind;

use crate::pc::Pc;
use emulator::board::{Board, Log};

/// A tick as the pins show it: the counter the firmware read, and the code it wrote before it read
/// the counter again.
struct PinTick {
    count: u32,
    code: u16,
    enabled: bool,
}

/// The ticks that the pins show.
fn pin_ticks(log: &Log) -> Vec<PinTick> {
    let mut written = log.written.iter().peekable();
    let mut enable = log.enable.iter().peekable();
    let (mut code, mut enabled) = (0, false);
    log.encoder
        .windows(2)
        .map(|pair| {
            while let Some(write) = written.next_if(|write| write.at < pair[1].at) {
                code = write.code;
            }
            while let Some(&(_, level)) = enable.next_if(|&&(at, _)| at < pair[1].at) {
                enabled = level;
            }
            PinTick { count: pair[0].value, code, enabled }
        })
        .collect()
}

/// The control core's inputs, tick by tick, with which it does what a board has done.
struct Replay<'a> {
    plan: Plan,
    /// The tick in which the board started.
    started: u64,
    samples: &'a [(u64, Sample)],
}

impl Replay<'_> {
    /// The tilt of a tick, where it was streamed.
    fn tilt(&self, tick: u64) -> Milliradians {
        Milliradians(self.sample(tick).map_or(0, |(_, sample)| sample.tilt_mrad))
    }

    fn sample(&self, tick: u64) -> Option<(u64, Sample)> {
        let first = self.samples.first().map_or(0, |&(tick, _)| tick);
        self.samples.get(tick.checked_sub(first)? as usize).copied()
    }

    /// One tick of a controller that takes the patient in tick `taken`.
    fn tick(&self, controller: &mut Controller, taken: Option<u64>, tick: u64, count: u32) -> TickOutput {
        if Some(tick) == taken {
            controller.order(LargeOrder::Configure(self.plan.clone()));
        }
        if tick == self.started {
            controller.order(Order::Start);
        }
        controller.order(Order::Heartbeat);
        controller.tick(TickInput { count: Counts(count.cast_signed()), tilt: self.tilt(tick) })
    }

    /// Returns the code that a board puts out.
    fn code(&self, output: &TickOutput) -> u16 {
        if output.enable { output.dac.0 } else { self.plan.device().dac.mid_scale() }
    }

    /// True if a controller that takes the patient in tick `taken` computes every code.
    fn agrees(&self, ticks: &[PinTick], taken: Option<u64>) -> bool {
        let mut controller = Controller::new(self.plan.clone());
        (0_u64..)
            .zip(ticks)
            .all(|(tick, pins)| self.code(&self.tick(&mut controller, taken, tick, pins.count)) == pins.code)
    }
}

/// Runs a board whose hand begins after a second, under `config` or the default, for ten seconds,
/// and sees that its codes, its enable line and its samples are the control core's, bit for bit;
/// how many ticks each state counted, and how many walls gave way.
///
/// # Panics
///
/// At the first tick that is not.
#[must_use]
pub fn follows(mut board: Board, config: Option<Config>) -> ([u32; 8], usize) {
    let mut pc = Pc::new();
    pc.connect(&mut board);
    if let Some(config) = &config {
        pc.configure(&mut board, config);
    }
    board.run_until(1_000_000_000);
    pc.listen(&mut board);
    pc.must(&mut board, Command::Start);
    while board.now() < 11_000_000_000 {
        pc.run_ms(&mut board, 100);
    }
    let (states, tripped) = agrees(&mut board, &pc, config);
    assert_eq!(tripped, None);
    let ticks: u32 = states.iter().sum();
    assert!(ticks > 100_000, "{ticks} ticks");
    let punctures = pc.heard.events.iter().filter(|event| matches!(event.kind, EventKind::Puncture { .. }));
    println!("| codes equal to control-core's | {ticks} ticks |");
    println!("by state {states:?}; {:?}", pc.counts());
    (states, punctures.count())
}

/// Sees that what a board has done since it was switched on, under `config` or the default, is what
/// the control core does, bit for bit; how many ticks each state counted, and what tripped first.
///
/// # Panics
///
/// At the first tick that is not.
#[must_use]
pub fn agrees(board: &mut Board, pc: &Pc, config: Option<Config>) -> ([u32; 8], Option<Fault>) {
    let log = board.at_stop(|stopped| std::mem::take(stopped.log()));
    let ticks = pin_ticks(&log);
    assert!(!pc.heard.samples.is_empty(), "the device streamed nothing");

    // The device numbers its ticks from the first one, and says in which it started.
    let mut events = pc.heard.events.iter();
    let started = events.find(|event| event.kind == EventKind::Started).expect("the device started").tick;
    // The table of Paper 000 looks up speed and angle in one tick of four, counted from the tick
    // that took the patient. No frame names that tick. The needle rests until long after it, so
    // only its remainder by four matters.
    let candidates: Vec<Option<u64>> = config.as_ref().map_or(vec![None], |_| (0..4).map(Some).collect());
    let plan = config.unwrap_or_else(Config::commissioned_virtual).plan().expect("it may run");
    let replay = Replay { plan, started, samples: &pc.heard.samples };
    let taken =
        candidates.iter().copied().find(|&taken| replay.agrees(&ticks, taken)).unwrap_or(candidates[0]);
    let mut controller = Controller::new(replay.plan.clone());
    let (mut states, mut tripped) = ([0_u32; 8], None);
    for (tick, pins) in (0_u64..).zip(&ticks) {
        let output = replay.tick(&mut controller, taken, tick, pins.count);
        assert_eq!(output.enable, pins.enabled, "tick {tick}: enable, {:?}", output.tripped);
        assert_eq!(replay.code(&output), pins.code, "tick {tick}: the DAC's code");
        states[usize::from(output.sample.state)] += 1;
        tripped = tripped.or(output.tripped);
        if let Some((streamed_tick, sample)) = replay.sample(tick) {
            assert_eq!((streamed_tick, sample), (tick, output.sample), "the sample that was streamed");
        }
    }
    (states, tripped)
}
