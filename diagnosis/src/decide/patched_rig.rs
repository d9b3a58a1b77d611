//! The patched rig, and the place where an effect acts.

use crate::data::rig::Rig;
use crate::data::schema::{Place, Region, Stretch};
use crate::evidence::parameters;
use crate::evidence::residual_maps;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::model::total;
use crate::fit::nominal::{Key, Nominal};
use crate::fit::skew;
use crate::laws::{Effect, Law};
use crate::propose::context::FittedModel;

/// Part of its nominal value that an inertia which hardly matters keeps at least.
const LEAST_INERTIA: f64 = 0.1;

/// The rig with refitted values and the effects found.
pub(crate) fn patch(given: &Rig, nominal: &Nominal, fit: &[BlockedRecording], last: &FittedModel) -> Rig {
    let mut rig = nominal.rig.clone();
    let (inertia, gain, _) = parameters::scale(nominal, last);
    // What was added to rig and command alike is no inertia of the machine.
    let added = nominal.virtual_inertia * gain / nominal.rig.actuator.gain;
    let least = if added == 0.0 { 0.0 } else { LEAST_INERTIA * given.model.inertia };
    rig.model.inertia = (inertia - added).max(least);
    rig.actuator.gain = gain;
    let value = |key: Key| last.fit.value(key).map(|x| x * inertia);
    if let Some(x) = value(Key::Viscous) {
        rig.model.viscous = Some(x.max(0.0));
    }
    if let Some(x) = value(Key::Coulomb) {
        rig.model.coulomb = Some(x.max(0.0));
    }
    if rig.model.offset.is_some() {
        rig.model.offset = value(Key::Offset);
    }
    if let Some(x) = value(Key::Weight) {
        rig.model.weight = Some(x);
    }
    if let Some(x) = value(Key::Gravity) {
        rig.model.gravity = Some(x);
    }
    if let Some(rows) = skew::total_rows(nominal, &last.fit) {
        // A rig has no key for a command that acts early.
        let late_s = rows * skew::row_s(&fit[0]) + rig.actuator.delay_s.unwrap_or(0.0);
        rig.actuator.delay_s = Some(late_s).filter(|late_s| *late_s > 0.0);
    }
    let effects = last.model.effects.iter().enumerate();
    rig.effects.extend(effects.map(|(index, effect)| fitted(effect, index, fit, last, inertia)));
    rig.name = format!("{} (patched)", rig.name);
    rig
}

/// The effect at `index` of a model with its fitted coefficients in the units of a rig, or with the
/// jumps that were found.
fn fitted(
    effect: &Effect,
    index: usize,
    fit: &[BlockedRecording],
    last: &FittedModel,
    inertia: f64,
) -> Effect {
    let ratio = last.fit.value(Key::Gain).unwrap_or(1.0);
    let theta = last.fit.theta(0);
    let mut effect = effect.clone();
    let definition = effect.name.definition();
    if definition.is_of_jumps() {
        // The steps of the recording with the most, as they happened.
        let steps = |track: &&BlockedRecording| track.jumps.lost.windows(2).filter(|w| w[0] != w[1]).count();
        let track = fit.iter().max_by_key(steps).expect("something was fitted");
        let jumped = track.jumps.lost.windows(2).enumerate().filter(|(_, w)| w[0] != w[1]);
        let jumps: Vec<_> = jumped.map(|(i, w)| (track.blocks.start[i + 1], w[1] - w[0])).collect();
        definition.put_jumps(&mut effect, &jumps);
        return effect;
    }
    let Some(law) = Law::new(&effect) else { return effect };
    for (column, theta) in last.fit.prepared[0].columns.iter().zip(&theta) {
        let Key::Term { effect: of, term } = column.key else { continue };
        if of != index {
            continue;
        }
        let unit = if law.in_sensor() {
            1.0
        } else if definition.is_relative_to_gain() {
            // A loss is against the motion, whichever way a command pushes.
            if definition.is_dry() { 1.0 / ratio.abs() } else { 1.0 / ratio }
        } else {
            inertia
        };
        effect.coefficients.insert(law.names()[term].clone(), theta * unit);
    }
    effect
}

/// Returns the stretches of time, and the states, in which an effect of the model acts most.
pub(crate) fn place(nominal: &Nominal, fit: &[BlockedRecording], last: &FittedModel, index: usize) -> Place {
    let mut place = Place::default();
    let mut pooled: Vec<(f64, f64)> = Vec::new();
    let variable = last.model.effects[index].name.definition().variable();
    let mut less = last.model.clone();
    less.effects.remove(index);
    for (r, track) in fit.iter().enumerate() {
        // What the effect adds, as acceleration per block.
        let columns = last.model.columns(nominal, track, &last.noise);
        let theta = last.fit.theta(r);
        let with = total(track, &columns, &theta);
        let columns = less.columns(nominal, track, &last.noise);
        let without: Vec<f64> = columns
            .iter()
            .map(|c| {
                let key = match c.key {
                    Key::Term { effect, term } if effect >= index => Key::Term { effect: effect + 1, term },
                    key => key,
                };
                last.fit.prepared[r].columns.iter().position(|c| c.key == key).map_or(0.0, |i| theta[i])
            })
            .collect();
        let without = total(track, &columns, &without);
        let weight: Vec<f64> = (0..track.block_count())
            .map(|j| {
                let force = (with.dv[j] - without.dv[j]) / track.blocks.span[j];
                let travel = with.dz[j] - without.dz[j];
                if track.motion.rest[j] {
                    0.0
                } else if last.model.effects[index].name.subsystem() == crate::laws::Subsystem::Sensor {
                    travel * travel
                } else {
                    force * force
                }
            })
            .collect();
        let intervals = residual_maps::intervals(track, &weight);
        if !intervals.is_empty() {
            place.recordings.push(Stretch { file: track.blocks.file.clone(), intervals_s: intervals });
        }
        let states = states(variable, track, nominal.rig.turn());
        pooled.extend(states.into_iter().zip(weight));
    }
    let (a, b): (Vec<f64>, Vec<f64>) = pooled.into_iter().unzip();
    if let Some((low, high)) = residual_maps::range(&a, &b) {
        place.states.push(Region { variable: variable.into(), low, high });
    }
    place
}

/// Returns a state of a recording, block by block; without its sign where an effect depends on its
/// size.
fn states(variable: &str, track: &BlockedRecording, turn: Option<f64>) -> Vec<f64> {
    let mut states = residual_maps::variable(track, variable, turn);
    if !matches!(variable, "travel" | "angle" | "time" | "tilt") {
        states.iter_mut().for_each(|x| *x = x.abs());
    }
    states
}
