//! The inertia that recordings show where the rig hardly knows it.
//!
//! Regressing motion on command overestimates the inertia under a speed loop, so this regresses the
//! command on the motion. Errors of the motion bias that inertia low: one near zero, or negative,
//! is hidden by noise, and not small.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::force_residual::Estimator;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::nominal::{InertiaSource, Nominal};
use numerics::linear::{Prior, Square, bounded};

/// Factor by which a gain over inertia that is hardly known may differ from the rig's.
const REACH: f64 = 40.0;
/// Part of the force error that a found inertia must take off to be kept instead of the rig's.
const MATERIAL: f64 = 0.05;
/// Relative standard deviation of a gain over inertia that was found.
const FOUND: f64 = 0.3;

/// Anchors the inertia where the motion shows it. Where noise hides it, the fits whose values are
/// shown keep the rig's, or what is seen in the band that the counts support if a material part of
/// the command asks for that.
pub(crate) fn anchor(nominal: &mut Nominal, tracks: &[BlockedRecording], white: &Noise, scale: f64) {
    let fit = |noise: &Noise| CommandFit::of(&Fit::new(&Model::default(), nominal, tracks, noise));
    let inertia = fit(white).inertia(nominal.gain());
    let kept = (inertia == Inertia::Hidden).then(|| {
        let in_band = fit(&Estimator::new(tracks, white, scale).weighing(tracks, white));
        match in_band.inertia(nominal.gain()) {
            Inertia::Found(gain) if in_band.prefers_its_own(nominal.gain()) => InertiaSource::Seen(gain),
            _ => InertiaSource::OfRig,
        }
    });
    nominal.kept_inertia = kept;
    nominal.anchor = match inertia {
        Inertia::Found(gain) => Some((gain, FOUND)),
        Inertia::Hidden | Inertia::TooHeavy => None,
    };
}

/// An inertia by the motion alone.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Inertia {
    /// Gain over inertia, of the rig's sign and within reach of it.
    Found(f64),
    /// Nothing: the inertia found is next to nothing or negative.
    Hidden,
    /// Far more than the rig's: something else is wrong.
    TooHeavy,
}

impl Inertia {
    /// Sorts the gain over inertia that was found by that of the rig.
    fn of(found: f64, nominal: f64) -> Self {
        let by_rig = nominal / found;
        match by_rig {
            _ if !by_rig.is_finite() || by_rig >= REACH => Self::TooHeavy,
            _ if by_rig <= REACH.recip() => Self::Hidden,
            _ => Self::Found(found),
        }
    }
}

/// The regression of the command on the motion under some noise: `command = (1/gain)·acceleration −
/// Σ forces/gain`.
struct CommandFit {
    /// Its normal equations.
    m: Square,
    b: Vec<f64>,
    /// The command's own square.
    square: f64,
    /// The place of 1/gain among the unknowns.
    place: usize,
}

impl CommandFit {
    fn of(fit: &Fit) -> Self {
        let size = fit.keys.len();
        // Unknowns: the data's own column takes the place of the gain's.
        let (mut m, mut b, mut square) = (Square::zero(size), vec![0.0; size], 0.0);
        for (one, places) in fit.prepared.iter().zip(&fit.places) {
            let p = places.len();
            // Undo the reference: the data itself is the residual plus the reference's columns.
            let mut raw: Vec<f64> = one.reference.clone();
            raw.push(1.0);
            for segment in &one.segments {
                let with_raw: Vec<f64> =
                    (0..=p).map(|i| (0..=p).map(|j| segment.at(i, j) * raw[j]).sum()).collect();
                let raw_square: f64 = with_raw.iter().zip(&raw).map(|(a, b)| a * b).sum();
                let inner = |i: usize, j: usize| match (i, j) {
                    (0, 0) => raw_square,
                    (0, j) => with_raw[j],
                    (i, 0) => with_raw[i],
                    (i, j) => segment.at(i, j),
                };
                square += segment.at(0, 0);
                for i in 0..p {
                    b[places[i]] += if i == 0 { with_raw[0] } else { segment.at(i, 0) };
                    for j in 0..p {
                        m.add(places[i], places[j], inner(i, j));
                    }
                }
            }
        }
        Self { m, b, square, place: fit.places[0][0] }
    }

    /// The unknowns that leave least, where 1/gain has a prior, and the square that they leave.
    fn solved(&self, by_gain: Prior) -> (Vec<f64>, f64) {
        let mut priors = vec![Prior::FREE; self.b.len()];
        priors[self.place] = by_gain;
        let x = bounded(&self.m, &self.b, &priors).x;
        let places = 0..x.len();
        let made = |i: usize| places.clone().map(|j| self.m.at(i, j) * x[j]).sum::<f64>();
        let off: f64 = places.clone().map(|i| x[i] * (2.0 * self.b[i] - made(i))).sum();
        (x, (self.square - off).max(0.0))
    }

    /// The inertia seen, beside the gain over inertia of the rig.
    fn inertia(&self, nominal: f64) -> Inertia {
        Inertia::of(1.0 / self.solved(Prior::FREE).0[self.place], nominal)
    }

    /// True if the inertia seen leaves materially less of the command than the rig's does, root
    /// mean square.
    fn prefers_its_own(&self, nominal: f64) -> bool {
        let fixed = 1.0 / nominal;
        let of_rig = self.solved(Prior { mean: fixed, low: fixed, high: fixed, ..Prior::FREE }).1;
        self.solved(Prior::FREE).1.sqrt() <= (1.0 - MATERIAL) * of_rig.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gain_out_of_reach_is_no_anchor() {
        assert_eq!(Inertia::of(-30.0, -2.0), Inertia::Found(-30.0));
        assert_eq!(Inertia::of(0.01, 2.0), Inertia::TooHeavy, "too heavy");
        assert_eq!(Inertia::of(100.0, 2.0), Inertia::Hidden, "too light");
        assert_eq!(Inertia::of(-3.0, 2.0), Inertia::Hidden, "of the wrong sign");
        assert_eq!(Inertia::of(f64::INFINITY, 2.0), Inertia::Hidden);
    }

    /// One unknown, `1/gain`, over a command of 1: the rest is what does not fit.
    fn of_one(slope: f64, rest: f64) -> CommandFit {
        let mut m = Square::zero(1);
        m.add(0, 0, 1.0);
        CommandFit { m, b: vec![slope], square: slope * slope + rest, place: 0 }
    }

    #[test]
    fn an_inertia_is_preferred_that_leaves_materially_less() {
        let clear = of_one(0.5, 0.01);
        assert_eq!(clear.inertia(4.0), Inertia::Found(2.0));
        assert!((clear.solved(Prior::FREE).1 - 0.01).abs() < 1e-12);
        assert!(clear.prefers_its_own(4.0), "0.1 instead of 0.27");
        assert!(!of_one(0.5, 1.0).prefers_its_own(4.0), "1 instead of 1.03");
    }
}
