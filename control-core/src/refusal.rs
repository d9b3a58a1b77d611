//! The reasons why a configuration may not run, in words that say what to do.

use core::fmt;
use fixed::types::I16F16;
use serde::{Deserialize, Serialize};

/// The reason why a configuration may not run. `layer` counts from 0, the outermost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// A value lies outside its range.
    OutOfRange {
        /// The field.
        field: Field,
        /// The requested value.
        value: I16F16,
        /// The least it may be.
        low: I16F16,
        /// The most it may be.
        high: I16F16,
    },
    /// A wall is steeper than the largest stiffness.
    TooStiff {
        /// The layer; for friction, the number of layers.
        layer: u8,
        /// Its largest slope in N/mm.
        slope: I16F16,
        /// The largest that is allowed, in N/mm.
        limit: I16F16,
    },
    /// A wall and the friction up to it ask for more force than the motor has.
    TooStrong {
        /// The layer.
        layer: u8,
        /// The force in N.
        force: I16F16,
        /// The force of the torque limit at the roller, in N.
        limit: I16F16,
    },
    /// A layer does not begin below the one above it.
    Overlap {
        /// The inner one of the two.
        layer: u8,
    },
    /// A wall's force jumps at contact.
    ContactStep {
        /// The layer.
        layer: u8,
        /// The jump in N.
        force: I16F16,
    },
    /// A rising parabola's vertex lies past contact, or a relief's before its puncture: the force would pull.
    WrongWay {
        /// The layer.
        layer: u8,
    },
    /// The relief begins above the force at which the wall gave way.
    ReliefAboveElastic {
        /// The layer.
        layer: u8,
    },
    /// A layer lies beyond the travel.
    BeyondTravel {
        /// The layer.
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
        /// The field.
        field: Field,
        /// The number found.
        found: u16,
        /// The required number.
        wanted: u16,
    },
    /// There is no layer.
    Empty,
    /// The patient asks for more than the device's torque ceiling gives.
    AboveCeiling {
        /// The force in N.
        force: I16F16,
        /// The force of the ceiling at the roller, in N.
        ceiling: I16F16,
    },
    /// The parts of a compensation ask together for more than its share of the torque ceiling.
    CompensationTooStrong {
        /// The requested torque, in mN·m.
        torque: I16F16,
        /// The largest allowed torque, in mN·m.
        limit: I16F16,
    },
    /// With the friction that a compensation leaves, the stiffness that the device allows would ring.
    CompensationUnstable {
        /// The stiffness that the device allows, in N/mm.
        stiffness: I16F16,
        /// The largest stable stiffness, in N/mm.
        limit: I16F16,
    },
    /// The stiffness that the device allows would ring with its friction, mass and delay.
    WouldRing {
        /// The stiffness that the device allows, in N/mm.
        stiffness: I16F16,
        /// The largest stable stiffness, in N/mm.
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
    FrictionLimitOut,
}

