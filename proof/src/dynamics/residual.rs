//! Force errors on the held-out recording, worked out from the files alone: a refit of the nominal structure by least
//! squares, and the patched rig as it stands.
//!
//! Both sides of the equation of motion go through the filters of the key's oracle. What is a nuisance of each recording is
//! found on it: its bias, where the rig allows one, and where the encoder's zero stands against what is periodic.

use std::path::{Path, PathBuf};

use super::known;
use super::laws::{Forces, effective_command, forces, is_along_travel, is_over};
use super::motion::{Motion, widened};
use super::recording::Recording;
use super::rig::Rig;
use crate::key::{Key, Oracle};
use crate::signal::{Butterworth, Normal};
use crate::tool::Paths;

/// Speeds that the laws see are low-passed at this many times the oracle's upper corner.
const LAW_BAND: f64 = 2.0;
/// Encoder zeros that are tried along the shortest wave, and along the spread of starts to either side.
const PHASES: f64 = 24.0;
const PLACES: i32 = 8;
/// Encoder zeros that are tried round a turn for a table over the angle.
const ANGLES: i32 = 64;
/// Relative standard deviations where the rig declares none.
const EASY: f64 = 0.1;
const FRICTION: f64 = 0.5;

/// The files of a case in the oracle's band.
pub(crate) struct Bench {
    rig: Rig,
    fits: Vec<Band>,
    held: Band,
    floor: f64,
    /// True inertia, the scale of the oracle's forces.
    truth: f64,
}

impl Bench {
    /// Reads rig and recordings.
    ///
    /// # Errors
    /// What cannot be read, or what the key does not tell.
    pub(crate) fn new(paths: &Paths, key: &Key) -> Result<Self, String> {
        let oracle = key.oracle.as_ref().ok_or("the key has no oracle")?;
        let truth = key.true_inertia.ok_or("the key does not tell the true inertia")?;
        let rig = read(&paths.rig)?;
        let recording = Recording::read(paths.holdout.first().ok_or("there is no held-out recording")?)?;
        let still: Vec<[f64; 2]> = oracle.still_s.iter().map(|s| s.map(|t| t - recording.time[0])).collect();
        let held = Band::of(&recording, &rig, oracle, &still);
        let fit = |path: &PathBuf| Ok(Band::of(&Recording::read(path)?, &rig, oracle, &[]));
        let fits = paths.fit.iter().map(fit).collect::<Result<_, String>>()?;
        Ok(Self { rig, fits, held, floor: oracle.floor, truth })
    }

    /// Rms that the refitted nominal structure leaves on the held-out recording, N·m or N in the scale of the true inertia.
    pub(crate) fn refit(&self) -> f64 {
        let values = refit(&self.rig, &self.fits, self.floor);
        values.left(&self.rig, &self.held) * self.truth / values.means[0]
    }

    /// The same of a patched rig.
    ///
    /// # Errors
    /// What cannot be read, or which of its effects the judge cannot run.
    pub(crate) fn patched(&self, file: &Path) -> Result<f64, String> {
        let patched = read(file)?;
        Ok(run(&self.rig, &patched, &self.held)? * self.truth / patched.inertia)
    }

    /// The same of a fit that has been told the whole structure.
    ///
    /// # Errors
    /// Which of the hidden effects nothing is fitted to.
    pub(crate) fn known_structure(&self, key: &Key) -> Result<f64, String> {
        let (left, inertia) = known::left(&self.rig, key, &self.fits, &self.held, self.floor)?;
        Ok(left * self.truth / inertia)
    }
}

