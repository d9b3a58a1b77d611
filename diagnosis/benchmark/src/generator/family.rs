//! Families of machines, from the drive of a hand-held needle to a heavy ball-screw axis: the
//! ranges of their sizes.

use std::f64::consts::TAU;

use crate::rng::Rng;

/// The requirements of a case on the machine.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Needs {
    /// `Some(true)`: rotary only.
    pub(crate) rotary: Option<bool>,
    /// The recordings must start at about the same place: the effect sits somewhere along the
    /// travel.
    pub(crate) place: bool,
    /// No weight, no tilt (they would hide the effect), or both wanted.
    pub(crate) tilt: Option<bool>,
    /// The nominal model has no offset key, and the machine has no offset.
    pub(crate) no_offset: bool,
    /// Only machines that turn fast.
    pub(crate) fast: bool,
    /// Only machines without a gear: a turn of the motor is a turn of the load.
    pub(crate) direct: bool,
}

/// A size that is drawn.
#[derive(Clone, Copy, Debug)]
enum Spread {
    /// Always this, without a draw.
    Fixed(f64),
    /// Uniform between two ends.
    Even(f64, f64),
    /// Uniform in the logarithm.
    Log(f64, f64),
    /// A value times a factor that is uniform between two ends.
    Times(f64, f64, f64),
}

impl Spread {
    fn draw(self, rng: &mut Rng) -> f64 {
        match self {
            Self::Fixed(value) => value,
            Self::Even(low, high) => rng.range(low, high),
            Self::Log(low, high) => rng.log_range(low, high),
            Self::Times(value, low, high) => value * rng.range(low, high),
        }
    }
}

/// A kind of machine with the ranges of its sizes. Masses in kg m² or kg, travel (u) in rad or m.
#[derive(Clone, Copy, Debug)]
pub(super) struct Family {
    pub(super) name: &'static str,
    inertia: Spread,
    /// Acceleration that the dry friction alone would make, u/s².
    friction_acceleration: Spread,
    /// Speed that the recordings reach, u/s.
    top_speed: Spread,
    /// Largest |command|, in `unit`.
    limit: Spread,
    /// Turns of the motor for one of the load, rounded to a whole number.
    gear: Spread,
    pub(super) unit: &'static str,
    /// Recorders' rates, in rows a second.
    pub(super) rates: &'static [f64],
    /// Force for one unit of command; `None`: drawn with the machine.
    pub(super) gain: Option<f64>,
    /// `None`: drawn with the machine.
    pub(super) counts_per_unit: Option<f64>,
    /// Steps of the converter from zero to the limit.
    pub(super) command_steps: f64,
}

/// The needle device of the architecture page, motor and roller.
const NEEDLE_DRIVE: Family = Family {
    name: "needle drive",
    inertia: Spread::Times(2.4e-6, 0.7, 1.5),
    friction_acceleration: Spread::Times(167.0, 0.7, 1.6),
    top_speed: Spread::Even(15.0, 50.0),
    limit: Spread::Fixed(1.2),
    gear: Spread::Fixed(1.0),
    unit: "A",
    rates: &[500.0, 1000.0, 2000.0, 5000.0, 10_000.0, 20_000.0],
    gain: Some(0.0234),
    counts_per_unit: Some(4000.0 / TAU),
    command_steps: 32_768.0,
};

const SERVO_DRIVE: Family = Family {
    name: "servo drive",
    inertia: Spread::Log(1e-5, 1e-3),
    friction_acceleration: Spread::Log(50.0, 300.0),
    top_speed: Spread::Even(15.0, 80.0),
    limit: Spread::Even(5.0, 20.0),
    gear: Spread::Fixed(1.0),
    unit: "A",
    rates: &[250.0, 500.0, 1000.0, 2000.0, 4000.0, 20_000.0],
    gain: None,
    counts_per_unit: None,
    command_steps: 32_768.0,
};

