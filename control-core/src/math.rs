//! Fixed-point helpers that the laws share. A product here is one multiplication and a handful of
//! moves on the board; the general conversions of `fixed` take forty instructions.

use crate::units::Milliradians;
use fixed::types::{I2F30, I8F24, I16F16};

/// log2(e).
const LOG2_E: I2F30 = I2F30::from_bits(1_549_082_005);
/// Taylor coefficients of 2^f, f in [−0.5, 0.5): lnⁿ2/n! in Q30. The remainder is below 2.5e-6.
const EXP2_Q30: [i32; 6] = [1_073_741_824, 744_261_118, 257_941_248, 59_597_086, 10_327_388, 1_431_680];

/// e^x for 0 ≤ x ≤ 8 (clamped to it), relative error below 5e-5.
pub(crate) fn exp(x: I16F16) -> I16F16 {
    let x = x.clamp(I16F16::ZERO, I16F16::from_bits(8 << 16));
    let power = truncating_product(x.to_bits(), LOG2_E.to_bits(), 30);
    // Round(x·log2(e)), 0 to 12; the rest is in [−0.5, 0.5).
    let whole = (power + (1 << 15)) >> 16;
    let fraction_q32 = (power - (whole << 16)) << 16;
    let mantissa_q30 = exp2_q30(fraction_q32);
    // 2^whole · mantissa: Q30 to Q16 is a shift by 14, of which `whole` is taken back.
    let shift = 14 - whole;
    I16F16::from_bits((mantissa_q30 + (1 << (shift - 1))) >> shift)
}

/// The sine of an angle from 0 to 1,571 mrad, to 1e-7.
pub(crate) fn sine(angle: Milliradians) -> I2F30 {
    /// A milliradian in Q29.
    const MRAD_Q29: i32 = 536_870;
    /// Its remainder in Q45.
    const REST_Q45: i32 = 59_768;
    /// 1/(2k(2k + 1)) of x·(1 − x²/6·(1 − x²/20·(1 − …))), innermost first, in Q32.
    const SHARES_Q32: [i32; 5] = [39_045_157, 59_652_324, 102_261_126, 214_748_365, 715_827_883];
    let mrad = i32::from(angle.0.clamp(0, 1_571));
    // Q29, below 1.571.
    let x = mrad * MRAD_Q29 + ((mrad * REST_Q45) >> 16);
    // Q28, below 2.47, so that a product with a share in Q32 stays in Q28.
    let square = upper_half(x, x) << 2;
    let one_q30 = 1 << 30;
    let series = SHARES_Q32.iter().fold(one_q30, |series, &share| {
        let term = upper_half(square, share);
        one_q30 - (((i64::from(term) * i64::from(series)) >> 28) as i32)
    });
    I2F30::from_bits(((i64::from(x) * i64::from(series)) >> 29) as i32)
}

/// `1/x` for x from 0.08 to 1, to 3e-7.
pub(crate) fn reciprocal(x: I2F30) -> I8F24 {
    let x = x.to_bits().max(85_899_346);
    // 12 bits and more by the division of 32 bits, twice as many after a step of Newton's.
    let rough_q16 = ((1_u32 << 31) / (x >> 15) as u32) as i32;
    let error_q30 = (1 << 30) - truncating_product(x, rough_q16, 16);
    I8F24::from_bits((rough_q16 << 8) + truncating_product(rough_q16, error_q30, 22))
}

/// e^−x for 0 ≤ x, to 1.2e-5: the last place of x·log2(e).
pub(crate) fn exp_negative(x: I16F16) -> I2F30 {
    // Beyond 21 nothing is left in 30 bits.
    let x = x.clamp(I16F16::ZERO, I16F16::from_bits(21 << 16));
    let power = -truncating_product(x.to_bits(), LOG2_E.to_bits(), 30);
    let whole = (power + (1 << 15)) >> 16;
    let mantissa_q30 = exp2_q30((power - (whole << 16)) << 16);
    I2F30::from_bits(mantissa_q30 >> -whole)
}

/// 2^f for f in [−0.5, 0.5), Q32 in, Q30 out.
fn exp2_q30(fraction_q32: i32) -> i32 {
    EXP2_Q30.iter().rev().fold(0, |sum, coefficient| coefficient + upper_half(sum, fraction_q32))
}

/// `part / whole` in Q28 for `0 ≤ part ≤ whole`, `whole` above zero, to 2e-5 of itself: two
/// divisions of 32 bits.
pub(crate) fn share(part: i32, whole: i32) -> i32 {
    let whole = whole.max(1).cast_unsigned();
    let places = whole.leading_zeros();
    // Its highest bit is set already; said so, the divisions need no check.
    let (part, whole) = (part.max(0).cast_unsigned() << places, (whole << places) >> 16 | 1 << 15);
    let first = part / whole;
    let rest = ((part - first * whole) << 12) / whole;
    ((first << 12) + rest).min(1 << 28).cast_signed()
}

/// [`I16F16::saturating_abs`] in two thirds of the instructions: the board subtracts saturating in
/// one.
pub(crate) fn magnitude(x: I16F16) -> I16F16 {
    x.max(I16F16::ZERO.saturating_sub(x))
}

/// `a · b`, saturating, with `b` in [−2, 2) and fine steps.
pub(crate) fn saturating_times(a: I16F16, b: I2F30) -> I16F16 {
    I16F16::from_bits(saturating_product(a.to_bits(), b.to_bits(), 30))
}

/// `a · b`, towards −∞; where it does not fit, a number of the same sign less than 1 from the
/// largest there is: half the instructions of the nearest.
pub(crate) fn saturating_multiply(a: I16F16, b: I16F16) -> I16F16 {
    let wide = i64::from(a.to_bits()) * i64::from(b.to_bits());
    let whole = ((wide >> 32) as i32).clamp(-1 << 15, (1 << 15) - 1);
    I16F16::from_bits(whole << 16 | (wide >> 16) as i32 & 0xFFFF)
}

