//! A score test for every candidate in turn, and no test against other explanations: no rival, no
//! free form, no held-out recording. The variance of a score is the scatter of its blocks with the
//! candidate in the model, so that autocorrelated noise counts once.

use super::estimate::BaselineTable;
use super::features::Feature;
use super::left_over;
use crate::signal::Normal;

/// Length of a block over the residual's correlation, 1/band.
const BLOCK: f64 = 30.0;
/// Chance of one false name in a case, shared among all candidates.
const LEVEL: f64 = 0.01;

/// Returns the coefficients and names of the effects that pass, at most three, one after another.
pub(super) fn select(
    features: &[Feature],
    normal: &Normal,
    columns: &[Vec<Vec<f64>>],
    tables: &[BaselineTable],
    nominal: &[usize],
) -> (Vec<f64>, Vec<&'static str>) {
    let groups = features.iter().map(|f| f.group).max().unwrap_or(0);
    let threshold = normal_quantile(LEVEL / groups.max(1) as f64);
    let mut active = nominal.to_vec();
    let mut names: Vec<&'static str> = Vec::new();
    while names.len() < 3 {
        let fitted = normal.solve(&active, &[]);
        let mut best: Option<(f64, Vec<usize>)> = None;
        for group in 1..=groups {
            let members: Vec<usize> = (0..features.len()).filter(|&i| features[i].group == group).collect();
            let Some(first) = members.first() else { continue };
            if names.contains(&features[*first].name) {
                continue;
            }
            let z = score(normal, columns, tables, &active, &fitted, &members);
            if z > best.as_ref().map_or(threshold, |b| b.0) {
                best = Some((z, members));
            }
        }
        let Some((_, members)) = best else { break };
        names.push(features[members[0]].name);
        active.extend(members);
    }
    (normal.solve(&active, &[]), names)
}

/// The score of some columns as a standard normal number.
fn score(
    normal: &Normal,
    columns: &[Vec<Vec<f64>>],
    tables: &[BaselineTable],
    active: &[usize],
    fitted: &[f64],
    members: &[usize],
) -> f64 {
    let k = members.len();
    let with = normal.solve(&[active, members].concat(), &[]);
    let shadows: Vec<Vec<f64>> = members.iter().map(|m| normal.regress(active, *m)).collect();
    let (mut sum, mut scatter) = (vec![0.0; k], Normal::new(k));
    for (table, columns) in tables.iter().zip(columns).take(2) {
        let block = (BLOCK / table.band * table.rate) as usize;
        let mut own = vec![0.0; k];
        let mut until = block;
        let rows = left_over(columns, table, fitted).zip(left_over(columns, table, &with));
        for (j, ((i, before), (_, after))) in rows.enumerate() {
            if i >= until {
                scatter.add(&own, 0.0);
                own.fill(0.0);
                until = i + block;
            }
            for (m, (member, shadow)) in members.iter().zip(&shadows).enumerate() {
                let known: f64 = active.iter().map(|a| columns[*a][j] * shadow[*a]).sum();
                let alone = columns[*member][j] - known;
                sum[m] += before * alone;
                own[m] += after * alone;
            }
        }
        scatter.add(&own, 0.0);
    }
    let all: Vec<usize> = (0..k).collect();
    let weighed = scatter.weigh(&all, &sum);
    let statistic: f64 = weighed.iter().zip(&sum).map(|(a, b)| a * b).sum();
    // Wilson and Hilferty's normal for chi-squared.
    let (k, part) = (k as f64, 2.0 / (9.0 * k as f64));
    ((statistic / k).max(0.0).cbrt() - 1.0 + part) / part.sqrt()
}

/// The standard normal number that is exceeded with probability `p` (Abramowitz and Stegun
/// 26.2.23).
fn normal_quantile(p: f64) -> f64 {
    let t = (-2.0 * p.ln()).sqrt();
    t - (2.515_517 + t * (0.802_853 + t * 0.010_328))
        / (1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_are_those_of_the_tables() {
        for (p, z) in [(0.025, 1.96), (0.001, 3.09), (1e-5, 4.265)] {
            assert!((normal_quantile(p) - z).abs() < 2e-3, "{p}");
        }
    }
}
