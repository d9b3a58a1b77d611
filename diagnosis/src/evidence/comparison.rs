//! The force residual of a model, compared with the simulation as given and refitted.

use crate::data::schema::{Both, FitTable};
use crate::evidence::known_travel::known;
use crate::evidence::residuals::{Residuals, relative_gain, residuals};
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::propose::context::{FitContext, FittedModel};

/// A fitted model with what it leaves.
pub(crate) struct ModelComparison {
    pub(crate) patched: FittedModel,
    pub(crate) on_fit: Residuals,
    pub(crate) on_holdout: Residuals,
    pub(crate) table: FitTable,
    /// True if the nominal values explain held-out recordings better than refitted ones; they are
    /// then used instead.
    pub(crate) keeps_nominal: bool,
}

impl ModelComparison {
    /// Lays a fitted model and the refit on all recordings, under one estimator.
    pub(crate) fn new(
        context: &FitContext,
        holdout: &[BlockedRecording],
        estimator: &Estimator,
        refit: &FittedModel,
        patched: FittedModel,
    ) -> Self {
        let nominal = context.nominal;
        let known: &[BlockedRecording] = &known(holdout, &patched.model, context.span);
        let on_fit = residuals(nominal, estimator, context.tracks, false, refit, &patched);
        let on_holdout = residuals(nominal, estimator, known, true, refit, &patched);
        // Values that a refit moved for the worse are not kept: the structure is wrong, or what the
        // rig says of them.
        let (mut on_fit, mut on_holdout) = (on_fit, on_holdout);
        let keeps_nominal =
            estimator.rms(&on_holdout.refit, known) > estimator.rms(&on_holdout.nominal, known);
        if keeps_nominal {
            for on in [&mut on_fit, &mut on_holdout] {
                on.refit = on.nominal.clone();
                if patched.model.effects.is_empty() {
                    on.patched = on.nominal.clone();
                }
            }
        }
        let both = |a: &Vec<Vec<f64>>, b: &Vec<Vec<f64>>| Both {
            fit: estimator.rms(a, context.tracks),
            holdout: estimator.rms(b, holdout),
        };
        let helps = relative_gain(estimator, holdout, &on_holdout.refit, &on_holdout.patched);
        let table = FitTable {
            metric: "force_rmse".into(),
            unit: nominal.rig.kind.force().into(),
            nominal: both(&on_fit.nominal, &on_holdout.nominal),
            refit: both(&on_fit.refit, &on_holdout.refit),
            patched: both(&on_fit.patched, &on_holdout.patched),
            force_rms: both(&on_fit.force, &on_holdout.force),
            // Nothing can take more than there is; some resamplings of few segments would.
            holdout_gain_ci95: [helps.low, helps.high].map(|x| x.min(1.0)),
        };
        Self { patched, on_fit, on_holdout, table, keeps_nominal }
    }
}
