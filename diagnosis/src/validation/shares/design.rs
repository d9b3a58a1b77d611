//! Least squares over some recordings, with stretches left out in turn.

use super::laws::Columns;
use super::sight::Sight;
use crate::selection::predictive::FOLDS;
use numerics::linear::{Prior, Square, bounded, dot};

/// Number of correlated rows that carry as much information as one independent row; the priors are
/// weighed accordingly.
const TOGETHER: f64 = 10.0;

/// One recording: inner products of its columns, target last, per fold.
struct Products {
    folds: Vec<Square>,
    rows: Vec<f64>,
    /// Place of each column in the common vector.
    places: Vec<usize>,
}

impl Products {
    fn new(columns: &[&[f64]], sight: &Sight, places: Vec<usize>) -> Self {
        let p = columns.len();
        let mut folds = vec![Square::zero(p + 1); FOLDS];
        let mut rows = vec![0.0; FOLDS];
        // Rows of one fold are contiguous.
        let mut from = 0;
        while from < sight.fold.len() {
            let fold = sight.fold[from];
            let to = from + sight.fold[from..].iter().take_while(|f| **f == fold).count();
            let column = |i: usize| if i == p { &sight.target[from..to] } else { &columns[i][from..to] };
            for i in 0..=p {
                for j in 0..=i {
                    let x = dot(column(i), column(j));
                    folds[fold].add(i, j, x);
                    if i != j {
                        folds[fold].add(j, i, x);
                    }
                }
            }
            rows[fold] += (to - from) as f64;
            from = to;
        }
        Self { folds, rows, places }
    }

    /// Sum of squares that coefficients leave in the folds that count.
    fn left(&self, x: &[f64], counts: impl Fn(usize) -> bool) -> (f64, f64) {
        let p = self.places.len();
        let step: Vec<f64> = self.places.iter().map(|place| -x[*place]).chain([1.0]).collect();
        let (mut sum, mut rows) = (0.0, 0.0);
        for (fold, m) in self.folds.iter().enumerate().filter(|(fold, _)| counts(*fold)) {
            for i in 0..=p {
                sum += step[i] * (0..=p).map(|j| m.at(i, j) * step[j]).sum::<f64>();
            }
            rows += self.rows[fold];
        }
        (sum.max(0.0), rows)
    }
}

/// A regression over some recordings.
pub(crate) struct Design {
    all: Vec<Products>,
    priors: Vec<Prior>,
    /// Places of each law's terms per recording.
    pub(crate) laws: Vec<Vec<Vec<usize>>>,
}

impl Design {
    /// Lays nominal columns and laws over the recordings from `first` on.
    pub(crate) fn new(sights: &[Sight], first: usize, priors: &[Prior], laws: &[&Columns]) -> Self {
        let mut priors = priors.to_vec();
        let mut places_of = vec![vec![Vec::new(); sights.len()]; laws.len()];
        for (law, places_of) in laws.iter().zip(&mut places_of) {
            let terms = law.bounds.len();
            let mut from = priors.len();
            for places in places_of.iter_mut() {
                if law.own || from == priors.len() {
                    from = priors.len();
                    priors.extend(law.bounds.iter().map(|(low, high)| Prior {
                        low: *low,
                        high: *high,
                        sd: law.sd,
                        mean: 0.0,
                    }));
                }
                *places = (from..from + terms).collect();
            }
        }
        let one = |(r, sight): (usize, &Sight)| {
            let own = laws.iter().flat_map(|law| law.of[first + r].iter());
            let columns: Vec<&[f64]> = sight.nominal.iter().chain(own).map(Vec::as_slice).collect();
            let nominal = 0..sight.nominal.len();
            let places = nominal.chain(places_of.iter().flat_map(|of| of[r].iter().copied())).collect();
            Products::new(&columns, sight, places)
        };
        let all = sights.iter().enumerate().map(one).collect();
        Self { all, priors, laws: places_of }
    }

