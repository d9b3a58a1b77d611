//! Methods without the tool, on the same files: refit only, forward selection by BIC, sparse
//! regression, a score test without opponents, an unstructured residual model, and a fit that knows
//! the whole structure. Each is written in the straightforward way, on one common estimate of the
//! motion.

mod estimate;
mod features;
mod score_test;

use crate::dynamics::JudgeDynamics;
use crate::generator::case::Case;
use crate::key::{Category, Key};
use crate::rng::Rng;
use crate::share::share;
use crate::signal::Normal;
use estimate::BaselineTable;
use features::Feature;

/// The answer of a baseline to a case.
#[derive(Clone, Debug)]
pub(crate) struct Opinion {
    /// Whose it is, in [`BASELINES`].
    pub(crate) rival: usize,
    /// Names in the contract's words, three at most; empty for baselines that name nothing.
    pub(crate) names: Vec<&'static str>,
    /// Held-out gain over an oracle's at the baselines' bandwidth; `None` where there is nothing to
    /// gain.
    pub(crate) share: Option<f64>,
}

/// A method that the tool is compared with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Baseline {
    pub(crate) name: &'static str,
    /// It gives effects names.
    pub(crate) names: bool,
}

/// The baselines.
pub(crate) const BASELINES: [Baseline; 6] = [
    Baseline { name: "told the structure, least squares", names: false },
    Baseline { name: "refit only", names: false },
    Baseline { name: "forward selection by BIC", names: true },
    Baseline { name: "sparse regression", names: true },
    Baseline { name: "score test without opponents", names: true },
    Baseline { name: "unstructured", names: false },
];

/// The fit that is given the whole structure, by the judge's inverse dynamics; none where there is
/// nothing to gain, or the effect has no law with few enough numbers.
pub(crate) fn known_structure(bench: &Result<JudgeDynamics, String>, key: &Key) -> Option<Opinion> {
    if !matches!(key.category, Category::Single | Category::Pair | Category::Triple) {
        return None;
    }
    let (bench, oracle) = (bench.as_ref().ok()?, key.oracle.as_ref()?);
    let left = bench.known_structure(key).ok()?;
    let share = share(bench.refit(), left, oracle.floor);
    Some(Opinion { rival: 0, names: Vec::new(), share })
}

/// Every rival on the case.
pub(crate) fn judge(case: &Case) -> [Opinion; 5] {
    let tables: Vec<BaselineTable> = (0..3).map(|k| estimate::table(case, k)).collect();
    let features = features::library(case, &tables);
    let base = features.iter().filter(|f| f.nominal).count();
    let columns: Vec<Vec<Vec<f64>>> = tables
        .iter()
        .enumerate()
        .map(|(k, t)| features::columns(&features, if k < 2 { k } else { usize::MAX }, t))
        .collect();
    let mut normal = Normal::new(features.len());
    let mut x = vec![0.0; features.len()];
    for (table, columns) in tables.iter().zip(&columns).take(2) {
        for (j, &i) in table.kept.iter().enumerate() {
            x.iter_mut().zip(columns).for_each(|(x, c)| *x = c[j]);
            normal.add(&x, table.rows[i].acceleration);
        }
    }
    let nominal: Vec<usize> = (0..base).collect();
    let refit = normal.solve(&nominal, &[]);
    let judged = |coefficients: &[f64], field: Option<&Field>| {
        held_out(&columns[2], &tables[2], coefficients, field) * case.plant.inertia.powi(2)
    };
    let refit_mean_square = judged(&refit, None);
    let oracle = case.held_out(case.machine.residual_bandwidth()).noise.powi(2);
    let opinion = |rival: usize, names: Vec<&'static str>, mean_square: f64| Opinion {
        rival,
        names,
        share: share_of_oracle(refit_mean_square, mean_square, oracle),
    };
    let independent = tables[0].independent;
    let (forward, forward_names) = forward_bic(&features, &normal, &nominal, independent);
    let (sparse, sparse_names) = thresholding(&features, &normal, &nominal, independent);
    let (scored, scored_names) = score_test::select(&features, &normal, &columns, &tables, &nominal);
    let field = unstructured(case, &columns, &tables, &refit);
    [
        opinion(1, Vec::new(), refit_mean_square),
        opinion(2, forward_names, judged(&forward, None)),
        opinion(3, sparse_names, judged(&sparse, None)),
        opinion(4, scored_names, judged(&scored, None)),
        opinion(5, Vec::new(), judged(&refit, Some(&field))),
    ]
}