fn read(path: &Path) -> Result<Rig, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    Rig::parse(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// A recording in the oracle's band.
pub(super) struct Band {
    pub(super) motion: Motion,
    filters_hz: [f64; 2],
    skip_s: f64,
    /// Rows that are judged, thinned to the band.
    kept: Vec<usize>,
}

impl Band {
    fn of(r: &Recording, rig: &Rig, oracle: &Oracle, still_s: &[[f64; 2]]) -> Self {
        let upper = oracle.filters_hz[0].max(oracle.filters_hz[1]);
        let motion = Motion::of(r, rig.counts_per_unit, LAW_BAND * upper, still_s);
        let stride = ((motion.rate / (8.0 * upper)) as usize).max(1);
        let corner = oracle.filters_hz[0].min(oracle.filters_hz[1]);
        let kept = settled(&motion, corner, oracle.skip_s).into_iter().step_by(stride).collect();
        Self { filters_hz: oracle.filters_hz, skip_s: oracle.skip_s, kept, motion }
    }

    /// A force of every row, in the band, at the rows that are judged. Rows at rest pass as nothing.
    pub(super) fn see(&self, force: impl Fn(usize) -> f64) -> Vec<f64> {
        self.filter(|i| if self.motion.rest[i] { 0.0 } else { force(i) })
    }

    /// The acceleration in the same way.
    fn acceleration(&self) -> Vec<f64> {
        self.filter(|i| self.motion.acceleration[i])
    }

    fn filter(&self, signal: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut filters = self.filters_hz.map(|hz| Butterworth::new(hz, self.motion.rate));
        let filtered: Vec<f64> =
            (0..self.motion.len()).map(|i| filters.iter_mut().fold(signal(i), |x, f| f.next(x))).collect();
        self.kept.iter().map(|&i| filtered[i]).collect()
    }

    /// Seconds that are judged.
    pub(super) fn seconds(&self) -> f64 {
        self.motion.time[self.motion.len() - 1] - self.skip_s
    }

    /// Acceleration, speed, direction, weight and measured load, as they stand on the left-hand side of the equation.
    pub(super) fn nominal_columns(&self) -> Vec<Vec<f64>> {
        let m = &self.motion;
        vec![
            self.acceleration(),
            self.see(|i| m.speed[i]),
            self.see(|i| m.direction[i]),
            self.see(|i| -m.tilt[i].sin()),
            self.see(|i| -m.force[i]),
        ]
    }

    /// Returns the number of consecutive rows that count as one independent row.
    pub(super) fn dependence(bands: &[Band], rows: usize, seconds: f64) -> f64 {
        let corner = bands.first().map_or(1.0, |b| b.filters_hz[0].min(b.filters_hz[1]));
        (rows as f64 / (2.0 * corner * seconds).max(1.0)).max(1.0)
    }
}

/// Time after a rest or a reversal in which the filters still tell of it, and before, over the inverse of their corner.
const SETTLING: f64 = 1.0;
const AHEAD: f64 = 0.1;
/// At least this part of the moving rows is judged, however often the motion turns round.
const LEAST: f64 = 0.2;

/// Rows that are judged: they move, and the filters have settled since the last rest or reversal, where the direction of
/// friction is not sure to a row.
fn settled(m: &Motion, corner_hz: f64, skip_s: f64) -> Vec<usize> {
    let n = m.len();
    let moving: Vec<usize> = (0..n).filter(|&i| m.time[i] > skip_s && !m.rest[i]).collect();
    let mut settling = SETTLING;
    loop {
        let rows = |share: f64| (share / corner_hz * m.rate) as usize;
        let (after, before) = (rows(settling), rows(AHEAD * settling));
        let blocked = widened(n, before, after, |i| m.rest[i]);
        let kept: Vec<usize> = moving.iter().copied().filter(|&i| !blocked[i]).collect();
        if kept.len() as f64 >= LEAST * moving.len() as f64 || settling < 0.05 {
            return kept;
        }
        settling *= 0.5;
    }
}

/// Nominal values: inertia, viscosity, dry friction, weight, and the measured load's.
pub(super) const NOMINAL: usize = 5;

/// Mean and standard deviation of each nominal value; a deviation of zero where there is no such term. The gain stays, for a
/// common scale of everything cannot be seen.
pub(super) fn prior(rig: &Rig) -> ([f64; NOMINAL], [f64; NOMINAL]) {
    let gain = rig.sigma("gain", EASY);
    let mut means = [rig.inertia, 0.0, 0.0, 0.0, 1.0];
    let mut sds = [rig.inertia * rig.sigma("inertia", EASY).hypot(gain), 0.0, 0.0, 0.0, gain];
    let terms = [
        (rig.viscous, "viscous", FRICTION),
        (rig.coulomb, "coulomb", FRICTION),
        (rig.weight, "weight", EASY),
    ];
    for (k, (value, name, otherwise)) in terms.into_iter().enumerate() {
        if let Some(value) = value {
            means[k + 1] = value;
            sds[k + 1] = value.abs() * rig.sigma(name, otherwise).hypot(gain);
        }
    }
    (means, sds)
}

/// Nominal values after the refit.
#[derive(Debug)]
struct Values {
    means: [f64; NOMINAL],
}

/// The force of the drive as the nominal rig has it.
fn drive(rig: &Rig, band: &Band) -> Vec<f64> {
    let nominal = Rig { effects: Vec::new(), ..rig.clone() };
    let command = effective_command(&nominal, &band.motion);
    band.see(|i| rig.gain * command[i])
}

/// Least squares on the fit recordings, held by the declared uncertainty; `floor` is the noise.
fn refit(rig: &Rig, fits: &[Band], floor: f64) -> Values {
    let (means, sds) = prior(rig);
    let width = NOMINAL + fits.len();
    let mut normal = Normal::new(width);
    let mut seconds = 0.0;
    for (r, band) in fits.iter().enumerate() {
        let columns = band.nominal_columns();
        for (j, drive) in drive(rig, band).iter().enumerate() {
            let mut row = vec![0.0; width];
            let mut left = *drive;
            for (k, column) in columns.iter().enumerate() {
                row[k] = column[j];
                left -= means[k] * row[k];
            }
            row[NOMINAL + r] = -1.0;
            normal.add(&row, left);
        }
        seconds += band.seconds();
    }
    // Rows that follow each other closely are not independent: the prior weighs accordingly.
    let weight = Band::dependence(fits, normal.rows, seconds);
    let mut penalty: Vec<f64> = sds.iter().map(|sd| weight * floor * floor / (sd * sd).max(1e-300)).collect();
    penalty.resize(width, 0.0);
    let mut active: Vec<usize> = (0..NOMINAL).filter(|&k| sds[k] > 0.0).collect();
    if rig.offset.is_some() {
        active.extend(NOMINAL..width);
    }
    let moved = normal.solve(&active, &penalty);
    Values { means: std::array::from_fn(|k| means[k] + moved[k]) }
}

impl Values {
    /// Rms of what they leave.
    fn left(&self, rig: &Rig, band: &Band) -> f64 {
        let mut left = drive(rig, band);
        for (value, column) in self.means.iter().zip(band.nominal_columns()) {
            left.iter_mut().zip(column).for_each(|(x, c)| *x -= value * c);
        }
        spread(&left, rig.offset.is_some())
    }
}

/// Root mean square, about the mean where a bias of the recording's own is allowed.
fn spread(x: &[f64], biased: bool) -> f64 {
    let n = x.len().max(1) as f64;
    let mean = if biased { x.iter().sum::<f64>() / n } else { 0.0 };
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}

/// Rms of what the patched rig leaves, over the best place of the encoder's zero.
pub(super) fn run(nominal: &Rig, patched: &Rig, band: &Band) -> Result<f64, String> {
    if patched.effects.iter().any(|e| e.name == "missed_counts") {
        return Err("lost counts come at times of their own, which no rig can tell beforehand".into());
    }
    let command = effective_command(patched, &band.motion);
    let biased = nominal.offset.is_some();
    let mut places = vec![0.0];
    if patched.effects.iter().any(is_along_travel) {
        let span = nominal.start_spread.unwrap_or(0.0);
        places.extend((1..=PLACES).flat_map(|i| {
            let place = span * f64::from(i) / f64::from(PLACES);
            [place, -place]
        }));
    }
    if let (true, Some(turn)) = (patched.effects.iter().any(|e| is_over(e, "angle")), nominal.turn) {
        places.extend((1..ANGLES).map(|i| turn * f64::from(i) / f64::from(ANGLES)));
    }
    let mut best = f64::INFINITY;
    for along in places {
        let Forces { sum, waves } = forces(patched, &band.motion, &command, along)?;
        let forces = band.see(|i| sum[i]);
        let left: Vec<f64> =
            forces.iter().zip(band.acceleration()).map(|(f, a)| f - patched.inertia * a).collect();
        let columns: Vec<[Vec<f64>; 2]> =
            waves.iter().map(|w| [band.see(|i| w.cos[i]), band.see(|i| w.sin[i])]).collect();
        if waves.is_empty() {
            best = best.min(spread(&left, biased));
            continue;
        }
        let shortest = waves.iter().map(|w| std::f64::consts::TAU / w.wave).fold(f64::MAX, f64::min);
        let longest = waves.iter().map(|w| std::f64::consts::TAU / w.wave).fold(0.0, f64::max);
        // Once round: a turn where it is known, else the longest wave.
        let round = nominal.turn.unwrap_or(longest).max(longest);
        let count = (PHASES * round / shortest).ceil().clamp(1.0, 2000.0) as usize;
        let sums = Sums::of(&left, &columns, biased);
        for i in 0..count {
            let shift = round * i as f64 / count as f64;
            let weights: Vec<f64> = waves
                .iter()
                .flat_map(|w| {
                    let [c, d] = w.coefficients;
                    let (sin, cos) = (w.wave * shift).sin_cos();
                    [c * cos + d * sin, d * cos - c * sin]
                })
                .collect();
            best = best.min(sums.left(&weights));
        }
    }
    Ok(best)
}

/// Second moments of what is left and the columns of the waves, so that a shift costs no pass over the rows.
struct Sums {
    rows: f64,
    energy: f64,
    cross: Vec<f64>,
    gram: Vec<Vec<f64>>,
}

impl Sums {
    fn of(left: &[f64], columns: &[[Vec<f64>; 2]], biased: bool) -> Self {
        let centred = |x: &[f64]| -> Vec<f64> {
            let mean = if biased { x.iter().sum::<f64>() / x.len().max(1) as f64 } else { 0.0 };
            x.iter().map(|x| x - mean).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let left = centred(left);
        let flat: Vec<Vec<f64>> = columns.iter().flatten().map(|c| centred(c)).collect();
        Self {
            rows: left.len().max(1) as f64,
            energy: dot(&left, &left),
            cross: flat.iter().map(|c| dot(c, &left)).collect(),
            gram: flat.iter().map(|a| flat.iter().map(|b| dot(a, b)).collect()).collect(),
        }
    }

    /// Rms of what is left once the weighted columns are added.
    fn left(&self, weights: &[f64]) -> f64 {
        let mut total = self.energy;
        for (i, a) in weights.iter().enumerate() {
            total += 2.0 * a * self.cross[i];
            total += weights.iter().zip(&self.gram[i]).map(|(b, g)| a * b * g).sum::<f64>();
        }
        (total.max(0.0) / self.rows).sqrt()
    }
}
