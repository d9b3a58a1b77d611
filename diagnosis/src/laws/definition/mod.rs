//! The definition of an effect, in a trait each for its law, for the search and for the report. A
//! file of `effects` defines each effect. Nothing here may know how an effect is found.

mod law;
mod report;
mod search;

pub(crate) use law::{Coupling, EffectLaw, ForceLaw, NominalTerm};
pub(crate) use report::{EffectReport, Fitted, Reported, sized};
pub(crate) use search::{EffectSearch, ExcitationLimits, Factors, Movable, Plain, RigFacts, Span, Unnamed};

/// An effect.
pub(crate) trait Definition: EffectLaw + EffectSearch + EffectReport {}

impl<T: EffectLaw + EffectSearch + EffectReport> Definition for T {}
