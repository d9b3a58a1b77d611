//! The comparison of a named effect with forces of any form, by what each gains on left-out blocks.

use crate::decide::thresholds::{FORM_SURE_Z, FORM_TOLD, NEARLY_ALL_OF_FORM};
use crate::fit::blocked_recording::BlockedRecording;
use crate::laws::Variable;
use crate::propose::free_form::{Densities, Gain, Inputs, Taken};

/// A form that explains the data without an effect.
pub(crate) struct Against {
    pub(crate) inputs: Inputs,
    /// Gain of the form in the effect's place or in addition to it, whichever is more, nats.
    pub(crate) most: f64,
    /// The gain of that beyond the effect's.
    beyond: Gain,
}

/// An effect of a model on left-out blocks.
pub(crate) struct Standing {
    /// Its own gain.
    pub(crate) own: Gain,
    pub(crate) against: Option<Against>,
}

impl Gain {
    /// True if it is significantly above zero.
    fn is_sure(&self) -> bool {
        self.sum > 0.0 && self.z() > FORM_SURE_Z
    }
}

impl Densities {
    /// Compares an effect, a force of `variable` alone if given, with the forms, given the
    /// densities of the model without it. A form of that variable and of another one has every such
    /// law in it, so that none takes anything beyond: it says nothing.
    pub(crate) fn standing(&self, without: &Self, variable: Option<Variable>) -> Standing {
        let own = self.alone.over(&without.alone);
        let contains = |inputs: &Inputs| {
            let variables = inputs.variables();
            variables.len() > 1 && variable.is_some_and(|own| variables.contains(&own))
        };
        let forms = self.with.iter().zip(&without.with).filter(|((inputs, _), _)| !contains(inputs));
        let against = forms.filter_map(|((inputs, both), (_, form))| {
            let (most, instead) = (both.over(&without.alone).sum, form.over(&without.alone).sum);
            let better = if instead > most { form } else { both };
            let most = most.max(instead);
            let (beyond, beside) = (better.over(&self.alone), both.over(form).sum);
            let little = (1.0 - NEARLY_ALL_OF_FORM) * most;
            let is_small = variable.is_none() || own.sum < little;
            (is_small && beyond.is_sure() && beyond.sum > little && beside < little).then_some(Against {
                inputs: *inputs,
                most,
                beyond,
            })
        });
        let against = against.max_by(|a, b| a.beyond.sum.total_cmp(&b.beyond.sum));
        Standing { own, against }
    }
}

/// True if the gain of a form is sure and large enough to be reported.
pub(crate) fn is_reportable(taken: &Taken, tracks: &[BlockedRecording]) -> bool {
    let blocks: usize = tracks.iter().map(BlockedRecording::block_count).sum();
    taken.gain.is_sure() && taken.gain.sum > 0.5 * FORM_TOLD * blocks as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::propose::free_form::Density;

    const UNITS: usize = 40;

    /// Densities of a model with one form: what model and form take together and alone over
    /// nothing, nats per unit.
    fn densities(alone: f64, with: f64) -> Densities {
        // A little scatter, as no two units are alike.
        let density = |sum: f64| Density((0..UNITS).map(|i| sum * (1.0 + 0.3 * (i as f64).sin())).collect());
        Densities { alone: density(alone), with: vec![(Inputs::Speed, density(with))] }
    }

    /// True if an effect holds that takes `own` where the form takes `form` and both together
    /// `both`.
    fn stands(own: f64, form: f64, both: f64) -> bool {
        densities(own, both).standing(&densities(0.0, form), None).against.is_none()
    }

    #[test]
    fn a_name_takes_nearly_all_that_a_free_form_takes() {
        assert!(stands(20.0, 19.0, 20.5), "its own law");
        assert!(!stands(16.0, 20.0, 20.0), "the form takes a fifth more and leaves it nothing");
        assert!(stands(16.0, 5.0, 21.0), "something else is there beside it, which the form takes");
        assert!(!stands(-300.0, 20.0, -10.0), "it takes nothing");
    }

    /// As of EMPS, where friction differs with direction and more is left that a form over speed
    /// and time since reversal takes.
    #[test]
    fn a_form_that_has_every_law_of_its_kind_in_it_denies_none() {
        let over = |alone: f64, with: f64| {
            let mut densities = densities(alone, with);
            densities.with[0].0 = Inputs::SinceReversalSpeed;
            densities
        };
        let against = |variable| over(1.0, 20.0).standing(&over(0.0, 20.0), variable).against;
        assert!(against(Some(Variable::Speed)).is_none());
        assert!(against(Some(Variable::Travel)).is_some() && against(None).is_some());
    }

    #[test]
    fn a_force_of_one_variable_is_denied_where_it_takes_little() {
        let against =
            |own| densities(own, 20.0).standing(&densities(0.0, 20.0), Some(Variable::Speed)).against;
        assert!(against(5.0).is_none() && against(1.0).is_some());
    }

    #[test]
    fn one_unit_with_a_huge_gain_is_one_witness() {
        let mut gains = vec![-1.0; UNITS];
        gains[7] = 1e6;
        let nothing = Density(vec![0.0; UNITS]);
        assert!(!Density(gains).over(&nothing).is_sure());
        assert!(Density(vec![1.0; UNITS]).over(&nothing).is_sure());
    }
}
