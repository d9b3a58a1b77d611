//! A needle that pushes straight down on tissue and pierces nothing: what that does to each
//! configuration.

use crate::body::Tissue;
use crate::configuration::{Configuration, Layer, Refusal, Vessel};
use crate::constraint::volume;
use crate::needle::Needle;
use std::f32::consts::FRAC_PI_2;

/// A step of the picture, s.
const STEP_S: f32 = 1.0 / 60.0;
/// Steps in which it goes down, and in which it comes to rest.
const STEPS: [usize; 2] = [40, 80];
/// Distance from the needle at which the surface beside it is looked at, mm.
pub const BESIDE_MM: f32 = 20.0;

/// The division of time: the picture's own way, or so finely that the compliances alone decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Division {
    /// As the configuration says.
    Picture,
    /// Into this many substeps.
    Substeps(u32),
}

/// Tissue under a needle at rest.
#[derive(Clone, Debug)]
pub struct Pushed {
    /// The tissue as it is now.
    pub tissue: Tissue,
    /// Displacement of the surface under the needle, mm.
    pub under_mm: f32,
    /// The same [`BESIDE_MM`] beside it, across.
    pub beside_mm: f32,
    /// Change of the tissue's volume, as a share.
    pub volume_change: f32,
    /// Elastic energy that the needle has put in, mJ.
    pub energy_mj: f64,
    /// Force of the constraints on the needle, N.
    pub force_n: f64,
    /// Sum of the squared forces on particles that nothing holds, as a share of the force on the
    /// needle: 0 in equilibrium.
    pub residual: f64,
}

/// The configurations of Paper 000's Table 1, each layer by itself and all three tied, and the
/// default limb; each with its name.
pub fn configurations() -> Vec<(&'static str, Configuration)> {
    let table = Configuration::paper_000();
    let alone = |layer: &Layer| Configuration {
        layers: vec![Layer { top_mm: 0.0, ..layer.clone() }],
        ..Configuration::paper_000()
    };
    let names = ["skin (top)", "vessel", "skin (bottom)"];
    let mut all: Vec<_> = names.into_iter().zip(table.layers.iter().map(alone)).collect();
    all.push(("all three, tied", table));
    all.push(("this project's limb", Configuration::default()));
    all
}

/// Pushes straight down by `depth_mm` from where the tissue's surface lies at rest; no wall gives
/// way.
pub fn push(configuration: &Configuration, depth_mm: f32, division: Division) -> Result<Pushed, Refusal> {
    let mut configuration = configuration.clone();
    let firm = |layer: &mut Layer| layer.gives_mm = 50.0;
    configuration.layers.iter_mut().for_each(firm);
    let near = |vessel: &mut Vessel| vessel.near_gives_mm = 50.0;
    configuration.vessel.iter_mut().for_each(near);
    if let Division::Substeps(substeps) = division {
        configuration.substeps = substeps;
    }
    let mut tissue = Tissue::new(&configuration)?;
    let at = |mm: f32| Needle::entering(mm, FRAC_PI_2, 0.0);
    // Table 1's vessel is smaller at rest than as built.
    for _ in 0..STEPS[1] {
        tissue.step(&at(-20.0), STEP_S);
    }
    let face = [[0.0; 3], [0.0, BESIDE_MM.min(configuration.half_width_mm), 0.0]];
    let depth = |tissue: &Tissue| face.map(|rest| tissue.moved(rest).map_or(0.0, |place| place[2]));
    let (surface, before) = (depth(&tissue), (volumes(&tissue), tissue.solver().energy()));
    for step in 1..=STEPS[0] {
        let share = step as f32 / STEPS[0] as f32;
        tissue.step(&at(surface[0] + depth_mm * share), STEP_S);
    }
    for _ in 0..STEPS[1] {
        tissue.step(&at(surface[0] + depth_mm), STEP_S);
    }
    let now = depth(&tissue);
    let (force_n, residual) = balance(&tissue);
    Ok(Pushed {
        under_mm: now[0] - surface[0],
        beside_mm: now[1] - surface[1],
        volume_change: volumes(&tissue) / before.0 - 1.0,
        energy_mj: (tissue.solver().energy() - before.1) * 1e-6,
        force_n,
        residual,
        tissue,
    })
}