/// `a · b` without its last `places` bits, towards −∞; saturating.
pub(crate) fn saturating_product(a: i32, b: i32, places: u32) -> i32 {
    saturate((i64::from(a) * i64::from(b)) >> places)
}

/// `a · b` without its last `places` bits, towards −∞, where it is known to fit: half the
/// instructions of [`saturating_product`]. Where it did not fit it could have the other sign: what
/// becomes the motor's torque is a product that saturates.
pub(crate) fn truncating_product(a: i32, b: i32, places: u32) -> i32 {
    let wide = (i64::from(a) * i64::from(b)) >> places;
    debug_assert!(i32::try_from(wide).is_ok(), "{a} · {b} >> {places}");
    wide as i32
}

/// `a · b / 2^32`, towards −∞: one instruction on the board.
pub(crate) fn upper_half(a: i32, b: i32) -> i32 {
    ((i64::from(a) * i64::from(b)) >> 32) as i32
}

/// The nearest number of 32 bits.
pub(crate) fn saturate(wide: i64) -> i32 {
    let (high, low) = ((wide >> 32) as i32, wide as i32);
    let sign = low >> 31;
    // Where the number fits, its upper half is nothing but the sign of the lower one.
    if high == sign { low } else { (high >> 31) ^ i32::MAX }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fixed::traits::ToFixed as _;

    #[test]
    fn exp_follows_its_twin() {
        for step in 0..=8 * 256 {
            let x = f64::from(step) / 256.0;
            let got = exp(x.to_fixed::<I16F16>()).to_num::<f64>();
            assert!((got / x.exp() - 1.0).abs() < 5e-5, "exp({x}) = {got}");
        }
        assert_eq!(exp(I16F16::MAX), exp(I16F16::from_bits(8 << 16)));
        assert_eq!(exp(I16F16::MIN), I16F16::ONE);
    }

    #[test]
    fn a_negative_power_and_a_share_follow_their_twins() {
        for step in 0..=12 * 256 {
            let x = f64::from(step) / 256.0;
            let got = exp_negative(x.to_fixed::<I16F16>()).to_num::<f64>();
            assert!((got - (-x).exp()).abs() < 1.2e-5, "exp(-{x}) = {got}");
        }
        assert_eq!(exp_negative(I16F16::MAX), 0);
        for whole in [1, 2, 3, 1_000, 65_537, 3_000_000, i32::MAX] {
            for part in [0, 1, whole / 7, whole / 2, whole - 1, whole].map(|part| part.min(whole)) {
                let exact = f64::from(part) / f64::from(whole);
                let got = f64::from(share(part, whole)) / f64::from(1 << 28);
                assert!((got - exact).abs() <= 3.1e-5 * exact + 5e-9, "{part}/{whole} = {got}");
            }
        }
    }

    #[test]
    fn sine_and_its_reciprocal_follow_their_twins() {
        for mrad in 0..=1_571_i16 {
            let exact = (f64::from(mrad) * 1e-3).sin();
            let got = sine(Milliradians(mrad));
            assert!((got.to_num::<f64>() - exact).abs() < 1e-7, "sin({mrad} mrad) = {got}, not {exact}");
            if exact > 0.08 {
                let inverse = reciprocal(got).to_num::<f64>();
                assert!((inverse * exact - 1.0).abs() < 4e-7, "1/sin({mrad} mrad) = {inverse}");
            }
        }
        assert_eq!(reciprocal(I2F30::ONE), I8F24::ONE);
        let straight = reciprocal(sine(Milliradians(1_571)));
        assert!(straight.abs_diff(I8F24::ONE).to_bits() <= 1, "straight in: {straight}");
    }

    #[test]
    fn a_product_is_exact_or_the_nearest_there_is() {
        let edges = [i32::MIN, i32::MIN + 1, -65_536, -3, -1, 0, 1, 2, 65_535, 1 << 30, i32::MAX];
        for (a, b) in edges.iter().flat_map(|&a| edges.map(|b| (a, b))) {
            for places in [0, 1, 16, 30] {
                let exact = (i128::from(a) * i128::from(b)) >> places;
                let nearest = exact.clamp(i32::MIN.into(), i32::MAX.into());
                assert_eq!(i128::from(saturating_product(a, b, places)), nearest, "{a} · {b} >> {places}");
            }
        }
    }

    #[test]
    fn a_product_in_q16_is_exact_or_large_with_its_own_sign() {
        let edges = [i32::MIN, i32::MIN + 1, -65_536, -3, -1, 0, 1, 2, 65_535, 1 << 30, i32::MAX];
        for (a, b) in edges.iter().flat_map(|&a| edges.map(|b| (a, b))) {
            let exact = (i64::from(a) * i64::from(b)) >> 16;
            let got = saturating_multiply(I16F16::from_bits(a), I16F16::from_bits(b)).to_bits();
            match i32::try_from(exact) {
                Ok(exact) => assert_eq!(got, exact, "{a} · {b}"),
                Err(_) => assert!(saturate(exact).abs_diff(got) < 1 << 16, "{a} · {b} is {got}"),
            }
        }
    }

    #[test]
    fn a_number_that_does_not_fit_becomes_the_nearest() {
        for wide in [i64::MIN, -(1 << 31) - 1, -(1 << 31), -1, 0, (1 << 31) - 1, 1 << 31, 1 << 32, i64::MAX] {
            assert_eq!(i64::from(saturate(wide)), wide.clamp(i32::MIN.into(), i32::MAX.into()), "{wide}");
        }
    }
}
