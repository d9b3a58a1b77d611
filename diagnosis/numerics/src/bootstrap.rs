//! Block bootstrap of a sum of gains, with pseudo-random numbers that are the same on every
//! machine.

/// Deterministic pseudo-random numbers (xorshift64*), seeded by a constant.
pub struct Random(u64);

impl Random {
    /// Starts the sequence of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed | 1)
    }
    /// Returns the next number from 0 to `n` − 1.
    pub fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize) % n
    }
}

/// Gain over segments: mean, its standard error, and a bootstrap interval of the sum.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// The sum of all segments.
    pub sum: f64,
    /// Its bootstrap interval of 95 % begins here …
    pub low: f64,
    /// … and ends here.
    pub high: f64,
    /// Mean over standard error; neighbours are taken together so that what lasts longer than a
    /// segment counts once.
    pub z: f64,
    /// The same with the gain of each block limited.
    pub clipped_z: f64,
}

/// Resamplings of the bootstrap.
const RESAMPLED: usize = 400;
/// Largest gain that one block counts with, in log-likelihood.
const WITNESS: f64 = 10.0;
/// Standard errors that are reported for a gain without any spread.
const SUREST: f64 = 100.0;
/// Neighbouring segments that are taken together.
const SEGMENTS_A_BLOCK: usize = 3;

/// Sum of gains with a block-bootstrap interval of 95 %.
pub fn bootstrap(gains: &[f64]) -> Gain {
    let blocks: Vec<f64> = gains.chunks(SEGMENTS_A_BLOCK).map(|c| c.iter().sum()).collect();
    let n = blocks.len();
    let sum: f64 = blocks.iter().sum();
    let mut random = Random::new(0x9E37_79B9_7F4A_7C15);
    let mut sums: Vec<f64> = (0..RESAMPLED).map(|_| (0..n).map(|_| blocks[random.below(n)]).sum()).collect();
    sums.sort_by(f64::total_cmp);
    let over_error = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / n as f64;
        let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n.max(2) - 1) as f64;
        let error = (variance / n as f64).sqrt();
        // Every stretch at the limit is as sure as it gets.
        if error > 0.0 { mean / error } else { SUREST * mean.signum() * f64::from(mean != 0.0) }
    };
    let z = over_error(&blocks);
    // One stretch with a huge gain is one witness: each counts up to a limit.
    let limited: Vec<f64> = blocks.iter().map(|x| x.clamp(-WITNESS, WITNESS)).collect();
    let clipped_z = over_error(&limited);
    Gain { sum, low: sums[RESAMPLED * 25 / 1000], high: sums[RESAMPLED * 975 / 1000], z, clipped_z }
}
