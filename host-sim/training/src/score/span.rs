//! The ticks of an attempt in the samples and events of a recording.

use control_core::controller::Sample;
use link::frames::Event;
use recording::stretches::Stretch;

/// Ticks of an insertion and where they are.
#[derive(Clone, Copy, Debug)]
pub struct Span<'a> {
    /// The whole that it is a part of.
    pub stretch: &'a Stretch,
    /// First tick.
    pub begin: u64,
    /// Tick after the last.
    pub end: u64,
}

impl Span<'_> {
    /// Its samples, 10 kHz.
    pub fn samples(&self) -> &[Sample] {
        &self.stretch.samples[self.at(self.begin)..self.at(self.end)]
    }

    pub(crate) fn at(&self, tick: u64) -> usize {
        (tick.clamp(self.stretch.first_tick, self.stretch.end_tick()) - self.stretch.first_tick) as usize
    }

    /// Events in it.
    pub fn events(&self) -> impl Iterator<Item = &Event> + '_ {
        self.stretch.events.iter().filter(|e| (self.begin..=self.end).contains(&e.tick))
    }

    /// Depth along the needle at `tick`, mm.
    pub fn depth_mm(&self, tick: u64) -> Option<f64> {
        let sample = self.stretch.samples.get(self.at(tick))?;
        Some(f64::from(sample.count) * self.stretch.hello.mm_per_count)
    }
}