/// Volume of all tetrahedra, mm³.
fn volumes(tissue: &Tissue) -> f32 {
    let points = tissue.points();
    let place = |index: &u32| crate::constraint::place(&points[*index as usize]);
    tissue
        .solver()
        .volumes()
        .iter()
        .map(|v| volume([0, 1, 2, 3].map(|corner| place(&v.corners[corner]))))
        .sum()
}

/// Force on the needle in N, and the forces on particles that nothing holds as a share of it.
fn balance(tissue: &Tissue) -> (f64, f64) {
    let Some(held) = tissue.touched() else { return (0.0, 0.0) };
    let mut forces = tissue.solver().forces();
    let mut sum = [0.0; 3];
    for corner in unique(&held.corners) {
        for (sum, part) in sum.iter_mut().zip(forces[corner as usize]) {
            *sum += part;
        }
    }
    // The needle takes from each particle that it holds a share of its force.
    for (corner, weight) in held.corners.iter().zip(held.weights) {
        for (part, sum) in forces[*corner as usize].iter_mut().zip(sum) {
            *part -= f64::from(weight) * sum;
        }
    }
    let free = forces.iter().zip(tissue.points()).filter(|(_, point)| point[3] > 0.0);
    let squares: f64 = free.flat_map(|(force, _)| force).map(|part| part * part).sum();
    let onto = sum.iter().map(|part| part * part).sum::<f64>().sqrt();
    (-sum[2] * 1e-6, squares.sqrt() / onto.max(1e-9))
}

/// Each of these numbers once.
fn unique(corners: &[u32]) -> Vec<u32> {
    let mut all = corners.to_vec();
    all.sort_unstable();
    all.dedup();
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::Distance;
    use crate::solver::{Parts, Solver};

    /// Each force against a difference of the energy, in tissue that is out of shape everywhere.
    #[test]
    fn forces_are_the_slopes_of_the_energy() {
        let tissue = Tissue::new(&configurations()[3].1).expect("it can be built");
        let built = tissue.solver();
        let at = |moved: Option<(usize, usize, f32)>| {
            let mut points = built.points().to_vec();
            for (number, point) in points.iter_mut().enumerate() {
                for (axis, place) in point[..3].iter_mut().enumerate() {
                    *place += 0.3 * ((number * 7 + axis * 3) as f32).sin();
                }
            }
            if let Some((number, axis, by)) = moved {
                points[number][axis] += by;
            }
            Solver::new(Parts {
                points,
                distances: built.distances().to_vec(),
                volumes: built.volumes().to_vec(),
                bendings: built.bendings().to_vec(),
                ties: built.ties().to_vec(),
            })
        };
        let forces = at(None).forces();
        // One inside, two of the faces that are tied, one of the skin.
        for number in [300, 741 - 3, 741 + 3, 120] {
            for (axis, force) in forces[number].into_iter().enumerate() {
                let by = 4e-3;
                let slope = (at(Some((number, axis, by))).energy() - at(Some((number, axis, -by))).energy())
                    / (2.0 * f64::from(by));
                assert!(
                    (force + slope).abs() < 0.01 * force.abs() + 200.0,
                    "{number} {axis}: {force}, {slope}"
                );
            }
        }
    }

    #[test]
    fn finer_steps_leave_less_of_the_balance_open() {
        let [coarse, fine] = [Division::Picture, Division::Substeps(16)]
            .map(|division| push(&configurations()[1].1, 5.0, division).expect("it can be built"));
        assert!(
            fine.residual < 0.3 && fine.residual < 0.3 * coarse.residual,
            "{} {}",
            fine.residual,
            coarse.residual
        );
        assert!((fine.under_mm - 5.0).abs() < 0.3 && fine.energy_mj > 1.0, "{} mm", fine.under_mm);
        assert!(fine.volume_change < 0.0, "{}", fine.volume_change);
    }

    #[test]
    fn a_spring_pulls_with_its_stretch_over_its_compliance() {
        let parts = Parts {
            points: vec![[0.0, 0.0, 0.0, 0.0], [1.5, 0.0, 0.0, 1.0]],
            distances: vec![Distance { ends: [0, 1], rest: 1.0, compliance: 0.01 }],
            ..Parts::default()
        };
        let forces = Solver::new(parts).forces();
        assert!((forces[1][0] + 50.0).abs() < 1e-3 && (forces[0][0] - 50.0).abs() < 1e-3, "{forces:?}");
    }
}
