//! What an effect is: everything that anyone asks of one, in one trait. A file of this folder defines each.
//!
//! Forces are in N·m or N when a plant runs and per inertia, as accelerations, when a recording is fitted; a law is written once
//! for both. Nothing here may know how an effect is found.

use super::joint_terms::JointTerms;
use super::{CommandLaw, Effect, EffectName, State, Subsystem};

/// A law with its state. The force is the sum of coefficient times term; laws in the sensor give travel instead.
pub(crate) trait ForceLaw: std::fmt::Debug + Send + Sync {
    /// Names of the terms, in the order of [`ForceLaw::terms`].
    fn names(&self) -> Vec<String>;
    /// The terms for one step; `out` has one place per name. `velocity` is nought where its sign is unknown.
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]);
    /// The part of the force that holds an axis at rest, per unit of the first coefficient, where only a part does.
    fn dry_part(&self, _state: &State) -> f64 {
        0.0
    }
    /// The same law with the same state.
    fn copy(&self) -> Box<dyn ForceLaw>;
}

/// What the recordings span, and what the rig says of the machine: all that a grid of shapes depends on.
#[derive(Debug, Clone)]
pub(crate) struct Span {
    /// Speed that 99 % of the blocks stay below, and the floor under which its sign is unknown, rad/s or m/s.
    pub(crate) speed: f64,
    pub(crate) speed_floor: f64,
    /// Speed that a twelfth of the moving blocks stay below.
    pub(crate) slow: f64,
    /// Travel relative to the start of each recording, rad or m.
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Largest |command|, and the mean of its square over time.
    pub(crate) command: f64,
    pub(crate) mean_square: f64,
    /// Longest recording, s.
    pub(crate) duration: f64,
    /// Mean time between rows, s, and between blocks.
    pub(crate) row: f64,
    pub(crate) block: f64,
    /// One count.
    pub(crate) count: f64,
    /// Smallest part of the largest command at which a drive may clip. Where the inertia is hardly known, a drive that
    /// clips at little explains slow motion as well as forces in balance do.
    pub(crate) clip: f64,
    /// Largest command that may do nothing.
    pub(crate) dead: f64,
    /// Whether the columns are there and vary.
    pub(crate) tilt: bool,
    pub(crate) force: bool,
    /// What the rig says.
    pub(crate) rig: Believed,
}

/// What the rig says of the machine.
#[derive(Debug, Clone, Default)]
pub(crate) struct Believed {
    /// Travel per turn of the motor and of the axis itself, where they are known, rad or m.
    pub(crate) turn: Option<f64>,
    pub(crate) axis_turn: Option<f64>,
    /// Whether a law of the travel may hold for all recordings.
    pub(crate) has_stroke: bool,
    /// Whether the nominal model has an offset, and viscous friction.
    pub(crate) has_offset: bool,
    pub(crate) has_viscous: bool,
    /// Whether it has a weight whose tilt is the axis' own angle: the gravity of a pendulum.
    pub(crate) has_gravity: bool,
    /// Whether gain over inertia was found from force, the rig hardly knowing it.
    pub(crate) is_anchored: bool,
    /// What the law of a joint takes from the whole machine, all per inertia.
    pub(crate) machine: Vec<(&'static str, f64)>,
    /// Deceleration by dry friction and acceleration per unit of command, rad/s² or m/s².
    pub(crate) dry: f64,
    pub(crate) per_command: f64,
}

impl Span {
    /// Largest less smallest travel, rad or m.
    pub(crate) fn travel(&self) -> f64 {
        self.high - self.low
    }
}

/// Sizes that the rig allows an effect, per inertia.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Allowed {
    /// Gain over inertia as far as it is known, the factor by which the truth may differ, and whether force has told it.
    pub(crate) gain: f64,
    pub(crate) gain_reach: f64,
    pub(crate) is_anchored: bool,
    /// Most that viscous and dry friction of the rig may be; none where it has none.
    pub(crate) viscous: Option<f64>,
    pub(crate) dry: Option<f64>,
    /// Most that the truth of dry friction may be by the rig's uncertainty.
    pub(crate) dry_by_uncertainty: f64,
}

/// Anything.
pub(crate) const FREE: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
/// Anything not below zero.
pub(crate) const POSITIVE: (f64, f64) = (0.0, f64::INFINITY);

/// A fitted effect, from which its values are reported.
pub(crate) struct Fitted<'a> {
    pub(crate) effect: &'a Effect,
    /// Coefficients with their standard deviations, per inertia.
    pub(crate) terms: Vec<(f64, f64)>,
    /// Inertia, kg·m² or kg, and the relative standard deviation of its scale.
    pub(crate) inertia: f64,
    pub(crate) common: f64,
    /// Gain over inertia.
    pub(crate) ratio: f64,
    /// Viscous and dry friction per inertia, by the rig's own terms or another effect's, and the rig's own dry friction.
    pub(crate) viscous: Option<f64>,
    pub(crate) dry: Option<f64>,
    pub(crate) own_dry: f64,
    /// Counts that recordings were seen to lose.
    pub(crate) lost: f64,
    /// Units of force, length and command.
    pub(crate) force: &'static str,
    pub(crate) length: &'static str,
    pub(crate) command: String,
    /// Relative standard deviation of a value of the shape.
    pub(crate) shape_sd: &'a dyn Fn(&str) -> f64,
}

