//! Samples a second that become frames and frames that become samples again, and by turns with it,
//! as its peer, postcard alone on the same blocks: no checksum, no COBS, no number, no search for
//! the end of a frame.
//!
//! `cargo run --release -p link --example frame_speed`

use control_core::controller::Sample;
use link::codec::{self, MAX_FRAME};
use link::frames::{BLOCK_SAMPLES, DeviceFrame, Numbered, SampleBlock};
use link::host::Reception;
use std::hint::black_box;
use std::time::Instant;

/// Blocks of a run: 3.2 s of the device.
const BLOCKS: usize = 1_000;
const RUNS: usize = 31;

fn main() {
    let blocks: Vec<SampleBlock> = (0..BLOCKS).map(block).collect();
    let (mut ours, mut alone) = (vec![], vec![]);
    for _ in 0..RUNS {
        ours.push(rate(|| framed(&blocks)));
        alone.push(rate(|| plain(&blocks)));
    }
    println!("frame_samples_per_s={:.0}", median(ours));
    println!("frame_samples_per_s.peer=postcard-alone frame_samples_per_s.peer_value={:.0}", median(alone));
}

/// An insertion at 16 mm/s, as the virtual device sends it.
fn block(number: usize) -> SampleBlock {
    let sample = |index: usize| {
        let tick = (number * BLOCK_SAMPLES + index) as i32;
        Sample {
            count: tick / 10,
            dac: 2_048 - (tick / 40 % 1_000) as u16,
            state: 3,
            tilt_mrad: 520 + (tick / 100 % 7) as i16,
        }
    };
    SampleBlock {
        first_tick: (number * BLOCK_SAMPLES) as u64,
        samples: (0..BLOCK_SAMPLES).map(sample).collect(),
    }
}

/// Frames there and back; the samples that arrived.
fn framed(blocks: &[SampleBlock]) -> u64 {
    let mut reception = Reception::default();
    let mut bytes = [0; MAX_FRAME];
    for (sequence, block) in (0_u32..).zip(blocks) {
        let frame = Numbered { sequence, frame: DeviceFrame::Samples(block.clone()) };
        let length = codec::encode(black_box(&frame), &mut bytes).expect("a block fits a frame");
        let mut bytes = black_box(&bytes[..length]);
        while let Some(frame) = reception.take(&mut bytes) {
            black_box(&frame);
        }
    }
    reception.counts().samples
}

/// The same blocks by postcard alone.
fn plain(blocks: &[SampleBlock]) -> u64 {
    let mut bytes = [0; MAX_FRAME];
    let there_and_back = |block: &SampleBlock| {
        let written = postcard::to_slice(black_box(block), &mut bytes).expect("a block fits");
        let read: SampleBlock = postcard::from_bytes(black_box(written)).expect("it was written just now");
        black_box(read).samples.len() as u64
    };
    blocks.iter().map(there_and_back).sum()
}

/// Samples a second; all of them have to arrive.
fn rate(run: impl FnOnce() -> u64) -> f64 {
    let begin = Instant::now();
    let samples = run();
    let seconds = begin.elapsed().as_secs_f64();
    assert_eq!(samples, (BLOCKS * BLOCK_SAMPLES) as u64, "every sample arrives");
    samples as f64 / seconds
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
