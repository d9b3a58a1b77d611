//! The nominal model in units of acceleration: its coefficients, their priors, and the sizes that
//! it allows effects.

use crate::data::rig::{Model, Rig};
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::skew_columns;
use crate::laws::definition::NominalTerm;
use crate::laws::{EffectName, WholeMachine};
use numerics::linear::Prior;
use regression::laws::{Bounds, Quantity};

/// A column's meaning. Coefficients are accelerations: force divided by inertia.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    /// Effective command: gain over inertia.
    Gain,
    Viscous,
    Coulomb,
    Offset,
    /// Rows by which the command acts late, beyond those that were found before, times gain over
    /// inertia.
    Skew,
    /// Part of the command that acts in the row before and as much in the row after, times gain
    /// over inertia.
    Spread,
    Weight,
    /// Gravity on an off-centre mass, of absolute counts.
    Gravity,
    /// The measured external load.
    External,
    /// Term of an effect of the model.
    Term {
        effect: usize,
        term: usize,
    },
}

/// An inertia that fits whose values are shown keep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum InertiaSource {
    /// Gain over inertia, seen in the band that the counts support.
    Seen(f64),
    /// The rig's: the recordings show none.
    OfRig,
}

/// The nominal model in units of acceleration, with what may move.
#[derive(Debug, Clone)]
pub(crate) struct Nominal {
    pub(crate) rig: Rig,
    /// Sign with which the measured load acts; zero where it was not seen to act.
    pub(crate) external: f64,
    /// Gain over inertia found from force where the rig hardly knows it: (value, relative standard
    /// deviation).
    pub(crate) anchor: Option<(f64, f64)>,
    /// The inertia of fits whose values are shown, where the rig hardly knows it and noise hides it
    /// from the fits of the search.
    pub(crate) kept_inertia: Option<InertiaSource>,
    /// True if the refit explains most of the force.
    pub(crate) is_balanced: bool,
    /// Inertia added to rig and command alike, where the machine's own hardly matters, kg·m² or kg.
    pub(crate) virtual_inertia: f64,
    /// Rows by which the commands were delayed because they act after their time stamps; none if
    /// the recordings show no skew.
    pub(crate) skew_rows: Option<f64>,
    /// True if the axis moves one way only: a constant force is a dry friction there.
    pub(crate) one_way: bool,
}

/// The number of standard deviations by which a nominal value may move in a refit.
const REACH: f64 = 3.0;
/// The same of gain over inertia: a refit that stops at the end of it makes a drift of the rest.
const RATIO_REACH: f64 = 3.5;
/// The number of standard deviations by which a nominal value may be below the truth.
const FARTHEST: f64 = 2.5;

/// Relative standard deviation of a gain over inertia that is kept.
const KEPT: f64 = 0.02;

/// Least part of the truth that a nominal value of some relative standard deviation may be.
fn least_of_truth(sd: f64) -> f64 {
    1.0 - (FARTHEST * sd).min(0.98)
}

/// Most that the truth may be over its nominal value: one that is off by its deviation may be small
/// against the truth, so that this is farther than the way down.
fn most_over_nominal(sd: f64) -> f64 {
    (2.0 * (1.0 + REACH * sd)).max(1.0 / least_of_truth(sd))
}

/// Part of a wandering bias that one may be where there is to be none.
const NO_BIAS: f64 = 1e-3;

/// Largest part of the command that may do nothing: where forces are in balance, where the inertia
/// is hardly known, and where forces are not in balance.
const IGNORED: f64 = 0.9;
const IGNORED_UNANCHORED: f64 = 0.35;
const IGNORED_UNBALANCED: f64 = 0.2;

impl Nominal {
    /// The nominal model of a rig, before anything was found of it in recordings.
    pub(crate) fn of(rig: &Rig) -> Self {
        Self {
            rig: rig.clone(),
            external: 0.0,
            anchor: None,
            kept_inertia: None,
            is_balanced: false,
            virtual_inertia: 0.0,
            skew_rows: None,
            one_way: false,
        }
    }

