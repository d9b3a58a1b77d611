//! A case before its strengths are found: a machine with plans for its recordings, played again and
//! again.

use super::drive::Segment;
use super::effects;
use super::machine::Machine;
use super::outside;
use super::plant::Plant;
use super::series::Series;
use super::simulate::{Believed, Diverged, Row, Run, simulate};
use super::spec::Spec;
use super::strength::{Declared, Measured, measure};
use crate::key::Category;
use crate::rng::Rng;

/// The excitation and the draws for one recording.
pub(super) struct RecordingPlan {
    pub(super) segments: Vec<Segment>,
    /// The time for which the machine has been running already, s.
    pub(super) warm: f64,
    pub(super) times: Vec<f64>,
    pub(super) tilt: Series,
    pub(super) force: Series,
    pub(super) unit_noise: Series,
    pub(super) rough: Series,
    pub(super) offset: f64,
    pub(super) start: f64,
    pub(super) zero: f64,
    pub(super) random: Rng,
}

/// A case before its strengths are found.
pub(super) struct CaseBuilder<'a> {
    pub(super) spec: &'a Spec,
    pub(super) rng: &'a Rng,
    pub(super) machine: Machine,
    pub(super) declared: Declared,
    pub(super) base: f64,
    pub(super) plans: Vec<RecordingPlan>,
}

impl CaseBuilder<'_> {
    pub(super) fn plant(&self, scales: &[(usize, f64)]) -> Plant {
        let mut plant = self.machine.plant.clone();
        for &(i, s) in scales {
            let name = self.spec.hidden[i];
            let mut form = self.rng.fork(&format!("form/{i}"));
            if self.spec.category == Category::Outside {
                outside::apply(name, &self.machine, &mut plant, self.base, s, &mut form);
            } else {
                effects::apply(name, &self.machine, &mut plant, self.base, s, &mut form);
            }
        }
        plant
    }

    /// The nominal model of `plant` that lacks some of what is hidden.
    pub(super) fn believed(&self, plant: &Plant, lacking: &[(usize, f64)]) -> Believed {
        let lacks = |name: &str| lacking.iter().any(|(i, _)| self.spec.hidden[*i] == name);
        let m = &self.machine;
        Believed {
            inertia: plant.inertia,
            viscous: if lacks("viscous_friction") { 0.0 } else { plant.viscous },
            coulomb: if lacks("coulomb_friction") { 0.0 } else { plant.dry.coulomb },
            gain: plant.gain,
            offset: plant.offset,
            weight: if m.weight_key { plant.weight } else { 0.0 },
        }
    }

    pub(super) fn play(
        &self,
        plant: &Plant,
        believed: &Believed,
        plan: &RecordingPlan,
        step: f64,
    ) -> Result<Vec<Row>, Diverged> {
        let m = &self.machine;
        let coulomb = m.plant.dry.coulomb;
        let scale = m.noise_share * coulomb;
        let mut disturbance = plan.unit_noise.clone();
        disturbance.values.iter_mut().for_each(|x| *x *= scale);
        if !plan.rough.values.is_empty() {
            for (i, value) in disturbance.values.iter_mut().enumerate() {
                *value += plan.rough.at(i as f64 * plan.unit_noise.interval);
            }
        }
        let run = Run {
            times: plan.times.clone(),
            segments: plan.segments.clone(),
            return_speed: m.top_speed,
            limit: m.limit,
            command_step: m.command_step,
            tilt: plan.tilt.clone(),
            force: plan.force.clone(),
            disturbance,
            offset: plan.offset,
            start: plan.start,
            zero_counts: plan.zero,
            noise_counts: m.noise_counts,
            warm: plan.warm,
            speed_bound: 12.0 * m.top_speed,
            random: plan.random.clone(),
        };
        simulate(plant, believed, &run, step)
    }

    /// Measures what effect `i` alone does. Its companions that are terms of the nominal model are
    /// present and known.
    pub(super) fn measured(
        &self,
        i: usize,
        s: f64,
        companions: &[(usize, f64)],
        step: f64,
    ) -> Result<Measured, Diverged> {
        let nominal = |(j, _): &&(usize, f64)| {
            *j != i && matches!(self.spec.hidden[*j], "viscous_friction" | "coulomb_friction")
        };
        let mut scales: Vec<(usize, f64)> = companions.iter().filter(nominal).copied().collect();
        scales.push((i, s));
        let plant = self.plant(&scales);
        let believed = self.believed(&plant, &[(i, s)]);
        let play = |p: &RecordingPlan| self.play(&plant, &believed, p, step);
        let fits: Vec<Vec<Row>> = self.plans.iter().take(2).map(play).collect::<Result<_, _>>()?;
        let rows: Vec<&[Row]> = fits.iter().map(Vec::as_slice).collect();
        let m = &self.machine;
        Ok(measure(&rows, 2, &believed, &self.declared, m.rate, m.residual_bandwidth()))
    }

    /// The |command| that the fit recordings exceed in 2 % of their rows when nothing is hidden.
    pub(super) fn peak_command(&self) -> Result<f64, Diverged> {
        let plant = self.machine.plant.clone();
        let believed = self.believed(&plant, &[]);
        let mut commands = Vec::new();
        for plan in self.plans.iter().take(2) {
            commands.extend(self.play(&plant, &believed, plan, 40e-6)?.iter().map(|r| r.command.abs()));
        }
        commands.sort_by(f64::total_cmp);
        Ok(commands[commands.len() * 98 / 100])
    }

    /// Finds the scale of effect `i` alone at which effect over noise is `target`, or the bound of
    /// it that comes nearest.
    pub(super) fn calibrate(
        &self,
        i: usize,
        target: f64,
        companions: &[(usize, f64)],
    ) -> Result<f64, Diverged> {
        let name = self.spec.hidden[i];
        let (low, high, mut s) = if self.spec.category == Category::Outside {
            outside::bounds(name)
        } else {
            effects::bounds(name, &self.machine)
        };
        s = (s * (target / 5.0)).clamp(low, high);
        let coarse = 40e-6;
        let mut last: Option<(f64, f64)> = None;
        // Largest scale known to be too weak, smallest known to be too strong.
        let (mut weak, mut strong): (Option<f64>, Option<f64>) = (None, None);
        for _ in 0..10 {
            let Ok(now) = self.measured(i, s, companions, coarse) else {
                // Too strong to be run.
                strong = Some(s);
                s = (weak.unwrap_or(low) * s).sqrt();
                continue;
            };
            let ratio = now.effect / now.noise.max(1e-300);
            let miss = (target / ratio.max(1e-9)).ln();
            if miss.abs() < 0.08 {
                break;
            }
            if miss > 0.0 {
                weak = Some(s);
            } else {
                strong = Some(s);
            }
            let slope = match last {
                Some((s0, r0)) if (s / s0).ln().abs() > 1e-3 => {
                    ((ratio / r0).ln() / (s / s0).ln()).clamp(0.4, 3.0)
                }
                _ => 1.0,
            };
            last = Some((s, ratio));
            let wanted = s * (miss / slope).clamp(-2.5, 2.5).exp();
            if let (Some(weak), Some(strong)) = (weak, strong) {
                let inside = weak.min(strong) * 1.01 < wanted && wanted < weak.max(strong) / 1.01;
                s = if inside { wanted } else { (weak * strong).sqrt() };
                continue;
            }
            let bounded = wanted.clamp(low, high);
            if (bounded / s).ln().abs() < 1e-3 {
                // At its bound: the recordings show no more of it.
                break;
            }
            s = bounded;
        }
        Ok(s)
    }
}
