//! Measures a tick of the control law on this PC: `cargo run --release -p firmware --example
//! tick_host`. Prints `tick_host_ns=…`, the median over runs of a second each of an insertion and
//! withdrawal over and over, and by turns with it, as its peer, the same law in `f64`, which must
//! ask the converter for the same codes.

mod law_f64;

use control_core::controller::{Order, TickInput, TickOutput};
use control_core::units::Counts;
use control_core::{Config, Controller, TICK_HZ};
use law_f64::LawF64;
use std::hint::black_box;
use std::time::Instant;

const RUNS: usize = 21;
/// A second in and a second out: 700 counts are 11 mm at the default roller.
const DEPTH_COUNTS: i32 = 700;
const TICKS: i32 = TICK_HZ as i32;
/// Codes of the converter, of 4,096, by which the two may differ by rounding.
const CODES_APART: i32 = 2;

fn main() {
    let config = Config::commissioned_virtual();
    let plan = config.plan().expect("the default is sound");
    let mut controller = Controller::new(plan);
    controller.order(Order::Start);
    let angle = tick(&mut controller, 0, 0).angle;
    let mut law = LawF64::new(&config, f64::from(angle.0) * 1e-3);
    law.tick(0);
    let apart = (0..2).map(|run| apart(&mut controller, &mut law, run)).max().unwrap_or(0);
    assert!(apart <= CODES_APART, "{apart} codes apart");
    let (mut fixed, mut float) = (vec![], vec![]);
    for run in 0..RUNS {
        fixed.push(nanoseconds(run, |at, count| {
            assert!(tick(&mut controller, at, count).enable, "the law ran with torque on");
        }));
        float.push(nanoseconds(run, |_, count| {
            black_box(law.tick(black_box(count)));
        }));
    }
    println!("codes_apart={apart} tick_host_ns={:.1}", median(fixed));
    println!("tick_host_ns.peer=the-law-alone-in-f64 tick_host_ns.peer_value={:.1}", median(float));
}

fn tick(controller: &mut Controller, at: i32, count: i32) -> TickOutput {
    if at % (TICKS / 10) == 0 {
        controller.order(Order::Heartbeat);
    }
    black_box(controller.tick(black_box(TickInput { count: Counts(count), ..TickInput::default() })))
}

fn count(run: usize, at: i32) -> i32 {
    let way = DEPTH_COUNTS * at / TICKS;
    if run.is_multiple_of(2) { way } else { DEPTH_COUNTS - way }
}

/// The largest difference of the codes over a second.
fn apart(controller: &mut Controller, law: &mut LawF64, run: usize) -> i32 {
    let each = (0..TICKS).map(|at| {
        let count = count(run, at);
        (i32::from(tick(controller, at, count).sample.dac) - i32::from(law.tick(count))).abs()
    });
    each.max().unwrap_or(0)
}

/// Nanoseconds a tick, over a second of the device.
fn nanoseconds(run: usize, mut tick: impl FnMut(i32, i32)) -> f64 {
    let begin = Instant::now();
    (0..TICKS).for_each(|at| tick(at, count(run, at)));
    begin.elapsed().as_secs_f64() * 1e9 / f64::from(TICKS)
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
