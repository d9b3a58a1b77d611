//! The description of an effect for the search: its shapes, their bounds, and what it may be
//! confused with.

use crate::laws::{Effect, EffectName};
use regression::laws::Within;

/// The range of the recordings and the rig's statement of the machine: a grid of shapes depends on
/// nothing else.
#[derive(Debug, Clone)]
pub(crate) struct Span {
    /// Speed that 99 % of the blocks stay below, and the floor under which its sign is unknown,
    /// rad/s or m/s.
    pub(crate) speed: f64,
    pub(crate) speed_floor: f64,
    /// Speed that a twelfth of the moving blocks stay below.
    pub(crate) slow: f64,
    /// Travel relative to the start of each recording, rad or m.
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Largest |command|, and whether it changes within any recording.
    pub(crate) command: f64,
    pub(crate) command_changes: bool,
    /// Mean square of the command over time.
    pub(crate) mean_square: f64,
    /// Longest recording, s.
    pub(crate) duration: f64,
    /// Mean time between rows, s, and between blocks.
    pub(crate) row: f64,
    pub(crate) block: f64,
    /// One count.
    pub(crate) count: f64,
    /// Smallest part of the largest command at which a drive may clip. Where the inertia is hardly
    /// known, a drive that clips at little explains slow motion as well as forces in balance do.
    pub(crate) clip: f64,
    /// Largest command that may do nothing.
    pub(crate) dead: f64,
    /// True if the axis moves one way only.
    pub(crate) one_way: bool,
    /// True if the columns are there and vary.
    pub(crate) tilt: bool,
    pub(crate) force: bool,
    /// The rig's statement of the machine.
    pub(crate) rig: RigFacts,
}

/// The rig's statement of the machine.
#[derive(Debug, Clone, Default)]
pub(crate) struct RigFacts {
    /// Travel per turn of the motor and of the axis itself, where they are known, rad or m.
    pub(crate) turn: Option<f64>,
    pub(crate) axis_turn: Option<f64>,
    /// True if a law of the travel may hold for all recordings.
    pub(crate) has_stroke: bool,
    /// True if the nominal model has an offset, and viscous friction.
    pub(crate) has_offset: bool,
    pub(crate) has_viscous: bool,
    /// True if it has a weight whose tilt is the axis' own angle: the gravity of a pendulum.
    pub(crate) has_gravity: bool,
    /// True if gain over inertia was found from force, the rig hardly knowing it.
    pub(crate) is_anchored: bool,
    /// Values of the whole machine that the law of a joint uses, all per inertia.
    pub(crate) machine: Vec<(&'static str, f64)>,
    /// Deceleration by dry friction and acceleration per unit of command, rad/s² or m/s².
    pub(crate) dry: f64,
    pub(crate) per_command: f64,
}

impl ExcitationLimits {
    /// True if the recordings, and a fitted effect, are within a limit.
    pub(crate) fn is_within(&self, limit: Within, effect: &Effect) -> bool {
        match limit {
            Within::OneSpeed => self.one_speed,
            Within::OneWay => self.one_way,
            Within::OneLength => self.one_length,
            Within::LessThanATurn => self.less_than_a_turn,
            Within::Line => self.linear,
            Within::LeavesMuch => self.leaves_much,
            Within::UnseenGap => effect.name.definition().is_unseen(effect, self.count),
        }
    }
}

impl Span {
    /// Largest less smallest travel, rad or m.
    pub(crate) fn travel(&self) -> f64 {
        self.high - self.low
    }
}

/// Limits of the recordings that decide whether twins can be distinguished.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct ExcitationLimits {
    /// True if all motion is at one speed, one way, in strokes of one length, within less than a
    /// turn, and along a line.
    pub(crate) one_speed: bool,
    pub(crate) one_way: bool,
    pub(crate) one_length: bool,
    pub(crate) less_than_a_turn: bool,
    pub(crate) linear: bool,
    /// True if the model leaves much of what the refit left.
    pub(crate) leaves_much: bool,
    /// One count, rad or m.
    pub(crate) count: f64,
}

/// Marks an effect that any machine may have.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain {
    /// Place in the order in which plain forces enter a model.
    pub(crate) rank: u8,
    /// True if another effect of the library may take the same force.
    pub(crate) has_twin: bool,
}

/// Physics without a name in the library, of the law of an effect: nothing of it is named, it
/// speaks only against names.
pub(crate) struct Unnamed {
    /// The law with the shape that makes it such.
    pub(crate) effect: Effect,
    /// As how many values its freedom counts.
    pub(crate) freedom: f64,
    /// A noun phrase that says what it is.
    pub(crate) what: String,
}

/// A value of a shape that may move: its key, and its bounds.
pub(crate) type Movable = (&'static str, f64, f64);

/// A value of a shape by its key, and factors on it.
pub(crate) type Factors = (&'static str, &'static [f64]);

/// The description of an effect for the search.
pub(crate) trait EffectSearch {
    /// Returns the number of values of a finer profile along the travel, by which shapes of a grid
    /// differ; 0 if they do not.
    fn profile_values(&self, _effect: &Effect) -> f64 {
        0.0
    }

    /// False for a force without a name, which is no hypothesis.
    fn is_sought(&self) -> bool {
        true
    }

    /// True if it is made of waves that are sought.
    fn is_periodic(&self) -> bool {
        false
    }

    /// Returns how any machine may have it; none if not. Such forces are looked for together,
    /// before anything else.
    fn plain(&self, _effect: &Effect) -> Option<Plain> {
        None
    }

    /// True if waves of such orders of a turn are its own and not another's.
    fn is_of_orders(&self, _orders: &[f64]) -> bool {
        true
    }

    /// True if it bends to the little that any model leaves next to reversals, and so gains a
    /// little on recordings in which there is nothing.
    fn bends_at_reversals(&self) -> bool {
        false
    }

    /// Travel over which it gives way after a reversal before it holds, rad or m, where it does and
    /// that should be short.
    fn gives_way_over(&self, _effect: &Effect) -> Option<f64> {
        None
    }

    /// The shapes from which a search starts; none where the recordings cannot show it.
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect>;

    /// The shape values that refinement may move.
    fn movable(&self, _effect: &Effect, _span: &Span) -> Vec<Movable> {
        Vec::new()
    }

    /// True if the likelihood of the first shape value has several optima.
    fn has_optima_apart(&self) -> bool {
        false
    }

    /// Factors on values of the shape that go together, to look elsewhere for the optimum of an
    /// effect that is built on the rest of the machine.
    fn start_factors(&self) -> &'static [Factors] {
        &[]
    }

    /// True if values of a shape go together.
    fn is_possible(&self, _effect: &Effect) -> bool {
        true
    }

    /// True if it is in doubt where the coefficient of a term is at its limit.
    fn is_in_doubt_at_limit(&self, _term: usize) -> bool {
        true
    }

    /// Returns the number of coefficients that are fitted, over so many recordings.
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        1
    }

    /// True if a reading of whole counts, one of them rad or m, does not show its shape.
    fn is_unseen(&self, _effect: &Effect, _count: f64) -> bool {
        false
    }

    /// Physics without a name that its law may also be: what may look like `fitted`, an effect of
    /// any name, or all there is where nothing is fitted. `name` is its own.
    fn unnamed(&self, _name: EffectName, _fitted: Option<&Effect>, _span: &Span) -> Vec<Unnamed> {
        Vec::new()
    }
}
