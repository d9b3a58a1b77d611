//! Forward selection on left-out frames of the fit: the law with the largest share goes in.

use crate::constants::{
    INERTIA_REACH, LEAST_SHARE, LINE_STEPS, NEXT_WAVE, REFINED, RIVALS, ROUNDS, SIZES_AGREE, WAVES,
};
use crate::evidence::{Evidence, HeldOut, compare, over_error};
use crate::fit::{Fitted, Model, agreement, expanded};
use crate::laws::{self, ActsOn, Law, Quantity, Shape};
use crate::problem::{Candidate, Problem};
use numerics::golden_section::golden;
use numerics::parallel;
use std::cell::RefCell;

/// A candidate beside a model.
pub(crate) struct Scored {
    pub(crate) candidate: usize,
    share: f64,
    /// Gain by frame of the fit.
    gains: Vec<f64>,
    agreement: f64,
    coefficients: Vec<f64>,
    /// True if the size has the sign and unit that the law asks for, and agrees in two halves.
    valid: bool,
}

/// One round: the laws before it, and the best of every law in order.
pub(crate) struct Round {
    before: Vec<usize>,
    pub(crate) ranked: Vec<Scored>,
}

/// A search over the laws of a problem.
pub(crate) struct Search {
    pub(crate) problem: Problem,
    pub(crate) candidates: Vec<Candidate>,
}

impl Search {
    /// Chooses up to three laws. The holdout is not read.
    pub(crate) fn run(problem: Problem) -> (Self, Vec<Round>) {
        let mut search = Self { problem, candidates: Vec::new() };
        search.add_all(ActsOn::Motion);
        search.ask();
        search.add_all(ActsOn::Command);
        let mut rounds: Vec<Round> = Vec::new();
        let mut chosen: Vec<usize> = Vec::new();
        while rounds.len() < ROUNDS {
            let ranked = search.round(&chosen);
            let Some(first) = ranked.first().filter(|s| s.valid && s.share >= LEAST_SHARE) else { break };
            let next = first.candidate;
            rounds.push(Round { before: chosen.clone(), ranked });
            chosen.push(next);
        }
        (search, rounds)
    }

    fn add_all(&mut self, acts_on: ActsOn) {
        let all: Vec<(&'static Law, Shape)> = laws::library()
            .filter(|law| law.acts_on == acts_on)
            .flat_map(|law| (law.shapes)(&self.problem.machine).into_iter().map(move |s| (law, s)))
            .collect();
        self.candidates.extend(parallel::map_all(&all, |(law, shape)| self.problem.candidate(law, *shape)));
    }

    /// Works out the force that the motion asks for, with the waves that lead in it.
    fn ask(&mut self) {
        let model = Model::new(&self.problem, Vec::new());
        let waves: Vec<usize> = (0..self.candidates.len())
            .filter(|i| self.candidates[*i].law.key == "cogging" && self.problem.machine.rig.turn.is_some())
            .collect();
        let mut scored = parallel::map_all(&waves, |i| self.score(&model, None, *i));
        scored.sort_by(|a, b| b.share.total_cmp(&a.share));
        let periods: Vec<f64> = scored
            .iter()
            .take(WAVES)
            .filter(|s| s.share > NEXT_WAVE)
            .map(|s| self.candidates[s.candidate].shapes[0].value)
            .collect();
        self.problem.ask(&periods);
    }

    /// The chosen laws as a model.
    fn model(&self, chosen: &[usize]) -> Model<'_> {
        Model::new(&self.problem, chosen.iter().map(|i| &self.candidates[*i]).collect())
    }

    /// Scores every law beside the chosen ones; the best of each, in order.
    fn round(&mut self, chosen: &[usize]) -> Vec<Scored> {
        let names: Vec<&str> = chosen.iter().map(|i| self.candidates[*i].law.key).collect();
        let open: Vec<usize> =
            (0..self.candidates.len()).filter(|i| !names.contains(&self.candidates[*i].law.key)).collect();
        let (mut best, found) = {
            let model = self.model(chosen);
            let bare = model.without_offsets();
            let scored = parallel::map_all(&open, |i| self.score(&model, Some(&bare), *i));
            let mut found = self.more_waves(&model, &scored);
            let best = self.best_by_law(scored);
            found.extend(self.refined(&model, &bare, &best));
            (best, found)
        };
        for (candidate, mut scored) in found {
            scored.candidate = self.candidates.len();
            self.candidates.push(candidate);
            best.push(scored);
        }
        let mut ranked = self.best_by_law(best);
        self.plain_before_refined(&mut ranked);
        ranked
    }

