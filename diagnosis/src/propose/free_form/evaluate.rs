//! Models with and without free forms, fitted with some blocks left out, by their normal equations
//! alone.

use super::basis::{self, Basis, Inputs, Point, Warps};
use super::compare::{Densities, Density};
use super::shape::{Coefficients, Shape};
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::{Gains, Noise};
use crate::fit::input::Input;
use crate::fit::linear_fit::{Prepared, layout};
use crate::fit::model::Model;
use crate::fit::nominal::{Key, Nominal};
use numerics::linear::{Factor, Square, dot};
use numerics::parallel;

/// Segments that are scored together, and such units that are left out together.
const SEGMENTS_A_UNIT: usize = 3;
const FOLDS: usize = 5;

/// Units of a recording in blocks, and the fold of each.
struct Units {
    bounds: Vec<(usize, usize)>,
    fold: Vec<usize>,
}

impl Units {
    fn of(track: &BlockedRecording) -> Self {
        let segments: Vec<(usize, usize)> = track.blocks.segments.windows(2).map(|w| (w[0], w[1])).collect();
        let bounds: Vec<(usize, usize)> =
            segments.chunks(SEGMENTS_A_UNIT).map(|c| (c[0].0, c[c.len() - 1].1)).collect();
        let fold = (0..bounds.len()).map(|i| i * FOLDS / bounds.len()).collect();
        Self { bounds, fold }
    }
}

/// Whitened columns of one recording by unit: inner products.
fn gram(a: &[&[f64]], b: &[&[f64]], (from, to): (usize, usize)) -> Vec<f64> {
    let mut out = Vec::with_capacity(a.len() * b.len());
    for x in a {
        for y in b {
            out.push(dot(&x[from..to], &y[from..to]));
        }
    }
    out
}

/// The same of columns with each other.
fn square_gram(a: &[&[f64]], (from, to): (usize, usize)) -> Vec<f64> {
    let n = a.len();
    let mut out = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..=i {
            let product = dot(&a[i][from..to], &a[j][from..to]);
            out[i * n + j] = product;
            out[j * n + i] = product;
        }
    }
    out
}

/// One free form with its whitened responses, `[recording][column][block]`.
struct Form {
    inputs: Inputs,
    frequency: Vec<f64>,
    responses: Vec<Vec<Vec<f64>>>,
    /// `[recording][unit]`: inner products of the columns.
    own: Vec<Vec<Vec<f64>>>,
}

/// A model with its whitened columns.
struct Base {
    prepared: Vec<Prepared>,
    /// Place of each column of each recording, and the prior's precision per place.
    places: Vec<Vec<usize>>,
    precision: Vec<f64>,
}

impl Base {
    fn new(model: &Model, nominal: &Nominal, tracks: &[BlockedRecording], noise: &Noise, scale: f64) -> Self {
        let prepared = parallel::map_all(tracks, |track| Prepared::new(model, nominal, track, noise));
        let (places, keys) = layout(&prepared);
        let mut precision = vec![0.0; keys.len()];
        for ((one, places), track) in prepared.iter().zip(&places).zip(tracks) {
            for (column, place) in one.columns.iter().zip(places) {
                let sd = match column.key {
                    Key::Term { .. } => column.prior.sd.min(scale / size(&column.input, track)),
                    _ => column.prior.sd,
                };
                precision[*place] = if sd.is_finite() { 1.0 / (sd * sd).max(1e-300) } else { 0.0 };
            }
        }
        Self { prepared, places, precision }
    }
}

/// Root mean square of the acceleration that one unit of an input makes; zero in the sensor.
fn size(input: &Input, track: &BlockedRecording) -> f64 {
    let mean = |square: f64| (square / track.block_count() as f64).sqrt();
    match input {
        Input::Held(a) => mean(a.iter().map(|a| a * a).sum()),
        Input::Rows { dv, .. } => mean(dv.iter().zip(&track.blocks.span).map(|(v, h)| (v / h).powi(2)).sum()),
        Input::Sensor(_) => 0.0,
    }
}

/// Everything for judging models against free forms under one noise.
pub(crate) struct Evaluator<'a> {
    nominal: &'a Nominal,
    tracks: &'a [BlockedRecording],
    noise: Noise,
    /// Acceleration that the command makes.
    scale: f64,
    units: Vec<Units>,
    points: Vec<Vec<Point>>,
    warps: Warps,
    forms: Vec<Form>,
}

/// Sizes of a free form over the acceleration that the command makes, and its length over the range
/// of its inputs.
const SIZES: [f64; 5] = [0.0004, 0.003, 0.02, 0.1, 0.5];
const LENGTHS: [f64; 3] = [0.1, 0.3, 1.0];

