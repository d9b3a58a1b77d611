//! From a [`Config`] to a [`Plan`] the tick can run: everything is checked and every division done
//! here. A configuration that is unstable, overflows or asks for more than the motor has is refused
//! with the reason, never clamped.

mod layers;

use crate::TICK_HZ;
use crate::anatomy::{Anatomy, NeedleLine};
use crate::compensation::{check, feedforward};
use crate::config::{Config, Device, Patient, Tissue};
use crate::kinematics::{Scale, counts_reaching, mm_per_count};
use crate::law;
use crate::passivity::BounceDamping;
pub use crate::refusal::{Field, Refusal};
use crate::refusal::{milli, within};
use crate::runaway;
use crate::safety::{DacScale, TorqueLimits};
use crate::stability;
use crate::stillness;
use crate::thermal::ThermalLimits;
use crate::units::Newtons;
use fixed::types::{I2F30, I16F16, U16F16};

/// 0.0005 N·s/mm: with 30 g and the speed estimate's 6 ms of delay, more would itself ring.
const LARGEST_DAMPING_BITS: i32 = 8_389;

impl Config {
    /// Both parts checked, ready to run.
    pub fn plan(&self) -> Result<Plan, Refusal> {
        Plan::new(&self.device, &self.patient)
    }
}

/// A configuration that may run.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) config: Config,
    pub(crate) scale: Scale,
    pub(crate) anatomy: Anatomy,
    pub(crate) law: law::PreparedLaw,
    /// Length by which a force of the law becomes the torque that is given: the roller's radius at
    /// the declared scale.
    pub(crate) lever: I16F16,
    /// 1/lever, 1/mm.
    pub(crate) per_lever: I16F16,
    pub(crate) torque_limits: TorqueLimits,
    /// Torque under which a motor that is not held moves.
    pub(crate) loaded_torque: U16F16,
    pub(crate) thermal: ThermalLimits,
    pub(crate) bounce_damping: BounceDamping,
    pub(crate) runaway: runaway::Bounds,
    pub(crate) damping: I2F30,
    pub(crate) compensation: feedforward::FeedforwardPlan,
    pub(crate) dac: DacScale,
    /// −1 where the encoder counts down on the way in.
    pub(crate) encoder_sign: i32,
    pub(crate) travel_counts: u32,
    pub(crate) heartbeat_ticks: u32,
}

impl Plan {
    /// Checks both parts and what they make together, and prepares them for the tick.
    pub fn new(device: &Device, patient: &Patient) -> Result<Self, Refusal> {
        let config = Config { device: *device, patient: patient.clone() };
        let config = &config;
        check_device(device)?;
        check_ceiling(config)?;
        let mm_per_count = mm_per_count(config.device.roller_radius, config.device.counts_per_turn);
        let scale = Scale::new(mm_per_count);
        within(Field::Scale, patient.scale, milli(100), I16F16::ONE)?;
        let met = layers::met(config)?;
        let law = law::PreparedLaw::new(&patient.law, &force_limits(config, &met.layers))?;
        let anatomy = layers::plan(config, &met, law.ruptures());
        let lever = device.roller_radius.0.saturating_mul(patient.scale);
        let fade_ticks = i32::from(config.device.limits.fade_in_ms.cast_signed()) * (TICK_HZ / 1000) as i32;
        Ok(Self {
            scale,
            anatomy,
            law,
            lever,
            per_lever: I16F16::ONE.saturating_div(lever.max(I16F16::DELTA)),
            torque_limits: TorqueLimits {
                torque: largest_torque(config),
                slew_per_tick: config.device.limits.slew_per_tick.0,
                fade_per_tick: I2F30::ONE / fade_ticks,
            },
            loaded_torque: stillness::loaded_torque(
                device.limits.torque.0,
                device.mechanism.dry_friction.0.saturating_mul(device.roller_radius.0).unsigned_abs(),
                check::at_rest(device),
            ),
            thermal: ThermalLimits::new(
                config.device.limits.continuous_torque,
                config.device.limits.winding_time_s,
            ),
            runaway: runaway::Bounds::new(
                mm_per_count,
                config.device.roller_radius.0,
                config.device.limits.max_counts_per_tick,
            ),
            bounce_damping: BounceDamping::new(config.device.passivity_damping),
            damping: I2F30::saturating_from_num(config.device.damping.0),
            compensation: check::prepare(device),
            dac: DacScale::new(device),
            encoder_sign: if device.encoder_reversed { -1 } else { 1 },
            travel_counts: counts_reaching(config.device.limits.travel, mm_per_count).unsigned_abs(),
            heartbeat_ticks: u32::from(config.device.limits.heartbeat_ms) * TICK_HZ / 1000,
            config: config.clone(),
        })
    }