/// A value of the report.
pub(crate) struct Reported {
    pub(crate) name: String,
    pub(crate) value: f64,
    pub(crate) sd: f64,
    pub(crate) unit: String,
}

impl Reported {
    pub(crate) fn new(name: impl Into<String>, (value, sd): (f64, f64), unit: impl Into<String>) -> Self {
        Self { name: name.into(), value, sd, unit: unit.into() }
    }
}

impl Fitted<'_> {
    /// A coefficient with its standard deviation, per inertia; nought where it is missing.
    pub(crate) fn term(&self, k: usize) -> (f64, f64) {
        self.terms.get(k).copied().unwrap_or((0.0, 0.0))
    }

    /// A force: the coefficient times the inertia, whose scale is known no better than the rig says.
    pub(crate) fn scaled(&self, (x, sd): (f64, f64)) -> (f64, f64) {
        let value = x * self.inertia;
        (value, ((sd * self.inertia).powi(2) + (value * self.common).powi(2)).sqrt())
    }

    /// A value of the shape with its standard deviation.
    pub(crate) fn shape(&self, key: &str) -> (f64, f64) {
        let value = self.effect.shape_or(key, 0.0);
        (value, value * (self.shape_sd)(key))
    }

    /// A force that is the effect's only coefficient, under a name and a unit.
    pub(crate) fn one_force(&self, name: &str, unit: String) -> Vec<Reported> {
        vec![Reported::new(name, self.scaled(self.term(0)), unit)]
    }
}

/// Root of the sum of squares of values, with its standard deviation.
pub(crate) fn sized(pairs: &[(f64, f64)]) -> (f64, f64) {
    let square: f64 = pairs.iter().map(|(x, _)| x * x).sum();
    let size = square.sqrt();
    let sd = pairs.iter().map(|(x, s)| (x * s).powi(2)).sum::<f64>().sqrt() / size.max(1e-300);
    (size, sd)
}

/// What recordings show, as far as it decides between twins.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Shown {
    /// Whether all motion is at one speed, in strokes of one length, within less than a turn, and along a line.
    pub(crate) one_speed: bool,
    pub(crate) one_length: bool,
    pub(crate) less_than_a_turn: bool,
    pub(crate) linear: bool,
    /// Whether the model leaves much of what the refit left.
    pub(crate) leaves_much: bool,
    /// One count, rad or m.
    pub(crate) count: f64,
}

/// A term of the rig's own model that is the same force as an effect: where the rig holds it, the effect cannot have been left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NominalTerm {
    /// Friction that grows with speed.
    Viscous,
    /// Dry friction.
    Coulomb,
    /// The gravity of an off-centre mass.
    Gravity,
    /// A weight that acts through the tilt.
    Weight,
}

/// What holds a second mass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coupling {
    /// Something stiff, a shaft or flanks that touch, which rings with the masses.
    Stiff,
    /// A grip, which lets go and does not ring.
    Grip,
}

/// What makes an effect one that any machine may have.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain {
    /// Place in the order in which plain forces enter a model.
    pub(crate) rank: u8,
    /// Whether another effect of the library may take the same force.
    pub(crate) has_twin: bool,
}

/// Physics without a name in the library, of the law of an effect: nothing of it is named, it speaks only against names.
pub(crate) struct Unnamed {
    /// The law with the shape that makes it such.
    pub(crate) effect: Effect,
    /// As how many values its freedom counts.
    pub(crate) freedom: f64,
    /// What it is, in words.
    pub(crate) what: String,
}

