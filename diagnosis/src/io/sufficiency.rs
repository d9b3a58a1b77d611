//! Whether recordings can tell anything: the reasons to say that they cannot, before anything is fitted.

use crate::io::recording::Recording;
use crate::io::rig::Rig;

/// Shortest recording, s, and slowest rate, Hz, that are worth fitting.
const SHORTEST_S: f64 = 1.9;
const SLOWEST_HZ: f64 = 90.0;
const FEWEST_ROWS: usize = 300;
/// Fewest counts of travel.
const FEWEST_COUNTS: f64 = 100.0;

/// The reason why a recording cannot tell, if there is one.
pub(crate) fn too_little(recording: &Recording, rig: &Rig) -> Option<String> {
    let file = &recording.file;
    let seconds = recording.duration_s();
    let rate = recording.rate_hz();
    if rate < SLOWEST_HZ {
        return Some(format!(
            "{file} has {rate:.3} rows a second where at least 100 are needed (are its times in milliseconds?)"
        ));
    }
    if seconds < SHORTEST_S || recording.len() < FEWEST_ROWS {
        return Some(format!(
            "{file} lasts {seconds:.2} s where at least 2 s are needed (are its times in seconds?)"
        ));
    }
    let spread = |column: &[f64]| {
        let low = column.iter().copied().fold(f64::INFINITY, f64::min);
        let high = column.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        high - low
    };
    let command = spread(&recording.command);
    let largest = recording.command.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    if command <= 1e-6 * largest || command == 0.0 {
        return Some(format!("the command of {file} is constant"));
    }
    let counts = spread(&recording.position_counts);
    if counts < FEWEST_COUNTS {
        return Some(format!(
            "{file} is at rest: it moves by {counts:.0} counts in all; record a motion of some turns"
        ));
    }
    // Longest gap: a hold of the last command over it would be a guess.
    let gap = recording.time_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
    if gap > 0.25 * seconds {
        return Some(format!("{file} has a gap of {gap:.2} s in its {seconds:.2} s"));
    }
    if let Some(limit) = rig.actuator.limit {
        let over = recording.command.iter().filter(|u| u.abs() > 1.5 * limit).count();
        if over * 10 > recording.len() {
            return Some(format!(
                "the command of {file} reaches {largest:.4}, far above the drive's limit of {limit}: its unit is not the rig's"
            ));
        }
    }
    let travel = counts / rig.encoder.counts_per_unit;
    let asked = rig.actuator.gain.abs() * largest / rig.model.inertia;
    // Constant acceleration over the whole recording bounds how far the axis can get; a thousandth of noise shows less.
    if travel > 30.0 * asked * seconds * seconds {
        return Some(format!(
            "{file} travels {travel:.3} {}, which its command cannot bring about with the rig's inertia and gain: a unit is off",
            rig.kind.length()
        ));
    }
    None
}
