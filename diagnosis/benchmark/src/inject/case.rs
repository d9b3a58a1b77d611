//! One case: a carrier, an effect drawn for it, and the size at which it leaves what is asked for.

use super::banded_recording::{BandedRecording, State, band};
use super::carrier::Carrier;
use super::conceal::{Changed, Concealed, conceal};
use super::regress::{Block, Oracle, solve};
use super::shapes::{self, HiddenLaw, Side};
use crate::dynamics::recording::Recording;
use crate::rng::Rng;
use crate::signal::rms;

/// A law of which the nominal model takes more than this part of the force is no effect of its own
/// there.
const IMITATED: f64 = 0.97;
/// The largest concealed force over that of the drive, or over that of the inertia where nothing
/// drives.
const STRONGEST: f64 = 1.0;
/// The size is found to this part.
const EXACT: f64 = 0.1;

/// A carrier with what every draw on it needs.
pub(crate) struct Ground {
    pub(crate) carrier: Carrier,
    states: Vec<State>,
    /// Those of the recordings to fit on, in the band of the tool's force errors.
    sights: Vec<BandedRecording>,
}

/// A case that can be written.
pub(crate) struct Drawn {
    pub(crate) effect: Concealed,
    /// One a recording, those to fit on first.
    pub(crate) changed: Vec<Changed>,
    /// Dry friction that the rig must know besides.
    pub(crate) coulomb: f64,
    pub(crate) oracle: Oracle,
}

impl Ground {
    /// `band_hz`: of the tool's force errors.
    pub(crate) fn new(carrier: Carrier, band_hz: f64) -> Self {
        let states = carrier.recordings().map(|r| State::of(r, &carrier.rig)).collect();
        let sights = carrier.fits.iter().map(|r| BandedRecording::of(r, &carrier.rig, band_hz)).collect();
        Self { carrier, states, sights }
    }

    /// Draws an effect that leaves `left` N·m or N on the recordings to fit on after the nominal
    /// model has been fitted.
    pub(crate) fn draw(&self, name: &str, left: f64, rng: &mut Rng) -> Option<Drawn> {
        let law = shapes::draw(name, &self.carrier, &self.states, rng)?;
        let strongest = self
            .carrier
            .recordings()
            .flat_map(|r| r.command.iter())
            .fold(0.0_f64, |most, u| most.max(u.abs()));
        let mut effect = Concealed {
            law,
            size: 1.0,
            fast: self.states.iter().map(|s| s.fast).fold(0.0, f64::max),
            travel: self.states.iter().map(State::travel).fold(0.0, f64::max),
            strongest,
            seed: rng.next(),
        };
        effect.size =
            if effect.law.is_linear() { left / self.leaves(&effect)? } else { self.seek(&mut effect, left)? };
        self.settle(effect)
    }

    /// Rms that the effect leaves in the band after the nominal model has been fitted to it;
    /// nothing where that imitates it or it cannot be so strong.
    fn leaves(&self, effect: &Concealed) -> Option<f64> {
        let mut blocks = Vec::new();
        for (i, (sight, r)) in self.sights.iter().zip(&self.carrier.fits).enumerate() {
            let changed = conceal(effect, r, &self.states[i], &self.carrier.rig, i);
            blocks.push(Block { columns: sight.nominal.clone(), target: self.force(sight, r, &changed) });
        }
        let force: Vec<f64> = blocks.iter().flat_map(|b| b.target.iter().copied()).collect();
        let left = super::regress::left_on(&blocks, &solve(&blocks));
        let own = matches!(effect.law, HiddenLaw::Bristles { .. }) || left > (1.0 - IMITATED) * rms(&force);
        (own && left.is_finite() && left > 0.0).then_some(left)
    }

    /// The force that a changed recording has more, in the band.
    fn force(&self, sight: &BandedRecording, r: &Recording, changed: &Changed) -> Vec<f64> {
        let rig = &self.carrier.rig;
        if changed.error.is_empty() {
            return sight.see_rows(&changed.force(r, rig.gain));
        }
        sight.see(&sight.reading_force(&changed.error, rig.inertia, rig.viscous.unwrap_or(0.0)))
    }

    /// The size of a law that is not in proportion to it.
    fn seek(&self, effect: &mut Concealed, left: f64) -> Option<f64> {
        let row_s = self.states[0].seconds() / self.states[0].time.len() as f64;
        let (mut low, mut high) = effect.law.bounds(effect.strongest, row_s);
        let mut at = |size: f64| {
            effect.size = size;
            self.leaves(effect)
        };
        for _ in 0..14 {
            let middle = (low * high).sqrt();
            match at(middle) {
                Some(x) if (x / left - 1.0).abs() < EXACT => return Some(middle),
                Some(x) if x > left => high = middle,
                _ => low = middle,
            }
        }
        // Whole rows and whole counts cannot do better.
        let size = (low * high).sqrt();
        let reached = at(size)?;
        (reached / left > 0.6 && reached / left < 1.6).then_some(size)
    }

