//! One case: a machine, what is hidden in it, two recordings to fit on and one held out, and the
//! key.

use super::case_builder::{CaseBuilder, RecordingPlan};
use super::effects;
use super::excite::{self, Kind};
use super::family::Needs;
use super::machine::Machine;
use super::outside;
use super::plant::Plant;
use super::series::Series;
use super::simulate::{Believed, Row, STEP};
use super::spec::Spec;
use super::strength::{Declared, Measured, measure};
use super::surroundings;
use super::truth::truth;
use crate::key::{Category, Parameter};
use crate::rng::Rng;

/// Values as the rig file has them; `None`: the key is missing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nominal {
    pub(crate) inertia: f64,
    pub(crate) viscous: Option<f64>,
    pub(crate) coulomb: Option<f64>,
    pub(crate) offset: Option<f64>,
    pub(crate) weight: Option<f64>,
    pub(crate) gain: f64,
}

/// A case with its key.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) spec: Spec,
    pub(crate) machine: Machine,
    pub(crate) plant: Plant,
    pub(crate) believed: Believed,
    pub(crate) declared: Declared,
    pub(crate) nominal: Nominal,
    /// Two to fit on, one held out.
    pub(crate) recordings: Vec<Vec<Row>>,
    /// A loop ran, and its reference is recorded.
    pub(crate) with_reference: [bool; 3],
    pub(crate) with_force: bool,
    /// The category that the case turned out to have: effects that do not show in the recordings
    /// cannot be asked for.
    pub(crate) category: Category,
    /// The level nearest to what was reached.
    pub(crate) level: f64,
    /// Strength of all that is hidden together, as reached.
    pub(crate) together: Measured,
    pub(crate) truths: Vec<Parameter>,
}

impl Case {
    /// The three recordings measured at another bandwidth, on the held-out one: what an oracle
    /// would remove and leave.
    pub(crate) fn held_out(&self, band: f64) -> Measured {
        let rows: Vec<&[Row]> = self.recordings.iter().map(Vec::as_slice).collect();
        measure(&rows, 2, &self.believed, &self.declared, self.machine.rate, band)
    }
}

/// Machines drawn until one can be recorded.
const ATTEMPTS: usize = 12;
/// Effect over noise from which a level counts as reached: 10, 3, 1.
const LEVELS: [(f64, f64); 3] = [(10.0, 7.0), (3.0, 2.1), (1.0, 0.7)];
/// From here on an effect of a pair or triple has to be found.
const SHOWS: f64 = 2.1;

/// Builds the case. Another machine is drawn only where nobody would keep the recordings: the
/// motion diverged, the loop lost its reference, or hardly anything moved. What does not show in
/// them stays as it is. `None`: no machine could be recorded.
pub(crate) fn build(spec: &Spec, seed: u64, quick: bool) -> Option<Case> {
    let label =
        format!("{}/{}/{}/{}", spec.category.word(), spec.hidden.join("+"), spec.strength, spec.repeat);
    (0..ATTEMPTS).find_map(|attempt| {
        let rng = Rng::new(seed).fork(&label).fork(&attempt.to_string());
        attempt_case(spec, &rng, quick)
    })
}

/// The level that a strength reaches, if any.
fn level(reached: f64) -> Option<f64> {
    LEVELS.iter().find(|(_, least)| reached >= *least).map(|(level, _)| *level)
}

/// Returns the category and strength of a case by what shows in it: a pair with one effect that
/// does not show is a case of one.
fn settle(spec: &Spec, alone: &[f64]) -> (Category, f64) {
    let strongest = alone.iter().copied().fold(0.0, f64::max);
    match spec.category {
        Category::Single | Category::Pair | Category::Triple => {
            match alone.iter().filter(|a| **a >= SHOWS).count() {
                3 => (Category::Triple, spec.strength),
                2 => (Category::Pair, spec.strength),
                _ => match level(strongest) {
                    Some(level) => (Category::Single, level),
                    None => (Category::CannotTell, spec.strength),
                },
            }
        }
        Category::Outside => (Category::Outside, level(strongest).unwrap_or(0.0)),
        other => (other, spec.strength),
    }
}

fn merged_needs(spec: &Spec) -> Needs {
    let mut all = Needs::default();
    for name in &spec.hidden {
        let n = if spec.category == Category::Outside { outside::needs(name) } else { effects::needs(name) };
        all.rotary = all.rotary.or(n.rotary);
        all.tilt = all.tilt.or(n.tilt);
        all.place |= n.place;
        all.no_offset |= n.no_offset;
        all.fast |= n.fast;
        all.direct |= n.direct;
    }
    if spec.category == Category::CannotTell {
        // Asymmetry with an offset allowed, imbalance on part of a turn.
        all.no_offset = false;
    }
    all
}