impl<'a> Evaluator<'a> {
    pub(crate) fn new(
        nominal: &'a Nominal,
        tracks: &'a [BlockedRecording],
        noise: &Noise,
        scale: f64,
    ) -> Self {
        let points: Vec<Vec<Point>> = tracks.iter().map(basis::points).collect();
        let warps = Warps::of(&points, nominal.rig.turn());
        let gains = parallel::map_all(tracks, |track| Gains::new(&track.observed(), noise));
        let units: Vec<Units> = tracks.iter().map(Units::of).collect();
        let forms = parallel::map_all(&Inputs::ALL, |inputs| {
            let basis = Basis::new(*inputs, &warps);
            let responses: Vec<Vec<Vec<f64>>> = tracks
                .iter()
                .zip(&points)
                .zip(&gains)
                .map(|((track, points), gains)| {
                    let columns = basis.columns(track, points, nominal.known_gain());
                    gains.all_responses(&track.observed(), &columns.iter().collect::<Vec<_>>())
                })
                .collect();
            let own = responses
                .iter()
                .zip(&units)
                .map(|(columns, units)| {
                    let all: Vec<&[f64]> = columns.iter().map(Vec::as_slice).collect();
                    parallel::map_all(&units.bounds, |b| square_gram(&all, *b))
                })
                .collect();
            Form { inputs: *inputs, frequency: basis.frequency, responses, own }
        });
        Self { nominal, tracks, noise: *noise, scale, units, points, warps, forms }
    }

    fn base(&self, model: &Model) -> Base {
        Base::new(model, self.nominal, self.tracks, &self.noise, self.scale)
    }
}

/// Normal equations of a model with or without a form, by unit.
struct Normal {
    size: usize,
    base: usize,
    /// `[unit over all recordings]`: matrix, right side, square of the residual, fold.
    units: Vec<(Square, Vec<f64>, f64, usize)>,
}

impl Normal {
    fn new(evaluator: &Evaluator, base: &Base, form: Option<&Form>) -> Self {
        let p = base.precision.len();
        let k = form.map_or(0, |f| f.frequency.len());
        let own = form.is_some_and(|f| f.inputs.own());
        let size = p + if own { k * evaluator.tracks.len() } else { k };
        let mut units = Vec::new();
        for (r, one) in base.prepared.iter().enumerate() {
            let shift = p + if own { r * k } else { 0 };
            for (u, bounds) in evaluator.units[r].bounds.iter().enumerate() {
                let mut m = Square::zero(size);
                let mut b = vec![0.0; size];
                let columns: Vec<&[f64]> = one.responses.iter().map(Vec::as_slice).collect();
                let data: [&[f64]; 1] = [&one.residual];
                let places = &base.places[r];
                let inner = gram(&columns, &columns, *bounds);
                let right = gram(&columns, &data, *bounds);
                for (i, a) in places.iter().enumerate() {
                    b[*a] += right[i];
                    for (j, c) in places.iter().enumerate() {
                        m.add(*a, *c, inner[i * columns.len() + j]);
                    }
                }
                if let Some(form) = form {
                    let waves: Vec<&[f64]> = form.responses[r].iter().map(Vec::as_slice).collect();
                    let cross = gram(&waves, &columns, *bounds);
                    let right = gram(&waves, &data, *bounds);
                    for i in 0..k {
                        b[shift + i] += right[i];
                        for (j, c) in places.iter().enumerate() {
                            m.add(shift + i, *c, cross[i * columns.len() + j]);
                            m.add(*c, shift + i, cross[i * columns.len() + j]);
                        }
                        for j in 0..k {
                            m.add(shift + i, shift + j, form.own[r][u][i * k + j]);
                        }
                    }
                }
                let square = gram(&data, &data, *bounds)[0];
                units.push((m, b, square, r * FOLDS + evaluator.units[r].fold[u]));
            }
        }
        Self { size, base: p, units }
    }

    /// Sum over the units that are not in a fold.
    fn sum(&self, without: Option<usize>) -> (Square, Vec<f64>) {
        let mut m = Square::zero(self.size);
        let mut b = vec![0.0; self.size];
        for (unit, right, _, fold) in &self.units {
            if Some(*fold) != without {
                m.a.iter_mut().zip(&unit.a).for_each(|(a, x)| *a += x);
                b.iter_mut().zip(right).for_each(|(a, x)| *a += x);
            }
        }
        (m, b)
    }

