//! The reasons why a configuration may not run, in words that say what to do.

use core::fmt;
use fixed::types::I16F16;
use serde::{Deserialize, Serialize};

/// The reason why a configuration may not run. `layer` counts from 0, the outermost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// A value is outside its range.
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
    /// A rising parabola's vertex is past contact, or a relief's before its puncture: the force
    /// would pull.
    WrongWay {
        /// The layer.
        layer: u8,
    },
    /// The relief begins above the force at which the wall gave way.
    ReliefAboveElastic {
        /// The layer.
        layer: u8,
    },
    /// A layer is beyond the travel.
    BeyondTravel {
        /// The layer.
        layer: u8,
    },
    /// The far wall of a vessel does not lie right below its near one, or there are two vessels, or
    /// none for what is said of one.
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
    /// With the friction that a compensation leaves, the stiffness that the device allows would
    /// ring.
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

/// Declares [`Field`], each field with its words.
macro_rules! fields {
    ($($name:ident: $words:literal,)*) => {
        /// A value of the configuration that has a range.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        #[expect(missing_docs, reason = "each is the name of a field of the configuration")]
        pub enum Field {
            $($name,)*
        }

        /// The key in the device's or the patient's file, or words with a unit if no key holds the
        /// value in this unit.
        impl fmt::Display for Field {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(match self {
                    $(Self::$name => $words,)*
                })
            }
        }
    };
}

// The order is that of the numbers in the link's frames.
fields! {
    RollerRadius: "roller_radius_mm",
    CountsPerTurn: "counts_per_turn",
    FullScaleTorque: "full_scale_torque_mnm",
    TorqueLimit: "torque_mnm",
    SlewPerTick: "slew_mnm_per_tick",
    FadeInMs: "fade_in_ms",
    MaxCountsPerTick: "max_counts_per_tick",
    Travel: "travel_mm",
    StiffnessLimit: "stiffness_n_per_mm",
    HeartbeatMs: "heartbeat_ms",
    Damping: "damping_n_s_per_mm",
    LevelLength: "level_length_mm",
    LevelCap: "level_cap",
    AnchorMs: "anchor_ms",
    FrictionStiffness: "stiffness_n_per_mm",
    FrictionLimit: "limit_n",
    Compliance: "compliance_mm2_per_n",
    PunctureTravel: "puncture_mm",
    UnloadStiffness: "unload_n_per_mm",
    BaseForce: "base_n",
    Friction: "friction_n_per_mm",
    LayerDepth: "depth_mm",
    DurationSeconds: "the duration in s",
    ServoStiffness: "the servo's stiffness in N/mm",
    Speed: "the speed in mm/s",
    Ratio: "the ratio of the steps",
    Steps: "the number of steps",
    DwellMs: "the dwell in ms",
    Frequency: "the frequency in Hz",
    ContinuousTorque: "continuous_torque_mnm",
    WindingTimeS: "winding_time_s",
    PassivityDamping: "passivity_damping_n_s_per_mm",
    SkinTilt: "the tilt on the skin in mrad",
    DacZero: "dac_zero_codes",
    LargestForce: "largest_force_n",
    SpringBack: "spring_back",
    Scale: "force_scale",
    TrackingStiffness: "tracking_n_per_mm",
    RelaxMs: "relax_ms",
    BristleStiffness: "stiffness_n_per_mm",
    BristleDamping: "damping_n_s_per_mm",
    ViscousFriction: "viscous_n_s_per_mm",
    SlidingFriction: "sliding_n",
    StickingFriction: "sticking_n",
    StribeckSpeed: "stribeck_mm_s",
    LateralForce: "the lateral force in N per mrad",
    LargestAngle: "the largest angle in mrad",
    CuttingForce: "cutting",
    Withdrawal: "withdrawal",
    TableDepth: "depth_step_mm",
    TableSpeed: "speeds_mm_s",
    TableAngle: "the angles in mrad",
    TableForce: "the forces in N",
    TableRupture: "gives_way",
    AfterPuncture: "after_puncture",
    VesselWidth: "width_mm",
    VesselOffset: "offset_mm",
    CompensationVersion: "compensation.version",
    WaveOrder: "the order of a wave",
    WaveAmplitude: "the amplitude of a wave in mN·m",
    Ripple: "the ripple",
    DryFriction: "the dry friction in mN·m",
    RestSpeed: "the speed at rest in mm/s",
    FullSpeed: "the speed of full friction in mm/s",
    Weight: "the weight in mN·m",
    DriveOffset: "the drive's offset in mN·m",
    Deadband: "the deadband in mN·m",
    AngleGain: "gains.angle",
    FrictionGain: "gains.friction",
    WeightGain: "gains.weight",
    DriveGain: "gains.drive",
    SpeedCeiling: "the speed of max_counts_per_tick in mm/s",
    EncoderSign: "encoder_reversed",
    MotorSign: "motor_reversed",
    Converter: "dac_bits",
    MovingMass: "mass_g",
    MechanismFriction: "dry_friction_n",
    DriveDelayUs: "delay_us",
    SlidingShare: "sliding",
    FrictionLimitOut: "limit_out_n",
    Vertex: "vertex_mm",
    Sensors: "[sensors]",
    WallRate: "wall_rate_s_per_mm",
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
            Refusal::CompensationUnstable { stiffness, limit } => {
                rings(f, "this compensation", stiffness, limit, "lower its gains or the device's stiffness")
            }
            Refusal::WouldRing { stiffness, limit } => {
                rings(f, "this friction, mass and delay", stiffness, limit, "lower the device's stiffness")
            }
            Refusal::Empty => f.write_str("there is no layer; add one"),
        }
    }
}

/// Says that the device allows more stiffness than is stable with `cause`; both in N/mm.
fn rings(
    f: &mut fmt::Formatter<'_>,
    cause: &str,
    stiffness: &I16F16,
    limit: &I16F16,
    remedy: &str,
) -> fmt::Result {
    write!(
        f,
        "with {cause} more than {limit:.3} N/mm would ring, but the device allows {stiffness:.3} N/mm; {remedy}"
    )
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
