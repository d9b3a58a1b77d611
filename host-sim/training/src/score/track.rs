//! Layers that were met again after they had given way: in the needle's own track, where they are
//! open, or next to it, where they are whole. They are found from the device's events alone.

use link::frames::{Event, EventKind};

/// The structures that a needle met again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MetAgain {
    /// Layers that were passed without giving way, because they had before: in the track.
    pub in_track: u32,
    /// Layers that gave way once more: next to the track, or under a law whose walls close behind
    /// the needle.
    pub whole: u32,
}

/// Reads `events`, which are in their order in time: what was met again from `begin` to `end`, and
/// had given way at any time before.
pub(crate) fn met_again(events: &[Event], (begin, end): (u64, u64)) -> MetAgain {
    let mut again = MetAgain::default();
    let mut given = [false; 8];
    for event in events.iter().filter(|event| event.tick <= end) {
        let counts = event.tick >= begin;
        match event.kind {
            EventKind::InTrack { .. } => again.in_track += u32::from(counts),
            EventKind::Puncture { layer } => {
                if let Some(given) = given.get_mut(usize::from(layer)) {
                    again.whole += u32::from(counts && *given);
                    *given = true;
                }
            }
            _ => {}
        }
    }
    again
}

#[cfg(test)]
mod tests {
    use super::*;
    use EventKind::{Contact, Exit, InTrack, Puncture};

    fn events(kinds: &[EventKind]) -> Vec<Event> {
        (0..).zip(kinds).map(|(tick, kind)| Event { tick: 10 * tick, kind: *kind }).collect()
    }

    #[test]
    fn layers_are_open_in_the_track_and_give_way_again_beside_it() {
        let first = [
            Contact { layer: 0 },
            Puncture { layer: 0 },
            Contact { layer: 1 },
            Puncture { layer: 1 },
            Exit { layer: 1 },
            Exit { layer: 0 },
            Contact { layer: 0 },
            InTrack { layer: 0 },
            Contact { layer: 1 },
        ];
        let in_track = [&first[..], &[InTrack { layer: 1 }]].concat();
        assert_eq!(met_again(&events(&in_track), (0, 1_000)), MetAgain { in_track: 2, whole: 0 });
        // The skin's hole is the same, the layer below is whole.
        let beside = [&first[..], &[Puncture { layer: 1 }]].concat();
        assert_eq!(met_again(&events(&beside), (0, 1_000)), MetAgain { in_track: 1, whole: 1 });
        assert_eq!(met_again(&events(&beside), (0, 50)), MetAgain::default(), "nothing yet");
        assert_eq!(met_again(&events(&beside), (80, 1_000)), MetAgain { in_track: 0, whole: 1 });
        assert_eq!(met_again(&[], (0, 10)), MetAgain::default());
    }
}