    /// Checks a line of the needle as [`Plan::new`] would a patient whose layers it meets there:
    /// one depth for each layer, each deeper than the one before and within the travel, and no more
    /// force than the motor gives.
    pub fn check_line(&self, line: &NeedleLine) -> Result<(), Refusal> {
        layers::check_line(self, line)
    }

    /// Returns the line of a needle that has not turned: the layers of the patient, and of a vessel
    /// the height at which the needle goes through it beside its axis.
    pub fn own_line(&self) -> NeedleLine {
        let mut line = NeedleLine { depths: self.patient().layers.iter().map(|layer| layer.depth).collect() };
        for met in &self.anatomy.layers {
            if let Some(depth) = line.depths.get_mut(usize::from(met.number)) {
                *depth = met.depth;
            }
        }
        line
    }

    /// The configuration that this came from.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Length of one count along the needle, in mm.
    pub fn mm_per_count(&self) -> I2F30 {
        self.scale.mm_per_count
    }

    /// The device's part of it.
    pub fn device(&self) -> &Device {
        &self.config.device
    }

    /// The patient's part of it.
    pub fn patient(&self) -> &Patient {
        &self.config.patient
    }

    /// The largest force at the roller within the torque limit and the patient's own.
    pub fn largest_force(&self) -> Newtons {
        Newtons(largest_force(&self.config))
    }

    /// Returns the tissue of layer `index`.
    pub fn tissue(&self, index: u8) -> Option<Tissue> {
        self.config.patient.layers.get(usize::from(index)).map(|layer| layer.tissue)
    }

    /// The code of zero torque.
    pub fn zero_torque_code(&self) -> crate::units::DacCode {
        self.dac.zero()
    }
}

/// The bounds of a law that acts in `layers`.
fn force_limits<'a>(config: &Config, layers: &'a [law::LayerHit]) -> law::ForceLimits<'a> {
    let Device { roller_radius, counts_per_turn, limits, .. } = config.device;
    law::ForceLimits {
        layers,
        configured: config.patient.layers.len(),
        travel: limits.travel.0,
        largest: largest_asked(config),
        stiffest: stiffest(config),
        count: I16F16::saturating_from_num(mm_per_count(roller_radius, counts_per_turn)),
    }
}

