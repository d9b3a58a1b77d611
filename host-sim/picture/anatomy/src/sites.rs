//! The sites: their structures by the figures of `docs/design/anatomy.md`.

use crate::body::{Body, Role, Structure, Tissue};
use crate::solid::Convex;
use crate::vector::Vector;
use std::f64::consts::TAU;

/// Between two points of a tube's centre line, mm.
const TUBE_STEP_MM: f64 = 2.0;

/// A site of insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Site {
    /// The joint of the shoulder from its side, with the upper arm along x.
    Shoulder,
    /// The inside of the elbow and the forearm beyond it.
    Forearm,
    /// The knee, its front up.
    Knee,
    /// The hip, its side up.
    Hip,
}

impl Site {
    /// All of them, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::Shoulder, Self::Forearm, Self::Knee, Self::Hip];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shoulder => "shoulder",
            Self::Forearm => "forearm",
            Self::Knee => "knee",
            Self::Hip => "hip",
        }
    }

    /// Returns the thickness of its fat if the patient says nothing of it, mm.
    pub fn usual_fat_mm(self) -> f64 {
        match self {
            Self::Shoulder => 5.79,
            Self::Forearm => 8.0,
            Self::Knee => 6.0,
            Self::Hip => 20.0,
        }
    }

    /// Returns the body with fat of this thickness, mm: what lies under the fat stays, the skin
    /// moves out.
    pub fn body(self, fat_mm: f64) -> Body {
        let structures = match self {
            Self::Shoulder => shoulder(fat_mm),
            Self::Forearm => forearm(fat_mm),
            Self::Knee => knee(fat_mm),
            Self::Hip => hip(fat_mm),
        };
        Body { structures }
    }

    /// Returns from where to where along the limb a needle may enter, mm.
    pub fn along_mm(self) -> [f64; 2] {
        match self {
            Self::Shoulder => [-35.0, 80.0],
            Self::Forearm => [-60.0, 80.0],
            Self::Knee => [-60.0, 50.0],
            Self::Hip => [-50.0, 60.0],
        }
    }
}

fn layer(name: &'static str, tissue: Tissue, solid: Convex) -> Structure {
    Structure { name, tissue, role: Role::Layer, parts: vec![vec![solid]], tubes: vec![] }
}

fn inside(name: &'static str, tissue: Tissue, parts: Vec<Vec<Convex>>) -> Structure {
    Structure { name, tissue, role: Role::Inside, parts, tubes: vec![] }
}

/// A structure of tubes, each a chain of capsules about its centre line.
fn tubes(name: &'static str, tissue: Tissue, tubes: Vec<(Vec<Vector>, f64)>) -> Structure {
    let chain = |(line, radius): &(Vec<Vector>, f64)| {
        let radius = *radius;
        let capsule = move |ends: &[Vector]| vec![Convex::Capsule { ends: [ends[0], ends[1]], radius }];
        line.windows(2).map(capsule).collect::<Vec<_>>()
    };
    Structure { name, tissue, role: Role::Tube, parts: tubes.iter().flat_map(chain).collect(), tubes }
}

fn ellipsoid(centre: Vector, half: Vector) -> Convex {
    Convex::Ellipsoid { centre, half }
}

/// A curve `(x, across·sin ψ(x), −down·cos ψ(x))` from `from` to `to`, ψ in degrees.
fn curve([across, down]: [f64; 2], [from, to]: [f64; 2], psi_deg: impl Fn(f64) -> f64) -> Vec<Vector> {
    let steps = ((to - from) / TUBE_STEP_MM).round().max(1.0);
    let point = |step: usize| {
        let x = from + (to - from) * step as f64 / steps;
        let psi = psi_deg(x).to_radians();
        [x, across * libm::sin(psi), -down * libm::cos(psi)]
    };
    (0..=steps as usize).map(point).collect()
}

