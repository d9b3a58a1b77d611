//! The inputs of an effect's terms over a recording. Nothing here is fitted.

use crate::effects::definition::Coupling;
use crate::effects::{Effect, Law, State, Variable};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::input::Input;

/// The inputs of one effect on force or sensor over a recording; `bias` is the acceleration by the force that is there all the
/// time, which a second mass takes up, `drive` is the command's input, asked for only where the effect scales it.
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
    let count = law.names().len();
    let n = track.block_count();
    let over_command = effect.table.as_ref().is_some_and(|table| table.over.contains(&Variable::Command))
        || effect.name.formula().is_some_and(|formula| formula.uses("u"));
    let of_drive = effect.shape.contains_key("of_drive");
    let uses_command = over_command || of_drive || effect.shape.contains_key("mean_square");
    let carried = uses_command.then(|| track.block_mean(command));
    let scales_drive = definition.scales_drive();
    let mut columns = vec![Vec::with_capacity(n); count];
    let mut out = vec![0.0; count];
    for j in 0..n {
        let state = State {
            position: track.motion.x[j],
            velocity: track.motion.v[j],
            acceleration: track.acceleration(j),
            rest: track.motion.rest[j],
            // What scales the drive scales its whole input below.
            drive: carried.as_ref().filter(|_| !scales_drive).map_or(1.0, |carried| carried[j]),
            command: carried.as_ref().map_or(1.0, |carried| carried[j]),
            tilt: track.tilt_at(j),
            external: track.force_at(j),
            time: track.blocks.start[j] + 0.5 * track.blocks.span[j],
            dt: track.blocks.span[j],
            ..State::default()
        };
        law.terms(&state, &mut out);
        for (column, term) in columns.iter_mut().zip(&out) {
            column.push(*term);
        }
    }
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

/// The input of a second mass, which is faster than a block.
fn of_second_mass(
    track: &BlockedRecording,
    coupling: Coupling,
    law: &mut Law,
    command: &[f64],
    bias: f64,
) -> Input {
    let slices = match coupling {
        Coupling::Grip => &track.rows.of_grip,
        Coupling::Stiff => &track.rows.of_contact,
    };
    let mut out = [0.0];
    let mut signal = Vec::new();
    for (j, slices) in slices.blocks().enumerate() {
        let (tilt, external) = (track.tilt_at(j), track.force_at(j));
        for slice in slices {
            let (command, hold) = (&command[slice.rows.clone()], &track.rows.hold[slice.rows.clone()]);
            let mean = command.iter().zip(hold).map(|(u, h)| u * h).sum::<f64>() / slice.span;
            let velocity = track.velocity_within(j, slice.start + 0.5 * slice.span);
            let dt = slice.span;
            let state =
                State { drive: mean, command: mean, velocity, tilt, external, bias, dt, ..State::default() };
            law.terms(&state, &mut out);
            signal.push(out[0]);
        }
    }
    slices.input(&signal)
}
