//! A second selection of effects, by other means than the first: forward selection by least squares
//! on a motion that was differentiated from the readings.
//!
//! A law counts by the smaller of its parts in the force error on stretches left out of the fit and
//! on held-out recordings, and only if its size is the same on both within a factor of two. Laws of
//! the command act on the command that the nominal model predicts, never on the recorded one, which
//! holds the noise that is to be explained. Where other physics and not noise limits, a name that
//! both selections give is right far more often than one that only one of them gives
//! (docs/measured/diagnosis.md).

mod axis;
mod regression;

use crate::effects::EffectName;
use crate::effects::plain_laws::{PlainLaw, PlainMotion, PlainRig, plain_laws};
use crate::io::recording::Recording;
use crate::io::rig::{Kind, Rig};
use crate::thresholds::{PLAIN_SAME_SIZE, PLAIN_SHARE};
use axis::Axis;
use numerics::parallel;
use regression::{Block, left_on, left_out, solve};
use std::sync::Arc;

/// Laws that go in at most.
const MOST: usize = 3;
/// Fewest rows of a recording that is used.
const FEWEST_ROWS: usize = 40;

/// A law that went in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlainFinding {
    pub(crate) name: EffectName,
    /// Part of the force error that it took.
    pub(crate) share: f64,
}

/// The laws that went in, in order, and those that could have.
#[derive(Clone, Debug, Default)]
pub(crate) struct PlainSelection {
    pub(crate) found: Vec<PlainFinding>,
    known: Vec<EffectName>,
}

impl PlainSelection {
    /// Selects laws; nothing where the rig has effects of its own, of which it knows nothing, or a
    /// recording has too few rows that move. Commands act `late_rows` rows after their time stamps;
    /// `one_way` says whether the axis moves one way only.
    pub(crate) fn new(rig: &Rig, late_rows: f64, one_way: bool, [fit, holdout]: [&[Recording]; 2]) -> Self {
        let all: Vec<&Recording> = fit.iter().chain(holdout).collect();
        let axes: Option<Vec<Axis>> =
            parallel::map_all(&all, |one| Axis::new(one, rig, late_rows)).into_iter().collect();
        let enough = |axes: &Vec<Axis>| axes.iter().all(|axis| axis.rows() >= FEWEST_ROWS);
        match axes.filter(enough) {
            Some(axes) if rig.effects.is_empty() => Selecting { axes, fits: fit.len(), one_way }.select(rig),
            _ => Self::default(),
        }
    }

    /// A selection whose outcome is known.
    #[cfg(test)]
    pub(crate) fn of(found: Vec<PlainFinding>, known: Vec<EffectName>) -> Self {
        Self { found, known }
    }

    /// True if one of some effects was found.
    pub(crate) fn has_one_of(&self, names: &[EffectName]) -> bool {
        self.found.iter().any(|one| names.contains(&one.name))
    }

    /// True if it has the whole law of every one of some effects.
    pub(crate) fn knows(&self, names: &[EffectName]) -> bool {
        names.iter().all(|name| self.known.contains(name))
    }
}

fn facts(rig: &Rig, one_way: bool) -> PlainRig {
    PlainRig {
        has_viscous: rig.model.viscous.is_some(),
        has_coulomb: rig.model.coulomb.is_some(),
        has_weight: rig.model.weight.is_some(),
        knows_place: rig.encoder.absolute || rig.encoder.start_spread.is_some(),
        turn: rig.turn(),
        is_rotary: rig.kind == Kind::Rotary,
        one_way,
    }
}

/// The columns of one law on every recording, those to fit on first.
struct Tried {
    columns: Vec<Vec<Vec<f64>>>,
    periodic: bool,
}

/// The recordings of a selection, those to fit on first.
struct Selecting {
    axes: Vec<Axis>,
    fits: usize,
    one_way: bool,
}

