//! A hand on the needle: a spring and a damper towards where it wants the tip, and physiological
//! tremor (8–12 Hz).

use std::f64::consts::TAU;

/// Sines that make the tremor.
const SINES: usize = 6;
/// Band of physiological tremor, Hz (Elble and Koller 1990).
const BAND: (f64, f64) = (8.0, 12.0);
const TICK_S: f64 = 1e-4;

/// The stiffness and damping of the grip on the needle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grip {
    /// N/m.
    pub stiffness_n_per_m: f64,
    /// N·s/m.
    pub damping_n_s_per_m: f64,
    /// Root mean square of the tremor, m.
    pub tremor_rms_m: f64,
    /// The same seed gives the same tremor.
    pub seed: u64,
}

/// A hand and the phase of its tremor.
#[derive(Clone, Debug)]
pub struct Hand {
    grip: Grip,
    sines: [Sine; SINES],
    ticks: u32,
    /// The position at which the hand took hold; it does so without a jerk.
    start: f64,
}

/// A sine as a pair that turns by a fixed angle each tick.
#[derive(Clone, Copy, Debug, Default)]
struct Sine {
    cos: f64,
    sin: f64,
    turn: (f64, f64),
    rad_per_s: f64,
}

impl Hand {
    /// A hand at rest at `start` m.
    pub fn new(grip: Grip, start: f64) -> Self {
        let mut random = SplitMix(grip.seed);
        let width = (BAND.1 - BAND.0) / SINES as f64;
        let sines = std::array::from_fn(|index| {
            // One sine in each part of the band, so that every seed fills it.
            let hertz = BAND.0 + width * (index as f64 + random.unit());
            let phase = TAU * random.unit();
            let per_tick = TAU * hertz * TICK_S;
            Sine {
                cos: libm::cos(phase),
                sin: libm::sin(phase),
                turn: libm::sincos(per_tick),
                rad_per_s: TAU * hertz,
            }
        });
        Self { grip, sines, ticks: 0, start }
    }

    /// Returns the hand's position at the beginning, m.
    pub fn start(&self) -> f64 {
        self.start
    }

    /// Moves the tremor on by a tick: displacement in m and its speed in m/s.
    pub(crate) fn tremor_tick(&mut self) -> (f64, f64) {
        if self.grip.tremor_rms_m == 0.0 {
            return (0.0, 0.0);
        }
        self.ticks = self.ticks.wrapping_add(1);
        // The mean square of a sine is a half.
        let amplitude = self.grip.tremor_rms_m * (2.0 / SINES as f64).sqrt();
        let mut sum = (0.0, 0.0);
        for sine in &mut self.sines {
            let (turn_sin, turn_cos) = sine.turn;
            let cos = sine.cos * turn_cos - sine.sin * turn_sin;
            sine.sin = sine.cos * turn_sin + sine.sin * turn_cos;
            sine.cos = cos;
            sum.0 += amplitude * sine.sin;
            sum.1 += amplitude * sine.rad_per_s * sine.cos;
        }
        if self.ticks.is_multiple_of(1 << 16) {
            self.renormalise();
        }
        sum
    }

    /// Rounding lets the pairs grow or shrink by an ulp a tick.
    fn renormalise(&mut self) {
        for sine in &mut self.sines {
            let length = libm::hypot(sine.cos, sine.sin);
            sine.cos /= length;
            sine.sin /= length;
        }
    }

    /// Force on the needle in N, towards `wanted` (m, m/s); none where the hand has let go.
    #[inline]
    pub fn force(&self, wanted: Option<(f64, f64)>, tip: f64, tip_speed: f64) -> f64 {
        let Some((place, speed)) = wanted else { return 0.0 };
        self.grip.stiffness_n_per_m * (place - tip) + self.grip.damping_n_s_per_m * (speed - tip_speed)
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014): the same numbers on every machine and with every
/// release.
struct SplitMix(u64);

impl SplitMix {
    /// A number from 0 up to 1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tremor(seed: u64, seconds: u32) -> Vec<(f64, f64)> {
        let grip = Grip { stiffness_n_per_m: 1e3, damping_n_s_per_m: 10.0, tremor_rms_m: 3e-5, seed };
        let mut hand = Hand::new(grip, 0.0);
        (0..seconds * 10_000).map(|_| hand.tremor_tick()).collect()
    }

    #[test]
    fn tremor_has_its_size_and_band_and_follows_its_seed() {
        for seed in 0..8 {
            let all = tremor(seed, 20);
            let rms = (all.iter().map(|t| t.0 * t.0).sum::<f64>() / all.len() as f64).sqrt();
            assert!((rms / 3e-5 - 1.0).abs() < 0.1, "seed {seed}: {rms} m");
            let crossings = all.windows(2).filter(|w| w[0].0 <= 0.0 && w[1].0 > 0.0).count();
            assert!((160..=240).contains(&crossings), "seed {seed}: {crossings} periods in 20 s");
            for pair in all.windows(2).step_by(97) {
                let slope = (pair[1].0 - pair[0].0) / TICK_S;
                assert!((slope - (pair[0].1 + pair[1].1) / 2.0).abs() < 1e-6, "its speed is its slope");
            }
        }
        assert_eq!(tremor(5, 1), tremor(5, 1));
        assert_ne!(tremor(5, 1), tremor(6, 1));
    }
}