    /// Log predictive density of every unit from a fit to the other folds.
    fn density(&self, precision: &[f64]) -> Density {
        let folds: Vec<usize> = {
            let mut all: Vec<usize> = self.units.iter().map(|u| u.3).collect();
            all.dedup();
            all
        };
        let (whole, whole_b) = self.sum(None);
        let solved = parallel::map_all(&folds, |fold| {
            let mut m = whole.clone();
            let mut b = whole_b.clone();
            for (unit, right, _, f) in &self.units {
                if f == fold {
                    m.a.iter_mut().zip(&unit.a).for_each(|(a, x)| *a -= x);
                    b.iter_mut().zip(right).for_each(|(a, x)| *a -= x);
                }
            }
            for (i, p) in precision.iter().enumerate() {
                m.add(i, i, *p);
            }
            (*fold, Factor::new(&m).solve(&b))
        });
        Density(
            self.units
                .iter()
                .map(|(m, b, square, fold)| {
                    let x = &solved.iter().find(|s| s.0 == *fold).expect("every fold is solved").1;
                    let n = self.size;
                    let mut sum = *square;
                    for i in 0..n {
                        let row = dot(&m.a[i * n..(i + 1) * n], x);
                        sum += x[i] * (row - 2.0 * b[i]);
                    }
                    -0.5 * sum.max(0.0)
                })
                .collect(),
        )
    }
}

impl Form {
    /// Relative standard deviation of each column's coefficient for a length, sum of squares one.
    fn spread(&self, length: f64) -> Vec<f64> {
        let lambda = 3.0_f64.sqrt() / (length * std::f64::consts::PI);
        let power: Vec<f64> = self.frequency.iter().map(|f| (lambda * lambda + f * f).powi(-2)).collect();
        let sum: f64 = power.iter().sum::<f64>().max(1e-300);
        power.iter().map(|p| (p / sum).sqrt()).collect()
    }
}

impl Evaluator<'_> {
    /// Densities of a model alone and with each form, its hyper-parameters by marginal likelihood.
    pub(crate) fn densities(&self, model: &Model) -> Densities {
        let base = self.base(model);
        let alone = Normal::new(self, &base, None).density(&base.precision);
        let with_form = |form: &Form| {
            let normal = Normal::new(self, &base, Some(form));
            let precision = self.most_likely(form, &base, &normal);
            (form.inputs, normal.density(&precision))
        };
        let forms: Vec<&Form> = self.forms.iter().filter(|form| !form.frequency.is_empty()).collect();
        let with = parallel::map_all(&forms, |form| with_form(form));
        Densities { alone, with }
    }

    /// Density of a model alone.
    pub(crate) fn alone(&self, model: &Model) -> Density {
        let base = self.base(model);
        Normal::new(self, &base, None).density(&base.precision)
    }

    /// The force of a form in addition to a model, fitted to all blocks; if it is over an angle, as
    /// in the first recording. `inertia` converts acceleration to force.
    pub(crate) fn shape(&self, model: &Model, inputs: Inputs, inertia: f64) -> Option<Shape> {
        let form = self.forms.iter().find(|form| form.inputs == inputs && !form.frequency.is_empty())?;
        let base = self.base(model);
        let normal = Normal::new(self, &base, Some(form));
        let (mut whole, b) = normal.sum(None);
        for (i, p) in self.most_likely(form, &base, &normal).iter().enumerate() {
            whole.add(i, i, *p);
        }
        let factor = Factor::new(&whole);
        let (x, inverse) = (factor.solve(&b), factor.inverse());
        let (first, count) = (normal.base, form.frequency.len());
        let mut covariance = Square::zero(count);
        for i in 0..count {
            for j in 0..count {
                covariance.add(i, j, inverse.at(first + i, first + j));
            }
        }
        let of = Coefficients { mean: x[first..first + count].to_vec(), covariance };
        let basis = Basis::new(inputs, &self.warps);
        Some(Shape::new(&basis, &of, &self.points, self.nominal.known_gain(), inertia))
    }

    /// Precisions of the priors of all columns, of the size and length of a form with the largest
    /// marginal likelihood.
    fn most_likely(&self, form: &Form, base: &Base, normal: &Normal) -> Vec<f64> {
        let (whole, b) = normal.sum(None);
        let mut best = (f64::NEG_INFINITY, Vec::new());
        let lengths = if form.inputs.own() { &LENGTHS[..1] } else { &LENGTHS };
        for length in lengths {
            let spread = form.spread(*length);
            for size in SIZES {
                let mut precision = base.precision.clone();
                let mut logs = 0.0;
                for i in 0..normal.size - normal.base {
                    let sd = size * self.scale * spread[i % spread.len()];
                    precision.push(1.0 / (sd * sd));
                    logs += sd.ln();
                }
                let mut m = whole.clone();
                for (i, p) in precision.iter().enumerate() {
                    m.add(i, i, *p);
                }
                let factor = Factor::new(&m);
                let evidence = 0.5 * dot(&factor.solve(&b), &b) - 0.5 * factor.log_det() - logs;
                if evidence > best.0 {
                    best = (evidence, precision);
                }
            }
        }
        best.1
    }
}