impl Selecting {
    fn select(&self, rig: &Rig) -> PlainSelection {
        let motions: Vec<PlainMotion> = self.axes.iter().map(|axis| axis.motion.clone()).collect();
        let laws = plain_laws(&facts(rig, self.one_way), &motions);
        let recorded: Vec<Vec<f64>> = motions.into_iter().map(|motion| motion.drive).collect();
        // A law that does not rest on the predicted command is the same in every round.
        let fixed = parallel::map_all(&laws, |law| (!law.by_command).then(|| self.columns(law, &recorded)));
        let (mut taken, mut found): (Vec<Arc<Tried>>, Vec<PlainFinding>) = (Vec::new(), Vec::new());
        while found.len() < MOST {
            let base = self.blocks(&taken);
            let coefficients = solve(&base[..self.fits]);
            let before = (left_out(&base[..self.fits]), self.held_out(&base, &coefficients, &taken));
            let predicted: Vec<Vec<f64>> =
                self.axes.iter().map(|axis| axis.predicted(&coefficients)).collect();
            let of = |i: usize| {
                let name = laws[i].name;
                if found.iter().any(|one| one.name == name) {
                    return None;
                }
                let tried = fixed[i].clone().unwrap_or_else(|| self.columns(&laws[i], &predicted));
                let share = self.share(&taken, &tried, before).filter(|share| *share >= PLAIN_SHARE)?;
                Some((PlainFinding { name, share }, tried))
            };
            let enough = parallel::map(laws.len(), of).into_iter().flatten();
            let Some((next, tried)) = enough.max_by(|a, b| a.0.share.total_cmp(&b.0.share)) else { break };
            found.push(next);
            taken.push(tried);
        }
        // Every column has its mean taken off, and with it what is constant.
        let sees_all = |name: &EffectName| !name.definition().may_be_constant();
        PlainSelection { found, known: laws.iter().map(|law| law.name).filter(sees_all).collect() }
    }

    fn columns(&self, law: &PlainLaw, drive: &[Vec<f64>]) -> Arc<Tried> {
        let of = |(axis, drive): (&Axis, &Vec<f64>)| {
            (law.columns)(&axis.motion, drive).iter().map(|column| axis.see(column)).collect()
        };
        Arc::new(Tried { columns: self.axes.iter().zip(drive).map(of).collect(), periodic: law.periodic })
    }

    /// Nominal columns and those of laws; a periodic law has two columns for every recording to fit
    /// on.
    fn blocks(&self, laws: &[Arc<Tried>]) -> Vec<Block> {
        let one = |(r, axis): (usize, &Axis)| {
            let mut columns = axis.nominal.clone();
            for law in laws {
                if !law.periodic {
                    columns.extend(law.columns[r].iter().cloned());
                    continue;
                }
                for own in 0..self.fits {
                    let zero = || vec![0.0; axis.rows()];
                    columns.extend(law.columns[r].iter().map(|c| if own == r { c.clone() } else { zero() }));
                }
            }
            Block { columns, target: axis.target.clone() }
        };
        self.axes.iter().enumerate().map(one).collect()
    }

    /// Root mean square left on the held-out recordings by what was fitted to the others: the phase
    /// of a periodic law is found there, its amplitude is not.
    fn held_out(&self, blocks: &[Block], coefficients: &[f64], laws: &[Arc<Tried>]) -> f64 {
        let mut blocks: Vec<Block> = blocks[self.fits..].to_vec();
        let mut at = self.axes[0].nominal.len();
        for law in laws {
            if !law.periodic {
                at += law.columns[0].len();
                continue;
            }
            let pair = |r: usize| coefficients[at + 2 * r].hypot(coefficients[at + 2 * r + 1]);
            let amplitude = (0..self.fits).map(pair).sum::<f64>() / self.fits as f64;
            at += 2 * self.fits;
            for (i, block) in blocks.iter_mut().enumerate() {
                let waves = &law.columns[self.fits + i];
                let own = Block { columns: waves.clone(), target: block.left(coefficients) };
                let phase = solve(std::slice::from_ref(&own));
                let scale = amplitude / phase[0].hypot(phase[1]).max(1e-300);
                for (c, wave) in phase.iter().zip(waves) {
                    block.target.iter_mut().zip(wave).for_each(|(t, x)| *t -= scale * c * x);
                }
            }
        }
        left_on(&blocks, coefficients)
    }

    /// The smaller of the two parts of the force error that a law takes; nothing where its sizes do
    /// not agree.
    fn share(&self, taken: &[Arc<Tried>], tried: &Arc<Tried>, before: (f64, f64)) -> Option<f64> {
        let laws: Vec<Arc<Tried>> = taken.iter().chain([tried]).cloned().collect();
        let base = self.blocks(&laws);
        let coefficients = solve(&base[..self.fits]);
        let terms = if tried.periodic { 2 * self.fits } else { tried.columns[0].len() };
        let there = self.size_on_holdout(&laws, tried);
        let own = &coefficients[coefficients.len() - terms..];
        let size = if tried.periodic { own[0].hypot(own[1]) } else { own[0] };
        let ratio = if size == 0.0 { 0.0 } else { there / size };
        if !(1.0 / PLAIN_SAME_SIZE..=PLAIN_SAME_SIZE).contains(&ratio) {
            return None;
        }
        let on_fit = 1.0 - left_out(&base[..self.fits]) / before.0;
        let on_holdout = 1.0 - self.held_out(&base, &coefficients, &laws) / before.1;
        let least = on_fit.min(on_holdout);
        least.is_finite().then_some(least)
    }

