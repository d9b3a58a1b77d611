//! The inputs to choose from, scaled to a machine's limits, its dry friction and its counts.

use crate::case::{Case, Limits};
use crate::input::{Segment, Signal};

/// Sines of a multisine; more do not fit into the device's excitation.
const LINES: usize = 12;
/// The signals hold the plant's limits by themselves with this much room for the servo's overshoot.
const ROOM: f64 = 0.85;

/// Returns the segments to choose from for a case; `seed` varies frequencies, ratios and speeds.
pub(crate) fn candidates(case: &Case, seed: u64) -> Vec<Segment> {
    let limits = case.limits.usable();
    let rig = &case.rivals[0].rig;
    let count = 1.0 / rig.encoder.counts_per_unit.abs();
    let dry = rig.model.coulomb.unwrap_or(0.0).clamp(0.01 * limits.force, 0.3 * limits.force);
    let mut random = Random(seed);
    let mut out = Vec::new();
    staircases(&mut out, &limits, &mut random);
    strokes(&mut out, &limits, &mut random);
    ladders(&mut out, &limits, count);
    let highest = highest_hz(case.reading_s);
    for (low, high) in [(1, 12), (3, 60), (5, 400), (60, 500)] {
        let high = high.min(highest);
        if high < 2 * low {
            continue;
        }
        let frequencies = frequencies(low, high, &mut random);
        for share in [0.4, 1.0, 3.0] {
            let force = (share * dry).min(ROOM * limits.force / LINES as f64);
            let signal = Signal::Multisine { force, frequencies: frequencies.clone() };
            out.push(Segment { signal, seconds: 5.0 });
        }
    }
    for force in [3.0 * dry, ROOM * limits.force] {
        out.push(Segment { signal: Signal::Ramps { force, ramp_s: 0.25 }, seconds: 4.0 });
    }
    out.push(Segment { signal: Signal::Hold, seconds: 2.0 });
    out
}

/// Readings by which two blocks of a fast recording are apart, s.
const BLOCK_S: f64 = 2.6e-3;
/// Periods of a sine between two readings of a slow recording that still show its force.
const PERIODS: f64 = 0.2;

/// The highest frequency that recordings show, Hz, `reading_s` being the time between two readings:
/// blocks of a fast recording hold some of what is faster than they are, and rows of a slow one do
/// not.
fn highest_hz(reading_s: f64) -> u16 {
    if reading_s <= BLOCK_S { u16::MAX } else { (PERIODS / reading_s) as u16 }
}

fn staircases(out: &mut Vec<Segment>, limits: &Limits, random: &mut Random) {
    for (top, dwell_s, steps) in [(1.0, 0.4, 8_u8), (0.3, 0.5, 8), (1.0, 0.3, 5)] {
        let fastest = (ROOM * top * limits.speed).min(ROOM * limits.travel / dwell_s);
        let ratio = random.between(1.8, 2.1);
        let slowest = fastest / ratio.powi(i32::from(steps) - 1);
        let signal = Signal::Staircase { slowest, ratio, steps, dwell_s };
        out.push(Segment { signal, seconds: 2.0 * dwell_s * f64::from(steps) });
    }
}

fn strokes(out: &mut Vec<Segment>, limits: &Limits, random: &mut Random) {
    for (part, leg_s, seconds) in [(0.04, 3.0, 6.0), (0.15, 1.5, 6.0), (0.5, 1.0, 6.0), (0.3, 1.2, 16.0)] {
        let speed = ROOM * part * limits.speed * random.between(0.9, 1.1);
        let stroke = (speed * leg_s).min(ROOM * limits.travel);
        out.push(Segment { signal: Signal::Triangle { stroke, speed }, seconds });
    }
}

fn ladders(out: &mut Vec<Segment>, limits: &Limits, count: f64) {
    for part in [0.015, 0.06] {
        let speed = ROOM * part * limits.speed;
        let (smallest, steps) = (4.0 * count, 9_u8);
        // Eight seconds there and back over all amplitudes, within the travel.
        let largest = (2.0 * speed).min(ROOM * limits.travel).max(2.0 * smallest);
        let ratio = (largest / smallest).powf(1.0 / f64::from(steps - 1)).clamp(1.0, 4.0);
        let signal = Signal::Ladder { smallest, ratio, steps, speed };
        out.push(Segment { signal, seconds: 8.0 });
    }
}

/// Frequencies between two, spaced by equal ratios that a seed disturbs, each once.
fn frequencies(low: u16, high: u16, random: &mut Random) -> Vec<u16> {
    let ratio = (f64::from(high) / f64::from(low)).powf(1.0 / (LINES - 1) as f64);
    let mut out: Vec<u16> = (0..LINES)
        .map(|i| (f64::from(low) * ratio.powf(i as f64 + random.between(-0.2, 0.2))).round().max(1.0) as u16)
        .collect();
    out.sort_unstable();
    out.dedup();
    out
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        low + (high - low) * ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Returns a multisine of a random band and strength within 80 % of the limits, `dry` being the dry
/// friction: what a design is compared with.
pub fn random_multisine(limits: &Limits, dry: f64, seed: u64, seconds: f64) -> Segment {
    let limits = limits.usable();
    let mut random = Random(seed ^ 0xA5A5);
    let low = (random.between(0.0, 60_f64.ln()).exp() as u16).max(1);
    let high = (f64::from(low) * random.between(6.0, 40.0)).clamp(20.0, 500.0) as u16;
    let dry = dry.clamp(0.01 * limits.force, 0.3 * limits.force);
    let force = (dry * random.between(0.3, 2.0)).min(ROOM * limits.force / LINES as f64);
    let frequencies = frequencies(low, high, &mut random);
    Segment { signal: Signal::Multisine { force, frequencies }, seconds }
}
