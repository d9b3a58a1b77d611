//! Weighted least squares on the fit recordings, with one fold left out at a time, and the same
//! model read on the holdout.

use crate::constants::FOLDS;
use crate::problem::{Candidate, Problem};
use numerics::linear::{Factor, Square, dot};

/// Normal equations.
#[derive(Clone)]
struct Equations {
    left: Square,
    right: Vec<f64>,
}

/// A model fitted to the fit recordings.
pub(crate) struct Fitted {
    /// Weighted residuals of the fit's rows, each by the values of the other folds.
    pub(crate) error: Vec<f64>,
    /// Coefficients of nominal terms, then offsets by recording, then the laws' in their order.
    pub(crate) values: Vec<f64>,
    /// The same from two halves of the frames.
    pub(crate) halves: [Vec<f64>; 2],
}

/// A model with its weights: what candidates are added to.
pub(crate) struct Model<'a> {
    problem: &'a Problem,
    /// Laws in the model.
    pub(crate) laws: Vec<&'a Candidate>,
    with_offsets: bool,
    /// Roots of the weights of all rows.
    pub(crate) root: Vec<f64>,
    /// Weighted columns of the fit's rows.
    columns: Vec<Vec<f64>>,
    y: Vec<f64>,
    /// By fold.
    equations: Vec<Equations>,
    pub(crate) fitted: Fitted,
    /// Variance beside the readings' noise, and the part of the estimated reading noise that shows.
    pub(crate) flat: f64,
    pub(crate) reading_part: f64,
}

/// Relative ridge that keeps equal columns apart: far below any noise.
const RIDGE: f64 = 1e-8;

impl<'a> Model<'a> {
    /// Fits `laws` beside the nominal terms; weights follow from the residuals, by iteration.
    pub(crate) fn new(problem: &'a Problem, laws: Vec<&'a Candidate>) -> Self {
        const ITERATIONS: usize = 4;
        let fit = problem.tiling.fit_rows;
        let inertia = &problem.nominal[0];
        let power = |x: &[f64]| dot(&x[..fit], &x[..fit]) / fit as f64;
        let power = power(&problem.y).max(power(&inertia.column) * inertia.mean.powi(2)) + 1e-300;
        // The first weights are nearly flat.
        let (mut flat, mut part) = (0.01 * power, 1.0);
        let mut model = Self::weighted(problem, laws.clone(), true, flat, part);
        for _ in 0..ITERATIONS {
            (flat, part) = noise(problem, &model, 1e-6 * power);
            model = Self::weighted(problem, laws.clone(), true, flat, part);
        }
        model
    }

    /// The same model without offsets, under the same weights.
    pub(crate) fn without_offsets(&self) -> Self {
        Self::weighted(self.problem, self.laws.clone(), false, self.flat, self.reading_part)
    }

    fn weighted(
        problem: &'a Problem,
        laws: Vec<&'a Candidate>,
        with_offsets: bool,
        flat: f64,
        reading_part: f64,
    ) -> Self {
        let fit = problem.tiling.fit_rows;
        let root: Vec<f64> =
            problem.reading.iter().map(|r| (reading_part * r + flat).sqrt().recip()).collect();
        let weigh = |x: &[f64]| -> Vec<f64> { x[..fit].iter().zip(&root).map(|(x, r)| x * r).collect() };
        let mut columns: Vec<Vec<f64>> = problem.nominal.iter().map(|n| weigh(&n.column)).collect();
        if with_offsets {
            columns.extend((0..problem.fit_recordings).map(|i| weigh(&only(problem, &problem.one, i))));
        }
        for law in &laws {
            columns.extend(expanded(problem, law, 0..problem.fit_recordings).iter().map(|c| weigh(c)));
        }
        let y = weigh(&problem.y);
        let equations = equations(problem, &columns, &[], &y);
        let fitted = solve(problem, &[&columns], &y, &equations);
        Self { problem, laws, with_offsets, root, columns, y, equations, fitted, flat, reading_part }
    }

    /// Fits one more law under the same weights.
    pub(crate) fn with(&self, law: &Candidate) -> Fitted {
        let columns = expanded(self.problem, law, 0..self.problem.fit_recordings);
        self.with_columns(&columns)
    }

    /// Fits more columns of the fit's rows under the same weights.
    pub(crate) fn with_columns(&self, columns: &[Vec<f64>]) -> Fitted {
        let weigh = |c: &Vec<f64>| c.iter().zip(&self.root).take(self.y.len()).map(|(x, r)| x * r).collect();
        let more: Vec<Vec<f64>> = columns.iter().map(weigh).collect();
        let added = equations(self.problem, &more, &self.columns, &self.y);
        let old = self.columns.len();
        let joined: Vec<Equations> =
            self.equations.iter().zip(&added).map(|(base, added)| join(base, added, old)).collect();
        solve(self.problem, &[&self.columns, &more], &self.y, &joined)
    }

