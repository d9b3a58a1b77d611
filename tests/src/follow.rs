//! The board and the control core beside each other, tick for tick: what the pins show against what the core computes from the same
//! counts and angles.

use control_core::controller::{Order, TickInput};
use control_core::units::{Counts, Milliradians};
use control_core::{Config, Controller};
use link::Command;
use link::frames::EventKind;

use crate::board::Board;
use crate::pc::Pc;

/// A tick as the pins show it: the counter the firmware read, and the code it wrote before it read
/// the counter again.
struct PinTick {
    count: u32,
    code: u16,
    enabled: bool,
}

/// Runs a board whose hand begins after a second, under `config` or the default, for ten seconds, and sees that its codes, its enable
/// line and its samples are the control core's, bit for bit; how many ticks each state counted, and how many walls gave way.
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
    let log = board.at_stop(|stopped| std::mem::take(stopped.log()));

    let mut written = log.written.iter().peekable();
    let mut enable = log.enable.iter().peekable();
    let (mut code, mut enabled) = (0, false);
    let ticks: Vec<PinTick> = log
        .encoder
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
        .collect();
    assert!(ticks.len() > 100_000, "{} ticks", ticks.len());

    // The device numbers its ticks from the first one, and says in which it started.
    let started = pc
        .heard
        .events
        .iter()
        .find(|event| event.kind == EventKind::Started)
        .expect("the device started")
        .tick;
    let tilt = |tick: u64| {
        let first = pc.heard.samples.first().map_or(0, |&(tick, _)| tick);
        let sample = tick.checked_sub(first).and_then(|place| pc.heard.samples.get(place as usize));
        sample.map_or(0, |&(_, sample)| sample.tilt_mrad)
    };
    // The table of seed 000 looks up speed and angle in one tick of four, counted from the tick that took the patient. No frame names that
    // tick; the needle rests until long after it, so that only its quarter matters.
    let taken: Vec<Option<u64>> = config.as_ref().map_or(vec![None], |_| (0..4).map(Some).collect());
    let plan = config.unwrap_or_else(Config::commissioned_virtual).plan().expect("it may run");
    let step = |controller: &mut Controller, taken: Option<u64>, tick: u64, pins: &PinTick| {
        if Some(tick) == taken {
            controller.order(Order::Configure(plan.clone()));
        }
        if tick == started {
            controller.order(Order::Start);
        }
        controller.order(Order::Heartbeat);
        controller.tick(TickInput { count: Counts(pins.count.cast_signed()), tilt: Milliradians(tilt(tick)) })
    };
    let agrees = |taken: &Option<u64>| {
        let mut controller = Controller::new(plan.clone());
        (0_u64..).zip(&ticks).all(|(tick, pins)| step(&mut controller, *taken, tick, pins).dac.0 == pins.code)
    };
    let taken = taken.iter().copied().find(agrees).unwrap_or(taken[0]);
    let mut controller = Controller::new(plan.clone());
    let mut states = [0_u32; 8];
    for (tick, pins) in (0_u64..).zip(&ticks) {
        let output = step(&mut controller, taken, tick, pins);
        assert_eq!((output.enable, output.tripped), (pins.enabled, None), "tick {tick}: enable");
        assert_eq!(output.dac.0, pins.code, "tick {tick}: the DAC's code");
        states[usize::from(output.sample.state)] += 1;
        let streamed =
            tick.checked_sub(pc.heard.samples[0].0).and_then(|place| pc.heard.samples.get(place as usize));
        if let Some(&(streamed_tick, sample)) = streamed {
            assert_eq!((streamed_tick, sample), (tick, output.sample), "the sample that was streamed");
        }
    }
    let punctures = pc.heard.events.iter().filter(|event| matches!(event.kind, EventKind::Puncture { .. }));
    println!("| codes equal to control-core's | {} ticks |", ticks.len());
    println!("by state {states:?}; {:?}", pc.counts());
    (states, punctures.count())
}
