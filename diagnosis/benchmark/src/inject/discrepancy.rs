//! A flexible discrepancy for the plain rival: the part of a machine that no law covers is a smooth
//! force over speed, travel, time, the way since a reversal and the drive's force, a Gaussian
//! process of reduced rank (Solin and Särkkä 2020). Every hypothesis carries it, the one without a
//! law included, orthogonal to its own regressors (Plumlee 2017) and with the scale of the
//! hypothesis without one, so that a law wins by its shape and not by taking something.

use std::f64::consts::PI;
use std::ops::Range;

use super::regress::Block;
use super::sight::Sight;

/// A cosine's prior variance falls beyond this many half waves in the range of its input.
const SMOOTH: f64 = 3.0;
/// Rows in the band for one that says something new: four are kept for every period of the band.
const ROWS_FOR_ONE: f64 = 2.0;
/// Ratios of the discrepancy's size to the noise that are tried, a factor apart.
const LEAST_RATIO: f64 = 1e-2;
const RATIO_STEP: f64 = 2.0;
const RATIOS: usize = 16;
/// A pivot below this part of its column does not count: the column depends on others.
const PIVOT: f64 = 1e-10;

/// An input of the discrepancy: its value at a point of a recording, the range of all recordings,
/// and its cosines; `reverses` where the force turns with the direction.
struct Input {
    value: fn(&Sight, &[f64], usize) -> f64,
    cosines: usize,
    reverses: bool,
}

const INPUTS: [Input; 7] = [
    Input { value: |s, _, i| s.speed[i], cosines: 10, reverses: false },
    Input { value: |s, _, i| s.place[i], cosines: 10, reverses: false },
    Input { value: |s, _, i| s.place[i], cosines: 6, reverses: true },
    Input { value: |s, _, i| s.time[i], cosines: 6, reverses: false },
    Input { value: |s, _, i| s.time[i], cosines: 4, reverses: true },
    Input { value: |s, _, i| s.since_reversal[i], cosines: 8, reverses: true },
    Input { value: |_, drive, i| drive[i], cosines: 8, reverses: false },
];

/// The functions of the discrepancy on every recording to fit on.
pub(crate) struct Basis {
    columns: Vec<Vec<Vec<f64>>>,
    /// Standard deviation of each function's weight in units of the discrepancy's size, its column
    /// of unit size.
    spread: Vec<f64>,
}

impl Basis {
    /// `drive` is the predicted force of the drive on each recording's grid.
    pub(crate) fn new(sights: &[Sight], drive: &[Vec<f64>]) -> Self {
        let mut out = Self { columns: vec![Vec::new(); sights.len()], spread: Vec::new() };
        for input in &INPUTS {
            let along = |(sight, drive): (&Sight, &Vec<f64>)| -> Vec<f64> {
                (0..sight.time.len()).map(|i| (input.value)(sight, drive, i)).collect()
            };
            let values: Vec<Vec<f64>> = sights.iter().zip(drive).map(along).collect();
            let all = || values.iter().flatten().copied();
            let (low, high) = (all().fold(f64::MAX, f64::min), all().fold(f64::MIN, f64::max));
            if high <= low {
                continue;
            }
            // A constant is the offset of a recording, unless it turns with the direction.
            for half_waves in usize::from(!input.reverses)..input.cosines {
                let of = |(sight, values): (&Sight, &Vec<f64>)| {
                    let wave = |x: f64| (half_waves as f64 * PI * (x - low) / (high - low)).cos();
                    let sign = |i: usize| if input.reverses { sight.direction[i] } else { 1.0 };
                    let column: Vec<f64> =
                        values.iter().enumerate().map(|(i, x)| sign(i) * wave(*x)).collect();
                    sight.see(&column)
                };
                let columns: Vec<Vec<f64>> = sights.iter().zip(&values).map(of).collect();
                let (sum, rows) =
                    columns.iter().flatten().fold((0.0, 0.0), |(sum, rows), x| (sum + x * x, rows + 1.0));
                let size = f64::sqrt(sum / f64::max(rows, 1.0));
                if size > 0.0 {
                    out.spread.push(1.0 / size / (1.0 + (half_waves as f64 / SMOOTH).powi(2)));
                    out.columns.iter_mut().zip(columns).for_each(|(all, one)| all.push(one));
                }
            }
        }
        out
    }

