//! The test whether recordings suffice for a diagnosis, before anything is fitted.

use crate::io::recording::Recording;
use crate::io::rig::Rig;
use crate::numerics::spread::spread;

/// Least of all recordings of a kind together, s and rows: short ones are pooled.
const SHORTEST_S: f64 = 1.9;
const SHORTEST_HOLDOUT_S: f64 = 0.9;
const FEWEST_ROWS: usize = 150;
/// Least of one recording, s and rows.
const LEAST_S: f64 = 0.25;
const LEAST_ROWS: usize = 40;
/// Slowest and fastest rate that is worth fitting, Hz.
const SLOWEST_HZ: f64 = 19.0;
const FASTEST_HZ: f64 = 25_000.0;
/// Nobody records a motion more slowly: the unit of the time is another.
const NOBODYS_HZ: f64 = 2.0;
/// Fewest counts of travel.
const FEWEST_COUNTS: f64 = 100.0;

/// The reason why recordings do not suffice for a verdict, if there is one; short recordings may
/// suffice together although each is too short by itself.
pub(crate) fn too_little(fit: &[Recording], holdout: &[Recording]) -> Option<String> {
    if let Some(reason) = fit.iter().chain(holdout).find_map(alone) {
        let enough = fit.iter().chain(holdout).filter(|recording| alone(recording).is_none());
        return Some(with_usable(
            reason,
            &enough.map(|recording| recording.file.as_str()).collect::<Vec<_>>(),
        ));
    }
    let pooled = |all: &[Recording], least: f64, what: &str| {
        let seconds: f64 = all.iter().map(Recording::duration_s).sum();
        let rows: usize = all.iter().map(Recording::len).sum();
        let files: Vec<&str> = all.iter().map(|recording| recording.file.as_str()).collect();
        (seconds < least || rows < FEWEST_ROWS).then(|| {
            format!(
                "{} {} {seconds:.2} s and {rows} rows {what} where at least {:.0} s and {FEWEST_ROWS} rows are needed (are its times in seconds?)",
                files.join(", "),
                if all.len() == 1 { "lasts" } else { "last" },
                least.ceil()
            )
        })
    };
    pooled(fit, SHORTEST_S, "to fit on").or_else(|| pooled(holdout, SHORTEST_HOLDOUT_S, "to judge by"))
}

/// A sentence on a recording that cannot be used, with the files that still could.
pub(crate) fn with_usable(sentence: String, usable: &[&str]) -> String {
    match usable.split_last() {
        None => sentence,
        Some((one, [])) => format!("{sentence}; {one} could still be used"),
        Some((last, more)) => format!("{sentence}; {} and {last} could still be used", more.join(", ")),
    }
}

/// The reason why one recording does not suffice.
fn alone(recording: &Recording) -> Option<String> {
    let file = &recording.file;
    let seconds = recording.duration_s();
    if let Some(sentence) = rate_is_off(recording) {
        return Some(sentence);
    }
    if seconds < LEAST_S || recording.len() < LEAST_ROWS {
        return Some(format!(
            "{file} lasts {seconds:.2} s with {} rows where at least {LEAST_S} s and {LEAST_ROWS} rows are needed (are its times in seconds?)",
            recording.len()
        ));
    }
    let largest = recording.command.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    // None at all is a free motion; one that never changes is distinguished from no offset.
    if largest > 0.0 && spread(&recording.command) <= 1e-6 * largest {
        return Some(format!("the command of {file} is constant; record one that changes"));
    }
    // Longest gap: a hold of the last command over it would be a guess.
    let gap = recording.time_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
    (gap > 0.25 * seconds).then(|| {
        format!("{file} has a gap of {gap:.2} s in its {seconds:.2} s; cut it into two recordings there")
    })
}

/// A sentence on a rate that is not read.
fn rate_is_off(recording: &Recording) -> Option<String> {
    let rate = recording.rate_hz();
    let unit = if rate < SLOWEST_HZ { "milliseconds" } else { "minutes" };
    (!(SLOWEST_HZ..FASTEST_HZ).contains(&rate)).then(|| {
        format!(
            "{} has {rate:.3} rows a second where 20 to 20000 are read (are its times in {unit}?)",
            recording.file
        )
    })
}

/// The reason why a recording cannot be used at all: at rest, or of another unit than the rig.
pub(crate) fn unusable(recording: &Recording, rig: &Rig) -> Option<String> {
    let file = &recording.file;
    if let Some(sentence) =
        rate_is_off(recording).filter(|_| !(NOBODYS_HZ..FASTEST_HZ).contains(&recording.rate_hz()))
    {
        return Some(sentence);
    }
    let counts = spread(&recording.position_counts);
    if counts < FEWEST_COUNTS {
        return Some(format!(
            "{file} is at rest: it moves by {counts:.0} counts in all; record a motion of some turns"
        ));
    }
    let largest = recording.command.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    if let Some(limit) = rig.actuator.limit {
        let over = recording.command.iter().filter(|u| u.abs() > 1.5 * limit).count();
        if over * 10 > recording.len() {
            return Some(format!(
                "the command of {file} reaches {largest:.4}, far above the drive's limit of {limit}: its unit is not the rig's; convert the column, or correct the limit"
            ));
        }
    }
    let seconds = recording.duration_s();
    let travel = counts / rig.encoder.counts_per_unit;
    let asked = rig.actuator.gain.abs() * largest / rig.model.inertia;
    // Constant acceleration over the whole recording bounds how far the command can bring the axis.
    // One that is zero, or is weak and lets something else drive the motion, is another matter:
    // there the motion itself must be possible.
    (largest > 0.0 && travel > IMPOSSIBLE * asked * seconds * seconds).then(|| {
        format!(
            "{file} travels {travel:.3} {}, which its command cannot cause with the rig's inertia and gain: correct the unit that is wrong (counts, command or time)",
            rig.kind.length()
        )
    })
}

/// Travel over the farthest that the command can cause from which a unit is wrong.
const IMPOSSIBLE: f64 = 30.0;
