//! The residual on the held-out recording, measured as a key's oracle is: by the judge's own
//! inverse dynamics, and by the residuals that the report gives.

use std::path::Path;

use crate::dynamics::JudgeDynamics;
use crate::key::{Key, Oracle};
use crate::signal::{Butterworth, rms};
use crate::tool::Paths;

/// Rms on the held-out recordings, in the oracle's band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ResidualRms {
    pub(crate) refit: f64,
    pub(crate) patched: f64,
}

/// Fewer held-out rows than this say nothing.
const FEWEST_ROWS: usize = 200;

/// By the judge's `bench`.
pub(crate) fn judged(bench: &Result<JudgeDynamics, String>, out: &Path) -> Result<ResidualRms, String> {
    let bench = bench.as_ref().map_err(Clone::clone)?;
    Ok(ResidualRms { patched: bench.patched(&out.join("patched-rig.toml"))?, refit: bench.refit() })
}

/// By the report in `out`; nothing where the key has no oracle.
pub(crate) fn reported(paths: &Paths, out: &Path, key: &Key) -> Option<ResidualRms> {
    let holdout = paths.holdout.first()?.file_name()?;
    measure(&out.join("residuals.csv"), &holdout.to_string_lossy(), key.oracle.as_ref()?).ok()
}

/// Measures `residuals.csv` on the recording `holdout`.
///
/// # Errors
/// What is missing or too short.
pub(crate) fn measure(file: &Path, holdout: &str, oracle: &Oracle) -> Result<ResidualRms, String> {
    let text = std::fs::read_to_string(file).map_err(|e| format!("no residuals.csv: {e}"))?;
    let mut lines = text.lines();
    let head: Vec<&str> = lines.next().unwrap_or("").split(',').map(str::trim).collect();
    let place = |name: &str| {
        head.iter().position(|h| *h == name).ok_or_else(|| format!("residuals.csv has no column `{name}`"))
    };
    let [recording, time, refit, patched] =
        [place("recording")?, place("time_s")?, place("refit")?, place("patched")?];
    let mut rows: Vec<(f64, Option<[f64; 2]>)> = Vec::new();
    for line in lines {
        let fields: Vec<&str> = line.split(',').map(|f| f.trim().trim_matches('"')).collect();
        let name = fields.get(recording).copied().unwrap_or("");
        if Path::new(name).file_name().is_none_or(|n| n != holdout) {
            continue;
        }
        let number = |i: usize| fields.get(i).and_then(|f| f.parse::<f64>().ok()).filter(|x| x.is_finite());
        let Some(t) = number(time) else { continue };
        // Empty at rest: friction is a reaction there; the filters see zero and the row is not
        // judged.
        rows.push((t, number(refit).zip(number(patched)).map(|(a, b)| [a, b])));
    }
    if rows.len() < FEWEST_ROWS {
        return Err(format!("residuals.csv has {} held-out rows, fewer than {FEWEST_ROWS}", rows.len()));
    }
    Ok(measure_rows(&rows, oracle))
}

/// The same for rows in hand: time, and the residuals under refit and patched model; `None` at
/// rest.
pub(crate) fn measure_rows(rows: &[(f64, Option<[f64; 2]>)], oracle: &Oracle) -> ResidualRms {
    let start = rows[0].0;
    let rate = (rows.len() - 1) as f64 / (rows[rows.len() - 1].0 - start);
    let judged: Vec<bool> = rows
        .iter()
        .map(|(t, values)| {
            let still = oracle.still_s.iter().any(|[a, b]| a <= t && t < b);
            t - start > oracle.skip_s && values.is_some() && !still
        })
        .collect();
    let band = |which: usize| {
        let mut filters = oracle.filters_hz.map(|hz| Butterworth::new(hz, rate));
        let filtered: Vec<f64> = rows
            .iter()
            .map(|(_, values)| filters.iter_mut().fold(values.map_or(0.0, |v| v[which]), |x, f| f.next(x)))
            .collect();
        let kept: Vec<f64> = filtered.into_iter().zip(&judged).filter(|(_, k)| **k).map(|(x, _)| x).collect();
        rms(&kept)
    };
    ResidualRms { refit: band(0), patched: band(1) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_in_the_band_keeps_its_size_and_rest_does_not_count() {
        let oracle = Oracle {
            floor: 0.0,
            refit: 1.0,
            filters_hz: [100.0, 40.0],
            skip_s: 0.5,
            still_s: vec![[3.0, 4.0]],
        };
        let rows: Vec<(f64, Option<[f64; 2]>)> = (0..8000)
            .map(|i| {
                let t = f64::from(i) * 1e-3;
                let wave = (12.0 * t).sin() + (2500.0 * t).sin();
                // The times at rest of the key are not judged.
                let size = if (3.0..3.8).contains(&t) { 50.0 } else { 1.0 };
                (t, (!(6.0..6.5).contains(&t)).then_some([size * wave, 0.5 * wave]))
            })
            .collect();
        let left = measure_rows(&rows, &oracle);
        // 1/√2, a little lower where the wave begins again after the rest.
        assert!((left.refit - 0.707).abs() < 0.03, "{left:?}");
        assert!((left.patched - 0.354).abs() < 0.015, "{left:?}");
    }

    #[test]
    fn a_file_of_the_contract_is_read() {
        let file = std::env::temp_dir().join(format!("proof-residuals-{}.csv", std::process::id()));
        let mut text = String::from("recording,time_s,velocity,nominal,refit,patched\n");
        for i in 0..1000 {
            text += &format!("fit.csv,{0},1,9,9,9\n\"holdout.csv\",{0},1,3,2,1\n", f64::from(i) * 1e-3);
        }
        std::fs::write(&file, text).unwrap();
        let oracle = Oracle { filters_hz: [50.0, 50.0], ..Oracle::default() };
        let left = measure(&file, "holdout.csv", &oracle).unwrap();
        assert!((left.refit - 2.0).abs() < 1e-9 && (left.patched - 1.0).abs() < 1e-9, "{left:?}");
        assert!(measure(&file, "other.csv", &oracle).unwrap_err().contains("0 held-out rows"));
        std::fs::remove_file(&file).unwrap();
    }
}
