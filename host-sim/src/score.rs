//! A trainee's figures, insertion by insertion: time, path, force, punctures, vessel hit, angle.

use crate::profile::{Profile, puncture_path_mm};
use crate::recording::export::{Stretch, stretches};
use crate::recording::read::Recording;
use control_core::TICK_HZ;
use control_core::config::Tissue;
use link::frames::{Event, EventKind};
use serde::Serialize;

/// One insertion: from the first touch of the outermost layer until the tip has left it, or the recording ends.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Insertion {
    /// When it began, s into the recording.
    pub begin_s: f64,
    /// How long it took, s.
    pub time_s: f64,
    /// How far the tip went in all, in and out, mm. Twice the depth is the least.
    pub path_mm: f64,
    /// Deepest place, mm.
    pub depth_mm: f64,
    /// Largest force that the motor made, N.
    pub peak_force_n: f64,
    /// Walls that gave way.
    pub punctures: u32,
    /// Whether the vessel's wall was among them.
    pub vessel: bool,
    /// How far the tip went beyond where the vessel's wall gave way, mm; none where it did not.
    pub overshoot_mm: Option<f64>,
    /// Inclination below the horizontal when the first wall gave way, °; none where none did.
    pub angle_deg: Option<f64>,
    /// The same less the profile's entry angle, °.
    pub angle_error_deg: Option<f64>,
}

/// All insertions of a recording against `profile`.
pub fn score(recording: &Recording, profile: &Profile) -> Vec<Insertion> {
    let layers = profile.config.patient.layers.iter();
    let vessel_mm = layers
        .filter(|layer| layer.tissue == Tissue::Vessel)
        .find_map(|layer| puncture_path_mm(layer, profile.entry_rad));
    let stretches = stretches(recording);
    let zero_tick = stretches.first().map_or(0, |s| s.first_tick);
    stretches
        .iter()
        .flat_map(|stretch| {
            spans(stretch)
                .into_iter()
                .map(|span| insertion(stretch, span, profile.entry_rad, vessel_mm, zero_tick))
                .collect::<Vec<_>>()
        })
        .collect()
}

/// Ticks of each insertion: from the touch of layer 0 to leaving it.
fn spans(stretch: &Stretch) -> Vec<(u64, u64)> {
    let end = stretch.end_tick();
    let (mut spans, mut begun) = (Vec::new(), None);
    for event in &stretch.events {
        match event.kind {
            EventKind::Contact { layer: 0 } => begun = begun.or(Some(event.tick)),
            EventKind::Exit { layer: 0 } => {
                spans.extend(begun.take().map(|begin| (begin, event.tick.max(begin))));
            }
            _ => {}
        }
    }
    spans.extend(begun.map(|begin| (begin, end)));
    spans
}

fn insertion(
    stretch: &Stretch,
    (begin, end): (u64, u64),
    entry_rad: f64,
    vessel_mm: Option<f64>,
    zero_tick: u64,
) -> Insertion {
    let at = |tick: u64| (tick - stretch.first_tick) as usize;
    let samples = &stretch.samples[at(begin)..at(end)];
    let hello = &stretch.hello;
    let counts: u64 = samples
        .windows(2)
        .map(|pair| u64::from(pair[0].count.wrapping_sub(pair[1].count).unsigned_abs()))
        .sum();
    let deepest = samples.iter().map(|s| s.count).max().unwrap_or(0);
    let depth_mm = f64::from(deepest) * hello.mm_per_count;
    let given: Vec<&Event> = stretch
        .events
        .iter()
        .filter(|e| (begin..=end).contains(&e.tick) && matches!(e.kind, EventKind::Puncture { .. }))
        .collect();
    let vessel = stretch
        .events
        .iter()
        .any(|e| (begin..=end).contains(&e.tick) && matches!(e.kind, EventKind::Vessel { .. }));
    let angle =
        given.first().and_then(|e| stretch.samples.get(at(e.tick))).map(|s| f64::from(s.tilt_mrad) * 1e-3);
    Insertion {
        begin_s: begin.saturating_sub(zero_tick) as f64 / f64::from(TICK_HZ),
        time_s: (end - begin) as f64 / f64::from(TICK_HZ),
        path_mm: counts as f64 * hello.mm_per_count,
        depth_mm,
        peak_force_n: samples.iter().map(|s| hello.force_n(s.dac).abs()).fold(0.0, f64::max),
        punctures: given.len() as u32,
        vessel,
        overshoot_mm: vessel_mm.filter(|_| vessel).map(|mm| (depth_mm - mm).max(0.0)),
        angle_deg: angle.map(f64::to_degrees),
        angle_error_deg: angle.map(|rad| (rad - entry_rad).to_degrees()),
    }
}
