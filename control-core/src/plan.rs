//! From a [`Config`] to a [`Plan`] the tick can run: everything is checked and every division done here. A configuration
//! that is unstable, overflows or asks for more than the motor has is refused with the reason, never clamped.

use crate::TICK_HZ;
use crate::config::{Config, FrictionLaw, Layer, MAX_LAYERS, Parabola, Tissue, Wall};
use crate::friction::Law;
use crate::jog;
use crate::kinematics::{Scale, counts_reaching, mm_per_count};
use crate::passivity::BounceDamping;
use crate::runaway;
use crate::safety::{DacScale, TorqueLimits};
use crate::thermal::ThermalLimits;
use crate::tissue::{self, Layers};
use crate::units::{Millimetres, Newtons};
use core::fmt;
use fixed::types::{I2F30, I16F16, U16F16};
use serde::{Deserialize, Serialize};

/// A wall heals when the tip is this far outside it: 0.2 mm.
const HEAL_DISTANCE: I16F16 = I16F16::from_bits(13_107);
/// A force that appears at contact all at once is felt as a hit and rings: at most 0.05 N.
const LARGEST_CONTACT_STEP: I16F16 = I16F16::from_bits(3_277);
/// 7 N/mm: the stiffness limit with one tick of delay.
const LARGEST_STIFFNESS: I16F16 = I16F16::from_bits(7 << 16);
/// 0.0005 N·s/mm: with 30 g and the speed estimate's 6 ms of delay, more would itself ring.
const LARGEST_DAMPING_BITS: i32 = 8_389;
/// Torque at which an encoder without a count counts as dead: an eighth of the limit, several times the dry friction of motor
/// and needle.
const FROZEN_TORQUE_SHARE: u32 = 8;

/// A configuration that may run.
#[derive(Clone, Debug)]
pub struct Plan {
    pub(crate) config: Config,
    pub(crate) scale: Scale,
    pub(crate) layers: Layers,
    pub(crate) torque_limits: TorqueLimits,
    /// Torque under which a motor that is not held moves.
    pub(crate) frozen_torque: U16F16,
    pub(crate) thermal: ThermalLimits,
    pub(crate) bounce_damping: BounceDamping,
    pub(crate) runaway: runaway::Bounds,
    pub(crate) damping: I2F30,
    pub(crate) dac: DacScale,
    pub(crate) travel_counts: u32,
    pub(crate) heartbeat_ticks: u32,
}

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
    /// Layers overlap, or a wall gives way only inside the next one.
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
    /// There is no layer.
    Empty,
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
    LayerTop,
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
                write!(f, "layer {layer} begins before the one above it has given way; move it deeper")
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
            Refusal::Empty => f.write_str("there is no layer; add one"),
        }
    }
}

impl Plan {
    /// Checks `config` and prepares it for the tick.
    pub fn new(config: &Config) -> Result<Self, Refusal> {
        check_device(config)?;
        let mm_per_count = mm_per_count(config.device.roller_radius, config.device.counts_per_turn);
        let scale = Scale::new(mm_per_count);
        check_friction(config)?;
        let layers = plan_layers(config, scale)?;
        let fade_ticks = i32::from(config.limits.fade_in_ms.cast_signed()) * (TICK_HZ / 1000) as i32;
        Ok(Self {
            scale,
            layers,
            torque_limits: TorqueLimits {
                torque: config.limits.torque.0,
                slew_per_tick: config.limits.slew_per_tick.0,
                fade_per_tick: I2F30::ONE / fade_ticks,
            },
            frozen_torque: config.limits.torque.0.unsigned_abs() / FROZEN_TORQUE_SHARE,
            thermal: ThermalLimits::new(config.limits.continuous_torque, config.limits.winding_time_s),
            runaway: runaway::Bounds::new(
                mm_per_count,
                config.device.roller_radius.0,
                config.limits.max_counts_per_tick,
            ),
            bounce_damping: BounceDamping::new(config.passivity_damping),
            damping: I2F30::saturating_from_num(config.damping.0),
            dac: DacScale::new(config.device.dac, config.device.full_scale_torque),
            travel_counts: counts_reaching(config.limits.travel, mm_per_count).unsigned_abs(),
            heartbeat_ticks: u32::from(config.limits.heartbeat_ms) * TICK_HZ / 1000,
            config: config.clone(),
        })
    }

    /// The configuration that this came from.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Length of one count along the needle, in mm.
    pub fn mm_per_count(&self) -> I2F30 {
        self.scale.mm_per_count
    }

    /// The largest force at the roller within the torque limit.
    pub fn largest_force(&self) -> Newtons {
        Newtons(largest_force(&self.config))
    }

    /// What layer `index` is made of.
    pub fn tissue(&self, index: u8) -> Option<Tissue> {
        self.layers.layers.get(usize::from(index)).map(|l| l.tissue)
    }

    /// The code of zero torque.
    pub fn zero_torque_code(&self) -> crate::units::DacCode {
        self.dac.zero()
    }
}

pub(crate) fn within(field: Field, value: I16F16, low: I16F16, high: I16F16) -> Result<(), Refusal> {
    if value < low || value > high { Err(Refusal::OutOfRange { field, value, low, high }) } else { Ok(()) }
}

