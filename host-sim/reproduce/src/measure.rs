//! The measurements on a recording of a procedure: force over time and depth, what it was before
//! and after a wall gave way.

use control_core::TICK_HZ;
use device_sim::error::Error;
use device_sim::profile::Profile;
use link::frames::EventKind;
use recording::read::Recording;
use recording::stretches::{Stretch, stretches};
use std::ops::Range;
use training::score::target::Reached;
use training::score::{Insertion, Judge};

/// A procedure as it was recorded, in one piece.
pub(super) struct Trace {
    stretch: Stretch,
}

impl Trace {
    /// The longest piece of a recording.
    pub(super) fn of(recording: &Recording) -> Result<Self, Error> {
        let longest = stretches(recording).into_iter().max_by_key(|s| s.samples.len());
        let none = || Error::failed(format_args!("{}: nothing was recorded", recording.file));
        Ok(Self { stretch: longest.ok_or_else(none)? })
    }

    /// Force at the roller against insertion, N, at sample `index`.
    fn force_n(&self, index: usize) -> f64 {
        self.stretch.samples.get(index).map_or(0.0, |s| self.stretch.hello.force_n(s.dac))
    }

    fn depth_at(&self, index: usize) -> f64 {
        let count = self.stretch.samples.get(index).map_or(0, |s| s.count);
        f64::from(count) * self.stretch.hello.mm_per_count
    }

    fn angle_at(&self, index: usize) -> f64 {
        self.stretch.samples.get(index).map_or(0.0, |s| f64::from(s.tilt_mrad) * 1e-3)
    }

    /// Samples in all.
    pub(super) fn len(&self) -> usize {
        self.stretch.samples.len()
    }

    /// Index of the sample at an event that `is_wanted`, the first after `from`.
    pub(super) fn event(&self, from: usize, is_wanted: impl Fn(&EventKind) -> bool) -> Option<usize> {
        let first = self.stretch.first_tick;
        let indices = self.stretch.events.iter().filter(|e| is_wanted(&e.kind));
        indices.map(|e| (e.tick - first) as usize).find(|index| *index >= from)
    }

    /// Index of the sample at an event that `is_wanted`, the last before `until`.
    pub(super) fn last_event(&self, until: usize, is_wanted: impl Fn(&EventKind) -> bool) -> Option<usize> {
        let first = self.stretch.first_tick;
        let indices = self.stretch.events.iter().filter(|e| is_wanted(&e.kind));
        indices.map(|e| (e.tick - first) as usize).take_while(|index| *index <= until).last()
    }

    /// The first sample after `from` at which the tip has been drawn back by a mm.
    pub(super) fn drawn_back(&self, from: usize) -> usize {
        let begin = self.depth_at(from);
        (from..self.len()).find(|index| self.depth_at(*index) < begin - 1.0).unwrap_or(from)
    }

    /// Index after `from` at which the tip comes within 0.5 mm of the deepest place that it reaches
    /// before it is drawn back by a mm.
    pub(super) fn nearly_turning(&self, from: usize) -> usize {
        let mut deepest = self.depth_at(from);
        for index in from..self.len() {
            let depth = self.depth_at(index);
            if depth < deepest - 1.0 {
                break;
            }
            deepest = deepest.max(depth);
        }
        (from..self.len()).find(|index| self.depth_at(*index) >= deepest - 0.5).unwrap_or(from)
    }

    /// Index at `seconds`.
    pub(super) fn index(&self, seconds: f64) -> usize {
        ((seconds * f64::from(TICK_HZ)) as usize).min(self.len().saturating_sub(1))
    }

    /// Largest force across the needle that would have held its direction, N; none without a
    /// fixture.
    pub(super) fn largest_lateral_n(&self, profile: &Profile) -> Option<f64> {
        self.insertions(profile).into_iter().find_map(|one| one.largest_lateral_n)
    }

    /// Index at which the needle has come to rest after `from`: not a count for a tenth of a
    /// second.
    pub(super) fn at_rest(&self, from: usize) -> usize {
        let samples = self.stretch.samples.get(from..).unwrap_or_default();
        let tenth = TICK_HZ as usize / 10;
        let still = samples.windows(tenth).position(|part| {
            let first = part.first().map_or(0, |s| s.count);
            part.iter().all(|s| s.count == first)
        });
        from + still.unwrap_or(0)
    }

    /// Returns the result for the patient's target in the first insertion.
    pub(super) fn target(&self, profile: &Profile) -> Option<Reached> {
        self.insertions(profile).into_iter().find_map(|one| one.target)
    }

