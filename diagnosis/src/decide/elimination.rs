//! Removes the effects that do not generalise when all are judged together.

use crate::decide::acceptance_criteria::gather_evidence;
use crate::decide::material::SelectedByShare;
use crate::decide::rejection::Rejection;
use crate::evidence::effect_evidence::EffectEvidence;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::parameters;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::noise::Colour;
use crate::laws::EffectName;
use crate::propose::context::{FitContext, FittedModel};

/// A hypothesis that was fitted in full and rejected.
#[derive(Clone)]
pub(crate) struct RejectedHypothesis {
    pub(crate) name: EffectName,
    /// Gain on held-out recordings, nats; none where it was not judged there.
    pub(crate) holdout_gain: Option<f64>,
    pub(crate) why: Rejection,
}

/// A model all of whose effects carry to the held-out recordings.
pub(crate) struct SurvivingModel {
    /// Under coloured noise.
    pub(crate) model: FittedModel,
    /// The evidence for each effect.
    pub(crate) effects: Vec<EffectEvidence>,
    /// The effects that were removed.
    pub(crate) rejected: Vec<RejectedHypothesis>,
    /// The effects that shares of the force error name.
    pub(crate) materials: Vec<SelectedByShare>,
}

/// The model of a proposer, each of whose effects stands, with the recordings in its motion.
pub(crate) struct Found {
    /// The fitted recordings in the motion of the model that was found.
    pub(crate) fit: Vec<BlockedRecording>,
    /// The recordings that judge, in that motion.
    pub(crate) holdout: HoldoutSet,
    /// The null under coloured noise.
    pub(crate) null: FittedModel,
    pub(crate) standing: SurvivingModel,
}

/// Takes out whatever does not carry to the held-out recordings, the weakest first, until all that
/// is left does, and judges that; `noise` is white, `null_noise` is the null's coloured one,
/// `materials` are the effects that shares name.
pub(crate) fn eliminate(
    mut model: FittedModel,
    context: &FitContext,
    holdout: &HoldoutSet,
    null_noise: &Noise,
    noise: &Noise,
    materials: &[SelectedByShare],
) -> SurvivingModel {
    let mut rejected = Vec::new();
    loop {
        let plain = context.fit(model.model.clone(), noise, Colour::White);
        let effects = gather_evidence(context, &plain, &model.noise, holdout);
        let weakest = effects
            .iter()
            .enumerate()
            .filter_map(|(i, f)| {
                // Where other physics limits, nothing explains everything: no likelihood rejects
                // what shares name.
                let judged = SelectedByShare::find(materials, f.effect.name).is_none().then_some(f)?;
                let is_absent = || parameters::is_absent(context, &plain, i);
                let why = judged.rejection().or_else(|| is_absent().then_some(Rejection::NoSize))?;
                Some((i, f.holdout.z, why))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((i, _, why)) = weakest else {
            return SurvivingModel { model, effects, rejected, materials: materials.to_vec() };
        };
        let (name, gain) = (effects[i].effect.name, effects[i].holdout.sum);
        rejected.push(RejectedHypothesis { name, holdout_gain: Some(gain), why });
        let mut less = model.model.clone();
        less.effects.remove(i);
        model = context.fit_coloured(less, &[null_noise, noise]);
    }
}
