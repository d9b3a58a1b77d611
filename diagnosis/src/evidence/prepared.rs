//! Rig and recordings before any effect is looked for, as `pipeline/prepare` makes them.

use crate::data::rig::{Kind, Rig};
use crate::evidence::holdout_set::HoldoutSet;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::nominal::Nominal;
use crate::laws::EffectName;
use crate::laws::definition::{ExcitationLimits, Span};
use crate::propose::context::FitContext;
use crate::propose::excitation::Excitation;

/// Rig and recordings before any effect is looked for.
pub(crate) struct Prepared {
    /// The rig as it was given.
    pub(crate) given: Rig,
    pub(crate) nominal: Nominal,
    /// The recordings that are fitted, in the motion of the refitted nominal model.
    pub(crate) fit: Vec<BlockedRecording>,
    /// The recordings that judge.
    pub(crate) holdout: HoldoutSet,
    pub(crate) span: Span,
    /// Acceleration that the command makes: the scale of the noise search.
    pub(crate) scale: f64,
    /// Noise under the refitted nominal model.
    pub(crate) noise: Noise,
    /// Laws of the command that the force which the motion asks for does not show.
    pub(crate) unsought: Vec<EffectName>,
}

impl Prepared {
    /// Returns the context of a search over recordings in some motion.
    pub(crate) fn context<'a>(&'a self, tracks: &'a [BlockedRecording]) -> FitContext<'a> {
        let Self { nominal, span, scale, unsought, .. } = self;
        FitContext { nominal, tracks, span, scale: *scale, unsought }
    }

    /// The facts about the axis that recordings in some motion show.
    pub(crate) fn limits(&self, tracks: &[BlockedRecording]) -> ExcitationLimits {
        let (count, rig) = (self.span.count, &self.nominal.rig);
        let excitation = Excitation::of(tracks, count, rig.turn()).limits();
        ExcitationLimits { one_way: self.span.one_way, linear: rig.kind == Kind::Linear, count, ..excitation }
    }
}
