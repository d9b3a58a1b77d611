//! Scatterers of random strength, the same in every run.

use crate::scene::SAMPLES;

/// Scatterers that columns are cut from.
const NOISE: usize = 1 << 16;

/// Returns where the column of scatterers begins that lies at a place of the body.
pub(crate) fn column_start(column: i64, cell: i64, turned: i64) -> usize {
    let mut mixed = (column as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15)
        ^ (cell as u64).wrapping_mul(0xC2B2_AE3D_27D4_EB4F)
        ^ (turned as u64).wrapping_mul(0x1656_67B1_9E37_79F9);
    mixed = (mixed ^ (mixed >> 29)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    ((mixed >> 20) as usize) % (NOISE - SAMPLES)
}

/// In-phase and quadrature of scatterers: two Gaussian numbers each (Box and Muller), of variance a
/// half.
pub(crate) fn scatterers(seed: u64) -> [Vec<f32>; 2] {
    let mut state = seed;
    let mut unit = || {
        // SplitMix64: the same on every machine.
        state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1_u32 << 24) as f32
    };
    let mut parts = [Vec::with_capacity(NOISE), Vec::with_capacity(NOISE)];
    for _ in 0..NOISE {
        let radius = (-(1.0 - unit()).ln()).sqrt();
        let (sine, cosine) = (std::f32::consts::TAU * unit()).sin_cos();
        parts[0].push(radius * cosine);
        parts[1].push(radius * sine);
    }
    parts
}
