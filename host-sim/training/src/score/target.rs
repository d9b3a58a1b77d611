//! The structures that an insertion was to reach and to spare, by name, from the device's events
//! and the tip's place along the skin.
//!
//! A target is a layer, or a part of it that ends to either side.

use super::gesture::Place;
use device_sim::profile::{Beside, Goal};
use link::frames::{Event, EventKind};
use serde::{Deserialize, Serialize};

/// The outcome for a target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TargetOutcome {
    /// The tip was never in it.
    #[default]
    Missed,
    /// The tip was in it and never deeper.
    Reached,
    /// The tip was in it and went through it.
    Beyond,
}

/// The result for a target.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reached {
    /// Its name.
    pub name: String,
    /// Its outcome.
    pub outcome: TargetOutcome,
    /// Time in it, all visits together, s.
    pub time_s: f64,
    /// The number of times that the tip passed its depth outside it.
    pub passed_beside: u32,
}

/// Reads `events`, which are in their order in time, of the insertion from `begin` to `end`.
/// `is_there` says whether the needle's line meets the target at a tick. Returns the visits of the
/// target too, each from its first tick to the tick after its last.
pub(super) fn walk(
    events: &[Event],
    (begin, end): (u64, u64),
    target: &Goal,
    is_there: impl Fn(u64) -> bool,
    tick_s: f64,
) -> (Reached, Vec<(u64, u64)>) {
    let mut found = Reached { name: target.name.clone(), ..Reached::default() };
    let (mut since, mut visits, mut beyond) = (None::<u64>, Vec::new(), false);
    for event in events.iter().filter(|event| (begin..=end).contains(&event.tick)) {
        let tick = event.tick;
        if enters(&event.kind, target.layer, target.has_wall)
            || leaves_below(&event.kind, target.below) && found.outcome != TargetOutcome::Missed
        {
            if is_there(tick) {
                since = since.or(Some(tick));
                found.outcome = if beyond { TargetOutcome::Beyond } else { TargetOutcome::Reached };
            } else {
                found.passed_beside += 1;
            }
        } else if target.below.is_some_and(|(layer, has_wall)| enters(&event.kind, layer, has_wall)) {
            beyond |= since.is_some();
            visits.extend(since.take().map(|since| (since, tick)));
            found.outcome = if beyond { TargetOutcome::Beyond } else { found.outcome };
        } else if event.kind == (EventKind::Exit { layer: target.layer }) {
            visits.extend(since.take().map(|since| (since, tick)));
        }
    }
    visits.extend(since.map(|since| (since, end)));
    let ticks: u64 = visits.iter().map(|(from, to)| to - from).sum();
    found.time_s = ticks as f64 * tick_s;
    (found, visits)
}

/// True if the tip comes into a layer from above.
fn enters(kind: &EventKind, layer: u8, has_wall: bool) -> bool {
    match kind {
        EventKind::Contact { layer: met } => *met == layer && !has_wall,
        EventKind::Puncture { layer: met } | EventKind::InTrack { layer: met } => *met == layer && has_wall,
        _ => false,
    }
}

/// True if the tip comes back from the layer below.
fn leaves_below(kind: &EventKind, below: Option<(u8, bool)>) -> bool {
    below.is_some_and(|(layer, _)| *kind == EventKind::Exit { layer })
}

/// Names of what was to be spared: touched, and left alone. `spared` has number and name of each.
pub(crate) fn hit_and_spared(
    events: &[Event],
    (begin, end): (u64, u64),
    spared: &[(u8, String)],
) -> (Vec<String>, Vec<String>) {
    let is_hit = |number: u8| {
        let within = events.iter().filter(|event| (begin..=end).contains(&event.tick));
        within.into_iter().any(|event| event.kind == EventKind::Contact { layer: number })
    };
    let (hit, left): (Vec<_>, Vec<_>) = spared.iter().cloned().partition(|(number, _)| is_hit(*number));
    let names = |all: Vec<(u8, String)>| all.into_iter().map(|(_, name)| name).collect();
    (names(hit), names(left))
}

/// Counts how often the tip came into a structure next to the way, and adds each structure's name
/// to what was hit or spared.
pub(super) fn beside_hits(
    places: &[Place],
    beside: &[Beside],
    hit: &mut Vec<String>,
    spared: &mut Vec<String>,
) -> u32 {
    let mut hits = 0;
    for structure in beside {
        let inside: Vec<bool> = places.iter().map(|place| structure.contains(place.in_section())).collect();
        let entries = inside.iter().take(1).filter(|is_in| **is_in).count()
            + inside.windows(2).filter(|pair| pair[1] && !pair[0]).count();
        if entries > 0 { &mut *hit } else { &mut *spared }.push(structure.name.clone());
        hits += entries as u32;
    }
    hits
}

#[cfg(test)]
mod tests {
    use super::*;
    use EventKind::{Contact, Exit, Puncture};

    fn at(told: &[(u64, EventKind)]) -> Vec<Event> {
        told.iter().map(|(tick, kind)| Event { tick: *tick, kind: *kind }).collect()
    }

