//! The size of a law of the command. Such a law has no coefficient, so that nothing else asks whether it is as large as its shape says, and
//! as large on held-out recordings: one that only makes the command smaller would gain as well. Its part of the command gets a coefficient here.

use crate::effects::CommandLaw;
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::fit::Fit;
use crate::estimation::nominal::Key;
use crate::selection::context::{FitContext, FittedModel};
use crate::thresholds::SAME_SIZE;
use crate::validation::rejection::Rejection;

/// Standard errors within which an amplitude may be another one.
const WITHIN_Z: f64 = 2.0;

/// The part of the command that an effect takes, over the part that its law takes, with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Amplitude {
    on_fit: (f64, f64),
    on_holdout: (f64, f64),
}

impl Amplitude {
    /// The amplitude of an effect that is no law of the command.
    pub(crate) const EXACT: Self = Self { on_fit: (1.0, 0.0), on_holdout: (1.0, 0.0) };

    /// The amplitude of effect `i` of a model on fitted and on held-out recordings.
    pub(crate) fn of(
        context: &FitContext,
        last: &FittedModel,
        holdout: &[BlockedRecording],
        i: usize,
    ) -> Self {
        let is_of_command = |i: usize| CommandLaw::new(&last.model.effects[i]).is_some();
        // Of two laws of the command neither has a part of its own.
        let only = (0..last.model.effects.len()).all(|other| (other == i) == is_of_command(other));
        if !only {
            return Self::EXACT;
        }
        let mut model = last.model.clone();
        model.is_loose = true;
        let on = |tracks: &[BlockedRecording]| {
            let fit = Fit::new(&model, context.nominal, tracks, &last.noise);
            let place = fit.keys.iter().position(|(key, _)| *key == Key::Taken)?;
            let (taken, gain) = (fit.value(Key::Taken)?, fit.value(Key::Gain)?);
            let sd = fit.solution.covariance.at(place, place).max(0.0).sqrt();
            let amplitude = (1.0 - taken / gain, sd / gain.abs());
            (amplitude.0.is_finite() && amplitude.1.is_finite()).then_some(amplitude)
        };
        let unknown = (1.0, f64::INFINITY);
        let on_holdout = if holdout.is_empty() { None } else { on(holdout) };
        Self { on_fit: on(context.tracks).unwrap_or(unknown), on_holdout: on_holdout.unwrap_or(unknown) }
    }

    /// Returns why the effect may not be named if its amplitude is surely another one.
    pub(super) fn rejection(&self) -> Option<Rejection> {
        let is_other = |(amplitude, sd): (f64, f64)| {
            amplitude + WITHIN_Z * sd < SAME_SIZE.start || amplitude - WITHIN_Z * sd > SAME_SIZE.end
        };
        let (on_fit, on_holdout) = (self.on_fit.0, self.on_holdout.0);
        (is_other(self.on_fit) || is_other(self.on_holdout))
            .then_some(Rejection::OtherAmplitude { on_fit, on_holdout })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::{Effect, EffectName};
    use crate::estimation::filter::Noise;
    use crate::estimation::model::Model;
    use crate::estimation::nominal::Nominal;
    use crate::io::recording::Recording;
    use crate::io::rig::Rig;
    use crate::selection::candidates::span_of;

    /// Twelve seconds of an axis whose drive clips at 0.7, with a little noise.
    fn clipped() -> Recording {
        let mut random = crate::numerics::bootstrap::Random::new(5);
        let (h, mut x, mut v) = (1e-3, 0.0, 0.0);
        let mut recording = Recording::default();
        for i in 0..12_000 {
            let t = h * f64::from(i);
            let u = (1.3 * t).sin() + 0.6 * (4.1 * t).sin();
            recording.time_s.push(t);
            recording.command.push(u);
            recording.position_counts.push((1000.0_f64 * x).floor());
            let a = 10.0 * f64::clamp(u, -0.7, 0.7) + 0.1 * (random.below(2001) as f64 / 1000.0 - 1.0);
            x += v * h + 0.5 * a * h * h;
            v += a * h;
        }
        recording
    }

    /// Returns the amplitude of a clip at some limit on the recording, and why it is rejected.
    fn of_clip(limit: f64) -> (f64, Option<Rejection>) {
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let tracks = [BlockedRecording::new(&clipped(), &rig)];
        let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
        let span = span_of(&tracks, &nominal);
        let context = FitContext { nominal: &nominal, tracks: &tracks, span: &span, scale: 10.0 };
        let noise = Noise { sensor: 1.0, white: 1e-5, slow: 1e-9, tau: 0.1, rest: 1.0 };
        let effects = vec![Effect::shaped(EffectName::CommandSaturation, &[("limit", limit)])];
        let last = context.fit_at(Model { effects, ..Model::default() }, &noise);
        let amplitude = Amplitude::of(&context, &last, &tracks, 0);
        (amplitude.on_fit.0, amplitude.rejection())
    }

    #[test]
    fn a_clip_has_the_amplitude_one_only_at_its_own_limit() {
        let (right, rejection) = of_clip(0.7);
        assert!((right - 1.0).abs() < 0.05 && rejection.is_none(), "{right} {rejection:?}");
        let (higher, rejection) = of_clip(1.1);
        assert!(higher > 1.4 && rejection.is_some(), "{higher} {rejection:?}");
    }

    #[test]
    fn an_amplitude_is_another_one_only_beyond_its_error() {
        let rejected = |on_fit, on_holdout| Amplitude { on_fit, on_holdout }.rejection().is_some();
        assert!(!rejected((1.1, 0.01), (0.9, 0.01)));
        assert!(rejected((1.8, 0.1), (1.0, 0.1)) && rejected((1.0, 0.01), (0.6, 0.05)));
        assert!(!rejected((1.8, 0.3), (0.6, 0.1)), "neither is sure");
        assert!(Amplitude::EXACT.rejection().is_none());
    }
}
