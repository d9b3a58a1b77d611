//! The place of the residual: maps over states that carry from the fitted to the held-out
//! recordings, and intervals of time.

use crate::fit::blocked_recording::BlockedRecording;
use numerics::bootstrap::{Gain, bootstrap};

/// A residual averaged over bins of a variable, moving forward and backward apart.
#[derive(Debug, Clone)]
pub struct Map {
    /// `speed`, `travel`, `angle`, `command` or `time`.
    pub variable: &'static str,
    /// Bounds of the bins.
    pub edges: Vec<f64>,
    /// Mean residual force per bin, moving forward and backward; none where there is too little.
    pub forward: Vec<Option<f64>>,
    /// The same, moving backward.
    pub backward: Vec<Option<f64>>,
    /// Part of the held-out mean square that the map of the fitted recordings predicts.
    pub carries: f64,
    /// True if that is more than chance.
    pub significant: bool,
}

const BINS: usize = 14;
const LEAST: usize = 20;

/// A state block by block by its name; an angle within a turn where that is known.
pub(crate) fn variable(track: &BlockedRecording, name: &str, turn: Option<f64>) -> Vec<f64> {
    match name {
        "speed" => track.motion.v.clone(),
        "travel" => track.places().collect(),
        "angle" => track.places().map(|x| turn.map_or(x, |turn| x.rem_euclid(turn))).collect(),
        "command" => track.block_mean(&track.rows.command),
        "tilt" => track.blocks.tilt.clone().unwrap_or_else(|| vec![0.0; track.block_count()]),
        _ => track.blocks.start.clone(),
    }
}

/// A recording with its residual and the variable that a map is over.
struct Seen<'a> {
    track: &'a BlockedRecording,
    residual: &'a [f64],
    values: Vec<f64>,
}

impl<'a> Seen<'a> {
    fn all(
        (tracks, residuals): (&'a [BlockedRecording], &'a [Vec<f64>]),
        name: &str,
        turn: Option<f64>,
    ) -> Vec<Self> {
        let seen = |(track, residual): (&'a BlockedRecording, &'a Vec<f64>)| Seen {
            track,
            residual,
            values: variable(track, name, turn),
        };
        tracks.iter().zip(residuals).map(seen).collect()
    }

    fn moving(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.track.block_count()).filter(|j| !self.track.motion.rest[*j])
    }
}

/// Bins of a variable.
struct Bins {
    low: f64,
    high: f64,
}

/// Mean residual of each bin, moving forward and backward.
type Means = Vec<[Option<f64>; 2]>;

impl Bins {
    /// Between the outermost of some values, less three in a thousand.
    fn of(seen: &[Seen]) -> Self {
        let mut all: Vec<f64> = seen.iter().flat_map(|one| one.values.iter().copied()).collect();
        all.sort_by(f64::total_cmp);
        let quantile = |p: usize| all[(all.len() - 1) * p / 1000];
        Self { low: quantile(3), high: quantile(997).max(quantile(3) + 1e-12) }
    }

    fn edges(&self) -> Vec<f64> {
        (0..=BINS).map(|i| self.low + (self.high - self.low) * i as f64 / BINS as f64).collect()
    }

    /// Bin of a block and its way.
    fn place(&self, one: &Seen, j: usize) -> (usize, usize) {
        let part = (one.values[j] - self.low) / (self.high - self.low);
        let bin = (part * BINS as f64).floor().clamp(0.0, (BINS - 1) as f64) as usize;
        (bin, usize::from(one.track.motion.v[j] < 0.0))
    }

    fn means<'a>(&self, seen: impl Iterator<Item = &'a Seen<'a>>) -> Means {
        let mut sums = vec![[(0.0, 0usize); 2]; BINS];
        for one in seen {
            for j in one.moving() {
                let (bin, way) = self.place(one, j);
                sums[bin][way].0 += one.residual[j];
                sums[bin][way].1 += 1;
            }
        }
        let mean = |cell: (f64, usize)| (cell.1 >= LEAST).then(|| cell.0 / cell.1 as f64);
        sums.into_iter().map(|cells| cells.map(mean)).collect()
    }

    /// Returns the gain of the means on each segment of a recording, and the sum of squares of the
    /// residual.
    fn gains(&self, means: &Means, one: &Seen) -> (Vec<f64>, f64) {
        let (mut gains, mut whole) = (vec![0.0; one.track.segment_count()], 0.0);
        for (gain, w) in gains.iter_mut().zip(one.track.blocks.segments.windows(2)) {
            for j in (w[0]..w[1]).filter(|j| !one.track.motion.rest[*j]) {
                let (bin, way) = self.place(one, j);
                let guess = means[bin][way].unwrap_or(0.0);
                *gain += one.residual[j].powi(2) - (one.residual[j] - guess).powi(2);
                whole += one.residual[j].powi(2);
            }
        }
        (gains, whole)
    }

    /// True if the others predict something of each recording: a slow disturbance looks like a map
    /// of one or two.
    fn repeats(&self, seen: &[Seen]) -> bool {
        if seen.len() < 2 {
            return true;
        }
        (0..seen.len()).all(|r| {
            let others = seen.iter().enumerate().filter(|(i, _)| *i != r).map(|(_, one)| one);
            let (gains, _) = self.gains(&self.means(others), &seen[r]);
            gains.iter().sum::<f64>() > 0.0
        })
    }
}

