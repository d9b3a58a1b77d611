//! What a tick of the control law costs on this PC: `cargo run --release -p firmware --example tick_host`. Prints
//! `tick_host_ns=…`, the median over runs of a second each of an insertion and withdrawal over and over.

use control_core::controller::{Order, TickInput};
use control_core::units::Counts;
use control_core::{Config, Controller, TICK_HZ};
use std::hint::black_box;
use std::time::Instant;

const RUNS: usize = 21;
/// A second in and a second out: 700 counts are 11 mm at the default roller.
const DEPTH_COUNTS: i32 = 700;

fn main() {
    let plan = Config::commissioned_virtual().plan().expect("the default is sound");
    let mut controller = Controller::new(plan);
    let mut nanoseconds: Vec<f64> = (0..RUNS).map(|run| second(&mut controller, run)).collect();
    nanoseconds.sort_by(f64::total_cmp);
    println!("tick_host_ns={:.1}", nanoseconds[RUNS / 2]);
}

/// Nanoseconds a tick, over a second of the device.
fn second(controller: &mut Controller, run: usize) -> f64 {
    controller.order(Order::Start);
    let ticks = TICK_HZ as i32;
    let begin = Instant::now();
    for tick in 0..ticks {
        let way = DEPTH_COUNTS * tick / ticks;
        let count = if run.is_multiple_of(2) { way } else { DEPTH_COUNTS - way };
        if tick % (ticks / 10) == 0 {
            controller.order(Order::Heartbeat);
        }
        let output =
            black_box(controller.tick(black_box(TickInput { count: Counts(count), ..TickInput::default() })));
        assert!(output.enable, "the law ran with torque on");
    }
    begin.elapsed().as_secs_f64() * 1e9 / f64::from(ticks)
}
