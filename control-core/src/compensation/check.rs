//! Checks that a compensation may be fed forward on a device, and prepares the values for the tick.

use super::feedforward::{FeedforwardPlan, ReadyWave};
use super::{Friction, Gains, VERSION, Wave};
use crate::config::Device;
use crate::refusal::{Field, Refusal, within};
use crate::stability;
use fixed::types::{I2F30, I16F16, I32F32, U16F16};

/// The largest share of what was found that is fed forward: 243/256. Rounding, wear and a rotor's
/// angle that is off by 2° stay below the rest.
const LARGEST_GAIN: u8 = 243;
/// A compensation may take this share of the torque ceiling; the rest is the law's.
const TORQUE_SHARE: i32 = 4;
/// Waves a turn: no more than one in so many counts.
const COUNTS_PER_WAVE: u16 = 8;

/// Checks that `device` may feed its compensation forward at `gains`.
pub fn check(device: &Device, gains: Gains) -> Result<(), Refusal> {
    let found = &device.compensation;
    if !found.is_some() {
        return Ok(());
    }
    within(Field::CompensationVersion, I16F16::from_num(found.version), version(), version())?;
    let zero = I16F16::ZERO;
    let torque = device.full_scale_torque.0;
    for wave in found.angle.iter().chain(&found.ripple) {
        let most = I16F16::saturating_from_num(device.counts_per_turn / COUNTS_PER_WAVE);
        within(Field::WaveOrder, I16F16::saturating_from_num(wave.order), zero, most)?;
    }
    for wave in &found.angle {
        within(Field::WaveAmplitude, wave.amplitude, zero, torque)?;
    }
    // A drive that gives nothing at some angle cannot be asked for more there.
    let half = I16F16::ONE / 2;
    within(Field::Ripple, amplitudes(&found.ripple), zero, half)?;
    for Friction { dry, viscous } in [found.inwards, found.outwards] {
        within(Field::DryFriction, dry.0, zero, torque)?;
        // 1 N·s/mm: at 1 mm/s a newton.
        within(Field::ViscousFriction, I16F16::from_num(viscous.0), zero, I16F16::ONE)?;
    }
    let window = crate::kinematics::mm_per_count(device.roller_radius, device.counts_per_turn);
    let one_count = I16F16::saturating_from_num(
        I32F32::from_num(window) * i64::from(crate::TICK_HZ) / i64::from(crate::kinematics::WINDOW_TICKS),
    );
    within(Field::RestSpeed, found.rest_speed.0, one_count, I16F16::from_num(100))?;
    within(Field::FullSpeed, found.full_speed.0, found.rest_speed.0 + I16F16::ONE, I16F16::from_num(200))?;
    within(Field::Weight, found.weight.0, -torque, torque)?;
    within(Field::DriveOffset, found.offset.0, -torque, torque)?;
    if found.deadband.0 != zero {
        within(Field::Deadband, found.deadband.0, I16F16::ONE / 1000, torque)?;
    }
    for (field, gain) in [
        (Field::AngleGain, gains.angle),
        (Field::FrictionGain, gains.friction),
        (Field::WeightGain, gains.weight),
        (Field::DriveGain, gains.drive),
    ] {
        within(field, gain.share(), zero, super::Gain(LARGEST_GAIN).share())?;
    }
    check_torque(device, gains)?;
    check_stability(device, gains)
}

/// All parts together stay within their share of the torque ceiling.
fn check_torque(device: &Device, gains: Gains) -> Result<(), Refusal> {
    let (torque, limit) = (largest(device, gains), device.limits.torque.0 / TORQUE_SHARE);
    if torque > limit { Err(Refusal::CompensationTooStrong { torque, limit }) } else { Ok(()) }
}

/// The largest torque that the parts together ask for, viscous friction apart, mN·m.
fn largest(device: &Device, gains: Gains) -> I16F16 {
    let found = &device.compensation;
    let dry = found.inwards.dry.0.max(found.outwards.dry.0);
    let drive = found.offset.0.saturating_abs().saturating_add(found.deadband.0);
    [
        (amplitudes(&found.angle), gains.angle),
        (dry, gains.friction),
        (found.weight.0.saturating_abs(), gains.weight),
        (drive, gains.drive),
    ]
    .into_iter()
    .fold(I16F16::ZERO, |sum, (torque, gain)| sum.saturating_add(torque.saturating_mul(gain.share())))
}