    /// The best of each law: valid ones first, then by share.
    fn best_by_law(&self, mut scored: Vec<Scored>) -> Vec<Scored> {
        scored.sort_by(|a, b| b.valid.cmp(&a.valid).then(b.share.total_cmp(&a.share)));
        let mut seen: Vec<&str> = Vec::new();
        scored.retain(|s| {
            let name = self.candidates[s.candidate].law.key;
            let new = !seen.contains(&name);
            seen.push(name);
            new
        });
        scored
    }

    /// Moves the law that the first one refines to the front, if the rig has none of it.
    fn plain_before_refined(&self, ranked: &mut [Scored]) {
        let name = |s: &Scored| self.candidates[s.candidate].law.key;
        let plain = ranked.first().and_then(|s| self.candidates[s.candidate].law.refines);
        let place = ranked.iter().position(|s| Some(name(s)) == plain && s.valid && s.share >= LEAST_SHARE);
        if let Some(place) = place {
            ranked[..=place].rotate_right(1);
        }
    }

    /// Moves the shapes of the leading laws between the values of their grids.
    fn refined(&self, model: &Model, bare: &Model, best: &[Scored]) -> Vec<(Candidate, Scored)> {
        let least = REFINED * best.first().map_or(0.0, |s| s.share).max(LEAST_SHARE);
        let leading = best.iter().filter(|s| s.share >= least).filter_map(|s| {
            let candidate = &self.candidates[s.candidate];
            let range = candidate.shapes[0].range.filter(|_| candidate.shapes.len() == 1)?;
            Some((s, candidate, range))
        });
        let leading: Vec<_> = leading.collect();
        let found = parallel::map_all(&leading, |(old, candidate, (low, high))| {
            let tried: RefCell<Option<(Candidate, Scored)>> = RefCell::new(None);
            golden(low.ln(), high.ln(), LINE_STEPS, |x| {
                let shape = Shape { value: x.exp(), ..candidate.shapes[0] };
                let new = self.problem.candidate(candidate.law, shape);
                let scored = self.score_candidate(model, Some(bare), &new, 0);
                let value = scored.share;
                let mut tried = tried.borrow_mut();
                if scored.valid && tried.as_ref().is_none_or(|(_, best)| value > best.share) {
                    *tried = Some((new, scored));
                }
                value
            });
            tried.into_inner().filter(|(_, new)| new.share > old.share)
        });
        found.into_iter().flatten().collect()
    }

    /// Several waves of one law together, added while another takes enough.
    fn more_waves(&self, model: &Model, scored: &[Scored]) -> Vec<(Candidate, Scored)> {
        let mut out = Vec::new();
        for law in laws::library().filter(|law| law.wave) {
            let of_law = scored.iter().filter(|s| self.candidates[s.candidate].law == law);
            let mut single: Vec<&Scored> = of_law.filter(|s| s.share > LEAST_SHARE).collect();
            single.sort_by(|a, b| b.share.total_cmp(&a.share));
            single.truncate(2 * WAVES);
            let Some(first) = single.first() else { continue };
            let (mut members, mut share) = (vec![first.candidate], first.share);
            while members.len() < WAVES {
                let left: Vec<usize> =
                    single.iter().map(|s| s.candidate).filter(|c| !members.contains(c)).collect();
                let joined = parallel::map_all(&left, |next| {
                    let joint = self.joint(&members, *next);
                    let scored = self.score_candidate(model, None, &joint, *next);
                    (joint, scored)
                });
                let best = joined.into_iter().max_by(|a, b| a.1.share.total_cmp(&b.1.share));
                let Some((joint, scored)) = best.filter(|(_, s)| s.share > share + NEXT_WAVE) else { break };
                members.push(scored.candidate);
                share = scored.share;
                out.push((joint, scored));
            }
        }
        out
    }