    /// The nominal model whose fits are shown: they keep an inertia that noise hides, as a fit
    /// under a speed loop makes it as heavy as it may be.
    pub(crate) fn shown(&self) -> Self {
        let anchor = match self.kept_inertia {
            Some(InertiaSource::Seen(gain)) => Some((gain, KEPT)),
            Some(InertiaSource::OfRig) => Some((self.gain(), KEPT)),
            None => self.anchor,
        };
        Self { anchor, ..self.clone() }
    }

    /// Gain over inertia as the rig states it.
    pub(crate) fn gain(&self) -> f64 {
        self.rig.actuator.gain / self.rig.model.inertia
    }

    /// Gain over inertia as far as it is known: by the anchor, where there is one.
    pub(crate) fn known_gain(&self) -> f64 {
        self.anchor.map_or(self.gain(), |(value, _)| value)
    }

    /// The inertia that goes with it and the rig's gain.
    fn known_inertia(&self) -> f64 {
        self.anchor.map_or(self.rig.model.inertia, |(value, _)| (self.rig.actuator.gain / value).abs())
    }

    /// Factor by which gain over inertia may differ from its nominal value.
    pub(crate) fn gain_reach(&self) -> f64 {
        1.0 + REACH * self.gain_sd()
    }

    /// Relative standard deviation of gain over inertia.
    pub(crate) fn gain_sd(&self) -> f64 {
        (self.rig.gain_sd().powi(2) + self.rig.inertia_sd().powi(2)).sqrt()
    }

    fn has_offset(&self) -> bool {
        self.rig.model.offset.is_some()
    }

    /// True if the nominal model holds an effect already, so that it cannot have been left out.
    pub(crate) fn holds(&self, name: EffectName) -> bool {
        name.definition().nominal_term().is_some_and(|term| self.has(term))
    }

    /// True if the nominal model has a term.
    pub(crate) fn has(&self, term: NominalTerm) -> bool {
        let model = &self.rig.model;
        match term {
            NominalTerm::Viscous => model.viscous.is_some_and(|x| x > 0.0),
            NominalTerm::Coulomb => model.coulomb.is_some_and(|x| x > 0.0),
            NominalTerm::Gravity => model.gravity.is_some_and(|x| x != 0.0),
            NominalTerm::Weight => model.weight.is_some_and(|x| x != 0.0),
        }
    }

    fn ratio_prior(&self) -> Prior {
        let (mean, sd) = self.anchor.unwrap_or((self.gain(), self.gain_sd()));
        let (a, b) = (mean / (1.0 + RATIO_REACH * sd), mean / (1.0 - RATIO_REACH * sd).max(0.05));
        Prior { mean, sd: sd * mean.abs(), low: a.min(b), high: a.max(b) }
    }

    /// True if a fitted gain over inertia stopped at a limit of its refit.
    pub(crate) fn is_at_limit(&self, ratio: f64) -> bool {
        let Prior { low, high, .. } = self.ratio_prior();
        [low, high].iter().any(|limit| (ratio - limit).abs() <= 1e-6 * limit.abs())
    }

