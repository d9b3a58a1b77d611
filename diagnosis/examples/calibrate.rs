//! `calibrate [EFFECT…]`: the diagnosis on recordings of a small simulator, one line per case. For thresholds and
//! development; the blinded proof is elsewhere.

#[path = "../tests/behaviour/common.rs"]
mod common;

use common::{Random, Setup, record, rig};

const ALL: &[&str] = &[
    "none",
    "parameters",
    "random_disturbance",
    "outside",
    "asymmetric_friction",
    "stribeck_friction",
    "presliding_friction",
    "quadratic_drag",
    "position_dependent_friction",
    "load_dependent_friction",
    "friction_drift",
    "cogging",
    "torque_ripple",
    "command_deadband",
    "command_saturation",
    "command_delay",
    "electrical_lag",
    "gain_drift",
    "backlash",
    "drive_compliance",
    "roller_slip",
    "mass_imbalance",
    "tilt_gravity",
    "position_spring",
    "position_dependent_damping",
    "encoder_eccentricity",
    "missed_counts",
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let sizes: Vec<f64> = match std::env::var("SIZES") {
        Ok(text) => text.split(',').filter_map(|x| x.parse().ok()).collect(),
        Err(_) => vec![1.0, 0.3],
    };
    let seeds: u64 = std::env::var("SEEDS").ok().and_then(|x| x.parse().ok()).unwrap_or(1);
    let (mut right, mut whole) = (0, 0);
    for effect in ALL {
        if !arguments.is_empty() && !arguments.iter().any(|a| a == effect) {
            continue;
        }
        for size in &sizes {
            for closed in [false, true] {
                for seed in 0..seeds {
                    let setup = Setup {
                        effect,
                        size: *size,
                        closed,
                        rate: [1000.0, 2000.0, 500.0][(seed % 3) as usize],
                        seconds: 12.0,
                        disturbance: 0.05,
                        seed: seed + 1,
                    };
                    let mut random = Random::new(seed + 77);
                    let mut off =
                        [0.15, 0.4, 0.4, 0.08].map(|sd| (sd * random.normal()).clamp(-1.5 * sd, 1.5 * sd));
                    if *effect == "none" {
                        off = [0.0; 4];
                    }
                    let extra = if *effect == "asymmetric_friction" { "" } else { "offset = 0.0" };
                    let rig = rig(off, extra);
                    let fit = record(&setup, 1);
                    let held = record(&setup, 2);
                    let start = std::time::Instant::now();
                    let outcome = diagnosis::diagnose_recordings(&rig, &[fit], &[held], &|_, _| ());
                    let r = match outcome {
                        Ok(outcome) => outcome.report,
                        Err(error) => {
                            println!("{effect:28} {size:4} error {error}");
                            continue;
                        }
                    };
                    let names: Vec<String> = r
                        .effects
                        .iter()
                        .map(|e| {
                            let class: Vec<&str> = e.class[1..].iter().map(|n| n.as_str()).collect();
                            let main: Vec<String> = e
                                .parameters
                                .iter()
                                .take(2)
                                .map(|(k, p)| format!("{k} {:.3e}", p.value))
                                .collect();
                            format!(
                                "{}({:.2}){}{{{}}}",
                                e.name,
                                e.confidence,
                                if class.is_empty() {
                                    String::new()
                                } else {
                                    format!("|{}", class.join("|"))
                                },
                                main.join(" ")
                            )
                        })
                        .collect();
                    let hit =
                        r.effects.len() == 1 && r.effects[0].class.iter().any(|n| n.as_str() == *effect);
                    whole += 1;
                    right += usize::from(hit);
                    println!(
                        "{}{effect:27} {size:4} {} {:18} nom {:5.1}% refit {:5.1}% patched {:5.1}% un {:.2} {:4.1}s {}",
                        if hit { '*' } else { ' ' },
                        if closed { "closed" } else { "open  " },
                        format!("{:?}", r.verdict),
                        100.0 * r.fit.nominal.holdout / r.fit.force_rms.holdout,
                        100.0 * r.fit.refit.holdout / r.fit.force_rms.holdout,
                        100.0 * r.fit.patched.holdout / r.fit.force_rms.holdout,
                        r.unexplained_fraction,
                        start.elapsed().as_secs_f64(),
                        names.join(" ")
                    );
                }
            }
        }
    }
    println!("{right} of {whole} named alone");
}