    fn bursa(reach_mm: Option<(f64, f64)>) -> Goal {
        Goal { name: "bursa".into(), layer: 3, has_wall: false, below: Some((4, false)), reach_mm }
    }

    fn judge(told: &[(u64, EventKind)], target: &Goal, along: impl Fn(u64) -> f64) -> Reached {
        let is_there = |tick| target.reach_mm.is_none_or(|(from, to)| (from..=to).contains(&along(tick)));
        walk(&at(told), (0, 1_000), target, is_there, 1e-3).0
    }

    /// Touched at 100, out again at 400: 0.3 s, worked by hand.
    #[test]
    fn a_target_is_reached_with_its_time() {
        let told = [(0, Contact { layer: 0 }), (100, Contact { layer: 3 }), (400, Exit { layer: 3 })];
        let found = judge(&told, &bursa(None), |_| 0.0);
        assert_eq!((found.outcome, found.passed_beside), (TargetOutcome::Reached, 0));
        assert!((found.time_s - 0.3).abs() < 1e-9);
        assert_eq!(judge(&told[..1], &bursa(None), |_| 0.0).outcome, TargetOutcome::Missed);
        // Until the end where it is not left.
        assert!((judge(&told[..2], &bursa(None), |_| 0.0).time_s - 0.9).abs() < 1e-9);
    }

    /// In at 100, through at 300, back at 600, out at 700: 0.2 and 0.1 s.
    #[test]
    fn beyond_is_beyond_even_when_it_comes_back() {
        let told = [
            (100, Contact { layer: 3 }),
            (300, Contact { layer: 4 }),
            (600, Exit { layer: 4 }),
            (700, Exit { layer: 3 }),
        ];
        let found = judge(&told, &bursa(None), |_| 0.0);
        assert!(found.outcome == TargetOutcome::Beyond && (found.time_s - 0.3).abs() < 1e-9, "{found:?}");
    }

    /// The tip first passes next to the target, at 26 mm along the skin, and is then redirected to
    /// 20 mm.
    #[test]
    fn a_target_that_ends_is_passed_beside_and_then_reached() {
        let told = [
            (100, Contact { layer: 3 }),
            (200, Exit { layer: 3 }),
            (500, Contact { layer: 3 }),
            (600, Exit { layer: 3 }),
        ];
        let along = |tick: u64| if tick < 300 { 26.0 } else { 20.0 };
        let found = judge(&told, &bursa(Some((12.0, 24.0))), along);
        assert_eq!((found.outcome, found.passed_beside), (TargetOutcome::Reached, 1));
        assert!((found.time_s - 0.1).abs() < 1e-9, "{found:?}");
        let missed = judge(&told[..2], &bursa(Some((12.0, 24.0))), along);
        assert_eq!((missed.outcome, missed.passed_beside), (TargetOutcome::Missed, 1));
    }

    #[test]
    fn a_target_with_a_wall_is_entered_where_it_gives_way() {
        let lumen =
            Goal { name: "lumen".into(), layer: 2, has_wall: true, below: Some((3, true)), reach_mm: None };
        let touched = [(100, Contact { layer: 2 }), (200, Exit { layer: 2 })];
        assert_eq!(judge(&touched, &lumen, |_| 0.0).outcome, TargetOutcome::Missed);
        let told = [
            (100, Contact { layer: 2 }),
            (150, Puncture { layer: 2 }),
            (250, Contact { layer: 3 }),
            (400, Puncture { layer: 3 }),
        ];
        let found = judge(&told, &lumen, |_| 0.0);
        assert!(found.outcome == TargetOutcome::Beyond && (found.time_s - 0.25).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn what_was_to_be_spared_is_named() {
        let spared = [(4, "tendon".to_owned()), (5, "cartilage".to_owned())];
        let (hit, left) = hit_and_spared(&at(&[(10, Contact { layer: 4 })]), (0, 100), &spared);
        assert_eq!((hit, left), (vec!["tendon".to_owned()], vec!["cartilage".to_owned()]));
    }

    #[test]
    fn a_vein_beside_the_way_is_hit_by_a_flat_needle() {
        let vein = Beside { name: "vein".into(), from_mm: 9.0, to_mm: 13.0, top_mm: 3.5, bottom_mm: 6.5 };
        let judge = |degrees: f64, depths_mm: &[f64]| {
            let angle_rad = degrees.to_radians();
            let places: Vec<Place> =
                depths_mm.iter().map(|mm| Place { depth_mm: *mm, angle_rad, origin_mm: [0.0; 2] }).collect();
            let (mut hit, mut spared) = (vec!["tendon".to_owned()], Vec::new());
            let hits = beside_hits(&places, std::slice::from_ref(&vein), &mut hit, &mut spared);
            (hits, hit.len(), spared.len())
        };
        let way: Vec<f64> = (0..40).map(f64::from).collect();
        assert_eq!(judge(45.0, &way), (0, 1, 1));
        assert_eq!(judge(25.0, &way), (1, 2, 0));
        assert_eq!(judge(25.0, &[5.0, 12.0, 5.0, 12.0]), (2, 2, 0), "each time counts");
    }
}
