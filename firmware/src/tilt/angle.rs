//! Angles without floating point: the tilt task may not use the floating-point unit, whose
//! registers every interrupt would then have to save.

use super::Acceleration;
use control_core::units::Milliradians;

/// `atan(2^-i)` in 1/1024 mrad.
const ARC_TANGENTS: [i32; 15] = [
    804_248, 474_774, 250_858, 127_340, 63_918, 31_989, 15_998, 7_999, 4_000, 2_000, 1_000, 500, 250, 125, 62,
];

/// `atan2(y, x)` in mrad for `x ≥ 0`, |x| and |y| up to 16,383, by CORDIC in vectoring mode; within
/// 1 mrad from a length of 100 on.
fn arc_tangent(y: i32, x: i32) -> Milliradians {
    // Sixteen more bits than the input: the shifts below lose none that matter.
    let (mut x, mut y) = (i64::from(x) << 16, i64::from(y) << 16);
    let mut angle = 0;
    for (shift, step) in ARC_TANGENTS.into_iter().enumerate() {
        let (dx, dy) = (y >> shift, x >> shift);
        if y > 0 {
            (x, y, angle) = (x + dx, y - dy, angle + step);
        } else {
            (x, y, angle) = (x - dx, y + dy, angle - step);
        }
    }
    Milliradians(((angle + 512) >> 10) as i16)
}

/// Inclination of the x axis below the horizontal: an axis that points down measures −1 g.
pub(crate) fn below_horizontal(acceleration: Acceleration) -> Milliradians {
    let Acceleration { x_mg, y_mg, z_mg } = acceleration;
    let square = |mg: i32| mg.unsigned_abs().saturating_mul(mg.unsigned_abs());
    let across = square(y_mg).saturating_add(square(z_mg)).isqrt();
    arc_tangent(-x_mg, across as i32)
}

/// The angle whose sine is `sine_milli` thousandths; clamped to a right angle.
pub(crate) fn from_sine(sine_milli: i32) -> Milliradians {
    let sine = sine_milli.clamp(-1000, 1000);
    let cosine = (1_000_000 - sine * sine).unsigned_abs().isqrt();
    arc_tangent(sine, cosine as i32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against floating point, over every direction at 1 g.
        #[test]
        fn follows_the_arc_tangent(pitch in -1.5_f64..1.5, roll in -3.1_f64..3.1) {
            let acceleration = Acceleration {
                x_mg: (-1000.0 * pitch.sin()).round() as i32,
                y_mg: (1000.0 * pitch.cos() * roll.sin()).round() as i32,
                z_mg: (1000.0 * pitch.cos() * roll.cos()).round() as i32,
            };
            let error = f64::from(below_horizontal(acceleration).0) - 1000.0 * pitch;
            prop_assert!(error.abs() <= 2.0, "{error}");
        }

        #[test]
        fn follows_the_arc_sine(sine in -1000_i32..=1000) {
            let error = f64::from(from_sine(sine).0) - 1000.0 * (f64::from(sine) / 1000.0).asin();
            // The root under the cosine is a whole number: coarse near a right angle.
            prop_assert!(error.abs() <= 2.0, "{error} at {sine}");
        }

        #[test]
        fn nothing_overflows(x in any::<i16>(), y in any::<i16>(), z in any::<i16>()) {
            let (x_mg, y_mg, z_mg) = (x.into(), y.into(), z.into());
            let tilt = below_horizontal(Acceleration { x_mg, y_mg, z_mg });
            prop_assert!((-1600..=1600).contains(&tilt.0));
        }
    }

    #[test]
    fn an_axis_that_points_down_is_inclined() {
        assert_eq!(below_horizontal(Acceleration { x_mg: -1000, y_mg: 0, z_mg: 0 }).0, 1571);
        assert_eq!(below_horizontal(Acceleration { x_mg: 0, y_mg: 0, z_mg: 1000 }).0, 0);
        assert_eq!(from_sine(1500).0, 1571);
    }
}