    /// Reads a model on the holdout: values of the fit, offsets and phases of its own. `laws` are
    /// all laws of `fitted`. Returns the weighted residuals of the holdout's rows, and for the
    /// last law the agreement of its size there with that of the fit.
    pub(crate) fn hold_out(&self, laws: &[&Candidate], fitted: &Fitted) -> (Vec<f64>, f64) {
        let p = self.problem;
        let first = p.tiling.fit_rows;
        let offsets = if self.with_offsets { p.fit_recordings } else { 0 };
        let mut left: Vec<f64> = p.y[first..].to_vec();
        let mut take = |column: &[f64], value: f64| {
            left.iter_mut().zip(&column[first..]).for_each(|(y, x)| *y -= value * x);
        };
        p.nominal.iter().zip(&fitted.values).for_each(|(n, value)| take(&n.column, *value));
        let mut at = p.nominal.len() + offsets;
        let mut waves = Vec::new();
        for law in laws {
            let count = law.columns.len();
            if law.own_phase {
                let values = &fitted.values[at..at + count * p.fit_recordings];
                waves.push((*law, mean_amplitudes(values, count)));
                at += values.len();
            } else {
                law.columns.iter().zip(&fitted.values[at..]).for_each(|(c, value)| take(c, *value));
                at += count;
            }
        }
        left.iter_mut().zip(&self.root[first..]).for_each(|(y, r)| *y *= r);
        let mut ratio = Vec::new();
        for i in p.fit_recordings..p.recordings {
            ratio.extend(self.own_values(&mut left, &waves, i));
        }
        let agreement = match laws.last() {
            Some(law) if law.own_phase => {
                let mean = ratio.iter().sum::<f64>() / ratio.len().max(1) as f64;
                mean.min(1.0 / mean.max(1e-300))
            }
            Some(law) => self.held_out_size(laws, law, &fitted.values[at - law.columns.len()..at]),
            None => 1.0,
        };
        (left, agreement)
    }

    /// Takes offset and waves of one held-out recording from the weighted residuals; waves keep the
    /// amplitudes of the fit. Returns the last law's amplitudes there over those.
    fn own_values(&self, left: &mut [f64], waves: &[(&Candidate, Vec<f64>)], recording: usize) -> Vec<f64> {
        let p = self.problem;
        let first = p.tiling.fit_rows;
        let rows = rows_of(p, recording);
        let weigh = |c: &[f64]| -> Vec<f64> { rows.clone().map(|k| c[k] * self.root[k]).collect() };
        let mut columns = if self.with_offsets { vec![weigh(&p.one)] } else { Vec::new() };
        let offsets = columns.len();
        waves.iter().for_each(|(law, _)| columns.extend(law.columns.iter().map(|c| weigh(c))));
        let y = &mut left[rows.start - first..rows.end - first];
        let mut values = plain(&columns, y);
        let mut at = offsets;
        let mut last = Vec::new();
        for (law, amplitudes) in waves {
            last.clear();
            for (pair, amplitude) in amplitudes.iter().enumerate() {
                let here = values[at + 2 * pair].hypot(values[at + 2 * pair + 1]) + 1e-300;
                last.push(here / (amplitude + 1e-300));
                values[at + 2 * pair..at + 2 * pair + 2].iter_mut().for_each(|x| *x *= amplitude / here);
            }
            at += law.columns.len();
        }
        for (column, value) in columns.iter().zip(&values) {
            y.iter_mut().zip(column).for_each(|(y, x)| *y -= value * x);
        }
        last
    }

    /// The agreement of the mean offset of the holdout with that of the fit, over the larger.
    pub(crate) fn offsets_agree(&self) -> f64 {
        let p = self.problem;
        let mean = |x: Vec<f64>| x.iter().sum::<f64>() / x.len().max(1) as f64;
        let at = p.nominal.len();
        let fit = mean(self.fitted.values[at..at + p.fit_recordings].to_vec());
        let held = p.fit_recordings..p.recordings;
        let columns: Vec<Vec<f64>> = held.map(|i| only(p, &p.one, i)).collect();
        let there = mean(self.alone(&self.laws, &columns)[at..at + columns.len()].to_vec());
        fit * there / (fit * fit).max(there * there).max(1e-300)
    }

