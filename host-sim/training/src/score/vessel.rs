//! The needle's effect on the vessel, from the device's events: contact, lumen, far wall,
//! structures that it should have spared. It counts ticks and layers, and knows no lengths or
//! forces.

use link::frames::{Event, EventKind};

/// Which layers are what, by their numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Targets {
    /// The vessel's near wall and what is under it.
    pub vessel: Option<u8>,
    /// Its far wall.
    pub far_wall: Option<u8>,
    /// Layers that the needle must not touch.
    pub spared: Vec<u8>,
}

/// The events of one insertion.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Passage {
    /// When the near wall was first touched.
    pub contact_tick: Option<u64>,
    /// When it first gave way.
    pub entry_tick: Option<u64>,
    /// The time of the tip in the lumen, all visits together.
    pub in_lumen_ticks: u64,
    /// The number of times that it came into the lumen: blood in the hub.
    pub flashbacks: u32,
    /// True if the far wall gave way.
    pub through_far_wall: bool,
    /// The number of times that a layer to be spared was touched.
    pub spared_hits: u32,
}

/// Reads `events`, which are in their order in time, of the insertion from `begin` to `end`.
pub fn passage(events: &[Event], (begin, end): (u64, u64), targets: &Targets) -> Passage {
    let mut passage = Passage::default();
    let mut since = None;
    for event in events.iter().filter(|e| (begin..=end).contains(&e.tick)) {
        let mut leave = || {
            let visit = since.take().map_or(0, |since: u64| event.tick - since);
            passage.in_lumen_ticks += visit;
        };
        match event.kind {
            EventKind::Contact { layer } => {
                if Some(layer) == targets.vessel {
                    passage.contact_tick = passage.contact_tick.or(Some(event.tick));
                }
                passage.spared_hits += u32::from(targets.spared.contains(&layer));
            }
            EventKind::Vessel { .. } => passage.entry_tick = passage.entry_tick.or(Some(event.tick)),
            EventKind::Flashback { .. } => {
                passage.flashbacks += 1;
                since = since.or(Some(event.tick));
            }
            EventKind::FarWall { .. } => {
                leave();
                passage.through_far_wall = true;
            }
            // Through a far wall that is open already.
            EventKind::InTrack { layer } if Some(layer) == targets.far_wall => leave(),
            EventKind::Exit { layer } if Some(layer) == targets.vessel => leave(),
            _ => {}
        }
    }
    passage.in_lumen_ticks += since.map_or(0, |since| end - since);
    passage
}

#[cfg(test)]
mod tests {
    use super::*;

    fn events(told: &[(u64, EventKind)]) -> Vec<Event> {
        told.iter().map(|(tick, kind)| Event { tick: *tick, kind: *kind }).collect()
    }

    const VESSEL: u8 = 2;
    const FAR: u8 = 3;

    fn targets() -> Targets {
        Targets { vessel: Some(VESSEL), far_wall: Some(FAR), spared: vec![FAR] }
    }

    /// Contact at 100, into the lumen at 150, through the far wall at 400, drawn back into the
    /// lumen at 900, out of the vessel at 1,000: 250 and 100 ticks in the lumen, worked by hand.
    #[test]
    fn a_through_puncture_counts_both_visits_of_the_lumen() {
        let told = events(&[
            (0, EventKind::Contact { layer: 0 }),
            (100, EventKind::Contact { layer: VESSEL }),
            (150, EventKind::Puncture { layer: VESSEL }),
            (150, EventKind::Vessel { layer: VESSEL }),
            (150, EventKind::Flashback { layer: VESSEL }),
            (300, EventKind::Contact { layer: FAR }),
            (400, EventKind::Puncture { layer: FAR }),
            (400, EventKind::FarWall { layer: FAR }),
            (900, EventKind::Exit { layer: FAR }),
            (900, EventKind::Flashback { layer: VESSEL }),
            (1_000, EventKind::Exit { layer: VESSEL }),
        ]);
        let expected = Passage {
            contact_tick: Some(100),
            entry_tick: Some(150),
            in_lumen_ticks: 350,
            flashbacks: 2,
            through_far_wall: true,
            spared_hits: 1,
        };
        assert_eq!(passage(&told, (0, 1_200), &targets()), expected);
        // Cut off while it is in the lumen: until then.
        let cut = Passage {
            in_lumen_ticks: 50,
            flashbacks: 1,
            through_far_wall: false,
            spared_hits: 0,
            ..expected
        };
        assert_eq!(passage(&told, (0, 200), &targets()), cut);
    }

    /// In again through both walls that have given way before: from 100 to 300 in the lumen.
    #[test]
    fn in_its_track_the_lumen_ends_at_the_open_far_wall() {
        let told = events(&[
            (100, EventKind::Contact { layer: VESSEL }),
            (100, EventKind::InTrack { layer: VESSEL }),
            (100, EventKind::Flashback { layer: VESSEL }),
            (300, EventKind::Contact { layer: FAR }),
            (300, EventKind::InTrack { layer: FAR }),
            (900, EventKind::Exit { layer: VESSEL }),
        ]);
        let passage = passage(&told, (0, 1_000), &targets());
        assert_eq!((passage.in_lumen_ticks, passage.flashbacks), (200, 1));
    }

    #[test]
    fn a_vessel_that_was_missed_was_not_touched() {
        let told = events(&[(5, EventKind::Contact { layer: 0 }), (9, EventKind::Contact { layer: 1 })]);
        assert_eq!(passage(&told, (0, 100), &targets()), Passage::default());
        assert_eq!(passage(&[], (0, 100), &Targets::default()), Passage::default());
    }
}
