//! The facts about a law that do not depend on who looks for it: the filter, the regression and the
//! simulator read this one record. The regression's columns, the filter's terms and the plant's
//! force are each in the file of who computes them.

use super::ActsOn;
use serde::{Deserialize, Serialize};

/// The subsystem that a law belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Subsystem {
    Transmission,
    Actuator,
    Load,
    Sensor,
}

/// A fact that recordings must show for a law to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Need {
    /// The axis has a dry friction, which the law changes.
    DryFriction,
    /// The inertia matters in the motion: where it does not, the drive's force is the scale of all
    /// else, and no joint shows.
    Inertia,
    /// The command changes within a recording: the force of one command throughout is any constant,
    /// and a drift of it any force over the time.
    ChangingCommand,
}

/// A limit of recordings within which two laws are the same force.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Within {
    /// All motion is at one speed.
    OneSpeed,
    /// The axis moves one way only.
    OneWay,
    /// All strokes have one length.
    OneLength,
    /// The axis moves less than a turn.
    LessThanATurn,
    /// The axis moves along a line, where the encoder may be on the load and nothing that turns
    /// need be heavy. An angle is the motor's: a drive that lets go runs away there, and a fit sees
    /// it.
    Line,
    /// The law leaves much of what it should explain: a spring may then well have a gap.
    LeavesMuch,
    /// The encoder does not see the gap: its flanks are a spring.
    UnseenGap,
}

/// A quantity in multiples of which a coefficient is bounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// None but one: a sign is all that bounds it.
    One,
    /// The value of the law's own shape.
    Shape,
    /// The steps of the reading as they were found.
    Jumps,
    /// The inertia of the motor without its load.
    MotorInertia,
    /// The smallest gain of the drive that the rig allows.
    SmallestGain,
    /// The largest gain of the drive that the rig allows.
    LargestGain,
    /// The largest gain that the rig allows; half of the gain where the rig hardly knows it.
    TrustedGain,
    /// Twice the rig's viscous friction.
    TwiceViscous,
    /// Twice the rig's dry friction.
    TwiceDry,
    /// The largest dry friction within the rig's uncertainty.
    LargestDry,
}

/// Bounds of a coefficient, in multiples of a quantity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// The lower bound.
    pub low: f64,
    /// The upper bound.
    pub high: f64,
    /// The quantity.
    pub of: Quantity,
}

impl Bounds {
    /// Any coefficient.
    pub const FREE: Self = Self { low: f64::NEG_INFINITY, ..Self::POSITIVE };
    /// Any coefficient that is not below zero.
    pub const POSITIVE: Self = bounds(0.0, f64::INFINITY, Quantity::One);
}

const fn bounds(low: f64, high: f64, of: Quantity) -> Bounds {
    Bounds { low, high, of }
}

/// A law of the library.
#[derive(Debug, Clone, Copy)]
pub struct Record {
    /// Its name in a rig and in a report.
    pub key: &'static str,
    /// The force that the drive has to supply for it.
    pub equation: &'static str,
    /// A noun phrase for it that a technician understands.
    pub words: &'static str,
    /// The subsystem that it belongs to.
    pub subsystem: Subsystem,
    /// The signals that it acts on.
    pub acts_on: ActsOn,
    /// True if it is a sine of the place: without an absolute reading every recording has a phase
    /// of its own.
    pub wave: bool,
    /// The values that the coefficient of each of its terms may have; the last holds for all terms
    /// beyond it.
    pub bounds: &'static [Bounds],
    /// The plain law that it refines: that one goes first where the rig has none.
    pub refines: Option<&'static str>,
    /// The facts that recordings must show.
    pub needs: &'static [Need],
    /// Laws that no recording within a limit distinguishes from it.
    pub twins: &'static [(Within, &'static str)],
}

/// Returns a law of the transmission and of the motion, of any size, that every motion may show and
/// that has no twin.
const fn law(key: &'static str, equation: &'static str, words: &'static str) -> Record {
    Record {
        key,
        equation,
        words,
        subsystem: Subsystem::Transmission,
        acts_on: ActsOn::Motion,
        wave: false,
        bounds: FREE,
        refines: None,
        needs: &[],
        twins: &[],
    }
}

/// Returns a law of the drive, which shows where its command changes.
const fn drive(key: &'static str, equation: &'static str, words: &'static str) -> Record {
    let needs = &[Need::ChangingCommand];
    let (subsystem, acts_on) = (Subsystem::Actuator, ActsOn::Command);
    Record { subsystem, acts_on, bounds: POSITIVE, needs, ..law(key, equation, words) }
}