    /// Values of a fit to the holdout alone: nominal terms, `offsets`, laws.
    fn alone(&self, laws: &[&Candidate], offsets: &[Vec<f64>]) -> Vec<f64> {
        let p = self.problem;
        let (first, end) = (p.tiling.fit_rows, p.tiling.rows.len());
        let weigh = |c: &[f64]| -> Vec<f64> { (first..end).map(|k| c[k] * self.root[k]).collect() };
        let mut columns: Vec<Vec<f64>> = p.nominal.iter().map(|n| weigh(&n.column)).collect();
        columns.extend(offsets.iter().map(|c| weigh(c)));
        for law in laws {
            columns.extend(expanded(p, law, p.fit_recordings..p.recordings).iter().map(|c| weigh(c)));
        }
        let mut sums = sums(&columns, &columns, &weigh(&p.y));
        let frames = (p.tiling.frames - p.tiling.fit_frames).max(1);
        add_prior(p, &mut sums, (end - first) as f64 / frames as f64);
        Factor::new(&sums.left).solve(&sums.right)
    }

    /// The agreement of the last law's force with that of a fit to the holdout alone.
    fn held_out_size(&self, laws: &[&Candidate], law: &Candidate, values: &[f64]) -> f64 {
        let p = self.problem;
        let held = if self.with_offsets { p.fit_recordings..p.recordings } else { 0..0 };
        let offsets: Vec<Vec<f64>> = held.map(|i| only(p, &p.one, i)).collect();
        let there = self.alone(laws, &offsets);
        let weigh = |c: &Vec<f64>| (p.tiling.fit_rows..c.len()).map(|k| c[k] * self.root[k]).collect();
        let columns: Vec<Vec<f64>> = law.columns.iter().map(weigh).collect();
        agreement(&columns, values, &there[there.len() - columns.len()..])
    }
}

/// f₁·f₂ over the larger of f₁², f₂² for the forces of two sets of coefficients: 1 if they are
/// equal, 0.4 if one is 2.5 times the other.
pub(crate) fn agreement(columns: &[Vec<f64>], a: &[f64], b: &[f64]) -> f64 {
    let force = |values: &[f64]| {
        let rows = 0..columns.first().map_or(0, Vec::len);
        rows.map(|k| columns.iter().zip(values).map(|(c, v)| c[k] * v).sum()).collect::<Vec<f64>>()
    };
    let (f, g) = (force(a), force(b));
    dot(&f, &g) / (dot(&f, &f).max(dot(&g, &g)) + 1e-300)
}

/// Amplitudes of pairs of columns, meaned over recordings.
fn mean_amplitudes(values: &[f64], count: usize) -> Vec<f64> {
    let recordings = values.len() / count;
    let mean_amplitude = |pair: usize| {
        let all = values.chunks(count).map(|v| v[2 * pair].hypot(v[2 * pair + 1]));
        all.sum::<f64>() / recordings as f64
    };
    (0..count / 2).map(mean_amplitude).collect()
}

/// The rows of a recording.
fn rows_of(p: &Problem, recording: usize) -> std::ops::Range<usize> {
    let start = p.tiling.rows.partition_point(|r| r.recording < recording);
    start..p.tiling.rows.partition_point(|r| r.recording <= recording)
}
/// A column that is zero outside one recording.
fn only(p: &Problem, column: &[f64], recording: usize) -> Vec<f64> {
    let mut out = vec![0.0; column.len()];
    let rows = rows_of(p, recording);
    out[rows.clone()].copy_from_slice(&column[rows]);
    out
}
/// The columns of a law: its own, or a set for each recording, recording by recording.
pub(crate) fn expanded(p: &Problem, law: &Candidate, recordings: std::ops::Range<usize>) -> Vec<Vec<f64>> {
    if !law.own_phase {
        return law.columns.clone();
    }
    recordings.flat_map(|i| law.columns.iter().map(move |c| only(p, c, i))).collect()
}

/// Inner products of `columns` with `others` and with `y`.
fn sums(columns: &[Vec<f64>], others: &[Vec<f64>], y: &[f64]) -> Equations {
    // `left` is square only where the two are the same; see `join` for the other use.
    let mut left = Square { n: others.len(), a: Vec::with_capacity(columns.len() * others.len()) };
    for c in columns {
        left.a.extend(others.iter().map(|o| dot(c, o)));
    }
    Equations { left, right: columns.iter().map(|c| dot(c, y)).collect() }
}

/// By fold, the products of `more` with `base` and then with `more` itself, row by row of `more`.
fn equations(p: &Problem, more: &[Vec<f64>], base: &[Vec<f64>], y: &[f64]) -> Vec<Equations> {
    let width = base.len() + more.len();
    let empty = Equations {
        left: Square { n: width, a: vec![0.0; width * more.len()] },
        right: vec![0.0; more.len()],
    };
    let mut folds = vec![empty; FOLDS];
    for (fold, rows) in stretches(p) {
        let e = &mut folds[fold];
        for (i, c) in more.iter().enumerate() {
            let c = &c[rows.clone()];
            for (j, other) in base.iter().chain(more).enumerate() {
                e.left.a[i * width + j] += dot(c, &other[rows.clone()]);
            }
            e.right[i] += dot(c, &y[rows.clone()]);
        }
    }
    folds
}