    /// Sums of products of the regressors, the functions and the target, in this order.
    fn products(&self, blocks: &[Block]) -> (Products, Range<usize>, Range<usize>) {
        let own = blocks.first().map_or(0, |block| block.columns.len());
        let flexible = own..own + self.spread.len();
        let mut products = Products::new(flexible.end + 1);
        for (block, functions) in blocks.iter().zip(&self.columns) {
            let columns: Vec<&[f64]> =
                block.columns.iter().chain(functions).chain([&block.target]).map(Vec::as_slice).collect();
            products.add(&columns);
        }
        (products, 0..own, flexible)
    }

    /// The discrepancy's size and the noise under a hypothesis, by the largest evidence.
    pub(crate) fn scale(&self, blocks: &[Block]) -> Scale {
        let rows = rows(blocks);
        let (mut products, own, flexible) = self.products(blocks);
        products.eliminate(own);
        let of = |ratio: f64| {
            let (left, volume) = products.flexible(flexible.clone(), &self.spread, ratio);
            let noise = (left / rows).max(f64::MIN_POSITIVE);
            (-0.5 * rows * noise.ln() - 0.5 * volume, Scale { noise, ratio })
        };
        let ratios = (0..RATIOS).map(|k| LEAST_RATIO * RATIO_STEP.powi(k as i32));
        let best = ratios.map(of).max_by(|a, b| a.0.total_cmp(&b.0));
        best.map_or(Scale { noise: 1.0, ratio: LEAST_RATIO }, |(_, scale)| scale)
    }

    /// Logarithm of the evidence of a hypothesis, less what its regressors' freedom is worth
    /// (Schwarz), nats; of the same scale only.
    pub(crate) fn evidence(&self, blocks: &[Block], scale: Scale) -> f64 {
        let (mut products, own, flexible) = self.products(blocks);
        let freedom = products.eliminate(own).0 as f64;
        let (left, volume) = products.flexible(flexible, &self.spread, scale.ratio);
        -0.5 * left / scale.noise - 0.5 * volume - 0.5 * freedom * rows(blocks).ln()
    }
}

/// Rows that say something new.
fn rows(blocks: &[Block]) -> f64 {
    blocks.iter().map(|block| block.target.len()).sum::<usize>() as f64 / ROWS_FOR_ONE
}

/// Variance of the noise, and the discrepancy's size over it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    noise: f64,
    ratio: f64,
}

/// A symmetric matrix of sums of products.
#[derive(Clone)]
struct Products {
    width: usize,
    sums: Vec<f64>,
}

impl Products {
    fn new(width: usize) -> Self {
        Self { width, sums: vec![0.0; width * width] }
    }

    fn add(&mut self, columns: &[&[f64]]) {
        for (i, a) in columns.iter().enumerate() {
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                let sum = a.iter().zip(*b).map(|(a, b)| a * b).sum::<f64>() / ROWS_FOR_ONE;
                self.sums[i * self.width + j] += sum;
                if i != j {
                    self.sums[j * self.width + i] += sum;
                }
            }
        }
    }

    /// Takes columns out of all others by least squares; returns how many were independent and the
    /// logarithm of their determinant.
    fn eliminate(&mut self, columns: Range<usize>) -> (usize, f64) {
        let (n, mut count, mut volume) = (self.width, 0, 0.0);
        let whole: Vec<f64> = columns.clone().map(|p| self.sums[p * n + p]).collect();
        for (p, whole) in columns.zip(whole) {
            let pivot = self.sums[p * n + p];
            if pivot <= PIVOT * whole {
                continue;
            }
            (count, volume) = (count + 1, volume + pivot.ln());
            let row: Vec<f64> = self.sums[p * n..(p + 1) * n].to_vec();
            for i in 0..n {
                let factor = row[i] / pivot;
                if factor != 0.0 {
                    let out = &mut self.sums[i * n..(i + 1) * n];
                    out.iter_mut().zip(&row).for_each(|(x, r)| *x -= factor * r);
                }
            }
        }
        (count, volume)
    }

    /// The target's square that functions of some spread leave, in units of the noise, and the
    /// logarithm of the volume that they take.
    fn flexible(&self, functions: Range<usize>, spread: &[f64], ratio: f64) -> (f64, f64) {
        let (mut scaled, n, first) = (self.clone(), self.width, functions.start);
        for (k, spread) in spread.iter().enumerate() {
            for other in 0..n {
                scaled.sums[(first + k) * n + other] *= ratio * spread;
                scaled.sums[other * n + first + k] *= ratio * spread;
            }
            scaled.sums[(first + k) * n + first + k] += 1.0;
        }
        let (_, volume) = scaled.eliminate(functions);
        (scaled.sums[n * n - 1], volume)
    }
}