/// Checks a device on its own, whoever the patient.
pub(crate) fn check_device(device: &Device) -> Result<(), Refusal> {
    let limits = &device.limits;
    within(Field::RollerRadius, device.roller_radius.0, milli(4_000), milli(25_000))?;
    // A count is held as I16F16 here: half the counts fit its range.
    within(
        Field::CountsPerTurn,
        I16F16::from_num(device.counts_per_turn / 2),
        milli(128_000),
        milli(32_767_000),
    )?;
    within(Field::FullScaleTorque, device.full_scale_torque.0, milli(10_000), milli(500_000))?;
    within(Field::TorqueLimit, limits.torque.0, milli(100), device.full_scale_torque.0)?;
    within(Field::ContinuousTorque, limits.continuous_torque.0, milli(3_000), milli(180_000))?;
    within(
        Field::WindingTimeS,
        I16F16::from_num(limits.winding_time_s.min(30_000)),
        milli(1_000),
        milli(600_000),
    )?;
    within(Field::SlewPerTick, limits.slew_per_tick.0, milli(1), milli(100_000))?;
    within(
        Field::FadeInMs,
        I16F16::from_num(limits.fade_in_ms.min(30_000)),
        milli(10_000),
        milli(5_000_000),
    )?;
    within(
        Field::MaxCountsPerTick,
        I16F16::from_num(limits.max_counts_per_tick.min(30_000)),
        milli(2_000),
        milli(1_000_000),
    )?;
    within(Field::Travel, limits.travel.0, milli(1_000), milli(500_000))?;
    check_stiffness(device)?;
    within(
        Field::HeartbeatMs,
        I16F16::from_num(limits.heartbeat_ms.min(30_000)),
        milli(20_000),
        milli(5_000_000),
    )?;
    within(Field::SkinTilt, I16F16::from_num(device.skin_tilt.0), milli(-1_571_000), milli(1_571_000))?;
    let zero = I16F16::from_num(device.dac.span() / 16);
    within(Field::DacZero, I16F16::from_num(device.dac_zero), -zero, zero)?;
    let damping = I16F16::saturating_from_num(device.damping.0);
    if !(0..=LARGEST_DAMPING_BITS).contains(&device.damping.0.to_bits()) {
        return Err(Refusal::OutOfRange {
            field: Field::Damping,
            value: damping,
            low: I16F16::ZERO,
            high: milli(1),
        });
    }
    // 0.02 N·s/mm: at 50 mm/s a newton.
    let passivity = I16F16::saturating_from_num(device.passivity_damping.0);
    within(Field::PassivityDamping, passivity, I16F16::ZERO, milli(20))?;
    check::check(device, device.compensation.gains)
}

/// The stiffness that the device allows is one that its mechanism bears.
fn check_stiffness(device: &Device) -> Result<(), Refusal> {
    let (mechanism, stiffness) = (&device.mechanism, device.limits.stiffness.0);
    within(Field::MovingMass, mechanism.mass.0, milli(1_000), milli(1_000_000))?;
    within(Field::MechanismFriction, mechanism.dry_friction.0, I16F16::ZERO, milli(10_000))?;
    within(
        Field::DriveDelayUs,
        I16F16::from_num(mechanism.delay_us.min(30_000)),
        milli(20_000),
        milli(1_000_000),
    )?;
    within(Field::StiffnessLimit, stiffness, milli(50), stability::STEEPEST)?;
    let limit = stability::stiffest(device).0;
    if stiffness > limit { Err(Refusal::WouldRing { stiffness, limit }) } else { Ok(()) }
}

/// No patient asks for more than the device's torque ceiling.
fn check_ceiling(config: &Config) -> Result<(), Refusal> {
    let Some(Newtons(force)) = config.patient.largest_force else { return Ok(()) };
    let ceiling = config.device.limits.torque.0.saturating_div(config.device.roller_radius.0);
    if force > ceiling {
        return Err(Refusal::AboveCeiling { force, ceiling });
    }
    within(Field::LargestForce, force, milli(10), ceiling)
}

/// Returns the force of the torque limit at the roller, mN·m over mm being N, or less where the
/// patient wants less.
fn largest_force(config: &Config) -> I16F16 {
    let ceiling = config.device.limits.torque.0.saturating_div(config.device.roller_radius.0);
    config.patient.largest_force.map_or(ceiling, |force| force.0.min(ceiling))
}

/// The force that a law may ask for: more than the device gives where the scale that is declared
/// makes it less.
fn largest_asked(config: &Config) -> I16F16 {
    largest_force(config).saturating_div(config.patient.scale)
}

/// The slope that a law may have.
fn stiffest(config: &Config) -> I16F16 {
    config.device.limits.stiffness.0.saturating_div(config.patient.scale)
}

/// The torque that [`largest_force`] takes.
fn largest_torque(config: &Config) -> I16F16 {
    let ceiling = config.device.limits.torque.0;
    let wanted =
        config.patient.largest_force.map(|force| force.0.saturating_mul(config.device.roller_radius.0));
    wanted.map_or(ceiling, |torque| torque.min(ceiling))
}