    fn joint(&self, members: &[usize], next: usize) -> Candidate {
        let all = members.iter().chain([&next]).map(|i| &self.candidates[*i]);
        let first = &self.candidates[next];
        Candidate {
            law: first.law,
            shapes: all.clone().flat_map(|c| c.shapes.clone()).collect(),
            columns: all.flat_map(|c| c.columns.clone()).collect(),
            own_phase: first.own_phase,
        }
    }

    fn score(&self, model: &Model, bare: Option<&Model>, candidate: usize) -> Scored {
        self.score_candidate(model, bare, &self.candidates[candidate], candidate)
    }

    /// Scores one more law on left-out frames of the fit.
    fn score_candidate(
        &self,
        model: &Model,
        bare: Option<&Model>,
        new: &Candidate,
        candidate: usize,
    ) -> Scored {
        let p = &self.problem;
        let constant = bare.filter(|_| takes_offsets(new));
        let fitted = model.with(new);
        let before = constant.map_or(&model.fitted.error, |bare| &bare.fitted.error);
        let (share, gains) = compare(p, before, &fitted.error, 0);
        let start = model.fitted.values.len();
        let added = |values: &[f64]| values[start..].to_vec();
        let agreement = match constant {
            Some(_) => same_sign(&model.fitted.values[p.nominal.len()..p.nominal.len() + p.fit_recordings]),
            None => {
                let columns = expanded(p, new, 0..p.fit_recordings);
                let weigh = |c: &Vec<f64>| {
                    c.iter().zip(&model.root).take(p.tiling.fit_rows).map(|(x, r)| x * r).collect()
                };
                let columns: Vec<Vec<f64>> = columns.iter().map(weigh).collect();
                agreement(&columns, &added(&fitted.halves[0]), &added(&fitted.halves[1]))
            }
        };
        let coefficients = added(&fitted.values);
        let valid = share > 0.0 && agreement >= SIZES_AGREE && self.has_its_size(new, coefficients[0]);
        Scored { candidate, share, gains, agreement, coefficients, valid }
    }

    /// True if the first coefficient, the force that the drive supplies, is within its bounds.
    fn has_its_size(&self, new: &Candidate, coefficient: f64) -> bool {
        let inertia = self.problem.machine.rig.inertia.nominal;
        let bounds = new.law.bounds_of(0);
        let within = |x: f64, low: f64, high: f64| x > low && x < high;
        let within_bounds = |x: f64| within(x, bounds.low, bounds.high);
        match bounds.of {
            Quantity::One => within_bounds(coefficient),
            Quantity::Shape => within_bounds(coefficient / new.shapes[0].value),
            Quantity::Jumps => within_bounds(coefficient / inertia),
            Quantity::MotorInertia => {
                let part = |ratio: f64| ratio / (1.0 + ratio);
                let (low, high) = (part(bounds.low) / INERTIA_REACH, part(bounds.high) * INERTIA_REACH);
                within(coefficient / inertia, low, high)
            }
            // Of the force that the motion asks for; as a part of the drive's it is less.
            Quantity::SmallestGain | Quantity::LargestGain | Quantity::TrustedGain => {
                within_bounds(coefficient / (1.0 + coefficient.abs()))
            }
            // The friction is fitted beside the law, from another moment or mean than the filter's.
            Quantity::TwiceViscous | Quantity::TwiceDry | Quantity::LargestDry => true,
        }
    }

    /// Reads the holdout, and completes the evidence of each round's first laws. Nothing is chosen
    /// after this.
    pub(crate) fn evidence(&self, rounds: &[Round]) -> Vec<Vec<Evidence>> {
        let free = self.problem.free_form();
        rounds.iter().map(|round| self.evidence_of(round, &free)).collect()
    }

    fn evidence_of(&self, round: &Round, free: &[Vec<f64>]) -> Vec<Evidence> {
        let model = self.model(&round.before);
        parallel::map(round.ranked.len(), |place| self.evidence_at(round, place, &model, free))
    }

