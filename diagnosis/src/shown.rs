//! What people see of a model: the force that it leaves, beside the simulation as it stands and refitted.

use crate::estimate::Estimator;
use crate::known::known;
use crate::report::{Both, FitTable};
use crate::residuals::{Residuals, relative_gain, residuals};
use crate::select::{Bench, Candidate};
use crate::track::Track;

/// A fitted model with what it leaves.
pub(crate) struct Shown {
    pub(crate) patched: Candidate,
    pub(crate) on_fit: Residuals,
    pub(crate) on_held: Residuals,
    pub(crate) table: FitTable,
}

impl Shown {
    /// Lays a fitted model and the refit on all recordings, under one estimator.
    pub(crate) fn new(
        bench: &Bench,
        held: &[Track],
        estimator: &Estimator,
        refit: &Candidate,
        patched: Candidate,
    ) -> Self {
        let nominal = bench.nominal;
        let known: &[Track] = &known(held, &patched.model, bench.span);
        let on_fit = residuals(nominal, estimator, bench.tracks, false, refit, &patched);
        let on_held = residuals(nominal, estimator, known, true, refit, &patched);
        let both = |a: &Vec<Vec<f64>>, b: &Vec<Vec<f64>>| Both {
            fit: estimator.rms(a, bench.tracks),
            holdout: estimator.rms(b, held),
        };
        let helps = relative_gain(estimator, held, &on_held.refit, &on_held.patched);
        let table = FitTable {
            metric: "force_rmse".into(),
            unit: nominal.rig.kind.force().into(),
            nominal: both(&on_fit.nominal, &on_held.nominal),
            refit: both(&on_fit.refit, &on_held.refit),
            patched: both(&on_fit.patched, &on_held.patched),
            force_rms: both(&on_fit.force, &on_held.force),
            // Nothing can take more than there is; some resamplings of few segments would.
            holdout_gain_ci95: [helps.low, helps.high].map(|x| x.min(1.0)),
        };
        Self { patched, on_fit, on_held, table }
    }
}