/// The key in the device's or the patient's file, or words with a unit if no key holds the value in this unit.
impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::RollerRadius => "roller_radius_mm",
            Self::CountsPerTurn => "counts_per_turn",
            Self::FullScaleTorque => "full_scale_torque_mnm",
            Self::TorqueLimit => "torque_mnm",
            Self::SlewPerTick => "slew_mnm_per_tick",
            Self::FadeInMs => "fade_in_ms",
            Self::MaxCountsPerTick => "max_counts_per_tick",
            Self::Travel => "travel_mm",
            Self::StiffnessLimit | Self::FrictionStiffness | Self::BristleStiffness => "stiffness_n_per_mm",
            Self::HeartbeatMs => "heartbeat_ms",
            Self::Damping | Self::BristleDamping => "damping_n_s_per_mm",
            Self::LevelLength => "level_length_mm",
            Self::LevelCap => "level_cap",
            Self::AnchorMs => "anchor_ms",
            Self::FrictionLimit => "limit_n",
            Self::FrictionLimitOut => "limit_out_n",
            Self::Compliance => "compliance_mm2_per_n",
            Self::PunctureTravel => "puncture_mm",
            Self::UnloadStiffness => "unload_n_per_mm",
            Self::BaseForce => "base_n",
            Self::Friction => "friction_n_per_mm",
            Self::LayerDepth => "depth_mm",
            Self::DurationSeconds => "the duration in s",
            Self::ServoStiffness => "the servo's stiffness in N/mm",
            Self::Speed => "the speed in mm/s",
            Self::Ratio => "the ratio of the steps",
            Self::Steps => "the number of steps",
            Self::DwellMs => "the dwell in ms",
            Self::Frequency => "the frequency in Hz",
            Self::ContinuousTorque => "continuous_torque_mnm",
            Self::WindingTimeS => "winding_time_s",
            Self::PassivityDamping => "passivity_damping_n_s_per_mm",
            Self::SkinTilt => "the tilt on the skin in mrad",
            Self::DacZero => "dac_zero_codes",
            Self::LargestForce => "largest_force_n",
            Self::SpringBack => "spring_back",
            Self::Scale => "force_scale",
            Self::TrackingStiffness => "tracking_n_per_mm",
            Self::RelaxMs => "relax_ms",
            Self::ViscousFriction => "viscous_n_s_per_mm",
            Self::SlidingFriction => "sliding_n",
            Self::StickingFriction => "sticking_n",
            Self::StribeckSpeed => "stribeck_mm_s",
            Self::LateralForce => "the lateral force in N per mrad",
            Self::LargestAngle => "the largest angle in mrad",
            Self::CuttingForce => "cutting",
            Self::Withdrawal => "withdrawal",
            Self::TableDepth => "depth_step_mm",
            Self::TableRupture => "gives_way",
            Self::AfterPuncture => "after_puncture",
            Self::TableSpeed => "speeds_mm_s",
            Self::TableAngle => "the angles in mrad",
            Self::TableForce => "the forces in N",
            Self::VesselWidth => "width_mm",
            Self::VesselOffset => "offset_mm",
            Self::CompensationVersion => "compensation.version",
            Self::WaveOrder => "the order of a wave",
            Self::WaveAmplitude => "the amplitude of a wave in mN·m",
            Self::Ripple => "the ripple",
            Self::DryFriction => "the dry friction in mN·m",
            Self::RestSpeed => "the speed at rest in mm/s",
            Self::FullSpeed => "the speed of full friction in mm/s",
            Self::Weight => "the weight in mN·m",
            Self::DriveOffset => "the drive's offset in mN·m",
            Self::Deadband => "the deadband in mN·m",
            Self::AngleGain => "gains.angle",
            Self::FrictionGain => "gains.friction",
            Self::WeightGain => "gains.weight",
            Self::DriveGain => "gains.drive",
            Self::SpeedCeiling => "the speed of max_counts_per_tick in mm/s",
            Self::EncoderSign => "encoder_reversed",
            Self::MotorSign => "motor_reversed",
            Self::Converter => "dac_bits",
            Self::MovingMass => "mass_g",
            Self::MechanismFriction => "dry_friction_n",
            Self::DriveDelayUs => "delay_us",
            Self::SlidingShare => "sliding",
        })
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Refusal::OutOfRange { field, value, low, high } => {
                write!(f, "{field} is {value:.4}; it must be from {low:.4} to {high:.4}")
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
                    "layer {layer} demands {force:.3} N, but the motor gives only {limit:.3} N; weaken it or use a smaller roller"
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
                write!(f, "layer {layer} is deeper than the travel; increase the travel or move the layer")
            }
            Refusal::AboveCeiling { force, ceiling } => {
                write!(
                    f,
                    "the patient's largest force is {force:.3} N, above the device's ceiling of {ceiling:.3} N, which no patient can raise; lower it"
                )
            }
            Refusal::NoVessel { layer } => {
                write!(f, "layer {layer}: a vessel needs exactly one far wall, directly below it")
            }
            Refusal::Count { field, found, wanted } => {
                write!(f, "there are {found} values of {field}; there must be {wanted}")
            }
            Refusal::CompensationTooStrong { torque, limit } => write!(
                f,
                "the compensation demands {torque:.3} mN·m; at most {limit:.3} mN·m, a quarter of the torque ceiling, is allowed; lower its gains"
            ),
            Refusal::CompensationUnstable { stiffness, limit } => write!(
                f,
                "with this compensation more than {limit:.3} N/mm would ring, but the device allows {stiffness:.3} N/mm; lower its gains or the device's stiffness"
            ),
            Refusal::WouldRing { stiffness, limit } => write!(
                f,
                "with this friction, mass and delay more than {limit:.3} N/mm would ring, but the device allows {stiffness:.3} N/mm; lower the device's stiffness"
            ),
            Refusal::Empty => f.write_str("there is no layer; add one"),
        }
    }
}

/// Refuses a value outside its range.
pub(crate) fn within(field: Field, value: I16F16, low: I16F16, high: I16F16) -> Result<(), Refusal> {
    if value < low || value > high { Err(Refusal::OutOfRange { field, value, low, high }) } else { Ok(()) }
}

/// Refuses a wrong number of values.
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
