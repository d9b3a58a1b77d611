//! The needle in a person's hand: the skin pushes back as the control core computes it.

use super::TILT_RAD;
use control_core::config::Config;
use control_core::controller::{Controller, Order, TickInput};
use control_core::units::{Counts, Milliradians};
use std::time::Duration;
use tests::browser::{Error, Page, check};

/// Tremor of the hand between two readings, and the converter's step.
const FORCE_TOLERANCE_N: f64 = 0.03;

/// A person takes the needle with the mouse and presses the skin: the force answers as the control
/// core computes it.
pub(super) fn drag(page: &mut Page) -> Result<(), Error> {
    page.wait("the needle outside", "__stats.depthMm < -3")?;
    let mut at = page.middle("section")?;
    page.mouse("mousePressed", at)?;
    page.wait("the needle taken", "document.getElementById('hand-note').textContent.startsWith('You hold')")?;
    push_until(page, &mut at, 1.9)?;
    // The hand holds still: needle and force settle.
    std::thread::sleep(Duration::from_millis(600));
    let depth_mm = page.number("__stats.depthMm")?;
    let force_n = page.number("__stats.forceN")?;
    let motor_n = page.number("__stats.motorN")?;
    let (least, greatest) = force_of_the_core(depth_mm)?;
    println!("at {depth_mm} mm the page shows {force_n} N, the core gives {least} to {greatest} N");
    check("the skin pushes back", force_n > 0.2, force_n)?;
    let allowed = least - FORCE_TOLERANCE_N..=greatest + FORCE_TOLERANCE_N;
    check("the force is the core's", allowed.contains(&force_n), (force_n, least, greatest))?;
    check("the motor gives it", (motor_n - force_n).abs() < FORCE_TOLERANCE_N, (motor_n, force_n))?;
    page.mouse("mouseReleased", at)?;
    std::thread::sleep(Duration::from_millis(1_500));
    let held = page.number("__stats.depthMm")?;
    check("the needle stays with the person", (held - depth_mm).abs() < 0.3, (held, depth_mm))
}

/// Moves the pressed mouse along the needle until the tip is at `depth_mm`.
fn push_until(page: &mut Page, at: &mut (f64, f64), depth_mm: f64) -> Result<(), Error> {
    for _ in 0..400 {
        if page.number("__stats.depthMm")? >= depth_mm {
            return Ok(());
        }
        *at = (at.0 + 3.0 * TILT_RAD.cos(), at.1 + 3.0 * TILT_RAD.sin());
        page.mouse("mouseMoved", *at)?;
        std::thread::sleep(Duration::from_millis(15));
    }
    Err(format!("the needle did not follow the mouse to {depth_mm} mm"))
}

/// The force that the control core gives with the tip at rest at `depth_mm` in whole skin: the
/// least on the way out, the greatest on the way in; friction makes the difference.
fn force_of_the_core(depth_mm: f64) -> Result<(f64, f64), Error> {
    let config = Config::commissioned_virtual();
    let device = config.device;
    let mm_per_turn = 2.0 * std::f64::consts::PI * device.roller_radius.0.to_num::<f64>();
    let mm_per_count = mm_per_turn / f64::from(device.counts_per_turn);
    let target = (depth_mm / mm_per_count).round() as i32;
    let beyond = target + (0.3 / mm_per_count) as i32;
    let mut core = Controller::new(config.plan().map_err(|e| e.to_string())?);
    core.order(Order::Start);
    let mut count: i32 = -100;
    let mut force = |target: i32| -> f64 {
        let mut force: f64 = 0.0;
        // Then half a second at rest.
        for tick in 0..5_000 + 20 * count.abs_diff(target) {
            if tick % 20 == 0 {
                count += (target - count).signum();
            }
            core.order(Order::Heartbeat);
            force = core.tick(TickInput { count: Counts(count), tilt: Milliradians(524) }).force.0.to_num();
        }
        force
    };
    let way_in = force(target);
    force(beyond);
    Ok((force(target).min(way_in), way_in))
}
