//! The rows of the regression: the drive's force, the nominal terms, and columns of laws.

use crate::constants::{GAIN_SPREAD, SPREAD, UNDRIVEN};
use crate::data::{Part, Recording, Rig, Value};
use crate::filters::{second_difference, under_hat};
use crate::laws::{self, ActsOn, Law, Machine, Scales, Shape, States};
use crate::signals::Signals;
use crate::tiles::Tiling;
use numerics::linear::dot;
use std::f64::consts::TAU;

/// A law with a shape, or several waves of one law, and the coefficients of its columns.
pub(crate) struct Candidate {
    pub(crate) law: &'static Law,
    pub(crate) shapes: Vec<Shape>,
    /// One value a row, rows of the fit first.
    pub(crate) columns: Vec<Vec<f64>>,
    /// True if each recording has coefficients of its own.
    pub(crate) own_phase: bool,
}

/// A nominal term: its column, its value and the variance of the prior.
pub(crate) struct Nominal {
    pub(crate) column: Vec<f64>,
    pub(crate) mean: f64,
    pub(crate) variance: f64,
}

/// Everything that no hypothesis changes.
pub(crate) struct Problem {
    pub(crate) machine: Machine,
    pub(crate) tiling: Tiling,
    signals: Vec<Signals>,
    pub(crate) recordings: usize,
    pub(crate) fit_recordings: usize,
    /// The drive's force.
    pub(crate) y: Vec<f64>,
    pub(crate) nominal: Vec<Nominal>,
    /// A force of one where the axis moves.
    pub(crate) one: Vec<f64>,
    /// Variance that noise of the readings gives each row, and the least part of it that must be
    /// there.
    pub(crate) reading: Vec<f64>,
    pub(crate) least_reading_part: f64,
    /// Coefficients of the force that the motion asks for.
    asked: Vec<f64>,
}

impl Problem {
    /// Puts recordings, those of the fit first, on their grids and transforms the nominal terms.
    pub(crate) fn new(rig: &Rig, recordings: &[&Recording]) -> Self {
        let signals = numerics::parallel::map_all(recordings, |r| Signals::new(r, rig));
        let parts: Vec<Part> = recordings.iter().map(|r| r.part).collect();
        let tiling = Tiling::new(&signals, &parts);
        let states: Vec<States> =
            signals.iter().enumerate().map(|(i, s)| States::new(s, &tiling, i, rig)).collect();
        let scales = Scales::new(&signals, &states, &parts, &tiling);
        let machine = Machine { rig: rig.clone(), states, scales, asked: Vec::new() };
        let fit_recordings = parts.iter().filter(|part| **part == Part::Fit).count();
        let mut problem = Self {
            machine,
            tiling,
            recordings: signals.len(),
            signals,
            fit_recordings,
            y: Vec::new(),
            nominal: Vec::new(),
            one: Vec::new(),
            reading: Vec::new(),
            least_reading_part: 0.0,
            asked: Vec::new(),
        };
        problem.y = problem.masked(|s| s.force.clone());
        problem.one = problem.masked(|s| vec![1.0; s.len()]);
        problem.nominal = problem.nominal_terms(rig);
        problem.fix_inertia_if_not_driven();
        problem.reading = problem.reading_variance(rig.inertia.nominal);
        let part = |s: &Signals| (s.least_noise / s.noise).powi(2);
        problem.least_reading_part =
            problem.signals.iter().take(fit_recordings).map(part).fold(1.0, f64::min);
        problem
    }

    /// The coefficients of a column at every point of the grid.
    fn whole(&self, column: impl Fn(&Signals) -> Vec<f64>) -> Vec<f64> {
        let mut out = Vec::with_capacity(self.tiling.rows.len());
        for (i, s) in self.signals.iter().enumerate() {
            self.tiling.transform(i, s.rate_hz, &column(s), 1, &mut out);
        }
        out
    }
    /// The same of a column that is zero at rest and near reversals.
    fn masked(&self, column: impl Fn(&Signals) -> Vec<f64>) -> Vec<f64> {
        self.whole(|s| s.apply_mask(&column(s)))
    }

    fn nominal_terms(&self, rig: &Rig) -> Vec<Nominal> {
        let gain = rig.gain.spread.unwrap_or(GAIN_SPREAD);
        let term = |column: Vec<f64>, value: Value| {
            let spread = value.spread.unwrap_or(SPREAD).hypot(gain);
            Nominal { column, mean: value.nominal, variance: (spread * value.nominal).powi(2) }
        };
        // Where masked, what is seen of the acceleration goes; the readings' noise stays.
        let acceleration = |s: &Signals| {
            let (raw, seen) = (second_difference(&s.q_raw, s.h), second_difference(&s.q, s.h));
            (0..s.len()).map(|i| if s.masked[i] { raw[i] - seen[i] } else { raw[i] }).collect()
        };
        let mut all = vec![term(self.whole(acceleration), rig.inertia)];
        if let Some(value) = rig.viscous {
            all.push(term(self.masked(|s| crate::filters::derivative(&s.q_raw, s.h)), value));
        }
        if let Some(value) = rig.coulomb {
            all.push(term(self.masked(|s| under_hat(&s.direction)), value));
        }
        if let (Some(value), true) = (rig.weight, self.signals.iter().all(|s| s.tilt.is_some())) {
            let down = |s: &Signals| s.tilt.as_deref().unwrap_or(&[]).iter().map(|x| -x).collect();
            all.push(term(self.masked(down), value));
        }
        if let Some((value, zero)) = rig.gravity {
            all.push(term(self.masked(|s| s.q.iter().map(|q| (q - zero).sin()).collect()), value));
        }
        if self.signals.iter().all(|s| s.load.is_some()) {
            let load = |s: &Signals| s.load.as_deref().unwrap_or(&[]).iter().map(|x| -x).collect();
            all.push(term(self.masked(load), Value { nominal: 1.0, spread: None }));
        }
        all
    }