    /// The coefficients that fit the folds that count best; `square` is the mean square that is
    /// left.
    pub(crate) fn solve(&self, square: f64, counts: impl Fn(usize) -> bool) -> Vec<f64> {
        let size = self.priors.len();
        let (mut m, mut b) = (Square::zero(size), vec![0.0; size]);
        let scale = 1.0 / (TOGETHER * square).max(1e-300);
        for one in &self.all {
            let p = one.places.len();
            for (_, products) in one.folds.iter().enumerate().filter(|(fold, _)| counts(*fold)) {
                for i in 0..p {
                    b[one.places[i]] += scale * products.at(i, p);
                    for j in 0..p {
                        m.add(one.places[i], one.places[j], scale * products.at(i, j));
                    }
                }
            }
        }
        bounded(&m, &b, &self.priors).x
    }

    /// Mean square of the target.
    pub(crate) fn target(&self) -> f64 {
        self.left_by(&vec![0.0; self.priors.len()])
    }

    /// Mean square that coefficients leave.
    pub(crate) fn left_by(&self, x: &[f64]) -> f64 {
        let (sum, rows) = self.all.iter().map(|one| one.left(x, |_| true)).fold((0.0, 0.0), add);
        sum / rows.max(1.0)
    }

    /// Mean square that is left on folds by fits to the others.
    pub(crate) fn left_out(&self, square: f64) -> f64 {
        let of_fold = |fold: usize| {
            let x = self.solve(square, |other| other != fold);
            self.all.iter().map(|one| one.left(&x, |f| f == fold)).fold((0.0, 0.0), add)
        };
        let (sum, rows) = (0..FOLDS).map(of_fold).fold((0.0, 0.0), add);
        sum / rows.max(1.0)
    }

    /// Inner product of the forces of law `i` by two vectors of coefficients, over all recordings.
    pub(crate) fn along(&self, i: usize, a: &[f64], b: &[f64]) -> f64 {
        let before = self.all[0].places.len() - self.laws[i..].iter().map(|of| of[0].len()).sum::<usize>();
        let of = |(one, places): (&Products, &Vec<usize>)| {
            let mut sum = 0.0;
            for m in &one.folds {
                for (k, p) in places.iter().enumerate() {
                    for (l, q) in places.iter().enumerate() {
                        sum += a[*p] * m.at(before + k, before + l) * b[*q];
                    }
                }
            }
            sum
        };
        self.all.iter().zip(&self.laws[i]).map(of).sum()
    }
}

fn add(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 + b.0, a.1 + b.1)
}

/// Mean square that is left on held-out recordings by coefficients found on the fitted ones: the
/// phase of a law that has its own in every recording is found there, its amplitude is not.
pub(crate) fn held_out(fitted: &Design, x: &[f64], there: &Design, square: f64, laws: &[&Columns]) -> f64 {
    let nominal = there.laws.first().map_or(there.priors.len(), |of| of[0][0]);
    let own = there.solve(square, |_| true);
    let mut theta = own.clone();
    theta[..nominal].copy_from_slice(&x[..nominal]);
    for (i, law) in laws.iter().enumerate() {
        let (from, to) = (&fitted.laws[i], &there.laws[i]);
        if !law.own {
            from[0].iter().zip(&to[0]).for_each(|(from, to)| theta[*to] = x[*from]);
            continue;
        }
        for pair in (0..law.bounds.len()).step_by(2) {
            let size = |x: &[f64], places: &[usize]| x[places[pair]].hypot(x[places[pair + 1]]);
            let amplitude = from.iter().map(|places| size(x, places)).sum::<f64>() / from.len() as f64;
            for places in to {
                let factor = amplitude / size(&own, places).max(1e-300);
                theta[places[pair]] = factor * own[places[pair]];
                theta[places[pair + 1]] = factor * own[places[pair + 1]];
            }
        }
    }
    there.left_by(&theta)
}
