//! The inputs of an effect's terms over a recording. Nothing here is fitted.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::input::Input;
use crate::fit::kept::Side;
use crate::laws::definition::Coupling;
use crate::laws::{Effect, Law, State, Variable};

/// The same inputs, kept from one model to the next where they are costly and rest on the command
/// as recorded.
pub(crate) fn kept_inputs(
    track: &BlockedRecording,
    effect: &Effect,
    command: &[f64],
    bias: f64,
    drive: impl FnOnce() -> Input,
) -> Vec<Input> {
    let definition = effect.name.definition();
    let is_costly =
        definition.coupling().is_some() || (definition.is_periodic() && !definition.scales_drive());
    let new = || effect_inputs(track, effect, command, bias, drive);
    if !is_costly || !std::ptr::eq(command, track.rows.command.as_slice()) {
        return new();
    }
    track.kept.inputs((&track.motion, &track.rows), (effect, bias), new)
}

/// The inputs of one effect on force or sensor over a recording; `bias` is the acceleration by the
/// force that is there all the time, which a second mass takes up, `drive` is the command's input,
/// asked for only where the effect scales it.
pub(crate) fn effect_inputs(
    track: &BlockedRecording,
    effect: &Effect,
    command: &[f64],
    bias: f64,
    drive: impl FnOnce() -> Input,
) -> Vec<Input> {
    let definition = effect.name.definition();
    if definition.is_of_jumps() {
        return vec![Input::Sensor(track.jumps.lost.clone())];
    }
    let Some(mut law) = Law::new(effect) else { return Vec::new() };
    if let Some(coupling) = definition.coupling() {
        return vec![of_second_mass(track, coupling, &mut law, command, bias)];
    }
    let scales_drive = definition.scales_drive();
    let columns = columns_of(track, effect, &mut law, command);
    let sensor = law.in_sensor();
    let drive = scales_drive.then(drive);
    columns
        .into_iter()
        .map(|column| {
            if sensor {
                Input::Sensor(column)
            } else if let Some(drive) = &drive {
                drive.scaled(&column)
            } else {
                Input::Held(column)
            }
        })
        .collect()
}

/// The terms of a law over the blocks of a recording: a column for each term.
fn columns_of(track: &BlockedRecording, effect: &Effect, law: &mut Law, command: &[f64]) -> Vec<Vec<f64>> {
    let count = law.names().len();
    let n = track.block_count();
    let carried = uses_command(effect).then(|| track.block_mean(command));
    // What scales the drive scales its whole input, and not the command here.
    let scales_drive = effect.name.definition().scales_drive();
    let mut columns = vec![Vec::with_capacity(n); count];
    let mut out = vec![0.0; count];
    for j in 0..n {
        let state = State {
            drive: carried.as_ref().filter(|_| !scales_drive).map_or(1.0, |carried| carried[j]),
            command: carried.as_ref().map_or(1.0, |carried| carried[j]),
            ..state_of_block(track, j)
        };
        let Some(sides) = track.motion.sides(j) else {
            law.terms(&state, &mut out);
            columns.iter_mut().zip(&out).for_each(|(column, term)| column.push(*term));
            continue;
        };
        columns.iter_mut().for_each(|column| column.push(0.0));
        for Side { part, velocity } in sides {
            law.terms(&State { velocity, dt: part * state.dt, ..state }, &mut out);
            columns.iter_mut().zip(&out).for_each(|(column, term)| column[j] += part * term);
        }
    }
    columns
}

/// True if a law reads the command in addition to the motion.
fn uses_command(effect: &Effect) -> bool {
    let over_command = effect.table.as_ref().is_some_and(|table| table.over.contains(&Variable::Command))
        || effect.name.formula().is_some_and(|formula| formula.uses("u"));
    over_command || effect.name.definition().reads_command(effect)
}

/// The state of the axis in block `j`, without its command.
fn state_of_block(track: &BlockedRecording, j: usize) -> State {
    State {
        position: track.place_at(j),
        velocity: track.motion.v[j],
        acceleration: track.acceleration(j),
        rest: track.motion.rest[j],
        tilt: track.tilt_at(j),
        external: track.force_at(j),
        time: track.blocks.start[j] + 0.5 * track.blocks.span[j],
        dt: track.blocks.span[j],
        ..State::default()
    }
}

/// The input of a second mass, which is faster than a block.
fn of_second_mass(
    track: &BlockedRecording,
    coupling: Coupling,
    law: &mut Law,
    command: &[f64],
    bias: f64,
) -> Input {
    let rows = &track.rows;
    let (slices, of_recorded) = match coupling {
        Coupling::Grip => (&rows.of_grip, &rows.grip_command),
        Coupling::Stiff => (&rows.of_contact, &rows.contact_command),
    };
    let is_recorded = std::ptr::eq(command, rows.command.as_slice());
    let of_other = (!is_recorded).then(|| slices.means(command, &rows.hold));
    let means = of_other.as_ref().unwrap_or(of_recorded);
    let mut out = [0.0];
    let mut signal = Vec::with_capacity(means.len());
    for (j, (slices, means)) in slices.blocks().zip(means.chunks_exact(slices.per_block())).enumerate() {
        let (tilt, external) = (track.tilt_at(j), track.force_at(j));
        for (slice, mean) in slices.iter().zip(means) {
            let (velocity, dt) = (track.velocity_within(j, slice), slice.span);
            let state = State {
                drive: *mean,
                command: *mean,
                velocity,
                tilt,
                external,
                bias,
                dt,
                ..State::default()
            };
            law.terms(&state, &mut out);
            signal.push(out[0]);
        }
    }
    slices.input(&signal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::laws::EffectName;

    /// Damping along the travel over recordings of one swing, the second from a quarter of it on.
    fn damping(absolute: bool) -> [Vec<f64>; 2] {
        let mut rig = Rig::of_values(0.01, 0.0, 0.0);
        rig.encoder.absolute = absolute;
        let taken = |from: usize| {
            let rows = from..from + 2000;
            let time_s: Vec<f64> = rows.clone().map(|row| row as f64 * 1e-3).collect();
            let counts = |t: &f64| (4000.0 * (3.0 * t).sin()).round();
            let position_counts = time_s.iter().map(counts).collect();
            let recording = Recording {
                command: vec![0.0; time_s.len()],
                position_counts,
                time_s,
                ..Recording::default()
            };
            let mut track = BlockedRecording::new(&recording, &rig);
            let speed = |t: &f64| 12_000.0 * (3.0 * (t + rows.start as f64 * 1e-3)).cos();
            track.motion.v = track.blocks.start.iter().map(speed).collect();
            let shape = [("low", -2.0), ("high", 2.0), ("degree", 3.0)];
            let effect = Effect::shaped(EffectName::PositionDependentDamping, &shape);
            let inputs = effect_inputs(&track, &effect, &track.rows.command, 0.0, || track.drive(None));
            match &inputs[0] {
                Input::Held(column) => column.clone(),
                _ => panic!("it is a force"),
            }
        };
        [taken(0), taken(500)]
    }

    #[test]
    fn an_absolute_encoder_says_where_a_law_of_the_travel_is() {
        let differ = |[first, second]: [Vec<f64>; 2]| {
            let later = first.len() / 4;
            let of = first[later..].iter().zip(&second);
            let largest = first.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            of.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) / largest
        };
        assert!(differ(damping(true)) < 0.03, "{}", differ(damping(true)));
        assert!(differ(damping(false)) > 0.2, "without it each recording counts from its start");
    }
}
