//! Something that is not in the library, as the opponent of every name: a force of any form. Nothing here changes a model.

use crate::estimation::model::Model;
use crate::selection::free_form::{Evaluator, Taken, is_told};
use crate::selection::search::FitContext;
use crate::validation::assess::Assessment;
use crate::validation::stepwise::Search;

/// Puts every name that would stand against forces of any form; a name that one of them makes needless is none.
pub(crate) fn oppose(assessment: &mut Assessment, context: &FitContext, s: &Search) {
    let named = assessment.named();
    if named.is_empty() {
        return;
    }
    let evaluator = Evaluator::new(context.nominal, context.tracks, &s.last.noise, context.scale);
    let model = assessment.shown.patched.model.clone();
    let whole = evaluator.densities(&model);
    for i in named {
        let mut less = model.clone();
        less.effects.remove(i);
        let standing = whole.standing(&evaluator.densities(&less));
        if let Some(against) = standing.against {
            let takes = match standing.own.sum {
                own if own > 0.0 => format!("{own:.0}"),
                _ => "nothing".to_owned(),
            };
            assessment.effects[i].rather = Some(format!(
                "a force over {} of a form that it cannot have takes {:.0} nats of left-out blocks where it takes {takes}",
                against.inputs.in_words(),
                against.most,
            ));
        }
    }
}

/// The force of any form that explains most of what a refit leaves, where that is sure and enough to be told.
pub(crate) fn alone(context: &FitContext, s: &Search) -> Option<Taken> {
    let evaluator = Evaluator::new(context.nominal, context.tracks, &s.null.noise, context.scale);
    let taken = evaluator.densities(&Model::default()).taken();
    taken.into_iter().find(|taken| is_told(taken, context.tracks))
}
