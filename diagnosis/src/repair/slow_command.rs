//! Commands that are logged more often than they are renewed, while the motion shows that the
//! machine had values in between.

use super::Renewals;
use super::balance::{self, Balance};
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use numerics::parallel;

/// Fewest new values that show a rhythm.
const FEWEST: usize = 20;
/// Part of the gaps between new values that are of the usual length, and how far they may be from
/// it, as a part of it.
const USUAL_PART: f64 = 0.9;
const NEAR: f64 = 0.25;
/// Part of what the command as it is held leaves of its variance that one which goes straight from
/// value to value may leave: a drive that holds its command moves its axis by steps of force, and
/// asks for nothing in between.
const DECISIVE: f64 = 0.5;
/// The same where the held command leaves more than this part, half of its root mean square: so
/// few values are not right either way.
const NEITHER: f64 = 0.8;
const LEAVES_MOST: f64 = 0.25;

/// Rows at which the command of each recording has a new value, where the motion asks for values in
/// between on every one whose command is held.
pub(super) fn renewals(all: &[&Recording], rig: &Rig) -> Vec<Option<Renewals>> {
    let is_plain = rig.effects.is_empty();
    let found = parallel::map_all(all, |one| {
        let rows = rhythm(&one.command).filter(|_| is_plain)?;
        let part = one.middle(balance::MOST_ROWS);
        let balance = Balance::new(&part, rig)?;
        let held = balance.left(0.0).part;
        let least = if held > LEAVES_MOST { NEITHER } else { DECISIVE };
        let is_sampled = balance.left_between(&rhythm(&part.command)?).part < least * held;
        let seconds = one.time_s[rows[rows.len() - 1]] - one.time_s[rows[0]];
        Some((is_sampled, Renewals { rate_hz: (rows.len() - 1) as f64 / seconds, rows }))
    });
    let all_sampled = found.iter().flatten().all(|(is_sampled, _)| *is_sampled);
    found.into_iter().map(|one| one.filter(|_| all_sampled).map(|(_, renewals)| renewals)).collect()
}

/// Rows at which a command changes, where they follow one another evenly and are not all.
fn rhythm(command: &[f64]) -> Option<Vec<usize>> {
    let rows: Vec<usize> = (1..command.len()).filter(|row| command[*row] != command[row - 1]).collect();
    let gaps: Vec<usize> = rows.windows(2).map(|w| w[1] - w[0]).collect();
    let mut sorted = gaps.clone();
    sorted.sort_unstable();
    let usual = *sorted.get(sorted.len() / 2)?;
    let is_near = |gap: &&usize| gap.abs_diff(usual) as f64 <= NEAR * usual as f64;
    let near = gaps.iter().filter(is_near).count();
    (usual > 1 && gaps.len() >= FEWEST && near as f64 >= USUAL_PART * gaps.len() as f64).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_even_rhythm_is_one() {
        let held = |every: usize| (0..600).map(|row| ((row / every) as f64 * 0.7).sin()).collect::<Vec<_>>();
        assert_eq!(rhythm(&held(5)).map(|rows| rows.len()), Some(119));
        assert!(rhythm(&held(1)).is_none(), "every row has its own");
        let coarse: Vec<f64> = (0..600).map(|row| (20.0 * (f64::from(row) * 0.05).sin()).round()).collect();
        assert!(rhythm(&coarse).is_none(), "a coarse command changes when it passes a step");
    }
}