/// Less than this part of the refit's mean square left to an oracle, and there is nothing to gain.
const EXPLAINABLE: f64 = 0.05;

/// Share of what an oracle, which has the true model and leaves the noise, takes off the held-out
/// mean square.
fn share_of_oracle(refit: f64, left: f64, oracle: f64) -> Option<f64> {
    let all = refit - oracle;
    let gain = refit - left;
    (gain.is_finite() && all > EXPLAINABLE * refit).then(|| (gain / all).clamp(-2.0, 2.0))
}

/// Returns the residual of the coefficients at the kept rows, and the rows' numbers.
fn left_over<'a>(
    columns: &'a [Vec<f64>],
    table: &'a BaselineTable,
    coefficients: &'a [f64],
) -> impl Iterator<Item = (usize, f64)> + 'a {
    table.kept.iter().enumerate().map(move |(j, &i)| {
        let known: f64 = columns.iter().zip(coefficients).map(|(c, a)| c[j] * a).sum();
        (i, table.rows[i].acceleration - known)
    })
}

/// Held-out mean square, the recording's own mean left out (its offset is its own).
fn held_out(columns: &[Vec<f64>], table: &BaselineTable, coefficients: &[f64], field: Option<&Field>) -> f64 {
    let (mut sum, mut squares) = (0.0, 0.0);
    for (i, mut left) in left_over(columns, table, coefficients) {
        if let Some(field) = field {
            left -= field.at(point(&table.rows[i]));
        }
        sum += left;
        squares += left * left;
    }
    let n = table.kept.len().max(1) as f64;
    squares / n - (sum / n).powi(2)
}

fn point(row: &estimate::Row) -> [f64; 3] {
    [row.place, row.speed, row.command]
}

/// Bayesian information criterion with the rows counted as independent only at the residual
/// bandwidth.
fn bic(residual: f64, rows: usize, independent: f64, parameters: usize) -> f64 {
    independent * (residual / rows.max(1) as f64).max(1e-300).ln() + parameters as f64 * independent.ln()
}

