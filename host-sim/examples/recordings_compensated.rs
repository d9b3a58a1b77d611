//! The predicted effect of feedforward on the forces of real machines: diagnosed from recordings to
//! fit, judged on recordings that were held out, compared with a raw map of the same recordings.
//!
//!     cargo run --release -p host-sim --example recordings_compensated -- RECORDINGS [CASE…]
//!
//! A case is `emps`, `anticogging` or a folder of `machines`. `docs/measured/recordings.md` says
//! where they come from. The force that a machine needs apart from its inertia is `gain·u − J·a +
//! external`; what is fed forward is the law of `docs/guide/compensation.md` with the usual gains,
//! in floating point. The raw map is the mean of that force over 64 places of a turn (or of the
//! travel) and both directions, at a gain of 1. Neither knows where a held-out recording begins:
//! the place is fitted on its first two fifths, and the rest judges. Rows that hardly move do not
//! count.

use diagnosis::laws::{Effect, EffectName};
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use diagnosis::simulation::Motion;
use std::path::{Path, PathBuf};

/// Usual gains of waves and of all else that is not friction, and of friction.
const GAIN: f64 = 0.92;
const FRICTION_GAIN: f64 = 0.8;
/// Part of a held-out recording on which its place is fitted.
const FITTED: f64 = 0.4;
const PLACES: usize = 64;
/// Steps in which a place is sought.
const SHIFTS: usize = 720;

/// A moving row: position, speed, tilt, and the force needed in addition to the inertia.
#[derive(Clone, Copy)]
struct Row {
    position: f64,
    speed: f64,
    tilt: f64,
    command: f64,
    force: f64,
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let Some(folder) = arguments.next().map(PathBuf::from) else {
        eprintln!("give the folder of recordings, and cases if not all");
        std::process::exit(2);
    };
    let wanted: Vec<String> = arguments.collect();
    println!(
        "| case | found | needed, rms | left, fed forward | left, raw map |\n| --- | --- | --- | --- | --- |"
    );
    for (name, dir, fit, holdout) in cases(&folder) {
        if !wanted.is_empty() && !wanted.contains(&name) {
            continue;
        }
        match judge(&dir, &fit, &holdout) {
            Ok(line) => println!("| {name} | {line} |"),
            Err(why) => println!("| {name} | not judged: {why} | | | |"),
        }
    }
}

type Case = (String, PathBuf, Vec<String>, Vec<String>);

fn cases(folder: &Path) -> Vec<Case> {
    let names = |files: &[&str]| files.iter().map(|file| (*file).to_owned()).collect();
    let mut cases = vec![
        ("emps".to_owned(), folder.join("emps"), names(&["train.csv"]), names(&["pulses.csv"])),
        (
            "anticogging".to_owned(),
            folder.join("anticogging"),
            names(&["tenth_rev_per_s_a.csv", "tenth_rev_per_s_b.csv"]),
            names(&["slower_0_03_rev_per_s.csv"]),
        ),
    ];
    let mut machines: Vec<PathBuf> = std::fs::read_dir(folder.join("machines"))
        .map(|entries| entries.flatten().map(|entry| entry.path()).filter(|path| path.is_dir()).collect())
        .unwrap_or_default();
    machines.sort();
    for dir in machines {
        let with = |begin: &str| {
            let mut files: Vec<String> = std::fs::read_dir(&dir)
                .map(|entries| {
                    entries.flatten().filter_map(|entry| entry.file_name().into_string().ok()).collect()
                })
                .unwrap_or_default();
            files.retain(|file| file.starts_with(begin) && file.ends_with(".csv"));
            files.sort();
            files
        };
        let name = dir.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        cases.push((name, dir.clone(), with("fit"), with("holdout")));
    }
    cases
}