fn shoulder(fat: f64) -> Vec<Structure> {
    let arm = |radius| Convex::Capsule { ends: [[0.0; 3], [250.0, 0.0, 0.0]], radius };
    let ball = |radius| ellipsoid([0.0; 3], [radius; 3]);
    let lateral = Convex::Below { axis: 0, limit: 20.0 };
    let upper = Convex::Below { axis: 2, limit: -5.0 };
    let vein = curve([45.2; 2], [0.0, 120.0], |x| 30.0 + 10.0 * libm::sin(TAU * x / 160.0));
    vec![
        layer("skin", Tissue::Skin, arm(44.0 + fat + 2.5)),
        layer("fat", Tissue::Fat, arm(44.0 + fat)),
        layer("deltoid", Tissue::Muscle, arm(44.0)),
        inside("bursa", Tissue::Bursa, vec![vec![ball(32.0), lateral, upper]]),
        inside("rotator cuff", Tissue::Tendon, vec![vec![ball(29.0), lateral]]),
        inside("humerus", Tissue::Cartilage, vec![vec![ball(23.0)], vec![arm(11.0)]]),
        inside("acromion", Tissue::Cartilage, vec![vec![ellipsoid([-18.0, 0.0, -37.5], [13.0, 14.0, 4.5])]]),
        tubes("vein", Tissue::Vessel, vec![(vein, 1.5)]),
    ]
}

fn forearm(fat: f64) -> Vec<Structure> {
    let cylinder = |out: f64| Convex::Cylinder { across: 34.0 + out, down: 26.0 + out };
    let under = |depth: f64| [36.0 + fat - depth, 28.0 + fat - depth];
    let psi = |x: f64| 6.0 * libm::cos(TAU * (x - 10.0) / 160.0) - 6.0;
    let (reach, forks) = ([-90.0, 110.0], 30.0);
    let vein = curve(under(6.3), reach, psi);
    let branch = curve(under(6.3), [forks, reach[1]], |x| psi(forks) + 0.5 * (x - forks));
    vec![
        layer("skin", Tissue::Skin, cylinder(fat + 2.0)),
        layer("fat", Tissue::Fat, cylinder(fat)),
        layer("muscle", Tissue::Muscle, cylinder(0.0)),
        tubes("artery", Tissue::Artery, vec![(curve(under(16.0), reach, |x| -8.0 + 0.05 * x), 2.0)]),
        tubes("nerve", Tissue::Nerve, vec![(curve(under(5.5), reach, |_| 14.0), 1.0)]),
        tubes("vein", Tissue::Vessel, vec![(vein, 1.5), (branch, 1.2)]),
    ]
}

fn knee(fat: f64) -> Vec<Structure> {
    let cylinder = |out: f64| Convex::Cylinder { across: 52.0 + out, down: 50.0 + out };
    let shaft = Convex::Capsule { ends: [[-250.0, 0.0, -8.0], [-10.0, 0.0, -8.0]], radius: 15.0 };
    let condyles = ellipsoid([4.0, 0.0, -4.0], [26.0, 36.0, 28.0]);
    let one = |centre, half| vec![vec![ellipsoid(centre, half)]];
    vec![
        layer("skin", Tissue::Skin, cylinder(fat + 2.0)),
        layer("fat", Tissue::Fat, cylinder(fat)),
        layer("quadriceps", Tissue::Muscle, cylinder(0.0)),
        inside("bursa", Tissue::Bursa, one([-18.0, 0.0, -35.0], [28.0, 24.0, 3.5])),
        inside("quadriceps tendon", Tissue::Tendon, one([-25.0, 0.0, -44.0], [32.0, 16.0, 4.0])),
        inside("femur", Tissue::Cartilage, vec![vec![shaft], vec![condyles]]),
        inside("patella", Tissue::Cartilage, one([12.0, 0.0, -46.0], [20.0, 20.0, 7.0])),
    ]
}

fn hip(fat: f64) -> Vec<Structure> {
    let cylinder = |out: f64| Convex::Cylinder { across: 67.5 + out, down: 62.5 + out };
    let shaft = Convex::Capsule { ends: [[20.0, 0.0, -20.0], [250.0, 0.0, -20.0]], radius: 14.0 };
    let trochanter = ellipsoid([0.0, 0.0, -34.0], [26.0, 20.0, 16.5]);
    let bursa = ellipsoid([0.0, 0.0, -52.0], [22.0, 18.0, 3.0]);
    vec![
        layer("skin", Tissue::Skin, cylinder(fat + 2.5)),
        layer("fat", Tissue::Fat, cylinder(fat)),
        layer("iliotibial tract", Tissue::Tendon, cylinder(0.0)),
        layer("gluteus", Tissue::Muscle, cylinder(-3.0)),
        inside("bursa", Tissue::Bursa, vec![vec![bursa]]),
        inside("femur", Tissue::Cartilage, vec![vec![trochanter], vec![shaft]]),
    ]
}
