//! A configuration of each law for the board: as many layers as there may be, everything on that a
//! value turns on. The board lies level; laid on the skin it would stand upright, so that the
//! needle goes straight in.

use control_core::Config;
use control_core::config::{
    Cutting, Fixture, ForceTable, Law, Layer, Lugre, MAX_ANGLES, MAX_DEPTHS, MAX_LAYERS, MAX_SPEEDS,
    Parabola, SPRING_BACK, Sparte, SpeedMethod, Tissue, Wall,
};
use control_core::units::{
    Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillimetresPerSecond, Milliradians, Newtons,
    Stiffness,
};
use fixed::types::{I8F24, I16F16};

const TISSUES: [Tissue; MAX_LAYERS] =
    [Tissue::Skin, Tissue::Fat, Tissue::Muscle, Tissue::Bursa, Tissue::Tendon, Tissue::Cartilage];

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

/// The first `count` layers, 6 mm apart, and two walls where there are four of them.
fn with_layers(count: usize) -> Config {
    let parabola = |vertex: f64, compliance: f64| Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons::default(),
    };
    let wall = Wall {
        elastic: parabola(0.0, 4.5),
        puncture_travel: Millimetres(q(3.0)),
        relief: parabola(3.5, 1_000.0),
        unload: Stiffness(q(0.05)),
        spring_back: SPRING_BACK,
    };
    let layer = |number: usize| Layer {
        tissue: TISSUES[number],
        depth: Millimetres(q(6.0 * number as f64)),
        wall: (number.is_multiple_of(3)).then_some(wall),
        friction: FrictionPerMillimetre::default(),
    };
    let mut config = Config::commissioned_virtual();
    config.device.skin_tilt = Milliradians(-1_571);
    config.device.speed = SpeedMethod::EdgeTiming;
    config.device.damping = Damping(I8F24::from_num(0.0002));
    config.device.limits.stiffness = Stiffness(q(3.0));
    config.patient.scale = q(0.6);
    config.patient.layers = (0..count).map(layer).collect();
    config
}

/// The law of Paper 002 in all its layers.
#[must_use]
pub fn shoulder() -> Config {
    sparte(MAX_LAYERS)
}

/// The law of Paper 002 in the first `count` of its layers.
#[must_use]
pub fn sparte(count: usize) -> Config {
    let mut config = with_layers(count);
    let cutting = [0.8, 1.5, 2.0, 2.5, 3.0, 4.0]
        .map(|force| Cutting { inwards: Newtons(q(force)), outwards: Newtons(q(0.3 * force)) });
    config.patient.law = Law::Sparte(Sparte {
        tracking: Stiffness(q(0.8)),
        after_puncture: q(0.6),
        relax_ms: 300,
        cutting: cutting.into_iter().take(count).collect(),
        friction: Lugre {
            stiffness: Stiffness(q(1.5)),
            damping: Damping(I8F24::from_num(0.000_1)),
            viscous: Damping(I8F24::from_num(0.001)),
            sliding: Newtons(q(0.3)),
            sticking: Newtons(q(0.35)),
            speed: MillimetresPerSecond(q(2.0)),
        },
        fixture: Fixture { per_mrad: Newtons(q(0.01)), largest: Milliradians(200) },
        wall_rate: q(0.005),
    });
    config
}

/// The law of Paper 000 with as large a table as there may be.
#[must_use]
pub fn phantom() -> Config {
    xr(MAX_LAYERS)
}

/// The same in so many layers.
#[must_use]
pub fn xr(count: usize) -> Config {
    let mut config = with_layers(count);
    let cells = 0..MAX_SPEEDS * MAX_ANGLES;
    // Rises and falls over depth, more with each cell.
    let force = |depth: usize, cell: usize| (200 * (1 + depth % 4) + 20 * cell) as u16;
    config.patient.law = Law::Xr(ForceTable {
        // 2 mm apart, and a little deeper in each cell.
        depths: (0..MAX_DEPTHS as u16)
            .flat_map(|depth| cells.clone().map(move |cell| 200 * depth + cell as u16))
            .collect(),
        speeds: [2.0, 8.0, 20.0].map(|speed| MillimetresPerSecond(q(speed))).into_iter().collect(),
        angles: [524, 1_047, 1_400].map(Milliradians).into_iter().collect(),
        forces: (0..MAX_DEPTHS).flat_map(|depth| cells.clone().map(move |cell| force(depth, cell))).collect(),
        gives_way: [3, 7, 11].into_iter().collect(),
        measured: 0b1_1110_0100,
        stiffness: Stiffness(q(1.5)),
        withdrawal: q(0.4),
    });
    config
}