    pub(super) fn priors(&self, key: Key, noise: &Noise) -> Prior {
        let rig = &self.rig;
        let j = self.known_inertia();
        let common = rig.inertia_sd().min(self.anchor.map_or(f64::INFINITY, |(_, sd)| sd));
        let relative = |value: f64, sd: f64| {
            let mean = value / j;
            let sd = (sd * sd + common * common).sqrt();
            // Friction never vanishes where the rig declares it.
            let (a, b) = (mean / (2.0 * (1.0 + REACH * sd)), mean * most_over_nominal(sd));
            let least = least_of_truth(sd).max(0.2);
            Prior { mean, sd: sd / least * mean.abs(), low: a.min(b), high: a.max(b) }
        };
        match key {
            Key::Gain => self.ratio_prior(),
            Key::Viscous => relative(rig.model.viscous.unwrap_or(0.0), rig.viscous_sd()),
            Key::Coulomb => relative(rig.model.coulomb.unwrap_or(0.0), rig.coulomb_sd()),
            Key::Weight => relative(rig.model.weight.unwrap_or(0.0), rig.weight_sd()),
            Key::Gravity => relative(rig.model.gravity.unwrap_or(0.0), rig.gravity_sd()),
            Key::Offset => {
                // A rig without an offset still sees a bias that wanders by a fraction of the
                // disturbance.
                let wander = 0.5 * noise.slow.sqrt();
                let sd = if self.has_offset() {
                    let declared = rig.uncertainty.offset.unwrap_or(0.0) / j;
                    declared.max(wander).max(0.3 * self.force_scale() / j)
                } else if self.one_way {
                    // What a bias took would be missing from the dry friction.
                    NO_BIAS * wander
                } else {
                    wander
                };
                Prior { mean: rig.model.offset.unwrap_or(0.0) / j, sd, ..Prior::FREE }
            }
            Key::Skew => skew_columns::prior(self.known_gain(), self.skew_rows.unwrap_or(0.0)),
            Key::Spread => skew_columns::prior_of_spread(self.known_gain()),
            Key::External => Prior { mean: self.external / j, sd: 0.5 / j, ..Prior::FREE },
            Key::Term { .. } => Prior::FREE,
        }
    }

    /// Returns the bounds of a term's coefficient, per inertia, within which the effect is what its
    /// name says.
    pub(crate) fn limits(&self, name: EffectName, term: usize) -> (f64, f64) {
        let Bounds { low, high, of } = name.bounds_of(term);
        let unit = self.quantity(of);
        let (a, b) = unit.map_or((f64::NEG_INFINITY, f64::INFINITY), |unit| (low * unit, high * unit));
        (a.min(b), a.max(b))
    }

    /// Returns a quantity in the unit of coefficients, per inertia; `None` if the rig has none, or
    /// the filter no coefficient in its unit.
    fn quantity(&self, of: Quantity) -> Option<f64> {
        let (gain, reach) = (self.known_gain(), self.gain_reach());
        let Model { viscous, coulomb, .. } = &self.rig.model;
        let friction = |value: &Option<f64>, factor: f64| {
            value.filter(|x| *x > 0.0).map(|x| factor * x / self.known_inertia())
        };
        match of {
            Quantity::One | Quantity::Jumps => Some(1.0),
            Quantity::Shape => None,
            Quantity::MotorInertia => Some(gain),
            Quantity::SmallestGain => Some(gain.abs() / reach),
            Quantity::LargestGain => Some(gain.abs() * reach),
            Quantity::TrustedGain => Some(gain.abs() * if self.anchor.is_some() { 0.5 } else { reach }),
            Quantity::TwiceViscous => friction(viscous, 2.0),
            Quantity::TwiceDry => friction(coulomb, 2.0),
            Quantity::LargestDry => friction(coulomb, most_over_nominal(self.rig.coulomb_sd())),
        }
    }

    /// Largest part of the command that may do nothing. Where the inertia is hardly known or the
    /// forces are far from balance, a drive that ignores its command explains anything, and so
    /// explains nothing.
    pub(crate) fn most_ignored(&self) -> f64 {
        match (self.anchor, self.is_balanced) {
            (Some(_), _) => IGNORED_UNANCHORED,
            (None, true) => IGNORED,
            (None, false) => IGNORED_UNBALANCED,
        }
    }

    /// True if effective commands ignore more of the command than is allowed.
    pub(crate) fn ignores_too_much(&self, tracks: &[BlockedRecording], effective: &[Vec<f64>]) -> bool {
        let (mut taken, mut whole) = (0.0, 0.0);
        for (track, effective) in tracks.iter().zip(effective) {
            taken += effective.iter().zip(track.rows.command.iter()).map(|(a, b)| (a - b).abs()).sum::<f64>();
            whole += track.rows.command.iter().map(|u| u.abs()).sum::<f64>();
        }
        taken > self.most_ignored() * whole
    }