/// Q16 of thousandths, for the ranges below.
const fn milli(thousandths: i64) -> I16F16 {
    I16F16::from_bits((thousandths * 65_536 / 1000) as i32)
}

fn check_device(config: &Config) -> Result<(), Refusal> {
    let device = &config.device;
    let limits = &config.limits;
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
    within(Field::StiffnessLimit, limits.stiffness.0, milli(50), LARGEST_STIFFNESS)?;
    within(
        Field::HeartbeatMs,
        I16F16::from_num(limits.heartbeat_ms.min(30_000)),
        milli(20_000),
        milli(5_000_000),
    )?;
    let damping = I16F16::saturating_from_num(config.damping.0);
    if !(0..=LARGEST_DAMPING_BITS).contains(&config.damping.0.to_bits()) {
        return Err(Refusal::OutOfRange {
            field: Field::Damping,
            value: damping,
            low: I16F16::ZERO,
            high: milli(1),
        });
    }
    // 0.02 N·s/mm: at 50 mm/s a newton.
    let passivity = I16F16::saturating_from_num(config.passivity_damping.0);
    within(Field::PassivityDamping, passivity, I16F16::ZERO, milli(20))
}

fn check_friction(config: &Config) -> Result<(), Refusal> {
    let layer = config.layers.len() as u8;
    let limit = config.limits.stiffness.0;
    match config.friction {
        FrictionLaw::Paper { level_length, level_cap, anchor_ms, stiffness, limit: force } => {
            within(Field::LevelLength, level_length.0, milli(1_000), milli(1_000_000))?;
            within(Field::LevelCap, level_cap, milli(1_000), milli(32_000))?;
            within(Field::AnchorMs, I16F16::from_num(anchor_ms.min(30_000)), milli(5_000), milli(1_000_000))?;
            within(Field::FrictionStiffness, stiffness.0, milli(1), limit)?;
            within(Field::FrictionLimit, force.0, milli(1), largest_force(config))?;
            let slope = friction_slope(&config.friction);
            if slope > limit { Err(Refusal::TooStiff { layer, slope, limit }) } else { Ok(()) }
        }
        FrictionLaw::Cone { stiffness } => within(Field::FrictionStiffness, stiffness.0, milli(50), limit),
    }
}

/// The steepest slope of friction.
fn friction_slope(law: &FrictionLaw) -> I16F16 {
    match *law {
        FrictionLaw::Paper { stiffness, level_cap, .. } => stiffness.0.saturating_mul(level_cap),
        FrictionLaw::Cone { stiffness } => stiffness.0,
    }
}

/// What the torque limit gives at the roller: mN·m over mm is N.
fn largest_force(config: &Config) -> I16F16 {
    config.limits.torque.0.saturating_div(config.device.roller_radius.0)
}

fn plan_layers(config: &Config, scale: Scale) -> Result<Layers, Refusal> {
    let (mut layers, mut walls) = (heapless::Vec::new(), heapless::Vec::<_, MAX_LAYERS>::new());
    let mut friction_above = I16F16::ZERO;
    for (index, layer) in config.layers.iter().enumerate() {
        let number = index as u8;
        let above = config.layers.get(..index).unwrap_or_default();
        check_order(layer, above, number, config)?;
        if let Some(above) = above.last() {
            let thickness = layer.top.0.saturating_sub(above.top.0);
            friction_above = friction_above.saturating_add(thickness.saturating_mul(above.friction.0));
        }
        if let Some(wall) = &layer.wall {
            check_wall(wall, number, friction_above, config)?;
        }
        within(Field::Friction, layer.friction.0, I16F16::ZERO, milli(1_900))?;
        let at = |depth: I16F16| counts_reaching(Millimetres(depth), scale.mm_per_count);
        let ready = tissue::Layer {
            tissue: layer.tissue,
            top: layer.top,
            contact: at(layer.top.0),
            exit: at(layer.top.0.saturating_sub(HEAL_DISTANCE)),
            walls_above: walls.len(),
            friction_per_mm: I2F30::saturating_from_num(layer.friction.0),
            friction_above: Newtons(friction_above),
        };
        if let Some(wall) = &layer.wall {
            let wall = tissue::Wall {
                layer: number,
                contact: ready.contact,
                puncture: at(layer.top.0.saturating_add(wall.puncture_travel.0)),
                jog: jog::Wall::new(wall, layer.top),
            };
            // All vectors hold MAX_LAYERS: the push cannot fail, nor the one below.
            let _ = walls.push(wall);
        }
        let _ = layers.push(ready);
    }
    check_deepest(config, friction_above)?;
    Layers::new(layers, walls, plan_friction(&config.friction)).ok_or(Refusal::Empty)
}