const DIRECT_DRIVE: Family = Family {
    name: "direct drive",
    inertia: Spread::Log(5e-3, 5e-2),
    friction_acceleration: Spread::Log(3.0, 20.0),
    top_speed: Spread::Even(2.0, 10.0),
    limit: Spread::Even(3.0, 10.0),
    rates: &[50.0, 100.0, 200.0, 440.0, 1000.0],
    ..SERVO_DRIVE
};

const SLIDE: Family = Family {
    name: "slide",
    inertia: Spread::Log(0.3, 5.0),
    friction_acceleration: Spread::Log(0.5, 4.0),
    top_speed: Spread::Even(0.1, 0.5),
    limit: Spread::Even(2.0, 10.0),
    rates: &[500.0, 1000.0, 2000.0, 5000.0],
    ..SERVO_DRIVE
};

const BALL_SCREW_AXIS: Family = Family {
    name: "ball-screw axis",
    inertia: Spread::Log(30.0, 150.0),
    friction_acceleration: Spread::Log(0.2, 0.6),
    top_speed: Spread::Even(0.15, 0.4),
    limit: Spread::Fixed(10.0),
    unit: "V",
    rates: &[100.0, 250.0, 500.0, 1000.0],
    ..SERVO_DRIVE
};

/// A joint behind a gear: much inertia and much friction, little speed.
const GEARED_JOINT: Family = Family {
    name: "geared joint",
    inertia: Spread::Log(0.05, 2.0),
    friction_acceleration: Spread::Log(5.0, 60.0),
    top_speed: Spread::Even(0.5, 3.0),
    limit: Spread::Even(2.0, 15.0),
    gear: Spread::Even(20.0, 160.0),
    rates: &[50.0, 100.0, 250.0, 500.0, 1000.0],
    ..SERVO_DRIVE
};

/// A lead screw or a syringe: its inertia hardly matters.
const SLOW_AXIS: Family = Family {
    name: "slow axis",
    inertia: Spread::Log(0.5, 10.0),
    friction_acceleration: Spread::Log(3.0, 30.0),
    top_speed: Spread::Log(0.01, 0.06),
    limit: Spread::Even(1.0, 10.0),
    rates: &[20.0, 50.0, 100.0, 200.0],
    ..SERVO_DRIVE
};

/// The families by the number that is drawn: the rotary ones without a gear (the fast ones first),
/// linear ones, geared ones.
static FAMILIES: [Family; 9] = [
    // With the converter of the board.
    Family { command_steps: 2048.0, ..NEEDLE_DRIVE },
    NEEDLE_DRIVE,
    SERVO_DRIVE,
    DIRECT_DRIVE,
    SLIDE,
    BALL_SCREW_AXIS,
    GEARED_JOINT,
    GEARED_JOINT,
    SLOW_AXIS,
];

/// Draws a family that meets the needs.
pub(super) fn draw_family(rng: &mut Rng, rotary: bool, needs: Needs) -> &'static Family {
    let number = match (rotary, needs.fast) {
        (true, true) => rng.below(3),
        (true, false) if needs.direct => rng.below(4),
        (true, false) => *rng.pick(&[0, 1, 2, 3, 6, 7]),
        _ => *rng.pick(&[4, 5, 8]),
    };
    &FAMILIES[number]
}

/// The sizes of a machine as drawn, in the units of its [`Family`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Sizes {
    pub(super) inertia: f64,
    pub(super) friction_acceleration: f64,
    pub(super) top_speed: f64,
    pub(super) limit: f64,
    pub(super) gear: f64,
}

impl Family {
    pub(super) fn draw_sizes(&self, rng: &mut Rng) -> Sizes {
        Sizes {
            inertia: self.inertia.draw(rng),
            friction_acceleration: self.friction_acceleration.draw(rng),
            top_speed: self.top_speed.draw(rng),
            limit: self.limit.draw(rng),
            gear: self.gear.draw(rng).round(),
        }
    }
}