    /// Deceleration that dry friction makes, from the rig if it gives a dry friction; otherwise
    /// what is ordinary for its drive.
    pub(crate) fn dry_deceleration(&self) -> f64 {
        let dry = self.rig.model.coulomb.filter(|x| *x > 0.0).unwrap_or(self.force_scale());
        dry / self.known_inertia()
    }

    /// Returns the values of the whole machine that the law of a joint uses: each as `fitted` has
    /// it, or as the rig has it.
    pub(crate) fn machine(&self, fitted: &dyn Fn(Key) -> Option<f64>) -> WholeMachine {
        let model = &self.rig.model;
        let fitted = |key: Key, otherwise: f64| fitted(key).unwrap_or(otherwise);
        let per_inertia = |force: Option<f64>| force.unwrap_or(0.0) / self.known_inertia();
        WholeMachine {
            per_command: fitted(Key::Gain, self.known_gain()),
            dry: fitted(Key::Coulomb, self.dry_deceleration()),
            viscous: fitted(Key::Viscous, per_inertia(model.viscous)),
            per_force: fitted(Key::External, per_inertia(Some(self.external))),
            weight: fitted(Key::Weight, per_inertia(model.weight)),
        }
    }

    /// A force that is ordinary for this rig: its dry friction, or what its drive does at a tenth
    /// of its limit.
    pub(crate) fn force_scale(&self) -> f64 {
        let limit = self.rig.actuator.limit.map_or(0.0, |limit| 0.1 * limit * self.rig.actuator.gain.abs());
        self.rig.model.coulomb.unwrap_or(0.0).max(limit)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn nominal(viscous: f64, coulomb: f64) -> Nominal {
        let rig = Rig::of_values(0.01, viscous, coulomb);
        Nominal { is_balanced: true, ..Nominal::of(&rig) }
    }

    #[test]
    fn friction_differs_and_drifts_within_the_rigs_limits() {
        let (asymmetric, drift) = (EffectName::AsymmetricFriction, EffectName::FrictionDrift);
        let known = nominal(0.02, 0.05);
        let near = |(low, high): (f64, f64), (a, b): (f64, f64)| {
            assert!((low - a).abs() < 1e-9 && (high - b).abs() < 1e-9, "{low} {high}");
        };
        near(known.limits(asymmetric, 0), (-4.0, 4.0));
        near(known.limits(asymmetric, 1), (-10.0, 10.0));
        let most = most_over_nominal(0.5) * 5.0;
        near(known.limits(drift, 0), (-0.9 * most, 3.0 * most));
        near(known.limits(drift, 1), (-3.6, 12.0));
        // A part of the gain as it is, and that may be larger than the rig's.
        let part = 0.9 * known.gain() * known.gain_reach();
        assert!(known.gain_reach() > 1.0);
        near(known.limits(EffectName::TorqueRipple, 0), (-part, part));
        near(known.limits(EffectName::DriveLoss, 0), (0.0, part));
        let smallest = known.gain() / known.gain_reach();
        near(known.limits(EffectName::GainDrift, 0), (-smallest, smallest));
        // A load's ratio is in terms of the gain with its sign, which may be either.
        let turned = Nominal { anchor: Some((-20.0, 0.3)), ..known.clone() };
        near(turned.limits(EffectName::RollerSlip, 0), (-160.0, -6.0));
        near(turned.limits(EffectName::TorqueRipple, 1), (-9.0, 9.0));
        // Gain over inertia twice the rig's: half the inertia, twice the deceleration.
        let anchored = Nominal { anchor: Some((20.0, 0.3)), ..known };
        near(anchored.limits(asymmetric, 0), (-8.0, 8.0));
        let nought = nominal(0.0, 0.0);
        for term in [0, 1] {
            assert_eq!(nought.limits(asymmetric, term), (f64::NEG_INFINITY, f64::INFINITY));
        }
    }
}
