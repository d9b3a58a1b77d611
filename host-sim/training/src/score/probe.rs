//! The share of the needle that the ultrasound image showed, from the page's messages about the
//! probe.

use control_core::TICK_HZ;
use recording::messages::Probe;

/// The page says at least once a second what the image shows; after this time without a word it
/// shows none.
const LONGEST_TICKS: u64 = TICK_HZ as u64 * 3 / 2;

/// The parts of the needle that the image showed, each as a mean over the time at which there was
/// an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Seen {
    /// Share of the time at which it showed the tip.
    pub(super) tip_share: f64,
    /// Share of the needle in tissue that lay in its plane.
    pub(super) in_plane_share: f64,
}

/// Returns what the image showed between two ticks; none if there was no image.
pub(super) fn seen(probes: &[Probe], (begin, end): (u64, u64)) -> Option<Seen> {
    let (mut tip, mut in_plane, mut shown) = (0.0, 0.0, 0.0);
    for (index, probe) in probes.iter().enumerate() {
        let next = probes.get(index + 1).map_or(end, |next| next.tick);
        let until = next.min(end).min(probe.tick + LONGEST_TICKS);
        let ticks = until.saturating_sub(probe.tick.max(begin)) as f64;
        shown += ticks;
        in_plane += ticks * probe.view.share_in_plane;
        tip += if probe.view.tip_seen { ticks } else { 0.0 };
    }
    (shown > 0.0).then(|| Seen { tip_share: tip / shown, in_plane_share: in_plane / shown })
}

#[cfg(test)]
mod tests {
    use super::*;
    use device_sim::session::ProbeView;

    /// Shares of the tip and of the needle.
    fn shares(probes: &[(u64, bool)]) -> Option<(f64, f64)> {
        // Where the tip is not seen, a quarter of the needle is.
        let share_in_plane = |tip_seen| if tip_seen { 1.0 } else { 0.25 };
        let view = |tip_seen| ProbeView {
            tip_seen,
            share_in_plane: share_in_plane(tip_seen),
            ..ProbeView::default()
        };
        let probe = |(tick, tip_seen)| Probe { tick, view: view(tip_seen) };
        let probes: Vec<Probe> = probes.iter().copied().map(probe).collect();
        seen(&probes, (10_000, 30_000)).map(|seen| (seen.tip_share, seen.in_plane_share))
    }

    #[test]
    fn the_time_at_which_the_tip_is_seen_is_counted() {
        // From 1 to 3 s: seen from before the begin until 1.5 s, then outside the plane, seen again
        // in the last 0.5 s.
        let half = shares(&[(5_000, true), (15_000, false), (25_000, true)]);
        assert_eq!(half, Some((0.5, 0.625)));
        assert_eq!(shares(&[]), None);
        assert_eq!(shares(&[(40_000, true)]), None, "after the insertion");
        // The page was closed 1.5 s after its last word.
        assert_eq!(shares(&[(10_000, true)]), Some((1.0, 1.0)));
    }
}
