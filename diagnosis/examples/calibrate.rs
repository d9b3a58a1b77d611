//! `calibrate [EFFECT…]`: the diagnosis on recordings of a small simulator, one line per case. For
//! thresholds and development; the blinded proof is elsewhere.

#[path = "../tests/behaviour/common.rs"]
mod common;

use common::{Random, Setup, record, rig};
use diagnosis::laws::EffectName;
use diagnosis::report::Named;
use std::time::Instant;

/// Cases of which no effect is the truth.
const WITHOUT_EFFECT: [&str; 4] = ["none", "parameters", "random_disturbance", "outside"];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sizes: Vec<f64> = match std::env::var("SIZES") {
        Ok(text) => text.split(',').filter_map(|x| x.parse().ok()).collect(),
        Err(_) => vec![1.0, 0.3],
    };
    let seeds: u64 = std::env::var("SEEDS").ok().and_then(|x| x.parse().ok()).unwrap_or(1);
    let wanted = |effect: &&str| arguments.is_empty() || arguments.iter().any(|a| a == *effect);
    let (mut right, mut whole) = (0, 0);
    let all = WITHOUT_EFFECT.into_iter().chain(EffectName::ALL.iter().map(|name| name.as_str()));
    for effect in all.filter(wanted) {
        for (size, closed) in sizes.iter().flat_map(|size| [(*size, false), (*size, true)]) {
            for seed in 0..seeds {
                if let Some(hit) = one(effect, size, closed, seed) {
                    whole += 1;
                    right += usize::from(hit);
                }
            }
        }
    }
    println!("{right} of {whole} named alone");
}

/// Diagnoses one case and prints its line: true if its effect is named alone, none if it was
/// refused.
fn one(effect: &'static str, size: f64, closed: bool, seed: u64) -> Option<bool> {
    let rate = [1000.0, 2000.0, 500.0][(seed % 3) as usize];
    let setup = Setup { effect, size, closed, rate, seconds: 12.0, disturbance: 0.05, seed: seed + 1 };
    let mut random = Random::new(seed + 77);
    let mut off = [0.15, 0.4, 0.4, 0.08].map(|sd| (sd * random.normal()).clamp(-1.5 * sd, 1.5 * sd));
    if effect == "none" {
        off = [0.0; 4];
    }
    let extra = if effect == "asymmetric_friction" { "" } else { "offset = 0.0" };
    let rig = rig(off, extra);
    let (fit, held) = (record(&setup, 1), record(&setup, 2));
    let start = Instant::now();
    let report = match diagnosis::diagnose_recordings(&rig, &[fit], &[held], &|_, _| ()) {
        Ok(outcome) => outcome.report,
        Err(error) => {
            println!("{effect:28} {size:4} error {error}");
            return None;
        }
    };
    let hit = matches!(&report.effects[..], [one] if one.class.iter().any(|name| name.as_str() == effect));
    let percent = |force: f64| 100.0 * force / report.fit.force_rms.holdout;
    println!(
        "{}{effect:27} {size:4} {} {:18} nom {:5.1}% refit {:5.1}% patched {:5.1}% un {:.2} {:4.1}s {}",
        if hit { '*' } else { ' ' },
        if closed { "closed" } else { "open  " },
        format!("{:?}", report.verdict),
        percent(report.fit.nominal.holdout),
        percent(report.fit.refit.holdout),
        percent(report.fit.patched.holdout),
        report.unexplained_fraction,
        start.elapsed().as_secs_f64(),
        report.effects.iter().map(named).collect::<Vec<_>>().join(" ")
    );
    Some(hit)
}

/// An effect's name, confidence, class and first two parameters.
fn named(effect: &Named) -> String {
    let class: String = effect.class[1..].iter().map(|name| format!("|{}", name.as_str())).collect();
    let first = effect.parameters.iter().take(2);
    let parameters: Vec<String> = first.map(|(key, p)| format!("{key} {:.3e}", p.value)).collect();
    format!("{}({:.2}){class}{{{}}}", effect.name, effect.confidence, parameters.join(" "))
}
