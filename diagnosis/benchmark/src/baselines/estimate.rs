//! One estimate for all baselines: position on an even grid, low-passed without phase, differenced
//! twice. Every column of a rival's library goes through the same low-pass, so that both sides of
//! an equation see the same filter.

use crate::generator::case::Case;
use crate::generator::simulate;
use crate::signal::{derivative, low_pass, rms};

/// One grid point of what a rival may use.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Row {
    pub(crate) command: f64,
    /// Rate of the command, low-passed.
    pub(crate) command_rate: f64,
    /// Travel since the start of the recording.
    pub(crate) place: f64,
    pub(crate) speed: f64,
    /// Low-passed: the target.
    pub(crate) acceleration: f64,
    /// Second derivative of the command, low-passed.
    pub(crate) command_bend: f64,
    /// Share of the recording passed.
    pub(crate) progress: f64,
    pub(crate) tilt: f64,
    pub(crate) load: f64,
    /// Travel since the last reversal.
    pub(crate) since_reversal: f64,
}

/// One recording on an even grid.
#[derive(Clone, Debug, Default)]
pub(crate) struct BaselineTable {
    pub(crate) rows: Vec<Row>,
    /// Grid points that move, thinned to the bandwidth, away from the ends.
    pub(crate) kept: Vec<usize>,
    pub(crate) rate: f64,
    pub(crate) band: f64,
    /// Independent samples in the two fit recordings together, about.
    pub(crate) independent: f64,
}

/// Estimates recording `k` from what the files hold: stamps, commands, counts, tilt, force.
pub(crate) fn table(case: &Case, k: usize) -> BaselineTable {
    let source = &case.recordings[k];
    let (rate, band) = (case.machine.rate, case.machine.residual_bandwidth());
    let (Some(first), Some(last)) = (source.first(), source.last()) else { return BaselineTable::default() };
    let n = ((last.stamp - first.stamp) * rate) as usize;
    let [counts, commands, tilt, load] = on_even_grid(source, first.stamp, rate, n);
    let start = counts.first().copied().unwrap_or(0.0);
    let place: Vec<f64> = counts.iter().map(|c| (c - start) / case.plant.counts_per_unit).collect();
    let place = low_pass(&place, rate, band);
    let speed = derivative(&place, rate);
    let acceleration = derivative(&speed, rate);
    let smooth_command = low_pass(&commands, rate, band);
    let command_rate = derivative(&smooth_command, rate);
    let command_bend = derivative(&command_rate, rate);
    // Far above the bandwidth the grid may be thinner: what selects works on tens of columns.
    let step = ((rate / (20.0 * band)) as usize).max(1);
    let command = if step > 1 { low_pass(&commands, rate, 5.0 * band) } else { commands };
    let slowest = 0.01 * rms(&speed);
    let edge = ((2.0 * rate / band) as usize).min(n / 10);
    let (mut rows, mut kept) = (Vec::with_capacity(n / step + 1), Vec::new());
    let (mut reversal, mut direction) = (0.0, 0.0);
    for i in (0..n).step_by(step) {
        if speed[i].abs() > slowest && speed[i].signum() != direction {
            direction = speed[i].signum();
            reversal = place[i];
        }
        if rows.len() % 5 == 0 && i >= edge && i + edge < n && speed[i].abs() > slowest {
            kept.push(rows.len());
        }
        rows.push(Row {
            command: command[i],
            command_rate: command_rate[i],
            command_bend: command_bend[i],
            place: place[i],
            speed: speed[i],
            acceleration: acceleration[i],
            progress: i as f64 / n as f64,
            tilt: tilt[i].sin(),
            load: load[i],
            since_reversal: (place[i] - reversal).abs(),
        });
    }
    let independent = 4.0 * band * case.machine.duration;
    BaselineTable { rows, kept, rate: rate / step as f64, band, independent }
}

/// Returns counts, commands, tilt and force of a recording at `n` points of an even grid from
/// `start` (s) on, `rate` a second.
fn on_even_grid(source: &[simulate::Row], start: f64, rate: f64, n: usize) -> [Vec<f64>; 4] {
    let columns: [fn(&simulate::Row) -> f64; 4] = [|r| r.counts, |r| r.command, |r| r.tilt, |r| r.force];
    let mut even: [Vec<f64>; 4] = Default::default();
    let mut j = 0;
    for i in 0..n {
        let t = start + i as f64 / rate;
        while j + 2 < source.len() && source[j + 1].stamp <= t {
            j += 1;
        }
        let (a, b) = (&source[j], &source[j + 1]);
        let share = (t - a.stamp) / (b.stamp - a.stamp);
        for (c, column) in columns.iter().enumerate() {
            let value = if c == 1 {
                // Held commands: the mean around the grid point.
                0.5 * (source[j.saturating_sub(1)].command + a.command)
            } else {
                column(a) + (column(b) - column(a)) * share
            };
            even[c].push(value);
        }
    }
    even
}
