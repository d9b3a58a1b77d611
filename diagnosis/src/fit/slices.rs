//! Rows of a block taken together, for laws that are faster than a block and slower than a row.
//! They hold time stamps unchanged and nothing of what a law makes of them.

use crate::fit::input::Input;
use std::ops::Range;

/// Some rows on end, with what a force held over them does to the block's mean.
#[derive(Debug, Clone)]
pub(crate) struct Slice {
    pub(crate) rows: Range<usize>,
    /// Start since that of the block, and length, s.
    pub(crate) start: f64,
    pub(crate) span: f64,
    /// Sums over the rows of the time since the slice's start, s, and of half its square, s².
    tau1: f64,
    tau2: f64,
    /// Part of the way from the middle of its block to that of the one before or after at which its
    /// own middle is.
    pub(crate) aside: f64,
    pub(crate) is_late: bool,
}

/// A recording's slices, as many in every block.
#[derive(Debug, Clone)]
pub(crate) struct Slices {
    per_block: usize,
    rows_per_block: usize,
    slices: Vec<Slice>,
}

impl Slices {
    /// Cuts blocks of rows into slices of `rows` or less; `row_hold` is how long each row lasts, s.
    pub(crate) fn new(row_hold: &[f64], rows_per_block: usize, rows: usize) -> Self {
        let mut slices = Vec::with_capacity(row_hold.len() / rows + 1);
        for (block, hold) in row_hold.chunks_exact(rows_per_block).enumerate() {
            let (mut first, mut start) = (block * rows_per_block, 0.0);
            for hold in hold.chunks(rows) {
                let (mut span, mut tau1, mut tau2) = (0.0, 0.0, 0.0);
                for h in hold {
                    tau1 += span;
                    tau2 += 0.5 * span * span;
                    span += h;
                }
                let rows = first..first + hold.len();
                slices.push(Slice { rows, start, span, tau1, tau2, aside: 0.0, is_late: false });
                first += hold.len();
                start += span;
            }
        }
        Self { per_block: rows_per_block.div_ceil(rows), rows_per_block, slices }
    }

    /// Says of each slice where in its block its middle is; `spans` are the lengths of the blocks,
    /// s.
    pub(crate) fn place_in(&mut self, spans: &[f64]) {
        for (slices, block) in self.slices.chunks_exact_mut(self.per_block).zip(spans) {
            for slice in slices {
                let part = (slice.start + 0.5 * slice.span) / block - 0.5;
                (slice.aside, slice.is_late) = (part.abs(), part >= 0.0);
            }
        }
    }

    /// Mean of a command over each slice; `row_hold` is how long each row lasts.
    pub(crate) fn means(&self, command: &[f64], row_hold: &[f64]) -> Vec<f64> {
        let mean = |slice: &Slice| {
            let (command, hold) = (&command[slice.rows.clone()], &row_hold[slice.rows.clone()]);
            command.iter().zip(hold).map(|(u, h)| u * h).sum::<f64>() / slice.span
        };
        self.slices.iter().map(mean).collect()
    }

    /// The slices of each block.
    pub(crate) fn blocks(&self) -> impl Iterator<Item = &[Slice]> {
        self.slices.chunks_exact(self.per_block)
    }

    /// Number of slices in a block.
    pub(crate) fn per_block(&self) -> usize {
        self.per_block
    }

    /// Returns the input of a signal held slice by slice.
    pub(crate) fn input(&self, signal: &[f64]) -> Input {
        let blocks = self.slices.len() / self.per_block;
        let [mut dv, mut dq, mut dz] = [0; 3].map(|_| Vec::with_capacity(blocks));
        for (slices, signal) in self.blocks().zip(signal.chunks_exact(self.per_block)) {
            let (mut v, mut q, mut sum) = (0.0, 0.0, 0.0);
            for (slice, a) in slices.iter().zip(signal) {
                sum += q * slice.rows.len() as f64 + v * slice.tau1 + a * slice.tau2;
                q += (v + 0.5 * a * slice.span) * slice.span;
                v += a * slice.span;
            }
            dv.push(v);
            dq.push(q);
            dz.push(sum / self.rows_per_block as f64);
        }
        Input::Rows { dv, dq, dz }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::fit::blocked_recording::BlockedRecording;

    #[test]
    fn a_signal_held_by_slices_does_what_it_does_held_row_by_row() {
        let rows = 1001;
        let recording = Recording {
            time_s: (0..rows).map(|i| 1e-4 * (f64::from(i) + 0.3 * f64::from(i % 7) / 7.0)).collect(),
            command: vec![0.0; rows as usize],
            position_counts: vec![0.0; rows as usize],
            ..Recording::default()
        };
        let track = BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.0));
        let slices = Slices::new(&track.rows.hold, track.rows.per_block, 7);
        let signal: Vec<f64> = (0..slices.slices.len()).map(|i| (0.7 * i as f64).sin()).collect();
        let by_row: Vec<f64> = slices
            .slices
            .iter()
            .zip(&signal)
            .flat_map(|(slice, a)| std::iter::repeat_n(*a, slice.rows.len()))
            .collect();
        let (Input::Rows { dv, dq, dz }, Input::Rows { dv: dv_row, dq: dq_row, dz: dz_row }) =
            (slices.input(&signal), track.rows.input(&by_row))
        else {
            panic!("both are held by rows");
        };
        for (some, by_row) in [(dv, dv_row), (dq, dq_row), (dz, dz_row)] {
            assert_eq!(some.len(), track.block_count());
            let largest = by_row.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            assert!(some.iter().zip(&by_row).all(|(a, b)| (a - b).abs() < 1e-12 * largest));
        }
    }
}