fn attempt_case(spec: &Spec, rng: &Rng, quick: bool) -> Option<Case> {
    let machine = draw_machine(spec, rng, quick);
    let mut pick = rng.fork("kinds");
    let with_force = spec.hidden.contains(&"load_dependent_friction") || pick.chance(0.04);
    let declared = draw_declared(&machine, &mut pick);
    let base = rng.fork("place").range(0.0, 2.0) * machine.plant.turn;
    let load = with_force.then_some(machine.plant.dry.coulomb * pick.range(0.8, 1.6));
    let around = Around { quick, base, load };
    let (plans, referenced): (Vec<RecordingPlan>, Vec<bool>) =
        (0..3).map(|k| draw_plan(spec, &machine, &around, &mut rng.fork(&format!("recording/{k}")))).unzip();
    let mut builder = CaseBuilder { spec, rng, machine, declared, base, plans };
    if spec.hidden.contains(&"command_saturation") {
        builder.machine.peak_command = builder.peak_command().ok()?;
    }
    let scales = find_scales(&builder)?;
    let mut alone = measured_alone(&builder, &scales)?;
    let plant = builder.plant(&scales);
    let believed = builder.believed(&plant, &scales);
    let recordings = record(&builder, &plant, &believed)?;
    let m = &builder.machine;
    let rows: Vec<&[Row]> = recordings.iter().map(Vec::as_slice).collect();
    let together = measure(&rows[..2], 2, &believed, &declared, m.rate, m.residual_bandwidth());
    let held = measure(&rows[2..], 1, &believed, &declared, m.rate, m.residual_bandwidth());
    if together.moving < 0.08 || held.moving < 0.08 || recordings.iter().any(|r| lost_control(r, m)) {
        return None;
    }
    if scales.len() == 1 {
        alone[0] = together.effect / together.noise;
    }
    let (category, level) = settle(spec, &alone);
    let cold = builder.plans[..2].iter().all(|p| p.warm == 0.0);
    let truths = if spec.category == Category::Outside {
        Vec::new()
    } else {
        spec.hidden.iter().flat_map(|name| truth(name, &plant, &rows[..2], cold)).collect()
    };
    let nominal = draw_nominal(spec, m, &plant, &declared, &mut rng.fork("nominal"));
    Some(Case {
        spec: spec.clone(),
        machine: builder.machine,
        plant,
        believed,
        declared,
        nominal,
        recordings,
        with_reference: [referenced[0], referenced[1], referenced[2]],
        with_force,
        category,
        level,
        together,
        truths,
    })
}

/// Draws the machine, with the recorder and the limits that the case asks for.
fn draw_machine(spec: &Spec, rng: &Rng, quick: bool) -> Machine {
    let mut machine = Machine::draw(&mut rng.fork("machine"), merged_needs(spec), quick);
    if let Some((rate, duration)) = spec.recorder {
        (machine.rate, machine.duration) = (rate, duration);
    }
    if spec.category == Category::CannotTell {
        machine.offset_key = true;
        if spec.hidden == ["mass_imbalance"] && spec.poor.is_some_and(|p| p.contains(&Kind::OneTriangle)) {
            machine.travel = 0.35 * machine.plant.turn;
            machine.start_spread = Some(0.01 * machine.travel);
        }
    }
    machine
}

/// Draws the uncertainties that the rig file declares.
fn draw_declared(machine: &Machine, pick: &mut Rng) -> Declared {
    Declared {
        inertia: pick.range(0.05, 0.2),
        viscous: pick.range(0.3, 0.5),
        coulomb: pick.range(0.25, 0.5),
        gain: pick.range(0.01, 0.1),
        weight: pick.range(0.1, 0.3),
        offset: 0.1 * machine.plant.dry.coulomb,
        offset_allowed: machine.offset_key,
    }
}

/// The conditions that the recordings of a case share.
struct Around {
    quick: bool,
    /// Mechanical place near which they start, if the machine has a start spread, in u.
    base: f64,
    /// Size of the pushes, as a force; `None`: nobody pushes.
    load: Option<f64>,
}

/// Draws a recording, and whether the reference of its loop is recorded.
fn draw_plan(spec: &Spec, machine: &Machine, around: &Around, own: &mut Rng) -> (RecordingPlan, bool) {
    let coulomb = machine.plant.dry.coulomb;
    let kinds = draw_kinds(spec, around.quick, own);
    let segments = excite::programme(&kinds, machine, own);
    let with_reference = segments.iter().any(|s| s.control.is_some()) && own.chance(0.85);
    // A machine that has run before is warm already.
    let warm = if own.chance(0.4) { 0.0 } else { machine.duration * own.range(0.0, 0.5) };
    let start = match machine.start_spread {
        Some(spread) => around.base + 0.5 * spread * own.range(-1.0, 1.0),
        None => machine.plant.turn * own.range(0.0, 3.0),
    };
    let mut unit_noise = surroundings::disturbance(machine, own);
    let mean = unit_noise.values.iter().sum::<f64>() / unit_noise.values.len() as f64;
    unit_noise.values.iter_mut().for_each(|x| *x -= mean);
    let mut rough = Series::default();
    if spec.category == Category::Disturbance {
        rough = surroundings::rough_disturbance(machine, own);
        let size = coulomb * own.range(0.12, 0.4);
        rough.values.iter_mut().for_each(|x| *x *= size);
    }
    let plan = RecordingPlan {
        segments,
        warm,
        times: machine.stamps(own),
        tilt: if machine.tilt { surroundings::tilt_sweep(machine, own) } else { Series::default() },
        force: around.load.map(|size| surroundings::pushes(machine, size, own)).unwrap_or_default(),
        unit_noise,
        rough,
        offset: if machine.offset_key { 0.04 * coulomb * own.bounded_normal(2.0) } else { 0.0 },
        start,
        zero: (own.range(-1e5, 1e5)).round() + own.unit(),
        random: own.fork("plant"),
    };
    (plan, with_reference)
}

