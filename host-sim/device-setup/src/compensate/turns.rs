//! The slow turns and the hold that are played before and after, and how long they take.

use crate::bench::DeviceDialogue;
use crate::servo::servo;
use control_core::controller::Sample;
use control_core::excitation::{Excitation, Signal};
use control_core::units::{Millimetres, MillimetresPerSecond};
use device_sim::error::Error;
use fixed::types::I16F16;
use std::f64::consts::TAU;
use std::time::Duration;

/// Speed of the slow turns, mm/s: a slow insertion.
const SPEED_MM_S: f64 = 10.0;
/// Turns of the roller each way.
pub(super) const TURNS: f64 = 1.05;
/// The time for which the roller is held.
const HOLD_MS: u32 = 6_000;

/// The slow turns and the hold.
pub(super) fn excitations(inertia: f64, radius_mm: f64, compensated: bool) -> (Excitation, Excitation) {
    let stroke = TURNS * TAU * radius_mm;
    let excitation = |signal, duration_ms| Excitation {
        signal,
        duration_ms,
        servo: servo(inertia, radius_mm),
        travel: Millimetres(I16F16::from_num(2.0 * stroke)),
        compensated,
    };
    let signal = Signal::Triangle {
        stroke: Millimetres(I16F16::from_num(stroke)),
        speed: MillimetresPerSecond(I16F16::from_num(SPEED_MM_S)),
    };
    (excitation(signal, (2.0 * stroke / SPEED_MM_S * 1e3) as u32), excitation(Signal::Hold, HOLD_MS))
}

pub(super) fn seconds(excitation: &Excitation) -> f64 {
    f64::from(excitation.duration_ms) * 1e-3
}

pub(super) async fn play(
    bench: &mut DeviceDialogue<'_>,
    turns: &Excitation,
    hold: &Excitation,
) -> Result<(Vec<Sample>, Vec<Sample>), Error> {
    Ok((played(bench, turns).await?, played(bench, hold).await?))
}

pub(super) async fn played(
    bench: &mut DeviceDialogue<'_>,
    excitation: &Excitation,
) -> Result<Vec<Sample>, Error> {
    bench.settle().await?;
    let longest = Duration::from_millis(u64::from(excitation.duration_ms) + 5_000);
    match bench.play_within(excitation, longest).await? {
        (samples, None) => Ok(samples),
        (_, Some(fault)) => Err(Error::failed(format_args!(
            "{fault}; see that nothing holds the roller and compensate again"
        ))),
    }
}
