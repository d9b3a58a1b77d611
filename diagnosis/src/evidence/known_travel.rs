//! The travel over which held-out recordings may judge: a law fitted over the travel says nothing
//! of travel that no fitted recording covers.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::model::Model;
use crate::laws::Effect;
use crate::laws::definition::Span;
use std::borrow::Cow;

/// Part of the fitted travel by which a recording may go beyond it.
const BEYOND: f64 = 0.03;

/// Recordings with the blocks marked of which a model knows nothing.
pub(crate) fn known<'a>(
    tracks: &'a [BlockedRecording],
    model: &Model,
    span: &Span,
) -> Cow<'a, [BlockedRecording]> {
    let follows = |effect: &Effect| effect.name.definition().follows_travel();
    let reach = BEYOND * span.travel();
    let is_unknown = |x: f64| x < span.low - reach || x > span.high + reach;
    let goes_beyond = |track: &BlockedRecording| track.places().any(is_unknown);
    if !model.effects.iter().any(follows) || !tracks.iter().any(goes_beyond) {
        return Cow::Borrowed(tracks);
    }
    let mut tracks = tracks.to_vec();
    for track in &mut tracks {
        track.unknown = track.places().map(is_unknown).collect();
    }
    Cow::Owned(tracks)
}

/// The smallest part of a recording beyond the fitted travel that is reported.
const TOLD: f64 = 0.05;

/// Travel over which held-out recordings go and fitted ones do not, rad or m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct BeyondFitted {
    /// The range of the held-out recordings.
    pub(crate) from: f64,
    pub(crate) to: f64,
    /// The range of the fitted ones.
    pub(crate) low: f64,
    pub(crate) high: f64,
}

/// The travel that held-out recordings cover and no fitted one does, if the model depends on it.
pub(crate) fn beyond(tracks: &[BlockedRecording], model: &Model, span: &Span) -> Option<BeyondFitted> {
    let known = known(tracks, model, span);
    let is_known = |track: &BlockedRecording| {
        let unknown = track.unknown.iter().filter(|unknown| **unknown).count();
        unknown as f64 > TOLD * track.block_count() as f64
    };
    if !known.iter().any(is_known) {
        return None;
    }
    let places = || known.iter().flat_map(BlockedRecording::places);
    let (from, to) = (places().fold(span.low, f64::min), places().fold(span.high, f64::max));
    Some(BeyondFitted { from, to, low: span.low, high: span.high })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::fit::nominal::Nominal;
    use crate::laws::EffectName as N;
    use crate::propose::candidates::span_of;

    fn slide(to: f64) -> BlockedRecording {
        let time_s: Vec<f64> = (0..401).map(|i| f64::from(i) * 2.5e-3).collect();
        let recording = Recording {
            command: vec![0.0; time_s.len()],
            position_counts: time_s.iter().map(|t| (1000.0 * to * t).round()).collect(),
            time_s,
            ..Recording::default()
        };
        BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.0))
    }

    #[test]
    fn a_profile_knows_only_the_travel_that_was_fitted() {
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
        let span = span_of(&[slide(10.0)], &nominal);
        let model = |name| Model { effects: vec![Effect::shaped(name, &[])], ..Model::default() };
        let unknown = |to: f64, name| {
            let tracks = [slide(to)];
            let tracks = known(&tracks, &model(name), &span);
            tracks[0].unknown.iter().filter(|x| **x).count() as f64 / tracks[0].block_count() as f64
        };
        assert_eq!(unknown(10.2, N::PositionDependentFriction), 0.0);
        assert!((unknown(20.0, N::PositionDependentFriction) - 0.485).abs() < 0.02);
        assert_eq!(unknown(20.0, N::QuadraticDrag), 0.0);
        let profile = model(N::PositionDependentFriction);
        let found = |to: f64| beyond(&[slide(to)], &profile, &span);
        assert_eq!(found(10.2), None);
        let far = found(20.0).expect("half of it is beyond");
        assert!(far.from == 0.0 && (far.to - 19.95).abs() < 1e-9, "{far:?}");
    }
}