/// A layer begins below the one above it, and a wall below the depth at which the wall above it gives way, whatever lies
/// between the two.
fn check_order(layer: &Layer, above: &[Layer], number: u8, config: &Config) -> Result<(), Refusal> {
    within(Field::LayerTop, layer.top.0, I16F16::ZERO, milli(500_000))?;
    let is_above = above.last().is_none_or(|above| above.top.0 < layer.top.0);
    let wall_above = above.iter().rev().find(|above| above.wall.is_some());
    let is_past_wall = layer.wall.is_none() || wall_above.is_none_or(|above| gives_way(above) < layer.top.0);
    if !is_above || !is_past_wall {
        return Err(Refusal::Overlap { layer: number });
    }
    if gives_way(layer) >= config.limits.travel.0 {
        Err(Refusal::BeyondTravel { layer: number })
    } else {
        Ok(())
    }
}

/// The depth at which the layer's wall gives way; where there is none, its top.
fn gives_way(layer: &Layer) -> I16F16 {
    layer.top.0.saturating_add(layer.wall.map_or(I16F16::ZERO, |wall| wall.puncture_travel.0))
}

fn check_wall(wall: &Wall, layer: u8, friction: I16F16, config: &Config) -> Result<(), Refusal> {
    for parabola in [&wall.elastic, &wall.relief] {
        check_parabola(parabola)?;
    }
    within(Field::PunctureTravel, wall.puncture_travel.0, milli(50), milli(30_000))?;
    within(Field::UnloadStiffness, wall.unload.0, milli(50), config.limits.stiffness.0)?;
    if wall.elastic.vertex.0 > I16F16::ZERO || wall.relief.vertex.0 <= wall.puncture_travel.0 {
        return Err(Refusal::WrongWay { layer });
    }
    let limit = config.limits.stiffness.0;
    let slope = wall.puncture_travel.0.saturating_sub(wall.elastic.vertex.0).saturating_mul_int(2);
    let slope = slope.saturating_div(wall.elastic.compliance.0);
    // Inside tissue the needle feels the wall and the hold of friction together.
    let hold = friction_slope(&config.friction);
    let slope =
        if layer > 0 { slope.saturating_add(hold) } else { slope }.max(wall.unload.0.saturating_add(hold));
    if slope > limit {
        return Err(Refusal::TooStiff { layer, slope, limit });
    }
    let elastic = jog::Parabola::new(&wall.elastic, Millimetres::default());
    let relief = jog::Parabola::new(&wall.relief, Millimetres::default());
    let step = elastic.force(Millimetres::default()).0;
    if step.unsigned_abs() > LARGEST_CONTACT_STEP.unsigned_abs() {
        return Err(Refusal::ContactStep { layer, force: step });
    }
    let peak = elastic.force(wall.puncture_travel).0;
    if relief.force(wall.puncture_travel).0 > peak {
        return Err(Refusal::ReliefAboveElastic { layer });
    }
    let force = peak.saturating_add(friction);
    let limit = largest_force(config);
    if force > limit { Err(Refusal::TooStrong { layer, force, limit }) } else { Ok(()) }
}

fn check_parabola(parabola: &Parabola) -> Result<(), Refusal> {
    within(Field::Compliance, parabola.compliance.0, milli(50), milli(1_000_000))?;
    within(Field::PunctureTravel, parabola.vertex.0, milli(-30_000), milli(100_000))?;
    within(Field::BaseForce, parabola.base.0, milli(-20_000), milli(20_000))
}

/// At the end of the travel friction is largest.
fn check_deepest(config: &Config, friction_above: I16F16) -> Result<(), Refusal> {
    let Some(last) = config.layers.last() else { return Err(Refusal::Empty) };
    let inside = config.limits.travel.0.saturating_sub(last.top.0);
    let force = inside.saturating_mul(last.friction.0).saturating_add(friction_above);
    let limit = largest_force(config);
    let layer = config.layers.len() as u8 - 1;
    if force > limit { Err(Refusal::TooStrong { layer, force, limit }) } else { Ok(()) }
}

fn plan_friction(law: &FrictionLaw) -> Law {
    match *law {
        FrictionLaw::Paper { level_length, level_cap, anchor_ms, stiffness, limit } => Law::Paper {
            per_level_length: I2F30::saturating_from_num(I2F30::ONE.wide_div(level_length.0)),
            level_cap,
            follow: follow_share(anchor_ms),
            stiffness,
            limit,
        },
        FrictionLaw::Cone { stiffness } => {
            Law::Cone { stiffness, inverse_stiffness: I16F16::ONE.saturating_div(stiffness.0) }
        }
    }
}

/// `1 − e^{−T/τ}` for T of one tick: with T/τ ≤ 0.02 three terms of the series leave less than 1e-8.
fn follow_share(anchor_ms: u16) -> I2F30 {
    let y = I2F30::ONE / i32::from(anchor_ms.max(1)) / 10;
    let y2 = y.saturating_mul(y);
    y - y2 / 2 + y2.saturating_mul(y) / 6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_anchor_follows_by_its_share_of_a_tick() {
        for anchor_ms in [5_u16, 60, 1_000] {
            let exact = -(-0.1 / f64::from(anchor_ms)).exp_m1();
            let share = follow_share(anchor_ms).to_num::<f64>();
            assert!((share - exact).abs() < 1.2e-8, "{anchor_ms} ms: {share} for {exact}");
        }
    }
}
