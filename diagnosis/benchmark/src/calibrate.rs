//! Weights of the tool's confidence from runs whose keys are open: a logistic regression of right
//! and wrong on evidence.
//!
//! Every category counts as it would in a full run, whatever was run. Seeds that calibrate may not
//! judge.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::Value;

use crate::cases::{Amounts, list};
use crate::signal::Normal;

/// Pull of every standardised weight towards zero, as of so many names.
const RIDGE: f64 = 1.5;
/// Newton steps; a handful suffices.
const STEPS: usize = 40;

/// A name that came through the tool's search.
struct Sample {
    category: String,
    right: f64,
    evidence: Vec<f64>,
    weight: f64,
}

/// Reads results and prints bias and weights.
pub(crate) fn calibrate(files: &[PathBuf]) -> Result<String, String> {
    let mut samples = Vec::new();
    let mut keys: Vec<String> = Vec::new();
    let mut cases: BTreeMap<String, f64> = BTreeMap::new();
    for file in files {
        let failed = |e: &dyn std::fmt::Display| {
            format!("cannot read {}: {e}; give the proof.json of a finished run", file.display())
        };
        let text = std::fs::read_to_string(file).map_err(|e| failed(&e))?;
        let result: Value = serde_json::from_str(&text).map_err(|e| failed(&e))?;
        for case in result["cases"].as_array().ok_or_else(|| failed(&"it has no `cases`"))? {
            let category = case["kind"].as_str().unwrap_or_default().to_string();
            *cases.entry(category.clone()).or_default() += 1.0;
            for weighed in case["weighed"].as_array().into_iter().flatten() {
                let Some(evidence) = weighed["evidence"].as_object() else { continue };
                keys = evidence.keys().cloned().collect();
                samples.push(Sample {
                    category: category.clone(),
                    right: f64::from(u8::from(weighed["right"] == Value::Bool(true))),
                    evidence: evidence.values().map(|v| v.as_f64().unwrap_or(0.0)).collect(),
                    weight: 1.0,
                });
            }
        }
    }
    if samples.len() < 10 * (keys.len() + 1) || samples.iter().any(|s| s.evidence.len() != keys.len()) {
        return Err(format!(
            "{} names with evidence are too few, or of different tools, for {} weights; run more cases",
            samples.len(),
            keys.len()
        ));
    }
    balance(&mut samples, &cases);
    let weights = fit(&samples, keys.len());
    let mut out = String::new();
    let wrong = samples.iter().filter(|s| s.right == 0.0).count();
    let _ = writeln!(out, "{} names, {wrong} of them wrong", samples.len());
    let _ = writeln!(out, "bias {:.2}", weights[0]);
    for (key, weight) in keys.iter().zip(&weights[1..]) {
        let _ = writeln!(out, "{key} {weight:.2}");
    }
    Ok(out)
}

/// Weighs each category by how many cases of it a full run has.
fn balance(samples: &mut [Sample], cases: &BTreeMap<String, f64>) {
    let mut full: BTreeMap<&str, f64> = BTreeMap::new();
    for spec in list(Amounts::full(1), 0) {
        *full.entry(spec.category.word()).or_default() += 1.0;
    }
    for sample in samples.iter_mut() {
        let run = cases[&sample.category];
        sample.weight = full.get(sample.category.as_str()).copied().unwrap_or(1.0) / run;
    }
    let mean = samples.iter().map(|s| s.weight).sum::<f64>() / samples.len() as f64;
    samples.iter_mut().for_each(|s| s.weight /= mean);
}

/// Bias and weights of the logistic regression, by Newton's method on standardised evidence.
fn fit(samples: &[Sample], keys: usize) -> Vec<f64> {
    let n = samples.len() as f64;
    let mean: Vec<f64> = (0..keys).map(|k| samples.iter().map(|s| s.evidence[k]).sum::<f64>() / n).collect();
    let sd: Vec<f64> = (0..keys)
        .map(|k| {
            let square = samples.iter().map(|s| (s.evidence[k] - mean[k]).powi(2)).sum::<f64>() / n;
            square.sqrt().max(1e-9)
        })
        .collect();
    let row = |s: &Sample| -> Vec<f64> {
        std::iter::once(1.0).chain((0..keys).map(|k| (s.evidence[k] - mean[k]) / sd[k])).collect()
    };
    let all: Vec<usize> = (0..=keys).collect();
    let penalty: Vec<f64> = all.iter().map(|i| if *i == 0 { 0.0 } else { RIDGE }).collect();
    let mut w = vec![0.0; keys + 1];
    for _ in 0..STEPS {
        // Each Newton step is a weighted regression on the score that would set the sample right.
        let mut normal = Normal::new(keys + 1);
        for s in samples {
            let x = row(s);
            let score: f64 = x.iter().zip(&w).map(|(x, w)| x * w).sum::<f64>().clamp(-30.0, 30.0);
            let p = 1.0 / (1.0 + (-score).exp());
            let spread = (p * (1.0 - p)).max(1e-6);
            let root = (s.weight * spread).sqrt();
            let scaled: Vec<f64> = x.iter().map(|x| x * root).collect();
            normal.add(&scaled, root * (score + (s.right - p) / spread));
        }
        w = normal.solve(&all, &penalty);
    }
    let raw: Vec<f64> = (0..keys).map(|k| w[k + 1] / sd[k]).collect();
    let bias = w[0] - raw.iter().zip(&mean).map(|(w, m)| w * m).sum::<f64>();
    std::iter::once(bias).chain(raw).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    #[test]
    fn weights_that_made_the_samples_are_found() {
        let truth = [0.5, 2.0, -1.0];
        let mut rng = Rng::new(4);
        let samples: Vec<Sample> = (0..6000)
            .map(|_| {
                let evidence = vec![rng.normal() + 1.0, 2.0 * rng.normal()];
                let score = truth[0] + truth[1] * evidence[0] + truth[2] * evidence[1];
                let right = f64::from(u8::from(rng.unit() < 1.0 / (1.0 + (-score).exp())));
                Sample { category: String::new(), right, evidence, weight: 1.0 }
            })
            .collect();
        for (found, truth) in fit(&samples, 2).iter().zip(truth) {
            assert!((found - truth).abs() < 0.2, "{found} for {truth}");
        }
    }

    #[test]
    fn too_few_names_are_refused_in_one_sentence() {
        let file = std::env::temp_dir().join(format!("calibrate-{}.json", std::process::id()));
        std::fs::write(&file, r#"{"cases":[{"category":"null","weighed":[]}]}"#).unwrap();
        assert!(calibrate(std::slice::from_ref(&file)).unwrap_err().contains("too few"));
        std::fs::remove_file(&file).unwrap();
        assert!(calibrate(&[file]).unwrap_err().contains("cannot read"));
    }
}