    /// Fixes the inertia where the drive supplies next to nothing: all-zero coefficients would fit
    /// best.
    fn fix_inertia_if_not_driven(&mut self) {
        let fit = self.tiling.fit_rows;
        let power = |x: &[f64]| dot(&x[..fit], &x[..fit]);
        let inertia = &mut self.nominal[0];
        if power(&self.y) < UNDRIVEN * power(&inertia.column) * inertia.mean.powi(2) {
            inertia.variance = (1e-3 * inertia.mean).powi(2);
            self.machine.scales.driven = false;
        }
    }

    /// White readings through the second difference, thinned.
    fn reading_variance(&self, inertia: f64) -> Vec<f64> {
        let variance = |row: &crate::tiles::Row| {
            let s = &self.signals[row.recording];
            let gain = inertia * (2.0 - 2.0 * (TAU * row.hz * s.h).cos()) / (s.h * s.h);
            (gain * s.noise).powi(2) / self.tiling.cuts[row.recording].stride as f64
        };
        self.tiling.rows.iter().map(variance).collect()
    }

    /// Works out the force that the motion asks for; laws of the command follow from it.
    pub(crate) fn ask(&mut self, periods: &[f64]) {
        self.machine.asked = laws::asked_by_motion(&self.machine, periods);
        self.machine.scales.large_asked = laws::large_of(&self.machine.asked, self.fit_recordings);
        self.asked = self.of_laws(|i| vec![self.machine.asked[i].clone()]).remove(0);
    }

    /// The coefficients of columns on the grid of the laws.
    fn of_laws(&self, columns: impl Fn(usize) -> Vec<Vec<f64>>) -> Vec<Vec<f64>> {
        let mut out: Vec<Vec<f64>> = Vec::new();
        for i in 0..self.recordings {
            let step = self.tiling.cuts[i].law_step;
            for (k, mut column) in columns(i).into_iter().enumerate() {
                column.iter_mut().zip(&self.machine.states[i].moving).for_each(|(x, w)| *x *= w);
                let column = if step == 1 { under_hat(&column) } else { column };
                if out.len() <= k {
                    out.push(Vec::with_capacity(self.tiling.rows.len()));
                }
                self.tiling.transform(i, self.signals[i].rate_hz, &column, step, &mut out[k]);
            }
        }
        out
    }

    /// The columns of a law with a shape.
    pub(crate) fn candidate(&self, law: &'static Law, shape: Shape) -> Candidate {
        let mut columns = self.of_laws(|i| (law.columns)(&self.machine, i, &shape));
        if law.acts_on == ActsOn::Command && !law.wave {
            // A gain that is off is no law: less the part in proportion to the force itself.
            columns.iter_mut().for_each(|c| self.less_own_part(c));
        }
        Candidate { law, shapes: vec![shape], columns, own_phase: law.wave && !self.machine.rig.absolute }
    }

    fn less_own_part(&self, column: &mut [f64]) {
        let mut start = 0;
        for i in 0..self.recordings {
            let rows = self.tiling.rows[start..].iter().take_while(|r| r.recording == i).count();
            let (u, c) = (&self.asked[start..start + rows], &mut column[start..start + rows]);
            let part = dot(u, c) / (dot(u, u) + 1e-300);
            c.iter_mut().zip(u).for_each(|(c, u)| *c -= part * u);
            start += rows;
        }
    }

    /// Smooth functions of speed, travel, travel since reversal and time, and products with the
    /// direction: what any law of these may look like.
    pub(crate) fn free_form(&self) -> Vec<Vec<f64>> {
        let m = &self.machine;
        self.of_laws(|i| {
            let s = &m.states[i];
            let ones = vec![1.0; s.q.len()];
            let speed = s.each(|k| s.v[k].abs() / m.scales.fast);
            let place = s.each(|k| 0.5 * ((s.q[k] - m.scales.middle) / m.scales.half_travel + 1.0));
            let since = s.each(|k| s.since[k] / m.scales.stroke);
            let time = s.each(|k| s.t[k] / m.scales.seconds);
            let mut all = Vec::new();
            for x in [speed, place, since, time] {
                all.extend(cosines(&x, &ones));
                all.extend(cosines(&x, &s.direction));
            }
            all
        })
    }
}

/// Four cosines of `x`, of half periods over its range of one, times `by`.
fn cosines(x: &[f64], by: &[f64]) -> Vec<Vec<f64>> {
    let wave = |n: i32, x: f64| (f64::from(n) * 0.5 * TAU * x.clamp(-1.0, 1.0)).cos();
    (1..=4).map(|n| x.iter().zip(by).map(|(x, by)| by * wave(n, *x)).collect()).collect()
}
