//! The stiffness that a wall may have on a device, from its moving mass and friction and the delay
//! of its motor. It knows no tissue.
//!
//! With the roller at rest between two counts a wall pushes with either of two forces, `K·Δ` apart:
//! dry friction `f` holds both where `K ≤ 2f/Δ` (Abbott and Okamura, IEEE Trans. Robotics 21, 2005;
//! Diolaiti et al., the same 22, 2006). A force that is late by `τ` is a spring with a damping of
//! `−K·τ`. A swing of speed `v` dies away where friction takes more than that gives, by describing
//! function `4f/π ≥ K·τ·v`, if the delay is short against the swing, `τ·√(K/m) ≤ φ`.

use crate::config::Device;
use crate::kinematics::mm_per_count;
use crate::units::Stiffness;
use fixed::types::{I16F16, I32F32};

/// 7 N/mm: the most that the tick's fixed point holds.
pub(crate) const STEEPEST: I16F16 = I16F16::from_bits(7 << 16);
/// A code is held for a tick: half of it on the average is delay, µs.
const HELD_US: i64 = 50;
/// `4/(π·v)` for a knock of 42 mm/s, in µs/mm: with it 2 N/mm go with 0.01 N and one tick of delay,
/// as the design notes measured.
const SWING: i64 = 30_315;
/// φ² for a quarter of a radian, in N·µs²/(g·mm).
const SHORT: i64 = 62_500;

/// The largest [`crate::config::SafetyConfig::stiffness`] that `device` may have.
pub fn stiffest(device: &Device) -> Stiffness {
    Stiffness(stiffest_with(device, I16F16::ONE))
}

/// The steepest slope that `device` renders without ringing while `friction_share` of its dry
/// friction is left where the needle moves, N/mm.
pub(crate) fn stiffest_with(device: &Device, friction_share: I16F16) -> I16F16 {
    let mechanism = &device.mechanism;
    let friction = I32F32::from_num(mechanism.dry_friction.0);
    let count = I32F32::from_num(mm_per_count(device.roller_radius, device.counts_per_turn));
    let delay_us = HELD_US + i64::from(mechanism.delay_us);
    let between_counts = (friction * 2).saturating_div(count.max(I32F32::DELTA));
    let moving = friction.saturating_mul(I32F32::from_num(friction_share));
    let late = moving.saturating_mul_int(SWING) / delay_us;
    let short = I32F32::from_num(mechanism.mass.0).saturating_mul_int(SHORT) / delay_us / delay_us;
    I16F16::saturating_from_num(between_counts.min(late).min(short)).min(STEEPEST)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Mechanism;
    use crate::units::{Grams, Newtons};

    /// N/mm, of so much dry friction in N, grams and µs of delay.
    fn of(friction: f64, grams: f64, delay_us: u16) -> f64 {
        let mechanism = Mechanism {
            mass: Grams(I16F16::from_num(grams)),
            dry_friction: Newtons(I16F16::from_num(friction)),
            delay_us,
        };
        stiffest(&Device { mechanism, ..Device::commissioned_virtual() }).0.to_num()
    }

    #[test]
    fn each_of_friction_mass_and_delay_bounds_the_stiffness() {
        let near = |a: f64, b: f64| assert!((a - b).abs() < 0.01, "{a} for {b}");
        // 2·0.01/0.0157, with a fine encoder's count.
        near(of(0.01, 30.0, 100), 1.273);
        near(of(0.03, 30.0, 300), 0.03 * 30_315.0 / 350.0);
        near(of(0.06, 2.0, 300), 2.0 * 62_500.0 / 350.0 / 350.0);
        near(of(0.06, 30.0, 100), 7.0);
        assert_eq!(of(0.0, 30.0, 100), 0.0);
    }
}
