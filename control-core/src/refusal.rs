//! Why a configuration may not run, in words that say what to do.

use core::fmt;
use fixed::types::I16F16;
use serde::{Deserialize, Serialize};

/// Why a configuration may not run. `layer` counts from 0, the outermost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// A value lies outside its range.
    OutOfRange {
        /// Which value.
        field: Field,
        /// What was asked for.
        value: I16F16,
        /// The least it may be.
        low: I16F16,
        /// The most it may be.
        high: I16F16,
    },
    /// A wall is steeper than the largest stiffness.
    TooStiff {
        /// Which layer; for friction, the number of layers.
        layer: u8,
        /// Its largest slope in N/mm.
        slope: I16F16,
        /// The largest that is allowed, in N/mm.
        limit: I16F16,
    },
    /// A wall and the friction up to it ask for more force than the motor has.
    TooStrong {
        /// Which layer.
        layer: u8,
        /// The force in N.
        force: I16F16,
        /// What the torque limit gives at the roller, in N.
        limit: I16F16,
    },
    /// A layer does not begin below the one above it.
    Overlap {
        /// The inner one of the two.
        layer: u8,
    },
    /// A wall's force jumps at contact.
    ContactStep {
        /// Which layer.
        layer: u8,
        /// The jump in N.
        force: I16F16,
    },
    /// A rising parabola's vertex lies past contact, or a relief's before its puncture: the force would pull.
    WrongWay {
        /// Which layer.
        layer: u8,
    },
    /// The relief begins above the force at which the wall gave way.
    ReliefAboveElastic {
        /// Which layer.
        layer: u8,
    },
    /// A layer lies beyond the travel.
    BeyondTravel {
        /// Which layer.
        layer: u8,
    },
    /// The far wall of a vessel does not lie right below its near one, or there are two vessels, or none for what is said of
    /// one.
    NoVessel {
        /// The layer that is out of place.
        layer: u8,
    },
    /// There are more or fewer of something than there must be.
    Count {
        /// What.
        field: Field,
        /// How many there are.
        found: u16,
        /// How many there must be.
        wanted: u16,
    },
    /// There is no layer.
    Empty,
    /// The patient asks for more than the device's torque ceiling gives.
    AboveCeiling {
        /// The force in N.
        force: I16F16,
        /// What the ceiling gives at the roller, in N.
        ceiling: I16F16,
    },
    /// The parts of a compensation ask together for more than its share of the torque ceiling.
    CompensationTooStrong {
        /// What they ask for, in mN·m.
        torque: I16F16,
        /// What they may ask for, in mN·m.
        limit: I16F16,
    },
    /// With the friction that a compensation leaves, the stiffness that the device allows would ring.
    CompensationUnstable {
        /// What the device allows, in N/mm.
        stiffness: I16F16,
        /// What is stable, in N/mm.
        limit: I16F16,
    },
    /// The stiffness that the device allows would ring with its friction, mass and delay.
    WouldRing {
        /// What the device allows, in N/mm.
        stiffness: I16F16,
        /// What is stable, in N/mm.
        limit: I16F16,
    },
}

