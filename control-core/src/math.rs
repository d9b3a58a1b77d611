//! Fixed-point helpers that the laws share. A product here is one multiplication and a handful of moves on the board; the
//! general conversions of `fixed` take forty instructions.

use fixed::types::{I2F30, I16F16};

/// log2(e).
const LOG2_E: I2F30 = I2F30::from_bits(1_549_082_005);
/// Taylor coefficients of 2^f, f in [−0.5, 0.5): lnⁿ2/n! in Q30. The remainder is below 2.5e-6.
const EXP2_Q30: [i32; 6] = [1_073_741_824, 744_261_118, 257_941_248, 59_597_086, 10_327_388, 1_431_680];

/// e^x for 0 ≤ x ≤ 8 (clamped to it), relative error below 5e-5.
pub(crate) fn exp(x: I16F16) -> I16F16 {
    let x = x.clamp(I16F16::ZERO, I16F16::from_bits(8 << 16));
    let power = scaled(x.to_bits(), LOG2_E.to_bits(), 30);
    // Round(x·log2(e)), 0 to 12; what is left of it lies in [−0.5, 0.5).
    let whole = (power + (1 << 15)) >> 16;
    let fraction_q32 = (power - (whole << 16)) << 16;
    let mantissa_q30 =
        EXP2_Q30.iter().rev().fold(0, |sum, coefficient| coefficient + upper_half(sum, fraction_q32));
    // 2^whole · mantissa: Q30 to Q16 is a shift by 14, of which `whole` is taken back.
    let shift = 14 - whole;
    I16F16::from_bits((mantissa_q30 + (1 << (shift - 1))) >> shift)
}

/// `a · b`, saturating, with `b` in [−2, 2) and fine steps.
pub(crate) fn times(a: I16F16, b: I2F30) -> I16F16 {
    I16F16::from_bits(product(a.to_bits(), b.to_bits(), 30))
}

/// `a · b`, saturating.
pub(crate) fn multiply(a: I16F16, b: I16F16) -> I16F16 {
    I16F16::from_bits(product(a.to_bits(), b.to_bits(), 16))
}

/// `a · b` without its last `places` bits, towards −∞; saturating.
pub(crate) fn product(a: i32, b: i32, places: u32) -> i32 {
    saturate((i64::from(a) * i64::from(b)) >> places)
}

/// `a · b` without its last `places` bits, towards −∞, where it is known to fit: half the instructions of [`product`].
pub(crate) fn scaled(a: i32, b: i32, places: u32) -> i32 {
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
    fn a_product_is_exact_or_the_nearest_there_is() {
        let edges = [i32::MIN, i32::MIN + 1, -65_536, -3, -1, 0, 1, 2, 65_535, 1 << 30, i32::MAX];
        for (a, b) in edges.iter().flat_map(|&a| edges.map(|b| (a, b))) {
            for places in [0, 1, 16, 30] {
                let exact = (i128::from(a) * i128::from(b)) >> places;
                let nearest = exact.clamp(i32::MIN.into(), i32::MAX.into());
                assert_eq!(i128::from(product(a, b, places)), nearest, "{a} · {b} >> {places}");
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
