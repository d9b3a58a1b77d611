//! The command that makes force: the recorded one after the command effects of a model.

use crate::fit::blocked_recording::BlockedRecording;
use crate::laws::{CommandLaw, Effect};

/// The effective commands of recordings under effects of which the last acts on the command; none
/// where it does not.
pub(crate) fn effective_commands(tracks: &[BlockedRecording], effects: &[Effect]) -> Option<Vec<Vec<f64>>> {
    CommandLaw::new(effects.last()?)?;
    tracks.iter().map(|track| effective_command(track, effects)).collect()
}

/// The effective command of a recording under the command effects of a model, per row.
pub(crate) fn effective_command(track: &BlockedRecording, effects: &[Effect]) -> Option<Vec<f64>> {
    let mut laws: Vec<CommandLaw> = effects.iter().filter_map(CommandLaw::new).collect();
    if laws.is_empty() {
        return None;
    }
    // A delay alone is what most trials are of.
    if let [CommandLaw::Delay { delay, .. }] = laws.as_slice() {
        return Some(delayed(&track.rows.command, &track.rows.hold, *delay));
    }
    let velocity = |row: usize| track.motion.v.get(row / track.rows.per_block).copied().unwrap_or(0.0);
    let rows = track.rows.command.iter().zip(track.rows.hold.iter()).enumerate();
    let effective = |(row, (u, h)): (usize, (&f64, &f64))| {
        laws.iter_mut().fold(*u, |u, law| law.step(u, velocity(row), *h))
    };
    Some(rows.map(effective).collect())
}

/// Mean over each row of commands that arrive late, as [`CommandLaw::Delay`] makes it: differences
/// of the command's integral, which cost no queue. A negative `delay`, s, is a command that arrives
/// early.
pub(crate) fn delayed(command: &[f64], hold: &[f64], delay: f64) -> Vec<f64> {
    // The row that holds what arrives now, when it began, and the integral until then.
    let (mut row, mut began, mut before) = (0, 0.0, 0.0);
    let mut integral = |time: f64| {
        while row + 1 < command.len() && began + hold[row] <= time {
            before += command[row] * hold[row];
            began += hold[row];
            row += 1;
        }
        // Before the first row the command is taken to have stood still.
        before + command[row] * (time - began)
    };
    let (mut time, mut last) = (-delay, integral(-delay));
    hold.iter()
        .map(|h| {
            time += h;
            let now = integral(time);
            let mean = (now - last) / h;
            last = now;
            mean
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::EffectName;

    #[test]
    fn a_delayed_command_is_what_the_law_of_a_delay_makes_of_it() {
        let hold: Vec<f64> = (0..500).map(|i| 1e-3 * (1.0 + 0.2 * f64::from(i % 7))).collect();
        let command: Vec<f64> = (0..500).map(|i| (0.3 * f64::from(i)).sin() + 0.5).collect();
        for delay in [1e-6, 0.4e-3, 1e-3, 7.3e-3, 0.9] {
            let effect = Effect::shaped(EffectName::CommandDelay, &[("delay", delay)]);
            let mut law = CommandLaw::new(&effect).expect("a delay acts on the command");
            for (now, (u, h)) in delayed(&command, &hold, delay).iter().zip(command.iter().zip(&hold)) {
                let expected = law.step(*u, 0.0, *h);
                assert!((now - expected).abs() < 1e-9, "{now} {expected} at a delay of {delay}");
            }
        }
    }
}
