//! The fourth stage: how sure each effect is, and whether something without a name explains the
//! recordings instead.

use crate::data::schema::FitTable;
use crate::decide::confidence_pass::{WeighingContext, weigh};
use crate::decide::diagnosis::Reason;
use crate::decide::elimination::Found;
use crate::decide::free_form_check::{self, FreeFormShare, Unnamed};
use crate::decide::out_of_library::{self, UnnamedPhysics};
use crate::decide::thresholds::MATERIAL;
use crate::decide::verdict::misfit;
use crate::decide::weighed_model::WeighedModel;
use crate::evidence::comparison::ModelComparison;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::parameters;
use crate::evidence::prepared::Prepared;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::model::Model;
use crate::fit::refit::is_driven;
use crate::propose::context::FittedModel;
use crate::propose::excitation::Excitation;

/// Everything that the decision rests on.
pub(crate) struct Assessment {
    /// The fitted recordings in the motion of the model that was found.
    pub(crate) fit: Vec<BlockedRecording>,
    /// The recordings that judge, in that motion.
    pub(crate) holdout: HoldoutSet,
    pub(crate) excitation: Excitation,
    /// The null under white noise.
    pub(crate) refit: FittedModel,
    /// The model found, its effects weighed.
    pub(crate) weighed: WeighedModel,
    /// The model with the named effects and no other, where that is another one than was weighed.
    pub(crate) named_alone: Option<ModelComparison>,
    /// The gain of a force of any form in addition to the named effects.
    pub(crate) beside: Option<FreeFormShare>,
    /// The force of any form that explains most, where nothing is named, and the refit with that
    /// force included.
    pub(crate) unnamed: Option<Unnamed>,
    pub(crate) with_unnamed: Option<ModelComparison>,
    /// Physics without a name that explains most, where nothing is named.
    pub(crate) foreign: Option<UnnamedPhysics>,
}

impl Assessment {
    /// Force errors with what is named.
    pub(super) fn table(&self) -> &FitTable {
        &self.named_alone.as_ref().unwrap_or(&self.weighed.shown).table
    }
}

/// Weighs the effects that were found; the reason where the rig's model does not describe the
/// recordings at all.
pub(crate) fn assess(prepared: &Prepared, found: Found) -> Result<Assessment, Reason> {
    let Prepared { nominal, .. } = prepared;
    let Found { fit, holdout, null, standing } = found;
    let context = prepared.context(&fit);
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let excitation = Excitation::of(&fit, count, nominal.rig.turn());
    let by_shares = !standing.materials.is_empty();
    let refit = context.fit_shown(Model::default(), &null.noise, by_shares);
    let weighing = WeighingContext {
        context: &context,
        refit: &refit,
        null: &null,
        holdout: &holdout,
        excitation: &excitation,
    };
    let weighed = weigh(&weighing, standing);
    if let Some(reason) = misfit(&weighed, nominal, is_driven(nominal, &fit)) {
        return Err(reason);
    }
    let (mut weighed, beside) = free_form_check::check(weighed, &context);
    let named_alone = only_named(&weighing, &mut weighed);
    let nothing_named = weighed.named().is_empty();
    let unnamed =
        nothing_named.then(|| free_form_check::alone(&context, &refit, &holdout, &null.noise)).flatten();
    let (unnamed, fitted) = unnamed.map_or((None, None), |(unnamed, fitted)| (Some(unnamed), fitted));
    let show = |fitted| ModelComparison::new(&context, &holdout.smoothed, &weighed.estimator, &refit, fitted);
    let with_unnamed = fitted.map(show);
    // A form that lowers no error on recordings it was not fitted to explains nothing.
    let lowers = |shown: &ModelComparison| shown.table.patched.holdout < shown.table.refit.holdout;
    let helps = with_unnamed.as_ref().is_none_or(lowers);
    let (unnamed, with_unnamed) = if helps { (unnamed, with_unnamed) } else { (None, None) };
    let foreign = nothing_named.then(|| out_of_library::alone(&context, &refit, &holdout)).flatten();
    Ok(Assessment {
        fit,
        holdout,
        excitation,
        refit,
        weighed,
        named_alone,
        beside,
        unnamed,
        with_unnamed,
        foreign,
    })
}

/// True if a model takes a material part off the held-out force error of the refit.
pub(super) fn is_material(table: &FitTable) -> bool {
    table.patched.holdout <= (1.0 - MATERIAL) * table.refit.holdout
}

/// The model with the named effects and no other, where that is another one: what is not named was
/// not found, and may be in no patched rig. An effect that has no size without the others is not
/// named either, nor are effects of the filter that together take no material part off the held-out
/// force error; those of the regression were judged by that before.
fn only_named(weighing: &WeighingContext, weighed: &mut WeighedModel) -> Option<ModelComparison> {
    let WeighingContext { context, refit, null, holdout, .. } = *weighing;
    let by_shares = !weighed.materials.is_empty();
    loop {
        let named = weighed.named();
        if named.len() == weighed.effects.len() {
            if by_shares || named.is_empty() || is_material(&weighed.shown.table) {
                return None;
            }
            weighed.weakest_is_immaterial(part_off(&weighed.shown.table));
            continue;
        }
        let last = &weighed.coloured_fit;
        let effects = named.iter().map(|i| last.model.effects[*i].clone()).collect();
        let model = Model { effects, ..last.model.clone() };
        let coloured_fit = context.fit_coloured(model, &[&null.noise, &last.noise]);
        let patched = context.fit_shown(coloured_fit.model, &coloured_fit.noise, by_shares);
        let is_there = |place: usize| {
            let values = parameters::parameters(context, &patched, place);
            let name = patched.model.effects[place].name;
            match weighed.effects[named[place]].material {
                Some(_) => parameters::has_size(name, &values),
                None => parameters::is_there(name, &values),
            }
        };
        let gone: Vec<usize> =
            named.iter().enumerate().filter(|(place, _)| !is_there(*place)).map(|(_, i)| *i).collect();
        if !gone.is_empty() {
            weighed.have_no_size(&gone);
            continue;
        }
        let shown = ModelComparison::new(context, &holdout.smoothed, &weighed.estimator, refit, patched);
        if by_shares || named.is_empty() || is_material(&shown.table) {
            return Some(shown);
        }
        weighed.weakest_is_immaterial(part_off(&shown.table));
    }
}

/// The part that a model takes off the held-out force error of the refit.
fn part_off(table: &FitTable) -> f64 {
    // A residual that is no number takes nothing off.
    (1.0 - table.patched.holdout / table.refit.holdout.max(1e-300)).max(f64::MIN)
}