/// A value of a shape that may move: its key, and its bounds.
pub(crate) type Movable = (&'static str, f64, f64);

/// A value of a shape by its key, and factors on it.
pub(crate) type Factors = (&'static str, &'static [f64]);

/// An effect.
pub(crate) trait Definition: Sync {
    /// Where it sits.
    fn subsystem(&self) -> Subsystem;

    /// What it is, in words that a technician uses.
    fn words(&self) -> &'static str;

    /// Its law, where it is a force or in the sensor.
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        None
    }

    /// Its law, where it acts on the command.
    fn command_law(&self, _effect: &Effect) -> Option<CommandLaw> {
        None
    }

    /// Whether the law's terms are travel added to what the encoder reads.
    fn in_sensor(&self) -> bool {
        false
    }

    /// Whether its force is dry friction, which holds an axis at rest rather than moving it.
    fn is_dry(&self) -> bool {
        false
    }

    /// Whether it changes a dry friction, which must be there first.
    fn needs_dry(&self) -> bool {
        false
    }

    /// Whether its terms are proportional to the command.
    fn scales_drive(&self) -> bool {
        false
    }

    /// Whether its coefficients in a rig are parts of the gain rather than forces.
    fn is_relative_to_gain(&self) -> bool {
        self.scales_drive()
    }

    /// Whether it is told by what the command does fast, or by the command's scale.
    fn is_of_command(&self) -> bool {
        false
    }

    /// Whether each recording has its own phase, so that coefficients are not shared.
    fn has_own_phase(&self) -> bool {
        false
    }

    /// Whether it is made of waves that are sought.
    fn is_periodic(&self) -> bool {
        false
    }

    /// What holds the second mass that its law is of, where it is of one: such a law is faster than a block.
    fn coupling(&self) -> Option<Coupling> {
        None
    }

    /// The term of the rig that is the same force.
    fn nominal_term(&self) -> Option<NominalTerm> {
        None
    }

    /// Whether and how any machine may have it: such forces are looked for together, before anything else.
    fn plain(&self, _effect: &Effect) -> Option<Plain> {
        None
    }

    /// Whether waves of such orders of a turn are its own and not another's.
    fn is_of_orders(&self, _orders: &[f64]) -> bool {
        true
    }

    /// Whether it changes with the time of the recording.
    fn drifts(&self) -> bool {
        false
    }

    /// Whether its law is of the travel as far as that was fitted, and says nothing beyond.
    fn follows_travel(&self) -> bool {
        false
    }

    /// Whether its one term is the jumps of each recording's readings, which are found before any effect is: each of its moments
    /// is decided by itself.
    fn is_of_jumps(&self) -> bool {
        false
    }

    /// Puts jumps that were found into an effect that is of them: times, s, and how far the reading jumps, rad or m.
    fn put_jumps(&self, _effect: &mut Effect, _jumps: &[(f64, f64)]) {}

    /// Whether it bends to the little that any model leaves next to reversals, and so gains a little on recordings in which
    /// there is nothing.
    fn bends_at_reversals(&self) -> bool {
        false
    }

    /// Travel over which it gives way after a reversal before it holds, rad or m, where it does and that should be short.
    fn gives_way_over(&self, _effect: &Effect) -> Option<f64> {
        None
    }

    /// Shape values without which it cannot be run; all are above zero.
    fn needed(&self) -> &'static [&'static str] {
        &[]
    }

    /// The shapes from which a search starts; none where the recordings cannot show it.
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect>;

    /// The shape values that refinement may move.
    fn movable(&self, _effect: &Effect, _span: &Span) -> Vec<Movable> {
        Vec::new()
    }

    /// Whether the likelihood of the first shape value has several optima.
    fn has_optima_apart(&self) -> bool {
        false
    }

    /// Factors on values of the shape that go together, to look elsewhere for the optimum of an effect that is built on the
    /// rest of the machine.
    fn start_factors(&self) -> &'static [Factors] {
        &[]
    }

    /// Whether values of a shape go together.
    fn is_possible(&self, _effect: &Effect) -> bool {
        true
    }

    /// What the coefficient of a term may be for the effect to be what its name says, per inertia.
    fn limits(&self, _term: usize, _allowed: &Allowed) -> (f64, f64) {
        FREE
    }

    /// Whether it is in doubt where the coefficient of a term stands at its limit.
    fn is_in_doubt_at_limit(&self, _term: usize) -> bool {
        true
    }

    /// How many coefficients are fitted, over so many recordings.
    fn freedom(&self, _effect: &Effect, _recordings: usize) -> usize {
        1
    }

    /// The values that are reported.
    fn report(&self, fitted: &Fitted) -> Vec<Reported>;

    /// Relative standard deviation of a reported value for the form of the law alone: the machine's law is never quite ours,
    /// and an interval that only noise makes is too narrow.
    fn form_sd(&self, _value: &str) -> f64 {
        0.005
    }

    /// The variable over which it shows: `speed`, `travel`, `angle`, `command`, `time` or `tilt`.
    fn variable(&self) -> &'static str {
        "speed"
    }

    /// Others that recordings which show so much cannot tell from it, however well either fits.
    fn twins(&self, _effect: &Effect, _shown: &Shown) -> Vec<EffectName> {
        Vec::new()
    }

    /// Physics without a name that its law may also be: what may look like `fitted`, an effect of any name, or all there is
    /// where nothing is fitted. `name` is its own.
    fn unnamed(&self, _name: EffectName, _fitted: Option<&Effect>, _span: &Span) -> Vec<Unnamed> {
        Vec::new()
    }

    /// Adds the effect to a joint and its motor, as other simulators have them; whether those can say it.
    fn add_to_joint(&self, _effect: &Effect, _joint: &mut JointTerms) -> bool {
        false
    }

    /// The recording that would tell it from another; none where the other knows better or nobody does.
    fn experiment(&self, _other: EffectName) -> Option<&'static str> {
        None
    }
}
