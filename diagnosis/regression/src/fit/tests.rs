//! Weighted least squares against a method without normal equations.

use super::*;
use crate::data::{Part, Recording, Rig, Value};

fn problem() -> Problem {
    let value = |nominal| Value { nominal, spread: Some(0.3) };
    let rig = Rig {
        rotary: true,
        inertia: value(1.0),
        viscous: Some(value(0.5)),
        coulomb: Some(value(2.0)),
        weight: None,
        gravity: None,
        has_offset: true,
        gain: value(1.0),
        known_delay_s: 0.0,
        known_lags_s: Vec::new(),
        counts_per_unit: 1e4,
        absolute: true,
        noise_counts: 0.0,
        turn: None,
        start_spread: None,
    };
    let recording = |part, phase: f64| {
        let time_s: Vec<f64> = (0..3000).map(|i| f64::from(i) * 0.01).collect();
        let q = |t: f64| (1.3 * t + phase).sin() + 0.2 * (7.0 * t).sin();
        let u = |t: f64| (2.0 * t).cos() + (9.0 * t + phase).sin();
        let counts = time_s.iter().map(|t| (1e4 * q(*t)).round()).collect();
        let command = time_s.iter().map(|t| u(*t)).collect();
        Recording { part, time_s, command, position_counts: counts, tilt_rad: None, load: None }
    };
    let all = [recording(Part::Fit, 0.0), recording(Part::Fit, 1.0), recording(Part::Holdout, 2.0)];
    Problem::new(&rig, &all.iter().collect::<Vec<_>>())
}

/// Least squares by modified Gram–Schmidt on rows, those of the prior appended; no normal
/// equations.
fn by_orthogonal_columns(mut columns: Vec<Vec<f64>>, mut y: Vec<f64>) -> Vec<f64> {
    let n = columns.len();
    let mut r = vec![vec![0.0; n]; n];
    let mut c = vec![0.0; n];
    for i in 0..n {
        r[i][i] = dot(&columns[i], &columns[i]).sqrt();
        let unit: Vec<f64> = columns[i].iter().map(|x| x / r[i][i]).collect();
        for j in i + 1..n {
            r[i][j] = dot(&unit, &columns[j]);
            columns[j].iter_mut().zip(&unit).for_each(|(x, u)| *x -= r[i][j] * u);
        }
        c[i] = dot(&unit, &y);
        y.iter_mut().zip(&unit).for_each(|(x, u)| *x -= c[i] * u);
    }
    let mut x = vec![0.0; n];
    for i in (0..n).rev() {
        x[i] = (c[i] - (i + 1..n).map(|j| r[i][j] * x[j]).sum::<f64>()) / r[i][i];
    }
    x
}

#[test]
fn weighted_least_squares_agrees_with_orthogonal_columns() {
    let p = problem();
    let model = Model::new(&p, Vec::new());
    let fit = p.tiling.fit_rows;
    let facts = (fit as f64 / p.tiling.fit_frames as f64).sqrt();
    let solve = |keep: &dyn Fn(usize) -> bool| {
        let rows = || (0..fit).filter(|k| keep(p.tiling.rows[*k].fold));
        let weigh = |c: &[f64]| rows().map(|k| c[k] * model.root[k]).collect::<Vec<f64>>();
        let mut columns: Vec<Vec<f64>> = p.nominal.iter().map(|n| weigh(&n.column)).collect();
        columns.extend((0..2).map(|i| weigh(&only(&p, &p.one, i))));
        let mut y = weigh(&p.y);
        for (i, n) in p.nominal.iter().enumerate() {
            let root = facts / n.variance.sqrt();
            columns.iter_mut().enumerate().for_each(|(j, c)| c.push(if i == j { root } else { 0.0 }));
            y.push(root * n.mean);
        }
        by_orthogonal_columns(columns, y)
    };
    let expected = solve(&|_| true);
    for (value, expected) in model.fitted.values.iter().zip(&expected) {
        assert!((value - expected).abs() < 1e-5 * (1.0 + expected.abs()), "{value} {expected}");
    }
    let without = solve(&|fold| fold != 1);
    let row = (0..fit).find(|k| p.tiling.rows[*k].fold == 1).expect("a row of fold 1");
    let terms = p.nominal.iter().zip(&without).map(|(n, v)| v * n.column[row]).sum::<f64>();
    let left = model.root[row] * (p.y[row] - terms - without[3 + p.tiling.rows[row].recording] * p.one[row]);
    assert!((left - model.fitted.error[row]).abs() < 1e-5 * (1.0 + left.abs()), "{left}");
}