/// A value of the configuration that has a range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[expect(missing_docs, reason = "each is the name of a field of the configuration")]
pub enum Field {
    RollerRadius,
    CountsPerTurn,
    FullScaleTorque,
    TorqueLimit,
    SlewPerTick,
    FadeInMs,
    MaxCountsPerTick,
    Travel,
    StiffnessLimit,
    HeartbeatMs,
    Damping,
    LevelLength,
    LevelCap,
    AnchorMs,
    FrictionStiffness,
    FrictionLimit,
    Compliance,
    PunctureTravel,
    UnloadStiffness,
    BaseForce,
    Friction,
    LayerDepth,
    DurationSeconds,
    ServoStiffness,
    Speed,
    Ratio,
    Steps,
    DwellMs,
    Frequency,
    ContinuousTorque,
    WindingTimeS,
    PassivityDamping,
    SkinTilt,
    DacZero,
    LargestForce,
    SpringBack,
    Scale,
    TrackingStiffness,
    RelaxMs,
    BristleStiffness,
    BristleDamping,
    ViscousFriction,
    SlidingFriction,
    StickingFriction,
    StribeckSpeed,
    LateralForce,
    LargestAngle,
    CuttingForce,
    Withdrawal,
    TableDepth,
    TableSpeed,
    TableAngle,
    TableForce,
    TableRupture,
    AfterPuncture,
    VesselWidth,
    VesselOffset,
    CompensationVersion,
    WaveOrder,
    WaveAmplitude,
    Ripple,
    DryFriction,
    RestSpeed,
    FullSpeed,
    Weight,
    DriveOffset,
    Deadband,
    AngleGain,
    FrictionGain,
    WeightGain,
    DriveGain,
    SpeedCeiling,
    EncoderSign,
    MotorSign,
    Converter,
    MovingMass,
    MechanismFriction,
    DriveDelayUs,
    SlidingShare,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::OutOfRange { field, value, low, high } => {
                write!(f, "{field:?} is {value:.4}; it must lie from {low:.4} to {high:.4}")
            }
            Refusal::TooStiff { layer, slope, limit } => {
                write!(
                    f,
                    "layer {layer} reaches {slope:.3} N/mm, which would ring; lower it to {limit:.3} N/mm or less"
                )
            }
            Refusal::TooStrong { layer, force, limit } => {
                write!(
                    f,
                    "layer {layer} asks for {force:.3} N and the motor gives {limit:.3} N; weaken it or use a smaller roller"
                )
            }
            Refusal::Overlap { layer } => {
                write!(f, "layer {layer} does not begin below the one above it; make it deeper")
            }
            Refusal::ContactStep { layer, force } => {
                write!(f, "the force of layer {layer} jumps by {force:.3} N at contact; choose b = −n²/a")
            }
            Refusal::WrongWay { layer } => {
                write!(
                    f,
                    "a parabola of layer {layer} falls where it should rise or rises where it should fall; move its vertex"
                )
            }
            Refusal::ReliefAboveElastic { layer } => {
                write!(f, "the relief of layer {layer} is stronger than the wall that gave way; weaken it")
            }
            Refusal::BeyondTravel { layer } => {
                write!(f, "layer {layer} lies beyond the travel; lengthen it or move the layer")
            }
            Refusal::AboveCeiling { force, ceiling } => {
                write!(
                    f,
                    "the patient's largest force is {force:.3} N and the device's ceiling is {ceiling:.3} N, which no patient raises; lower it"
                )
            }
            Refusal::NoVessel { layer } => write!(
                f,
                "layer {layer} is no vessel's: let one vessel and then its far wall follow one another, and no other"
            ),
            Refusal::Count { field, found, wanted } => {
                write!(f, "there are {found} values of {field:?}; there must be {wanted}")
            }
            Refusal::CompensationTooStrong { torque, limit } => write!(
                f,
                "the compensation asks for {torque:.3} mN·m and may ask for {limit:.3} mN·m, a quarter of the torque ceiling; lower its gains"
            ),
            Refusal::CompensationUnstable { stiffness, limit } => write!(
                f,
                "with this compensation more than {limit:.3} N/mm would ring and the device allows {stiffness:.3} N/mm; lower its gains or the device's stiffness"
            ),
            Refusal::WouldRing { stiffness, limit } => write!(
                f,
                "with this friction, mass and delay more than {limit:.3} N/mm would ring and the device allows {stiffness:.3} N/mm; lower the device's stiffness"
            ),
            Refusal::Empty => f.write_str("there is no layer; add one"),
        }
    }
}

/// Refuses what lies outside its range.
pub(crate) fn within(field: Field, value: I16F16, low: I16F16, high: I16F16) -> Result<(), Refusal> {
    if value < low || value > high { Err(Refusal::OutOfRange { field, value, low, high }) } else { Ok(()) }
}

/// As many of something as there must be.
pub(crate) fn count(field: Field, found: usize, wanted: usize) -> Result<(), Refusal> {
    if found == wanted {
        Ok(())
    } else {
        Err(Refusal::Count { field, found: found as u16, wanted: wanted as u16 })
    }
}

/// Q16 of thousandths, for ranges.
pub(crate) const fn milli(thousandths: i64) -> I16F16 {
    I16F16::from_bits((thousandths * 65_536 / 1000) as i32)
}