    /// The evidence for the law at a place of a round; that for all but its first ones does not
    /// read the holdout.
    fn evidence_at(&self, round: &Round, place: usize, model: &Model, free: &[Vec<f64>]) -> Evidence {
        let p = &self.problem;
        let noise = p.reading[..p.tiling.fit_rows].iter().sum::<f64>();
        let scored = &round.ranked[place];
        let candidate = &self.candidates[scored.candidate];
        let fitted = model.with(candidate);
        let rival = &round.ranked[if place == 0 { 1.min(round.ranked.len() - 1) } else { 0 }];
        let ahead: Vec<f64> = scored.gains.iter().zip(&rival.gains).map(|(a, b)| a - b).collect();
        let unweighted = fitted.error.iter().zip(&model.root).map(|(e, r)| (e / r).powi(2)).sum::<f64>();
        let printed = place <= RIVALS;
        let free_form_more = || {
            let with_free = [expanded(p, candidate, 0..p.fit_recordings), free.to_vec()].concat();
            compare(p, &fitted.error, &model.with_columns(&with_free).error, 0).0.max(0.0)
        };
        Evidence {
            share: scored.share,
            z: over_error(&scored.gains),
            size_agreement: scored.agreement,
            lead_z: over_error(&ahead),
            free_form_more: if printed { free_form_more() } else { f64::NAN },
            residual_over_noise: (unweighted / (noise + 1e-300)).sqrt(),
            rows: p.tiling.fit_rows as f64,
            held_out: printed.then(|| self.held_out(model, candidate, &fitted)),
        }
    }

    fn held_out(&self, model: &Model, candidate: &Candidate, fitted: &Fitted) -> HeldOut {
        let p = &self.problem;
        let laws: Vec<&Candidate> = model.laws.iter().copied().chain([candidate]).collect();
        let (after, mut size_agreement) = model.hold_out(&laws, fitted);
        let before = if takes_offsets(candidate) {
            size_agreement = model.offsets_agree();
            let bare = model.without_offsets();
            bare.hold_out(&model.laws, &bare.fitted).0
        } else {
            model.hold_out(&model.laws, &model.fitted).0
        };
        let (share, gains) = compare(p, &before, &after, p.tiling.fit_rows);
        HeldOut { share, z: over_error(&gains), size_agreement }
    }

    /// Force error of the fit (left-out frames) and of the holdout, N·m or N rms, of a model with
    /// the laws of all `rounds` before and with `last`.
    pub(crate) fn force_error(&self, rounds: &[Round]) -> [f64; 2] {
        let chosen: Vec<usize> = rounds.iter().map(|r| r.ranked[0].candidate).collect();
        let model = self.model(&chosen);
        let first = self.problem.tiling.fit_rows;
        let rms = |e: &[f64], root: &[f64]| {
            let sum: f64 = e.iter().zip(root).map(|(e, r)| (e / r).powi(2)).sum();
            (sum / e.len() as f64).sqrt()
        };
        let held = model.hold_out(&model.laws, &model.fitted).0;
        [rms(&model.fitted.error, &model.root), rms(&held, &model.root[first..])]
    }

    /// The size of the first coefficients of a scored law.
    pub(crate) fn coefficients<'b>(&self, scored: &'b Scored) -> &'b [f64] {
        &scored.coefficients
    }
}

impl Scored {
    /// True if sign, unit and agreement are as the law asks.
    pub(crate) fn is_valid(&self) -> bool {
        self.valid
    }
}

/// True if a law is a constant force beside others: what it takes is what offsets take.
fn takes_offsets(candidate: &Candidate) -> bool {
    candidate.law.key == "asymmetric_friction" && candidate.shapes[0].form != "viscous"
}

/// Square of the mean over the mean square: 1 if all are equal, 1/n if one is alone.
fn same_sign(x: &[f64]) -> f64 {
    let (sum, squares) = (x.iter().sum::<f64>(), x.iter().map(|x| x * x).sum::<f64>());
    sum * sum / (x.len() as f64 * squares + 1e-300)
}
