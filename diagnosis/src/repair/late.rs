//! Commands that are logged after the motion that they make. No machine moves before its force, so
//! that more than a row of this is the log's; a force that acts late is the machine's, or a reading
//! that is logged late, and a law of the library.

use super::balance::{self, Balance, Unbalanced};
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use numerics::parallel;

/// Longest time that is tried, s, and most rows.
const LONGEST_S: f64 = 0.1;
const MOST_ROWS: usize = 60;
/// Rows within which every model allows for a skew of its own.
const SKEW_ROWS: i32 = 1;
/// Part of the variance that a skew leaves which the shift may leave: half of its root mean square.
const DECISIVE: f64 = 0.25;
/// Part of the command's variance that the shift may leave: the balance has to speak of the
/// machine.
const UNDERSTOOD: f64 = 0.25;
/// Least part of it that inertia takes: friction of a slow axis comes after its reversals by
/// itself, where it takes some travel to build up.
const BY_INERTIA: f64 = 0.1;

/// Rows by which the commands of each recording are logged late; none where they are not, or not
/// all by the same time.
pub(super) fn late_rows(all: &[&Recording], rig: &Rig) -> Option<Vec<usize>> {
    if !rig.effects.is_empty() {
        return None;
    }
    let found = parallel::map_all(all, |one| alone(one, rig));
    let found: Vec<usize> = found.into_iter().collect::<Option<_>>()?;
    let seconds = |(rows, one): (&usize, &&Recording)| *rows as f64 / one.rate_hz();
    let mut times: Vec<f64> = found.iter().zip(all).map(seconds).collect();
    let each = times.clone();
    times.sort_by(f64::total_cmp);
    let usual = *times.get(times.len() / 2)?;
    let is_usual = |(time, one): (&f64, &&Recording)| (time - usual).abs() * one.rate_hz() < 1.5;
    let agree = each.iter().zip(all).all(is_usual);
    agree.then(|| all.iter().map(|one| (usual * one.rate_hz()).round() as usize).collect())
}

/// Rows by which the commands of one recording are logged late.
fn alone(recording: &Recording, rig: &Rig) -> Option<usize> {
    let recording = &recording.middle(balance::MOST_ROWS);
    let rate = recording.rate_hz();
    let most = ((LONGEST_S * rate) as usize).min(MOST_ROWS) as i32;
    let balance = Balance::new(recording, rig)?;
    let left_at = |rows: i32| balance.left(f64::from(rows) / rate);
    let by_skew = (-SKEW_ROWS..=SKEW_ROWS).map(left_at).map(|left| left.part).fold(f64::INFINITY, f64::min);
    let (rows, Unbalanced { part, by_inertia }) =
        (-most..=most).map(|rows| (rows, left_at(rows))).min_by(|a, b| a.1.part.total_cmp(&b.1.part))?;
    let is_decisive = part < DECISIVE * by_skew && part < UNDERSTOOD && by_inertia > BY_INERTIA;
    (rows < -SKEW_ROWS && rows > -most && is_decisive).then_some(-rows as usize)
}