fn judge(dir: &Path, fit: &[String], holdout: &[String]) -> Result<String, String> {
    let rig = Rig::read(&dir.join("rig.toml")).map_err(|why| why.to_string())?;
    let read = |files: &[String]| -> Result<Vec<Recording>, String> {
        files.iter().map(|file| Recording::read(&dir.join(file)).map_err(|why| why.to_string())).collect()
    };
    let (fit, holdout) = (read(fit)?, read(holdout)?);
    let quiet = |_: &str, _: f64| ();
    let outcome =
        diagnosis::diagnose_recordings(&rig, &fit, &holdout, &quiet).map_err(|why| why.to_string())?;
    let found = &outcome.patched_rig;
    let fitted: Vec<Vec<Row>> = fit.iter().map(|recording| rows(recording, found)).collect();
    let map = RawMap::new(found, &fitted);
    let (mut needed, mut fed, mut mapped) = (Vec::new(), Vec::new(), Vec::new());
    for recording in &holdout {
        let rows = rows(recording, found);
        let (known, judged) = rows.split_at((rows.len() as f64 * FITTED) as usize);
        let turn = map.span;
        let at = placed(known, turn, |row, shift| fed_forward(found, row, shift));
        let map_at = placed(known, turn, |row, shift| map.force(row, shift));
        needed.extend(judged.iter().map(|row| row.force));
        fed.extend(judged.iter().map(|row| row.force - fed_forward(found, row, at)));
        mapped.extend(judged.iter().map(|row| row.force - map.force(row, map_at)));
    }
    if needed.len() < 100 {
        return Err("too few moving rows were held out".into());
    }
    let names: Vec<&str> = found.effects.iter().map(|effect| effect.name.as_str()).collect();
    let names = if names.is_empty() { "values alone".to_owned() } else { names.join(", ") };
    let before = rms(&needed);
    let left = |values: &[f64]| format!("{:.3e} ({:.0} %)", rms(values), 100.0 * rms(values) / before);
    Ok(format!("{names} | {before:.3e} {} | {} | {}", rig.kind.force(), left(&fed), left(&mapped)))
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|x| x * x).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// The rows of a recording that move, with the scale and the inertia that were found.
fn rows(recording: &Recording, rig: &Rig) -> Vec<Row> {
    let motion = Motion::new(recording, rig);
    let (command, acceleration) = (motion.smoothed(&recording.command), motion.accelerations());
    let external = recording.force.as_ref().map(|force| motion.smoothed(force));
    let slow = slow(rig);
    (0..recording.len())
        .filter(|&at| motion.velocity[at].abs() > slow)
        .map(|at| Row {
            position: if rig.encoder.absolute {
                recording.position_counts[at] / rig.encoder.counts_per_unit
            } else {
                motion.position[at]
            },
            speed: motion.velocity[at],
            tilt: recording.tilt_rad.as_ref().map_or(0.0, |tilt| tilt[at]),
            command: command[at],
            force: rig.actuator.gain * command[at] - rig.model.inertia * acceleration[at]
                + external.as_ref().map_or(0.0, |force| force[at]),
        })
        .collect()
}

/// Two counts in 20 ms, the time over which a speed is taken.
fn slow(rig: &Rig) -> f64 {
    2.0 / rig.encoder.counts_per_unit / 0.02
}