/// Friction is what keeps a stiff wall quiet that is a tick late; a wave by angle is a stiffness of
/// its own.
fn check_stability(device: &Device, gains: Gains) -> Result<(), Refusal> {
    let found = &device.compensation;
    let has_friction = found.inwards.dry.0.max(found.outwards.dry.0) > I16F16::ZERO;
    let taken = if has_friction { gains.friction.share() } else { I16F16::ZERO };
    let limit = stability::stiffest_with(device, I16F16::ONE - taken)
        .saturating_sub(steepest(device).saturating_mul(gains.angle.share()));
    let stiffness = device.limits.stiffness.0;
    if stiffness > limit { Err(Refusal::CompensationUnstable { stiffness, limit }) } else { Ok(()) }
}

/// The steepest slope of the waves by angle: `Σ order·amplitude/radius²`, N/mm.
fn steepest(device: &Device) -> I16F16 {
    let radius = I32F32::from_num(device.roller_radius.0);
    let per_radian = device.compensation.angle.iter().fold(I32F32::ZERO, |sum, wave| {
        sum.saturating_add(I32F32::from_num(wave.amplitude).saturating_mul(I32F32::from_num(wave.order)))
    });
    I16F16::saturating_from_num(per_radian / (radius * radius))
}

fn amplitudes(waves: &[Wave]) -> I16F16 {
    waves.iter().fold(I16F16::ZERO, |sum, wave| sum.saturating_add(wave.amplitude.saturating_abs()))
}

fn version() -> I16F16 {
    I16F16::from_num(VERSION)
}

/// Divides what the tick is not to divide. The device has passed [`check`].
pub(crate) fn prepare(device: &Device) -> FeedforwardPlan {
    let found = &device.compensation;
    let counts = u64::from(device.counts_per_turn.max(1));
    let per_speed = |friction: &Friction| {
        let torque =
            I32F32::from_num(friction.viscous.0).saturating_mul(I32F32::from_num(device.roller_radius.0));
        I2F30::saturating_from_num(torque)
    };
    // 2A/order rad, at counts/2π a rad.
    const PER_TWO_PI: I32F32 = I32F32::from_bits(683_565_276);
    let counts_a_radian = I32F32::from_num(device.counts_per_turn) * PER_TWO_PI;
    let store = found.angle.iter().filter(|wave| wave.order != 0).fold(I32F32::ZERO, |sum, wave| {
        let swing = I32F32::from_num(wave.amplitude) * 2 / i64::from(wave.order);
        sum.saturating_add(swing.saturating_mul(counts_a_radian))
    });
    let span = found.full_speed.0.saturating_sub(found.rest_speed.0);
    let inverse = |x: I16F16| I16F16::ONE.checked_div(x).unwrap_or_default();
    let mut plan = FeedforwardPlan {
        is_some: found.is_some(),
        viscous: [per_speed(&found.inwards), per_speed(&found.outwards)],
        per_blend: per_blend(span),
        per_deadband: inverse(found.deadband.0.saturating_mul_int(2)),
        store: store.to_bits() >> 16,
        ..FeedforwardPlan::default()
    };
    let turn_per_count = u32::try_from(((1_u64 << 32) + counts / 2) / counts).unwrap_or(u32::MAX);
    make_ready(&found.angle, turn_per_count, &mut plan.angle);
    make_ready(&found.ripple, turn_per_count, &mut plan.ripple);
    plan
}

/// The first wave of order 0 ends them. Out of line, and not once for each number of waves: it
/// takes less flash.
#[inline(never)]
fn make_ready(waves: &[Wave], turn_per_count: u32, ready: &mut [ReadyWave]) {
    for (ready, &wave) in ready.iter_mut().zip(waves.iter().take_while(|wave| wave.order != 0)) {
        *ready = ReadyWave::new(wave, turn_per_count);
    }
}

/// 1/span in s/mm, for a span of 1 mm/s and more.
fn per_blend(span: I16F16) -> I2F30 {
    I2F30::saturating_from_num(I32F32::ONE / I32F32::from_num(span.max(I16F16::ONE)))
}

/// Torque that is there even where no force is felt, next to which a needle at rest shows no dead
/// encoder, mN·m.
pub(crate) fn at_rest(device: &Device) -> U16F16 {
    let gains = Gains { friction: super::Gain(0), ..device.compensation.gains };
    largest(device, gains).unsigned_abs()
}