fn forward_bic(
    features: &[Feature],
    normal: &Normal,
    nominal: &[usize],
    independent: f64,
) -> (Vec<f64>, Vec<&'static str>) {
    let mut active = nominal.to_vec();
    let mut names: Vec<&'static str> = Vec::new();
    let mut best = normal.solve(&active, &[]);
    let mut score = bic(normal.residual(&best), normal.rows, independent, active.len());
    let groups: usize = features.iter().map(|f| f.group).max().unwrap_or(0) + 1;
    // Several groups may carry the same name (harmonics): three names at most, eight groups at
    // most.
    for _ in 0..8 {
        let mut step: Option<(f64, Vec<usize>, Vec<f64>, &'static str)> = None;
        for group in 0..groups {
            let members: Vec<usize> =
                (0..features.len()).filter(|&i| features[i].group == group && !features[i].nominal).collect();
            let Some(&first) = members.first() else { continue };
            let name = features[first].name;
            if active.contains(&first) || names.len() >= 3 && !names.contains(&name) {
                continue;
            }
            let mut tried = active.clone();
            tried.extend(&members);
            let solution = normal.solve(&tried, &[]);
            let now = bic(normal.residual(&solution), normal.rows, independent, tried.len());
            if now < step.as_ref().map_or(score, |s| s.0) {
                step = Some((now, tried, solution, name));
            }
        }
        let Some((now, tried, solution, name)) = step else { break };
        (score, active, best) = (now, tried, solution);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    (best, names)
}

/// Sequentially thresholded least squares (Brunton, Proctor, Kutz 2016) on columns of unit rms; the
/// threshold is the one of a grid with the best BIC.
fn thresholding(
    features: &[Feature],
    normal: &Normal,
    nominal: &[usize],
    independent: f64,
) -> (Vec<f64>, Vec<&'static str>) {
    let scale: Vec<f64> = (0..features.len()).map(|i| normal.column_rms(i)).collect();
    let start = normal.solve(nominal, &[]);
    let residual = (normal.residual(&start) / normal.rows.max(1) as f64).sqrt();
    let mut best: Option<(f64, Vec<f64>)> = None;
    for threshold in [0.03, 0.1, 0.3, 0.6, 1.0] {
        let mut active: Vec<usize> = (0..features.len()).filter(|&i| scale[i] > 0.0).collect();
        let mut solution = Vec::new();
        for _ in 0..10 {
            // A trace of ridge: the library is nearly collinear, as such libraries are.
            let penalty: Vec<f64> = scale.iter().map(|s| 1e-6 * s * s * normal.rows as f64).collect();
            solution = normal.solve(&active, &penalty);
            let kept: Vec<usize> = active
                .iter()
                .copied()
                .filter(|&i| features[i].nominal || (solution[i] * scale[i]).abs() >= threshold * residual)
                .collect();
            if kept.len() == active.len() {
                break;
            }
            active = kept;
        }
        let score = bic(normal.residual(&solution), normal.rows, independent, active.len());
        if best.as_ref().is_none_or(|b| score < b.0) {
            best = Some((score, solution));
        }
    }
    let solution = best.map(|b| b.1).unwrap_or(start);
    let mut sizes: Vec<(&'static str, f64)> = Vec::new();
    for (i, f) in features.iter().enumerate().filter(|(_, f)| !f.nominal) {
        let size = (solution[i] * scale[i]).powi(2);
        if size > 0.0 {
            match sizes.iter_mut().find(|s| s.0 == f.name) {
                Some(s) => s.1 += size,
                None => sizes.push((f.name, size)),
            }
        }
    }
    sizes.sort_by(|a, b| b.1.total_cmp(&a.1));
    (solution, sizes.into_iter().take(3).map(|s| s.0).collect())
}

/// Radial basis functions over place, speed and command.
struct Field {
    centres: Vec<[f64; 3]>,
    scale: [f64; 3],
    weights: Vec<f64>,
}

impl Field {
    fn basis(&self, point: [f64; 3], out: &mut [f64]) {
        for (value, centre) in out.iter_mut().zip(&self.centres) {
            let distance: f64 = (0..3).map(|i| ((point[i] - centre[i]) * self.scale[i]).powi(2)).sum();
            *value = (-0.5 * distance).exp();
        }
    }

    fn at(&self, point: [f64; 3]) -> f64 {
        let mut x = vec![0.0; self.centres.len()];
        self.basis(point, &mut x);
        x.iter().zip(&self.weights).map(|(a, b)| a * b).sum()
    }
}

fn unstructured(case: &Case, columns: &[Vec<Vec<f64>>], tables: &[BaselineTable], refit: &[f64]) -> Field {
    let mut rng = Rng::new(case.spec.id as u64).fork("centres");
    let rows: Vec<([f64; 3], f64)> = (0..2)
        .flat_map(|k| {
            left_over(&columns[k], &tables[k], refit).map(move |(i, left)| (point(&tables[k].rows[i]), left))
        })
        .collect();
    let count = 100.min(rows.len());
    let centres: Vec<[f64; 3]> = (0..count).map(|_| rows[rng.below(rows.len())].0).collect();
    let mut scale = [0.0; 3];
    for (i, s) in scale.iter_mut().enumerate() {
        let n = rows.len().max(1) as f64;
        let mean = rows.iter().map(|r| r.0[i]).sum::<f64>() / n;
        let spread = (rows.iter().map(|r| (r.0[i] - mean).powi(2)).sum::<f64>() / n).sqrt();
        *s = 1.0 / (0.5 * spread).max(1e-12);
    }
    let mut field = Field { centres, scale, weights: Vec::new() };
    let mut normal = Normal::new(count);
    let mut b = vec![0.0; count];
    for (place, left) in &rows {
        field.basis(*place, &mut b);
        normal.add(&b, *left);
    }
    let all: Vec<usize> = (0..count).collect();
    let penalty = vec![0.01 * rows.len() as f64 / count.max(1) as f64; count];
    field.weights = normal.solve(&all, &penalty);
    field
}