    /// The size of the last law on the held-out recordings alone, with phases of their own.
    fn size_on_holdout(&self, laws: &[Arc<Tried>], last: &Tried) -> f64 {
        let of = |r: usize| {
            let own = laws.iter().flat_map(|law| law.columns[r].iter().cloned());
            let columns = self.axes[r].nominal.iter().cloned().chain(own).collect();
            Block { columns, target: self.axes[r].target.clone() }
        };
        let alone: Vec<Block> = (self.fits..self.axes.len()).map(of).collect();
        let there = solve(&alone[..if last.periodic { 1 } else { alone.len() }]);
        let own = &there[there.len() - last.columns[0].len()..];
        if last.periodic { own[0].hypot(own[1]) } else { own[0] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::EffectName as N;

    /// An axis of inertia 2 and dry friction 0.5 that swings, with one force more. Its command is
    /// held from each row on, so that half a row early is the middle of what it has to be.
    fn recording(seed: u32, rows: u32, extra: impl Fn(f64, f64) -> f64) -> Recording {
        let mut recording = Recording::default();
        let mut random = u64::from(seed);
        for row in 0..rows {
            let t = 16.0 * f64::from(row) / f64::from(rows);
            let (a, b) = (1.7 + 0.1 * f64::from(seed), 4.1);
            let q = 3.0 * (a * t).sin() + 0.7 * (b * t).sin();
            let v = 3.0 * a * (a * t).cos() + 0.7 * b * (b * t).cos();
            let acceleration = -3.0 * a * a * (a * t).sin() - 0.7 * b * b * (b * t).sin();
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let noise = (random >> 33) as f64 / f64::from(1_u32 << 31) - 0.5;
            recording.time_s.push(t);
            recording.position_counts.push((q * 1e5).round());
            recording.command.push(2.0 * acceleration + 0.5 * v.signum() - extra(q, v) + noise);
        }
        recording
    }

    fn rig() -> Rig {
        let rig = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 2.0\ncoulomb = 0.5\nviscous = 0.0\n[actuator]\n\
                   gain = 1.0\ncommand_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 1e5\n";
        Rig::parse(rig, "a test").expect("a rig")
    }

    fn names(fit: &[Recording], holdout: &[Recording]) -> Vec<N> {
        let selection = PlainSelection::new(&rig(), 0.0, false, [fit, holdout]);
        assert!(selection.knows(&[N::QuadraticDrag, N::CommandDelay]) && !selection.knows(&[N::Backlash]));
        selection.found.iter().filter(|one| one.share >= 0.15).map(|one| one.name).collect()
    }

    fn found(extra: impl Fn(f64, f64) -> f64 + Copy) -> Vec<N> {
        names(&[recording(1, 8000, extra)], &[recording(2, 8000, extra)])
    }

    #[test]
    fn laws_of_speed_place_and_angle_are_found_and_nothing_is_not() {
        assert_eq!(found(|_, v| -0.1 * v * v.abs()), [N::QuadraticDrag]);
        assert_eq!(found(|q, _| -1.5 * q), [N::PositionSpring]);
        // Every recording has a phase of its own.
        assert_eq!(found(|q, _| 1.2 * (7.0 * q + 0.4).sin()), [N::Cogging]);
        assert!(found(|_, _| 0.0).is_empty());
    }

    /// Friction that differs with direction by a dry part is a constant while the axis moves.
    #[test]
    fn a_constant_force_is_neither_found_nor_denied() {
        let constant = [1, 2].map(|seed| recording(seed, 8000, |_, _| 1.5));
        let selection = PlainSelection::new(&rig(), 0.0, false, [&constant[..1], &constant[1..]]);
        assert!(!selection.has_one_of(&[N::AsymmetricFriction]), "{:?}", selection.found);
        assert!(!selection.knows(&[N::AsymmetricFriction]));
    }

    #[test]
    fn a_finer_recording_is_thinned_and_finds_the_same() {
        let extra = |_: f64, v: f64| -0.1 * v * v.abs();
        let fine = [1, 2].map(|seed| recording(seed, 32_000, extra));
        assert_eq!(names(&fine[..1], &fine[1..]), [N::QuadraticDrag]);
        let rows = |rows| Axis::new(&recording(1, rows, extra), &rig(), 0.0).expect("it moves").rows();
        assert!(rows(32_000) < 3 * rows(8_000), "{} rows", rows(32_000));
    }
}
