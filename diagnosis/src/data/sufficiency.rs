//! The test whether recordings suffice for a diagnosis, before anything is fitted.

use crate::data::recording::Recording;
use crate::data::rig::Rig;
use numerics::spread::spread;

/// Least of all recordings of a kind together, s and rows: short ones are pooled.
const SHORTEST_S: f64 = 1.9;
const SHORTEST_HOLDOUT_S: f64 = 0.9;
const FEWEST_ROWS: usize = 150;
/// Least of one recording, s and rows.
const LEAST_S: f64 = 0.25;
const LEAST_ROWS: usize = 40;
/// Slowest and fastest rate that is worth fitting, Hz.
pub(crate) const SLOWEST_HZ: f64 = 19.0;
const FASTEST_HZ: f64 = 25_000.0;
/// Nobody records a motion more slowly: the unit of the time is another.
const NOBODYS_HZ: f64 = 2.0;
/// Fewest counts of travel.
const FEWEST_COUNTS: f64 = 100.0;

/// The reason why recordings do not suffice for a verdict, if there is one; short recordings may
/// suffice together although each is too short by itself.
pub(crate) fn too_little(fit: &[Recording], holdout: &[Recording]) -> Option<String> {
    let all: Vec<&Recording> = fit.iter().chain(holdout).collect();
    let reason = |one: &&Recording| alone(one).or_else(|| of_constant_command(one, &all));
    if let Some(first) = all.iter().find_map(reason) {
        let enough = all.iter().filter(|one| reason(one).is_none());
        return Some(with_usable(
            first,
            &enough.map(|recording| recording.file.as_str()).collect::<Vec<_>>(),
        ));
    }
    together(fit, SHORTEST_S, "to fit on").or_else(|| together(holdout, SHORTEST_HOLDOUT_S, "to judge by"))
}

/// The reason why recordings together do not suffice for `what`, which needs `least` s.
fn together(all: &[Recording], least: f64, what: &str) -> Option<String> {
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
    // Longest gap: a hold of the last command over it would be a guess.
    let gap = recording.time_s.windows(2).map(|w| w[1] - w[0]).fold(0.0, f64::max);
    (gap > 0.25 * seconds).then(|| {
        format!("{file} has a gap of {gap:.2} s in its {seconds:.2} s; cut it into two recordings there")
    })
}

/// Part of the travel by which an axis comes back where it reverses.
const BACK: f64 = 0.05;

/// The reason why the constant command of a recording says nothing: no recording has another
/// command, so that nothing distinguishes it from an offset, or the axis reverses more often than a
/// constant force can make it. No command at all is a free motion.
fn of_constant_command(recording: &Recording, all: &[&Recording]) -> Option<String> {
    let first = *recording.command.first()?;
    let is_same = |one: &Recording| one.command.iter().all(|u| (u - first).abs() <= 1e-6 * first.abs());
    if first == 0.0 || !is_same(recording) {
        return None;
    }
    let is_offset = all.iter().all(|one| is_same(one));
    (is_offset || reversals(&recording.position_counts) > 1)
        .then(|| format!("the command of {} is constant; record one that changes", recording.file))
}

/// The number of times that a position comes back by [`BACK`] of its travel.
fn reversals(counts: &[f64]) -> usize {
    let back = BACK * spread(counts);
    let (mut count, mut way, mut farthest) = (0, 0.0, counts[0]);
    for place in counts {
        let ahead = if way == 0.0 { (place - farthest).abs() - back } else { way * (place - farthest) };
        if way == 0.0 && ahead > 0.0 {
            (way, farthest) = ((place - farthest).signum(), *place);
        } else if way != 0.0 && ahead > 0.0 {
            farthest = *place;
        } else if way != 0.0 && ahead < -back {
            (count, way, farthest) = (count + 1, -way, *place);
        }
    }
    count
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A second at 500 Hz under a constant command.
    fn under(command: f64, place: fn(f64) -> f64) -> Recording {
        let time_s: Vec<f64> = (0..500).map(|row| f64::from(row) * 2e-3).collect();
        let position_counts = time_s.iter().map(|t| (1e4 * place(*t)).round()).collect();
        let command = vec![command; time_s.len()];
        Recording { file: "fit.csv".into(), time_s, position_counts, command, ..Recording::default() }
    }

    #[test]
    fn constant_commands_that_differ_are_steps() {
        // An axis that ran the other way first.
        let all = [under(1.0, |t| t * t), under(-1.2, |t| 1.2 * t - t * t)];
        let [one, other] = &all;
        assert_eq!(too_little(&all, std::slice::from_ref(one)), None);
        assert!(of_constant_command(one, &[one, one]).is_some(), "nothing distinguishes it from an offset");
        let swings = under(1.0, |t| (4.0 * TAU * t).sin());
        assert!(of_constant_command(&swings, &[&swings, other]).is_some(), "no constant force does that");
        let free = under(0.0, |t| (4.0 * TAU * t).sin());
        assert_eq!(of_constant_command(&free, &[&free, other]), None, "nothing drives a free motion");
    }

    #[test]
    fn a_position_that_comes_back_reverses() {
        let turns = |place: fn(f64) -> f64| reversals(&under(0.0, place).position_counts);
        assert_eq!(turns(|t| t), 0);
        assert_eq!(turns(|t| t + 0.002 * (90.0 * t).sin()), 0, "a cogging motor runs on");
        assert_eq!(turns(|t| 1.2 * t - t * t), 1);
        assert_eq!(turns(|t| (2.0 * TAU * t).sin()), 4);
    }
}
