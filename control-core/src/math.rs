//! Fixed-point helpers that the laws share.

use fixed::types::{I2F30, I16F16};

/// log2(e).
const LOG2_E: I2F30 = I2F30::from_bits(1_549_082_005);
/// Taylor coefficients of 2^f, f in [−0.5, 0.5): lnⁿ2/n! in Q30. The remainder is below 2.5e-6.
const EXP2: [I2F30; 6] = [
    I2F30::from_bits(1_073_741_824),
    I2F30::from_bits(744_261_118),
    I2F30::from_bits(257_941_248),
    I2F30::from_bits(59_597_086),
    I2F30::from_bits(10_327_388),
    I2F30::from_bits(1_431_680),
];

/// e^x for 0 ≤ x ≤ 8 (clamped to it), relative error below 5e-5.
pub(crate) fn exp(x: I16F16) -> I16F16 {
    let power = times(x.clamp(I16F16::ZERO, I16F16::from_bits(8 << 16)), LOG2_E);
    let whole = power.round();
    let fraction = I2F30::from_bits((power - whole).to_bits() << 14);
    let mantissa =
        EXP2.iter().rev().fold(I2F30::ZERO, |sum, c| c.saturating_add(sum.saturating_mul(fraction)));
    // 2^whole · mantissa: Q30 to Q16 is a shift by 14, of which `whole` is taken back.
    let shift = (14 - whole.to_num::<i32>()).clamp(1, 30);
    let rounded = (i64::from(mantissa.to_bits()) + (1_i64 << (shift - 1))) >> shift;
    I16F16::from_bits(i32::try_from(rounded).unwrap_or(i32::MAX))
}

/// `a · b`, saturating, with `b` in [−2, 2) and fine steps.
pub(crate) fn times(a: I16F16, b: I2F30) -> I16F16 {
    a.wide_mul(b).saturating_to_num()
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
    }
}