    /// Conceals the effect in every recording; nothing where the forces would make somebody wonder.
    fn settle(&self, effect: Concealed) -> Option<Drawn> {
        let rig = &self.carrier.rig;
        let changed: Vec<Changed> = self
            .carrier
            .recordings()
            .enumerate()
            .map(|(i, r)| conceal(&effect, r, &self.states[i], rig, i))
            .collect();
        let usable = |c: &Changed| c.command.iter().chain(&c.counts).all(|x| x.is_finite());
        if !changed.iter().all(usable) || !self.bearable(&effect, &changed) {
            return None;
        }
        let coulomb = if matches!(effect.law, HiddenLaw::Bristles { .. }) { effect.size } else { 0.0 };
        let oracle = self.oracle(&changed);
        Some(Drawn { effect, changed, coulomb, oracle })
    }

    /// True if the size of the forces is plausible.
    fn bearable(&self, effect: &Concealed, changed: &[Changed]) -> bool {
        let rig = &self.carrier.rig;
        if let HiddenLaw::Eccentric = effect.law {
            return effect.size < 0.15;
        }
        if effect.law.side() == Side::Reading {
            return true;
        }
        let forces: Vec<f64> =
            self.carrier.recordings().zip(changed).flat_map(|(r, c)| c.force(r, rig.gain)).collect();
        let drive: Vec<f64> =
            self.carrier.recordings().flat_map(|r| r.command.iter().map(|u| rig.gain * u)).collect();
        let inertia: Vec<f64> =
            self.sights.iter().flat_map(|s| s.nominal[0].iter().map(|a| rig.inertia * a)).collect();
        rms(&forces) < STRONGEST * rms(&drive).max(rms(&inertia))
    }

    fn oracle(&self, changed: &[Changed]) -> Oracle {
        let mut blocks: Vec<Block> = Vec::new();
        for (r, c) in self.carrier.recordings().zip(changed) {
            let sight = BandedRecording::of(&written(r, c), &self.carrier.rig, band(r));
            let force = self.force(&sight, r, c);
            let mut columns = sight.nominal.clone();
            columns.push(force.iter().map(|f| -f).collect());
            blocks.push(Block { columns, target: sight.target.clone() });
        }
        let holdouts = blocks.split_off(self.carrier.fits.len());
        Oracle::of(&blocks, &holdouts)
    }

    /// The carrier as it is written, for who sees nothing else.
    pub(crate) fn written(&self, drawn: &Drawn) -> Carrier {
        let mut carrier = self.carrier.clone();
        let count = carrier.fits.len();
        for (i, changed) in drawn.changed.iter().enumerate() {
            let r = if i < count { &mut carrier.fits[i] } else { &mut carrier.holdouts[i - count] };
            *r = written(r, changed);
        }
        carrier
    }
}

fn written(r: &Recording, changed: &Changed) -> Recording {
    Recording { command: changed.command.clone(), counts: changed.counts.clone(), ..r.clone() }
}

#[cfg(test)]
mod tests {
    use super::super::plain::{self, tests::carrier};
    use super::*;

    #[test]
    fn what_is_drawn_leaves_what_is_asked_for_and_is_found() {
        let ground = Ground::new(carrier(|_, _| 0.0), 15.0);
        for (name, left) in [("quadratic_drag", 0.4), ("gain_drift", 0.3), ("cogging", 0.4)] {
            let drawn = (1..20)
                .find_map(|seed| ground.draw(name, left, &mut Rng::new(seed)))
                .expect("the axis can hold it");
            let reached = ground.leaves(&drawn.effect).unwrap() / left;
            assert!((reached - 1.0).abs() < 0.11, "{name}: {reached} of what was asked for");
            assert!(drawn.oracle.solves(), "{name}: {:?}", drawn.oracle);
            let found = plain::select(&ground.written(&drawn), 0.15);
            assert!(found.iter().any(|f| f.name == name), "{name}: {found:?}");
        }
    }

    #[test]
    fn nothing_is_drawn_that_the_recordings_cannot_hold() {
        let ground = Ground::new(carrier(|_, _| 0.0), 15.0);
        // The rig knows both frictions; there is no load, no tilt, and no place that recordings
        // share.
        for name in ["viscous_friction", "coulomb_friction", "load_dependent_friction", "tilt_gravity"] {
            assert!(ground.draw(name, 0.1, &mut Rng::new(1)).is_none(), "{name}");
        }
        assert!(ground.draw("quadratic_drag", 1e4, &mut Rng::new(1)).is_none(), "far beyond the drive");
    }
}