/// Finds the scale of every hidden effect at which it has the strength asked for. `None`: the
/// motion diverges.
fn find_scales(builder: &CaseBuilder) -> Option<Vec<(usize, f64)>> {
    let spec = builder.spec;
    let mut scales: Vec<(usize, f64)> = Vec::new();
    for i in 0..spec.hidden.len() {
        let s = if spec.category == Category::CannotTell {
            let (low, high, guess) = effects::bounds(spec.hidden[i], &builder.machine);
            (2.0 * guess).clamp(low, high)
        } else {
            builder.calibrate(i, spec.strength, &scales).ok()?
        };
        scales.push((i, s));
    }
    Some(scales)
}

/// Measures every effect again, by itself, at its scale in the case: effect over noise. `None`: the
/// motion diverges.
fn measured_alone(builder: &CaseBuilder, scales: &[(usize, f64)]) -> Option<Vec<f64>> {
    let strength = |&(i, s): &(usize, f64)| {
        let now = builder.measured(i, s, scales, 40e-6).ok()?;
        Some(now.effect / now.noise)
    };
    scales.iter().map(strength).collect()
}

/// Plays and stamps the recordings. `None`: the motion diverges.
fn record(builder: &CaseBuilder, plant: &Plant, believed: &Believed) -> Option<Vec<Vec<Row>>> {
    let play = |p| builder.play(plant, believed, p, STEP);
    let mut recordings: Vec<Vec<Row>> = builder.plans.iter().map(play).collect::<Result<_, _>>().ok()?;
    let stamping = builder.machine.stamping;
    for (k, recording) in recordings.iter_mut().enumerate() {
        let times: Vec<f64> = recording.iter().map(|r| r.time).collect();
        let stamps = stamping.of(&times, &mut builder.rng.fork(&format!("stamps/{k}")));
        let errs = stamping.by_chance();
        for (row, stamp) in recording.iter_mut().zip(stamps) {
            // Read as if at the stamp: at speed an error of time is one of place, and noise.
            row.reading_error -= if errs { row.v * (stamp - row.time) } else { 0.0 };
            row.stamp = stamp;
        }
    }
    Some(recordings)
}

/// A drive that asks for its limit all the time, or a loop that has lost its reference: nobody
/// would keep the recording.
fn lost_control(rows: &[Row], m: &Machine) -> bool {
    let clipped = rows.iter().filter(|r| r.command.abs() > 0.999 * m.limit).count();
    let mut far = 0;
    for row in rows {
        let error = (row.reference_counts - row.counts) / m.plant.counts_per_unit;
        far += usize::from(error.abs() > 0.2 * m.travel);
    }
    clipped * 10 > rows.len() || far * 10 > rows.len()
}

/// Draws the excitations of a recording, independent of the hidden effects: three kinds, in the
/// small run two.
fn draw_kinds(spec: &Spec, quick: bool, pick: &mut Rng) -> Vec<Kind> {
    if let Some(poor) = spec.poor {
        return vec![*pick.pick(poor)];
    }
    let mut left = excite::RICH.to_vec();
    (0..if quick { 2 } else { 3 }).map(|_| left.swap_remove(pick.below(left.len()))).collect()
}

fn draw_nominal(spec: &Spec, m: &Machine, plant: &Plant, declared: &Declared, rng: &mut Rng) -> Nominal {
    let lacks = |name: &str| spec.hidden.contains(&name);
    let exact = matches!(spec.category, Category::Null | Category::Disturbance);
    let mut off = |sigma: f64| {
        if exact {
            1.0
        } else if spec.category == Category::ParametersOnly {
            // Clearly wrong, and still what the rig declares possible.
            1.0 + sigma * rng.sign() * rng.range(0.8, 2.0)
        } else {
            1.0 + sigma * rng.bounded_normal(2.0)
        }
    };
    let inertia = plant.inertia * off(declared.inertia);
    let viscous = plant.viscous * off(declared.viscous);
    let coulomb = plant.dry.coulomb * off(declared.coulomb);
    let gain = plant.gain * off(declared.gain);
    let weight = plant.weight * off(declared.weight);
    let offset =
        if exact { plant.offset } else { plant.offset + 0.5 * declared.offset * rng.bounded_normal(2.0) };
    Nominal {
        inertia,
        gain,
        viscous: (!lacks("viscous_friction")).then_some(viscous.max(0.02 * plant.viscous)),
        coulomb: (!lacks("coulomb_friction")).then_some(coulomb.max(0.02 * plant.dry.coulomb)),
        offset: m.offset_key.then_some(offset),
        weight: m.weight_key.then_some(weight),
    }
}