    fn insertions(&self, profile: &Profile) -> Vec<Insertion> {
        let judge = Judge::new(profile, None, self.stretch.first_tick);
        judge.spans(&self.stretch).into_iter().map(|(span, _)| judge.insertion(span)).collect()
    }

    /// Way of the tip in mm, and the force across the needle that would hold its direction of
    /// entry, N: `per_rad` for each radian off it, up to `most_rad`; from the first contact to the
    /// last exit.
    pub(super) fn lateral_over_way(&self, per_rad: f64, most_rad: f64) -> Vec<(f64, f64)> {
        let Some(begin) = self.event(0, is_contact_with(0)) else { return Vec::new() };
        let end = self.event(begin, is_exit_from(0)).unwrap_or_else(|| self.len());
        let entry = self.angle_at(begin);
        let mut way_mm = 0.0;
        let mut last = self.depth_at(begin);
        (begin..end)
            .step_by(100)
            .map(|index| {
                let depth = self.depth_at(index);
                way_mm += (depth - std::mem::replace(&mut last, depth)).abs();
                (way_mm, per_rad * (self.angle_at(index) - entry).clamp(-most_rad, most_rad))
            })
            .collect()
    }

    /// Index of the deepest place.
    pub(super) fn deepest(&self) -> usize {
        (0..self.len()).max_by_key(|index| self.stretch.samples[*index].count).unwrap_or(0)
    }

    /// Largest force in `range`, N.
    pub(super) fn largest_n(&self, range: Range<usize>) -> f64 {
        range.map(|index| self.force_n(index)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Smallest force in `range`, N.
    pub(super) fn smallest_n(&self, range: Range<usize>) -> f64 {
        range.map(|index| self.force_n(index)).fold(f64::INFINITY, f64::min)
    }

    /// Mean force in `range`, N; none of an empty one.
    pub(super) fn mean_n(&self, range: Range<usize>) -> Option<f64> {
        let count = range.len();
        (count > 0).then(|| range.map(|index| self.force_n(index)).sum::<f64>() / count as f64)
    }

    /// Depth along the needle, mm, and force, N, every so many samples of `range`.
    pub(super) fn force_over_depth(&self, range: Range<usize>) -> Vec<(f64, f64)> {
        range.step_by(10).map(|index| (self.depth_at(index), self.force_n(index))).collect()
    }

    /// Time in s from the range's beginning, and force in N.
    pub(super) fn force_over_time(&self, range: Range<usize>) -> Vec<(f64, f64)> {
        let begin = range.start;
        let seconds = move |index: usize| (index - begin) as f64 / f64::from(TICK_HZ);
        range.step_by(10).map(|index| (seconds(index), self.force_n(index))).collect()
    }

    /// The tip's way in the section, mm along the skin and below it.
    pub(super) fn way(&self, range: Range<usize>) -> Vec<(f64, f64)> {
        let place = |index: usize| {
            let (sin, cos) = self.angle_at(index).sin_cos();
            (self.depth_at(index) * cos, self.depth_at(index) * sin)
        };
        range.step_by(100).map(place).collect()
    }

    /// Depth along the needle at `index`, mm.
    pub(super) fn depth_mm(&self, index: usize) -> f64 {
        self.depth_at(index)
    }

    /// Returns the force just before a wall gave way at `index`, and the least of the fifth of a
    /// second after, N.
    pub(super) fn fall_n(&self, index: usize) -> (f64, f64) {
        let fifth = TICK_HZ as usize / 5;
        let before = self.largest_n(index.saturating_sub(fifth / 4)..index + 1);
        (before, self.smallest_n(index..(index + fifth).min(self.len())))
    }
}

/// True if it is the puncture of this layer.
pub(super) fn is_puncture_of(layer: u8) -> impl Fn(&EventKind) -> bool {
    move |kind| matches!(kind, EventKind::Puncture { layer: which } if *which == layer)
}

/// True if it is the contact with this layer.
pub(super) fn is_contact_with(layer: u8) -> impl Fn(&EventKind) -> bool {
    move |kind| matches!(kind, EventKind::Contact { layer: which } if *which == layer)
}

/// True if it is the exit from this layer.
pub(super) fn is_exit_from(layer: u8) -> impl Fn(&EventKind) -> bool {
    move |kind| matches!(kind, EventKind::Exit { layer: which } if *which == layer)
}