/// The shift of the place at which `force` leaves the least on rows, from 0 to `span`.
fn placed(rows: &[Row], span: f64, force: impl Fn(&Row, f64) -> f64) -> f64 {
    let left = |shift: f64| -> f64 {
        rows.iter().step_by(1 + rows.len() / 3_000).map(|row| (row.force - force(row, shift)).powi(2)).sum()
    };
    let shifts = (0..SHIFTS).map(|step| span * step as f64 / SHIFTS as f64);
    shifts.map(|shift| (left(shift), shift)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(0.0, |best| best.1)
}

/// Returns the force that a machine found to be `rig` would feed forward, N·m or N.
fn fed_forward(rig: &Rig, row: &Row, shift: f64) -> f64 {
    let model = &rig.model;
    let mut dry = [model.coulomb.unwrap_or(0.0); 2];
    let mut viscous = [model.viscous.unwrap_or(0.0); 2];
    let mut weight = model.weight.unwrap_or(0.0);
    let gravity_zero = model.gravity_zero.unwrap_or(0.0);
    let mut adds =
        model.offset.unwrap_or(0.0) - model.gravity.unwrap_or(0.0) * (row.position - gravity_zero).sin();
    for effect in &rig.effects {
        let value = |key: &str| effect.coefficients.get(key).copied().unwrap_or(0.0);
        match effect.name {
            EffectName::CoulombFriction => dry = dry.map(|dry| dry + value("coulomb")),
            EffectName::ViscousFriction => viscous = viscous.map(|b| b + value("viscous")),
            EffectName::AsymmetricFriction => {
                dry = [dry[0] + value("coulomb_difference"), dry[1] - value("coulomb_difference")];
                viscous =
                    [viscous[0] + value("viscous_difference"), viscous[1] - value("viscous_difference")];
            }
            EffectName::TiltGravity => weight += value("weight"),
            EffectName::Cogging | EffectName::MassImbalance => adds += waves(effect, row.position + shift),
            EffectName::TorqueRipple => {
                adds += rig.actuator.gain * row.command * waves(effect, row.position + shift);
            }
            _ => {}
        }
    }
    adds += weight * row.tilt.sin();
    let direction = usize::from(row.speed < 0.0);
    let rest = slow(rig);
    let t = ((row.speed.abs() - rest) / (2.0 * rest)).clamp(0.0, 1.0);
    let friction = (dry[direction] + viscous[direction] * row.speed.abs()).max(0.0) * t * t * (3.0 - 2.0 * t);
    FRICTION_GAIN * friction.copysign(row.speed) - GAIN * adds
}

fn waves(effect: &Effect, position: f64) -> f64 {
    let mut waves = effect.waves();
    if waves.is_empty() {
        let turn = effect.turn().unwrap_or(std::f64::consts::TAU);
        waves.push(("1".into(), std::f64::consts::TAU / turn));
    }
    let value = |key: String| effect.coefficients.get(&key).copied().unwrap_or(0.0);
    waves
        .iter()
        .map(|(name, per)| {
            let (sin, cos) = (per * position).sin_cos();
            value(format!("cos_{name}")) * cos + value(format!("sin_{name}")) * sin
        })
        .sum()
}

/// Mean force by place and direction.
struct RawMap {
    span: f64,
    mean: Vec<[f64; 2]>,
}

impl RawMap {
    fn new(rig: &Rig, recordings: &[Vec<Row>]) -> Self {
        let positions = || recordings.iter().flatten().map(|row| row.position);
        let travel = positions().fold(f64::MIN, f64::max) - positions().fold(f64::MAX, f64::min);
        // More than a turn: a map of the turn. Less: of the travel.
        let span = rig.turn().filter(|turn| travel > 0.9 * turn).unwrap_or(travel.max(1e-12));
        let mut map = Self { span, mean: vec![[0.0; 2]; PLACES] };
        let mut counts = vec![[0.0; 2]; PLACES];
        for row in recordings.iter().flatten() {
            let (place, direction) = map.place(row, 0.0);
            map.mean[place][direction] += row.force;
            counts[place][direction] += 1.0;
        }
        for (means, counts) in map.mean.iter_mut().zip(&counts) {
            for direction in 0..2 {
                means[direction] /= f64::max(counts[direction], 1.0);
            }
        }
        map
    }

    fn place(&self, row: &Row, shift: f64) -> (usize, usize) {
        let part = ((row.position + shift) / self.span).rem_euclid(1.0);
        (((part * PLACES as f64) as usize).min(PLACES - 1), usize::from(row.speed < 0.0))
    }

    fn force(&self, row: &Row, shift: f64) -> f64 {
        let (place, direction) = self.place(row, shift);
        self.mean[place][direction]
    }
}
