//! The sine of a phase, for what is periodic: excitations, and forces that repeat with the turn of
//! the rotor.

use crate::math::upper_half;
use fixed::types::I2F30;

/// Sine of a phase of which 2^32 is a turn; error below 1e-4. Straight lines between 256 points:
/// twelve sines are to fit a tick.
pub(crate) fn sine(phase: u32) -> I2F30 {
    let &[from, to] =
        SINE_Q30.get((phase >> 24) as usize..).and_then(<[i32]>::first_chunk).unwrap_or(&[0, 0]);
    // The rest of the phase in Q31, and a way of which the last bit is free.
    let way = upper_half((to - from) << 1, (phase << 8 >> 1).cast_signed());
    I2F30::from_bits(from + way)
}

/// A turn of the sine and its first point again.
static SINE_Q30: [i32; 257] = sine_table();

#[expect(clippy::indexing_slicing, reason = "evaluated by the compiler")]
const fn sine_table() -> [i32; 257] {
    const HALF_PI_Q30: i64 = 1_686_629_713;
    const QUARTER: i64 = 64;
    let mut table = [0; 257];
    let mut place = 0;
    while place < 257 {
        // From −1 to 1 quarter turns; beyond a quarter the sine runs back.
        let turn = (place as i64 + 2 * QUARTER) % (4 * QUARTER) - 2 * QUARTER;
        let folded = if turn > QUARTER {
            2 * QUARTER - turn
        } else if turn < -QUARTER {
            -2 * QUARTER - turn
        } else {
            turn
        };
        let x = HALF_PI_Q30 * folded / QUARTER;
        // x·(1 − x²/(2·3)·(1 − x²/(4·5)·(…))), to x¹³.
        let square = (x * x) >> 30;
        let (mut sum, mut n) = (1_i64 << 30, 12);
        while n > 0 {
            sum = (1 << 30) - ((square * sum) >> 30) / (n * (n + 1));
            n -= 2;
        }
        table[place] = ((x * sum) >> 30) as i32;
        place += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sine_follows_its_twin() {
        for step in 0..4096_u32 {
            let phase = step << 20;
            let exact = (f64::from(step) / 4096.0 * core::f64::consts::TAU).sin();
            let got = sine(phase).to_num::<f64>();
            assert!((got - exact).abs() < 1e-4, "{step}: {got} for {exact}");
        }
    }
}
