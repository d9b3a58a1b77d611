//! A minute at 10 kHz to fit and one to hold out: the time it takes, and how much memory.

#[path = "../tests/behaviour/common.rs"]
mod common;

use common::{Setup, record, rig};

fn main() {
    let setup = Setup {
        effect: "stribeck_friction",
        size: 1.0,
        closed: false,
        rate: 10_000.0,
        seconds: 60.0,
        disturbance: 0.05,
        seed: 9,
    };
    let rig = rig([0.1, 0.2, -0.2, 0.05], "offset = 0.0");
    let (fit, held) = (record(&setup, 1), record(&setup, 2));
    println!("{} and {} rows", fit.len(), held.len());
    let start = std::time::Instant::now();
    let outcome = diagnosis::diagnose_recordings(&rig, &[fit], &[held], &|stage, done| {
        println!("{:5.1} s {:3.0} % {stage}", start.elapsed().as_secs_f64(), 100.0 * done);
    });
    println!("{:.2} s", start.elapsed().as_secs_f64());
    match outcome {
        Ok(outcome) => print!("{}", outcome.summary()),
        Err(error) => println!("{error}"),
    }
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    for line in status.lines().filter(|line| line.starts_with("VmHWM")) {
        println!("{line}");
    }
}