/// Averages residuals over bins on the fitted recordings and asks the held-out ones whether that
/// was luck.
pub(crate) fn maps(
    fit: (&[BlockedRecording], &[Vec<f64>]),
    holdout: (&[BlockedRecording], &[Vec<f64>]),
    turn: Option<f64>,
) -> Vec<Map> {
    let mut names = vec!["speed", "travel", "command", "time"];
    if turn.is_some() {
        names.push("angle");
    }
    names
        .into_iter()
        .map(|name| {
            let (fit, holdout) = (Seen::all(fit, name, turn), Seen::all(holdout, name, turn));
            let bins = Bins::of(&fit);
            let means = bins.means(fit.iter());
            let (mut gains, mut whole) = (Vec::new(), 0.0);
            for one in &holdout {
                let (of_one, square) = bins.gains(&means, one);
                gains.extend(of_one);
                whole += square;
            }
            // In units of a segment's mean square, so that the limit per witness means the same
            // everywhere.
            let unit = (whole / gains.len().max(1) as f64).max(1e-300);
            gains.iter_mut().for_each(|gain| *gain /= unit);
            let gain: Gain = bootstrap(&gains);
            Map {
                variable: name,
                edges: bins.edges(),
                forward: means.iter().map(|cells| cells[0]).collect(),
                backward: means.iter().map(|cells| cells[1]).collect(),
                carries: if whole > 0.0 { gain.sum / gains.len() as f64 } else { 0.0 },
                significant: gain.low > 0.0 && gain.z > 2.6 && bins.repeats(&fit),
            }
        })
        .collect()
}

/// Stretches of time, s, in which a weight per block is high, merged where they nearly touch; the
/// strongest 24.
pub(crate) fn intervals(track: &BlockedRecording, weight: &[f64]) -> Vec<[f64; 2]> {
    let n = track.block_count();
    let length = (0.1 * track.block_rate()).ceil().max(1.0) as usize;
    let means: Vec<f64> = weight.chunks(length).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
    let average = means.iter().sum::<f64>() / means.len() as f64;
    if average.is_nan() || average <= 0.0 {
        return Vec::new();
    }
    let mut out: Vec<([f64; 2], f64)> = Vec::new();
    for (i, mean) in means.iter().enumerate() {
        if *mean < average {
            continue;
        }
        let (a, b) = (i * length, ((i + 1) * length).min(n) - 1);
        let (from, to) = (
            track.blocks.lead_s + track.blocks.start[a],
            track.blocks.lead_s + track.blocks.start[b] + track.blocks.span[b],
        );
        match out.last_mut() {
            Some((last, sum)) if from - last[1] < 0.15 => {
                last[1] = to;
                *sum += mean;
            }
            _ => out.push(([from, to], *mean)),
        }
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out.truncate(24);
    let mut intervals: Vec<[f64; 2]> = out.into_iter().map(|(i, _)| i).collect();
    intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    intervals
}

/// Ends between which nine tenths of a weight lie.
pub(crate) fn range(values: &[f64], weights: &[f64]) -> Option<(f64, f64)> {
    let mut pairs: Vec<(f64, f64)> =
        values.iter().copied().zip(weights.iter().copied()).filter(|(_, w)| *w > 0.0).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = pairs.iter().map(|p| p.1).sum();
    let quantile = |part: f64| {
        let mut sum = 0.0;
        pairs.iter().find(|p| {
            sum += p.1;
            sum >= part * whole
        })
    };
    Some((quantile(0.05)?.0, quantile(0.95)?.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;

    /// A slide to and fro, and its residual by the function of travel and time.
    fn seen(residual: impl Fn(f64, f64) -> f64) -> (BlockedRecording, Vec<f64>) {
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let time_s: Vec<f64> = (0..4001).map(|i| f64::from(i) * 2.5e-3).collect();
        let position_counts = time_s.iter().map(|t| (1000.0 * (2.0 * t).sin()).round()).collect();
        let command = vec![0.0; time_s.len()];
        let recording = Recording { time_s, command, position_counts, ..Recording::default() };
        let mut track = BlockedRecording::new(&recording, &rig);
        track.motion.v = track.blocks.start.iter().map(|t| 2.0 * (2.0 * t).cos()).collect();
        let residual =
            track.motion.x.iter().zip(&track.blocks.start).map(|(x, t)| residual(*x, *t)).collect();
        (track, residual)
    }

    fn repeats(all: &[(BlockedRecording, Vec<f64>)]) -> bool {
        let seen: Vec<Seen> = all
            .iter()
            .map(|(track, residual)| Seen { track, residual, values: variable(track, "travel", None) })
            .collect();
        Bins::of(&seen).repeats(&seen)
    }

    #[test]
    fn a_map_repeats_where_the_others_predict_each_recording() {
        let stiffness = || seen(|x, _| x);
        assert!(repeats(&[stiffness(), stiffness()]));
        assert!(!repeats(&[stiffness(), seen(|x, _| -x)]));
        let random = |seed: u64| {
            let mut random = numerics::bootstrap::Random::new(seed);
            let steps: Vec<f64> = (0..40).map(|_| random.below(2001) as f64 / 1000.0 - 1.0).collect();
            seen(move |_, t| steps[(t * 3.0) as usize])
        };
        assert!(!repeats(&[random(3), random(5), random(11)]), "a slow disturbance is no map");
        assert!(repeats(&[stiffness()]), "one recording has nothing to repeat in");
    }
}