/// A force of either direction: nothing in its physics bounds it.
const FREE: &[Bounds] = &[Bounds::FREE];
/// Friction takes energy and never gives any, and a drive loses by a deadband, a clip or a lag.
const POSITIVE: &[Bounds] = &[Bounds::POSITIVE];
/// Friction brakes in both directions, so that they differ from their mean by less than that.
const ASYMMETRY: &[Bounds] =
    &[bounds(-1.0, 1.0, Quantity::TwiceViscous), bounds(-1.0, 1.0, Quantity::TwiceDry)];
/// Friction that warms up stays friction; assumed: a tenth of it stays, and it grows fourfold at
/// most. Dry friction first, then viscous.
const WARMING: &[Bounds] =
    &[bounds(-0.9, 3.0, Quantity::LargestDry), bounds(-0.9, 3.0, Quantity::TwiceViscous)];
/// A spring pulls back; its force where the recording starts has either sign.
const SPRING: &[Bounds] = &[Bounds::POSITIVE, Bounds::FREE];
/// Counts that are lost are lost once; assumed: a size found in noise and quantisation, and an
/// inertia that the rig has wrong, are off by this much.
const LOST: &[Bounds] = &[bounds(0.5, 1.6, Quantity::Jumps)];
/// A load is a mass, which is not below zero; assumed: at most six times its motor's.
const ON_SPRING: &[Bounds] = &[bounds(0.0, 6.0, Quantity::MotorInertia)];
/// Assumed: less than a tenth of its motor's is not felt through a gap; eight times at most.
const BEHIND_GAP: &[Bounds] = &[bounds(0.1, 8.0, Quantity::MotorInertia)];
/// A small mass that always slips is a friction of another form, not a drive that lets go; assumed:
/// small is 0.3 of its motor's, and eight times is the most.
const IN_GRIP: &[Bounds] = &[bounds(0.3, 8.0, Quantity::MotorInertia)];
/// A commutation may lose most of the torque at some angle, and the part is one of the gain as it
/// is; where that is hardly known, a ripple as large explains what cogging does.
const RIPPLE: &[Bounds] = &[bounds(-0.9, 0.9, Quantity::TrustedGain)];
/// Assumed: least squares on a delayed force find its delay to this part.
const DELAY: &[Bounds] = &[bounds(0.6, 1.6, Quantity::Shape)];
/// The gain keeps its sign, whatever gain the rig allows: the smallest bounds its drift.
const GAIN: &[Bounds] = &[bounds(-1.0, 1.0, Quantity::SmallestGain)];
/// A drive that loses all does not move its axis; assumed: nor does one that loses nine tenths.
const LOSS: &[Bounds] = &[bounds(0.0, 0.9, Quantity::LargestGain)];
const DRY: Option<&str> = Some("coulomb_friction");
const VISCOUS: Option<&str> = Some("viscous_friction");

