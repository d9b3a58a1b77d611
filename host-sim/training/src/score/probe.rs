//! Whether the ultrasound image showed the tip, from what the page told of the probe.

use control_core::TICK_HZ;
use recording::messages::Probe;

/// The page says at least once a second what the image shows; after this time without a word it shows none.
const LONGEST_TICKS: u64 = TICK_HZ as u64 * 3 / 2;

/// Returns the share of the time between two ticks at which the image showed the tip; none if no image was shown.
pub(super) fn tip_seen_share(probes: &[Probe], (begin, end): (u64, u64)) -> Option<f64> {
    let (mut seen, mut shown) = (0, 0);
    for (index, probe) in probes.iter().enumerate() {
        let next = probes.get(index + 1).map_or(end, |next| next.tick);
        let until = next.min(end).min(probe.tick + LONGEST_TICKS);
        let ticks = until.saturating_sub(probe.tick.max(begin));
        shown += ticks;
        seen += if probe.view.tip_seen { ticks } else { 0 };
    }
    (shown > 0).then(|| seen as f64 / shown as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use device_sim::session::ProbeView;

    fn share(probes: &[(u64, bool)]) -> Option<f64> {
        let probe = |(tick, tip_seen)| Probe { tick, view: ProbeView { tip_seen, ..ProbeView::default() } };
        let probes: Vec<Probe> = probes.iter().copied().map(probe).collect();
        tip_seen_share(&probes, (10_000, 30_000))
    }

    #[test]
    fn the_time_at_which_the_tip_is_seen_is_counted() {
        // From 1 to 3 s: seen from before the begin until 1.5 s, then beside the plane, seen again in the last 0.5 s.
        let half = share(&[(5_000, true), (15_000, false), (25_000, true)]);
        assert_eq!(half, Some(0.5));
        assert_eq!(share(&[]), None);
        assert_eq!(share(&[(40_000, true)]), None, "after the insertion");
        // The page was closed 1.5 s after its last word.
        assert_eq!(share(&[(10_000, true)]), Some(1.0));
    }
}