/// Puts base equations and those of added columns together.
fn join(base: &Equations, added: &Equations, old: usize) -> Equations {
    let n = old + added.right.len();
    let mut left = Square::zero(n);
    for i in 0..old {
        left.a[i * n..i * n + old].copy_from_slice(&base.left.a[i * old..(i + 1) * old]);
    }
    for i in old..n {
        for j in 0..n {
            let x = added.left.a[(i - old) * n + j];
            left.a[i * n + j] = x;
            left.a[j * n + i] = x;
        }
    }
    Equations { left, right: [&base.right[..], &added.right].concat() }
}

/// Stretches of the fit's rows that belong to one fold.
fn stretches(p: &Problem) -> Vec<(usize, std::ops::Range<usize>)> {
    let rows = &p.tiling.rows[..p.tiling.fit_rows];
    let mut out: Vec<(usize, std::ops::Range<usize>)> = Vec::new();
    for (i, row) in rows.iter().enumerate() {
        match out.last_mut() {
            Some((fold, range)) if *fold == row.fold => range.end = i + 1,
            _ => out.push((row.fold, i..i + 1)),
        }
    }
    out
}

/// Adds the rig's values to the equations; a misfit is one fact a frame, so the prior is too.
fn add_prior(p: &Problem, e: &mut Equations, rows_a_frame: f64) {
    for (i, nominal) in p.nominal.iter().enumerate() {
        if nominal.variance > 0.0 {
            e.left.add(i, i, rows_a_frame / nominal.variance);
            e.right[i] += rows_a_frame * nominal.mean / nominal.variance;
        }
    }
    (0..e.left.n).for_each(|i| e.left.add(i, i, RIDGE * e.left.at(i, i)));
}

/// Least squares without a prior.
fn plain(columns: &[Vec<f64>], y: &[f64]) -> Vec<f64> {
    let mut e = sums(columns, columns, y);
    (0..e.left.n).for_each(|i| e.left.add(i, i, RIDGE * e.left.at(i, i)));
    Factor::new(&e.left).solve(&e.right)
}

/// The equations of the folds that are kept.
fn added(folds: &[Equations], keep: &dyn Fn(usize) -> bool) -> Equations {
    let n = folds[0].right.len();
    let mut sum = Equations { left: Square::zero(n), right: vec![0.0; n] };
    for e in folds.iter().enumerate().filter(|(k, _)| keep(*k)).map(|(_, e)| e) {
        sum.left.a.iter_mut().zip(&e.left.a).for_each(|(s, x)| *s += x);
        sum.right.iter_mut().zip(&e.right).for_each(|(s, x)| *s += x);
    }
    sum
}

/// Solves with each fold left out, for all and for two halves.
fn solve(p: &Problem, columns: &[&[Vec<f64>]], y: &[f64], folds: &[Equations]) -> Fitted {
    let rows_a_frame = p.tiling.fit_rows as f64 / p.tiling.fit_frames.max(1) as f64;
    let values = |keep: &dyn Fn(usize) -> bool| {
        let mut sum = added(folds, keep);
        add_prior(p, &mut sum, rows_a_frame);
        Factor::new(&sum.left).solve(&sum.right)
    };
    let left_out: Vec<Vec<f64>> = (0..FOLDS).map(|fold| values(&|k| k != fold)).collect();
    let mut error = y.to_vec();
    for (fold, rows) in stretches(p) {
        for (column, value) in columns.iter().copied().flatten().zip(&left_out[fold]) {
            let pairs = error[rows.clone()].iter_mut().zip(&column[rows.clone()]);
            pairs.for_each(|(e, x)| *e -= value * x);
        }
    }
    let halves = [values(&|k| k % 2 == 0), values(&|k| k % 2 == 1)];
    Fitted { error, values: values(&|_| true), halves }
}

/// Estimates the flat variance and the part of the expected reading noise that shows: two
/// coefficients of the squared residuals, neither below zero, by weighted least squares.
fn noise(p: &Problem, model: &Model, least: f64) -> (f64, f64) {
    let (mut aa, mut ab, mut bb, mut ay, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for ((e, root), reading) in model.fitted.error.iter().zip(&model.root).zip(&p.reading) {
        // The variance of a square is twice the square of the variance.
        let w = root.powi(4);
        let square = (e / root).powi(2);
        aa += w;
        ab += w * reading;
        bb += w * reading * reading;
        ay += w * square;
        by += w * reading * square;
    }
    let det = aa * bb - ab * ab;
    let part =
        if det > 1e-9 * aa * bb { ((aa * by - ab * ay) / det).clamp(p.least_reading_part, 1.0) } else { 1.0 };
    (((ay - part * ab) / aa).max(least), part)
}

#[cfg(test)]
mod tests;
