//! A check of recordings in seconds: everything that is said before an effect is looked for.
//! Nothing here names or rejects.

use crate::data::recording::Recording;
use crate::data::rig::{Kind, Rig};
use crate::data::schema::DataFault;
use crate::evidence::prepared::Prepared;
use crate::evidence::residuals::{drive_force, forces};
use crate::fit::force_residual::Estimator;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::nominal::{InertiaSource, Key};
use crate::laws::definition::ExcitationLimits;
use crate::laws::{Effect, EffectName};
use crate::propose::excitation::Excitation;
use crate::propose::untested::{self, NotTested};
use crate::repair::Checked;

/// Correlation of two fitted values from which only their combination shows.
const ALIKE: f64 = 0.95;

/// The limits of what recordings of a rig can show.
pub(crate) struct Check {
    pub(crate) kind: Kind,
    pub(crate) recordings: Vec<Seen>,
    pub(crate) faults: Vec<DataFault>,
    /// Rows by which commands act late; none where no skew shows.
    pub(crate) late_rows: Option<f64>,
    /// True if the motion shows no inertia.
    pub(crate) is_inertia_hidden: bool,
    pub(crate) excitation: Excitation,
    /// Pairs of values of the rig that the fitted recordings cannot distinguish, with their
    /// correlation.
    pub(crate) alike: Vec<(&'static str, &'static str, f64)>,
    /// Effects that no such recordings can tell from each other.
    pub(crate) twins: Vec<[EffectName; 2]>,
    pub(crate) untested: Vec<(EffectName, NotTested)>,
    /// Parts of the fitted force, root mean square: what the refitted rig leaves, and what reading
    /// whole counts alone would.
    pub(crate) left: f64,
    pub(crate) noise: f64,
    /// Band in which forces are seen, Hz.
    pub(crate) band_hz: f64,
}

/// One recording as it is used.
pub(crate) struct Seen {
    pub(crate) file: String,
    pub(crate) seconds: f64,
    pub(crate) rate_hz: f64,
    /// Travel, counts.
    pub(crate) counts: f64,
    /// Part of the rows whose command is at the largest or the rig's limit.
    pub(crate) at_limit: f64,
}

/// Looks at recordings that can be used, prepared without a skew that somebody knows.
pub(crate) fn check(rig: &Rig, checked: &Checked, prepared: &Prepared) -> Check {
    let context = prepared.context(&prepared.fit);
    let fit = Fit::new(&Model::default(), context.nominal, context.tracks, &prepared.noise);
    let estimator = Estimator::new(context.tracks, &prepared.noise, prepared.scale);
    let inertia = prepared.nominal.rig.model.inertia;
    let rms = |of: &[Vec<f64>]| estimator.rms(of, context.tracks);
    let force = rms(&drive_force(&prepared.nominal, &estimator, context.tracks)).max(1e-300);
    let left = rms(&forces(&estimator, context.tracks, &fit.totals(context.tracks), inertia));
    let noise = estimator.counting(context.tracks, &prepared.noise, prepared.span.count) * inertia;
    let excitation = Excitation::of(&prepared.fit, prepared.span.count, rig.turn());
    let untested = untested::untested(&prepared.span, &prepared.nominal);
    let all = checked.fit.iter().chain(&*checked.holdout);
    Check {
        kind: rig.kind,
        recordings: all.map(|one| seen(one, rig)).collect(),
        faults: checked.faults.clone(),
        late_rows: prepared.nominal.skew_rows,
        is_inertia_hidden: prepared.nominal.kept_inertia == Some(InertiaSource::OfRig)
            || prepared.nominal.virtual_inertia > 0.0,
        excitation,
        alike: alike(&fit),
        twins: twins(&prepared.limits(&prepared.fit), &untested),
        untested,
        left: left / force,
        noise: noise / force,
        band_hz: estimator.bandwidth_hz,
    }
}

fn seen(recording: &Recording, rig: &Rig) -> Seen {
    let ends = |column: &[f64]| {
        column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)))
    };
    let (low, high) = ends(&recording.position_counts);
    let (least, most) = ends(&recording.command);
    let largest = rig.actuator.limit.unwrap_or(f64::INFINITY).min(least.abs().max(most.abs()));
    let at_limit = recording.command.iter().filter(|u| u.abs() >= largest && largest > 0.0).count();
    Seen {
        file: recording.file.clone(),
        seconds: recording.duration_s(),
        rate_hz: recording.rate_hz(),
        counts: high - low,
        at_limit: at_limit as f64 / recording.len().max(1) as f64,
    }
}

/// A value of the rig in words; none for what is no value of it.
fn in_words(key: Key) -> Option<&'static str> {
    match key {
        Key::Gain => Some("inertia over gain"),
        Key::Viscous => Some("viscous friction"),
        Key::Coulomb => Some("dry friction"),
        Key::Weight => Some("the weight under the tilt"),
        Key::Gravity => Some("gravity"),
        _ => None,
    }
}

/// Pairs of values of the rig whose errors go together in a fit.
fn alike(fit: &Fit) -> Vec<(&'static str, &'static str, f64)> {
    let covariance = &fit.solution.covariance;
    let values: Vec<(usize, &'static str)> =
        fit.keys.iter().enumerate().filter_map(|(i, (key, _))| Some((i, in_words(*key)?))).collect();
    let correlation = |i: usize, j: usize| {
        covariance.at(i, j) / (covariance.at(i, i) * covariance.at(j, j)).sqrt().max(1e-300)
    };
    let pairs = values.iter().enumerate().flat_map(|(n, a)| values[..n].iter().map(move |b| (*b, *a)));
    pairs
        .map(|((i, a), (j, b))| (a, b, correlation(i, j)))
        .filter(|(_, _, correlation)| correlation.abs() > ALIKE)
        .collect()
}

/// Effects that are tested and have the same shape in all such motion.
fn twins(shown: &ExcitationLimits, untested: &[(EffectName, NotTested)]) -> Vec<[EffectName; 2]> {
    let is_tested =
        |name: &EffectName| name.definition().is_sought() && untested.iter().all(|(other, _)| other != name);
    let mut pairs: Vec<[EffectName; 2]> = Vec::new();
    for name in EffectName::ALL.iter().filter(|name| is_tested(name)) {
        for other in Effect::shaped(*name, &[]).twins(shown) {
            let pair = [*name.min(&other), *name.max(&other)];
            if is_tested(&other) && !pairs.contains(&pair) {
                pairs.push(pair);
            }
        }
    }
    pairs
}