/// The laws, those of the motion first.
pub static RECORDS: [Record; 27] = [
    Record { bounds: POSITIVE, ..law("viscous_friction", "b·q̇", "friction that grows with speed") },
    Record {
        bounds: POSITIVE,
        twins: &[(Within::OneWay, "asymmetric_friction")],
        ..law("coulomb_friction", "F·sgn q̇", "dry friction")
    },
    Record {
        refines: DRY,
        bounds: ASYMMETRY,
        ..law(
            "asymmetric_friction",
            "F·|sgn q̇| + b·|q̇|, or one of them",
            "friction that differs with direction",
        )
    },
    Record {
        refines: VISCOUS,
        bounds: POSITIVE,
        twins: &[(Within::OneSpeed, "stribeck_friction")],
        ..law("quadratic_drag", "c·q̇·|q̇|", "drag with the square of speed")
    },
    Record {
        refines: DRY,
        bounds: POSITIVE,
        needs: &[Need::DryFriction],
        twins: &[(Within::OneSpeed, "quadratic_drag")],
        ..law("stribeck_friction", "P·sgn q̇·exp(−(|q̇|/v)^δ)", "friction that falls as speed rises from zero")
    },
    Record {
        refines: DRY,
        bounds: POSITIVE,
        needs: &[Need::DryFriction],
        twins: &[(Within::OneLength, "backlash")],
        ..law(
            "presliding_friction",
            "F·(z − sgn q̇), z bristles that yield over x",
            "elastic bristles before sliding",
        )
    },
    Record {
        refines: DRY,
        needs: &[Need::DryFriction],
        twins: &[(Within::OneSpeed, "gain_drift")],
        bounds: WARMING,
        ..law(
            "friction_drift",
            "F·sgn q̇·exp(−t/τ), or in proportion to t",
            "friction that changes as the recording goes on",
        )
    },
    Record {
        bounds: POSITIVE,
        ..law("load_dependent_friction", "µ·|load|·sgn q̇", "dry friction that grows with the load")
    },
    Record {
        subsystem: Subsystem::Load,
        twins: &[(Within::LessThanATurn, "mass_imbalance")],
        bounds: SPRING,
        ..law("position_spring", "c·x + d·x³, or on one side of a place", "a spring along the travel")
    },
    Record {
        refines: DRY,
        needs: &[Need::DryFriction],
        ..law("position_dependent_friction", "g(x)·sgn q̇", "dry friction that changes along the travel")
    },
    Record {
        subsystem: Subsystem::Load,
        refines: VISCOUS,
        ..law("position_dependent_damping", "g(x)·q̇", "damping that changes along the travel")
    },
    Record {
        subsystem: Subsystem::Load,
        ..law("tilt_gravity", "−W·sin tilt", "a weight that acts through the tilt")
    },
    Record {
        subsystem: Subsystem::Sensor,
        bounds: LOST,
        ..law("missed_counts", "J·(second difference of the counts lost)", "lost encoder counts")
    },
    Record {
        bounds: ON_SPRING,
        needs: &[Need::Inertia],
        twins: &[(Within::LeavesMuch, "backlash")],
        ..law(
            "drive_compliance",
            "J_load·(a_load − q̈), a spring between them",
            "a spring between motor and load",
        )
    },
    Record {
        bounds: BEHIND_GAP,
        needs: &[Need::DryFriction, Need::Inertia],
        twins: &[(Within::UnseenGap, "drive_compliance"), (Within::OneLength, "presliding_friction")],
        ..law("backlash", "J_load·(a_load − q̈), a gap between them", "a gap at reversals")
    },
    Record {
        bounds: IN_GRIP,
        needs: &[Need::Inertia],
        twins: &[(Within::Line, "command_saturation")],
        ..law(
            "roller_slip",
            "J_load·(a_load − q̈), dry contact between them",
            "slip of the drive above a force limit",
        )
    },
    Record {
        subsystem: Subsystem::Actuator,
        wave: true,
        ..law("cogging", "A·sin(n·θ) + B·cos(n·θ)", "torque periodic in the angle")
    },
    Record {
        subsystem: Subsystem::Load,
        wave: true,
        twins: &[(Within::Line, "cogging"), (Within::LessThanATurn, "position_spring")],
        ..law("mass_imbalance", "A·sin q + B·cos q", "gravity on an off-centre mass")
    },
    Record {
        subsystem: Subsystem::Sensor,
        wave: true,
        ..law("encoder_eccentricity", "J·ë + b·ė, e = A·sin θ + B·cos θ", "an encoder error once per turn")
    },
    Record {
        subsystem: Subsystem::Actuator,
        wave: true,
        acts_on: ActsOn::Command,
        bounds: RIPPLE,
        ..law(
            "torque_ripple",
            "û·(A·sin(n·θ) + B·cos(n·θ))",
            "torque periodic in the angle and proportional to the command",
        )
    },
    drive("command_deadband", "w·clip(û/x, ±1)", "a deadband of the command"),
    Record {
        twins: &[(Within::Line, "roller_slip")],
        ..drive(
            "command_saturation",
            "û·(1 − |û/L|^p)^(−1/p) − û, or a hinge at L",
            "clipping of large commands",
        )
    },
    Record {
        twins: &[(Within::OneSpeed, "command_saturation")],
        ..drive(
            "supply_limit",
            "û beyond L·(1 − q̇·sgn û/v)",
            "a clip that falls with speed, as the supply's voltage does against back-EMF",
        )
    },
    Record {
        bounds: DELAY,
        ..drive("command_delay", "û(t + τ) − û(t)", "a delay between command and torque")
    },
    drive("electrical_lag", "τ·dû/dt", "a first-order lag between command and torque"),
    Record {
        bounds: GAIN,
        needs: &[Need::ChangingCommand, Need::Inertia],
        twins: &[(Within::OneSpeed, "friction_drift")],
        ..drive("gain_drift", "û·g(t), or of the heat ∫û²", "a torque constant that drifts")
    },
    Record {
        subsystem: Subsystem::Transmission,
        refines: DRY,
        bounds: LOSS,
        ..drive("drive_loss", "f·|û|·sgn q̇", "a loss in proportion to the drive's own force, as a gear has")
    },
];

impl Record {
    /// Returns the bounds of a term's coefficient.
    pub fn bounds_of(&self, term: usize) -> Bounds {
        self.bounds[term.min(self.bounds.len() - 1)]
    }
}

/// Returns the record of a key; a law without one does not compile.
pub(super) const fn of(key: &str) -> &'static Record {
    let mut i = 0;
    while i < RECORDS.len() {
        if is_same(RECORDS[i].key.as_bytes(), key.as_bytes()) {
            return &RECORDS[i];
        }
        i += 1;
    }
    panic!("a law needs a record")
}

const fn is_same(a: &[u8], b: &[u8]) -> bool {
    let mut i = 0;
    while i < a.len() && i < b.len() && a[i] == b[i] {
        i += 1;
    }
    i == a.len() && i == b.len()
}
