//! Physics outside the contract's names: the right answer is to say that something is there and
//! that no name fits.

use super::family::Needs;
use super::machine::Machine;
use super::plant::{Foreign, Plant};
use crate::rng::Rng;

/// The kinds of foreign physics.
pub(crate) const FOREIGN: [&str; 11] = [
    "creep_spring",
    "whirling_force",
    "hum",
    "irregular_wells",
    "payload_change",
    "linkage_inertia",
    "gear_loss",
    "speed_window_friction",
    "one_way_flywheel",
    "latching_force",
    "travel_times_speed",
];

/// Kinds that the tool recognises without a name for them: no longer outside.
const DETECTED: [&str; 5] = ["creep_spring", "hum", "payload_change", "linkage_inertia", "gear_loss"];

/// True if the tool has a detector for it.
pub(crate) fn has_detector(name: &str) -> bool {
    DETECTED.contains(&name)
}

/// Returns its requirements on the machine.
pub(crate) fn needs(name: &str) -> Needs {
    let mut needs = Needs::default();
    if matches!(name, "irregular_wells" | "linkage_inertia" | "latching_force" | "travel_times_speed") {
        needs.place = true;
    }
    needs
}

/// (smallest, largest, first guess) of the scale.
pub(crate) fn bounds(name: &str) -> (f64, f64, f64) {
    match name {
        "payload_change" | "linkage_inertia" | "one_way_flywheel" => (0.01, 1.5, 0.3),
        "gear_loss" => (0.005, 0.5, 0.1),
        _ => (0.01, 1.5, 0.2),
    }
}

/// Puts it into `plant` at scale `s`; `rng` draws the form and must be the same for every scale.
pub(crate) fn apply(name: &str, m: &Machine, plant: &mut Plant, base: f64, s: f64, rng: &mut Rng) {
    let (coulomb, v, travel) = (m.plant.dry.coulomb, m.top_speed, m.travel);
    let foreign = match name {
        "creep_spring" => {
            let relaxation = rng.range(0.4, 1.5);
            Foreign::CreepSpring { stiffness: s * coulomb / (0.2 * v * relaxation), relaxation }
        }
        "whirling_force" => Foreign::WhirlingForce {
            amplitude: s * coulomb,
            base_hz: rng.range(0.3, 1.0),
            per_speed_hz: rng.range(2.0, 6.0) / v.powf(0.6),
            power: 0.6,
        },
        "hum" => {
            let top = (0.4 * m.residual_bandwidth()).min(18.0);
            Foreign::Hum { amplitude: s * coulomb, hertz: rng.range(0.5 * top, top) }
        }
        "irregular_wells" => draw_wells(s * coulomb, base, travel, rng),
        "payload_change" => Foreign::PayloadChange { share: s, at: rng.range(0.35, 0.65) },
        "linkage_inertia" => Foreign::Linkage {
            share: s,
            centre: base + travel * rng.range(0.3, 0.6),
            width: travel * rng.range(0.1, 0.25),
        },
        "one_way_flywheel" => Foreign::Flywheel { share: s },
        "latching_force" => draw_latches(s * coulomb, base, travel, rng),
        "travel_times_speed" => Foreign::Shuttle {
            amplitude: s * coulomb * rng.sign(),
            centre: base + travel * rng.range(0.3, 0.6),
            scale: rng.range(0.1, 0.3) * 0.5 * travel * v,
        },
        "gear_loss" => {
            plant.dry.per_drive = s;
            return;
        }
        "speed_window_friction" => {
            let centre = v * rng.range(0.25, 0.5);
            plant.dry.speed_window = Some((s * coulomb, centre, centre * rng.range(0.2, 0.35)));
            return;
        }
        other => unreachable!("`{other}` is not among the foreign physics"),
    };
    plant.foreign.push(foreign);
}

/// Draws seven wells over the travel, which begins at `base`; both in u.
fn draw_wells(force: f64, base: f64, travel: f64, rng: &mut Rng) -> Foreign {
    let width = travel * rng.range(0.012, 0.03);
    let wells = (0..7)
        .map(|_| {
            let depth = force * width * rng.range(0.5, 1.5) * rng.sign();
            (depth, base + travel * rng.range(0.02, 0.9), width * rng.range(0.6, 1.6))
        })
        .collect();
    Foreign::Wells { wells }
}

/// Draws three latches over the travel, which begins at `base`; both in u.
fn draw_latches(force: f64, base: f64, travel: f64, rng: &mut Rng) -> Foreign {
    let places = (0..3)
        .map(|i| {
            let up = base + travel * (0.2 + 0.25 * f64::from(i) + rng.range(0.0, 0.1));
            (up, up - travel * rng.range(0.05, 0.15))
        })
        .collect();
    Foreign::Latch { force, places, side: rng.sign() }
}
