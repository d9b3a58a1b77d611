//! Ticks of plant and control core together, a second: on one thread, how it scales over two, and
//! the time of one, ten and a hundred times as many.
//!
//! `cargo run --release -p host-sim --example plant_speed`

use device_sim::device::virtual_device::VirtualDevice;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use std::time::Instant;

/// A minute of the device.
const TICKS: u32 = 600_000;
const REPEATS: u32 = 5;
/// Ticks of which the time is compared: a hundredth of a minute, a tenth, and all of it.
const WORK: [u32; 3] = [TICKS / 100, TICKS / 10, TICKS];

/// Seconds that so many ticks of a new device take.
fn seconds(ticks: u32) -> f64 {
    let profile = Profile::find("adult").expect("it is built in");
    let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
    let mut device = VirtualDevice::new(&profile, procedure);
    device.start_alone();
    let begin = Instant::now();
    for _ in 0..ticks {
        device.tick_alone();
    }
    let taken = begin.elapsed().as_secs_f64();
    assert!(device.is_enabled(), "it ran with torque on");
    taken
}

/// Ticks a second of `threads` devices side by side, all together; the best of a few runs.
fn rate(threads: usize) -> f64 {
    (0..REPEATS)
        .map(|_| {
            std::thread::scope(|scope| {
                let all: Vec<_> =
                    (0..threads).map(|_| scope.spawn(|| f64::from(TICKS) / seconds(TICKS))).collect();
                all.into_iter().map(|one| one.join().expect("a run ends")).sum::<f64>()
            })
        })
        .fold(0.0, f64::max)
}

fn main() {
    let (one, two) = (rate(1), rate(2));
    println!("plant_core_ticks_per_s={one:.0} plant_core_scaling={:.2}", two / one);
    for ticks in WORK {
        let least = (0..REPEATS).map(|_| seconds(ticks)).fold(f64::INFINITY, f64::min);
        println!("work.plant.ticks.{ticks}={least:.6}");
    }
}
