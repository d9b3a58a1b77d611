use super::*;
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::laws::EffectName as N;
use crate::pipeline::prepare::prepare;
use crate::repair::Checked;
use crate::simulation::{Plant, Surroundings};
use std::f64::consts::TAU;

const RATE: f64 = 500.0;

fn rig(effect: &str) -> Rig {
    let text = format!(
        "format = 1\nkind = \"rotary\"\n[model]\ninertia = 1e-3\nviscous = 2e-3\ncoulomb = 0.02\n\
         [actuator]\ngain = 1.0\ncommand_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 2e4\n{effect}"
    );
    Rig::parse(&text, "a test").expect("the rig is right")
}

/// A speed loop that first turns the machine fast, and then slowly on: there its command hardly
/// changes but for what the machine does.
fn turned_slowly(machine: &Rig, speed: f64) -> Recording {
    let (mut plant, mut recording) = (Plant::new(machine), Recording::default());
    let (mut before, mut sum) = (0.0, 0.0);
    for row in 0..(12.0 * RATE) as u32 {
        let t = f64::from(row) / RATE;
        let wanted = if t < 0.8 { -6.0 } else { speed };
        let position = plant.counts() / machine.encoder.counts_per_unit;
        let error = wanted - (position - before) * RATE;
        before = position;
        sum += error / RATE;
        let command = 0.02 * error + 0.4 * sum;
        recording.time_s.push(t);
        recording.command.push(command);
        recording.position_counts.push(plant.counts());
        for _ in 0..20 {
            plant.step(command, Surroundings::default(), 1.0 / RATE / 20.0);
        }
    }
    recording
}

/// The laws and numbers of waves that the search keeps of cogging that it has and a ripple that it
/// tries.
fn decided(machine: &Rig) -> Vec<(N, usize)> {
    let (model, take) = (rig(""), |speed| turned_slowly(machine, speed));
    let prepared =
        prepare(&model, &Checked::unchanged(&[take(1.0), take(1.2)], &[take(0.8)]), Some(0.0), &|_, _| ());
    let search = Search { prepared: &prepared, progress: &|_, _| (), done: Cell::new(0.0) };
    let now = search.start();
    let on = search.context(&now.tracks);
    let cogging = Effect::of_orders(N::Cogging, TAU, &[6.0]);
    let ripple = Effect::of_orders(N::TorqueRipple, TAU, &[10.0]);
    let candidate = on.fit(
        Model { effects: vec![cogging, ripple], ..Model::default() },
        &now.white_fit.noise,
        Colour::White,
    );
    let chosen = prefer_fewer_waves(&on, candidate);
    chosen.model.effects.iter().map(|one| (one.name, one.waves().len())).collect()
}

/// A known effect of one wave.
fn wave(name: &str, order: u32, amplitude: f64) -> String {
    format!(
        "[[effect]]\nname = \"{name}\"\n[effect.shape]\norder_{order} = {order}\nturn = {TAU}\n\
         [effect.coefficients]\ncos_{order} = 0.0\nsin_{order} = {amplitude}\n"
    )
}

#[test]
fn waves_of_cogging_beside_a_steady_command_are_no_ripple() {
    let machine = rig(&(wave("cogging", 6, 0.01) + &wave("cogging", 10, 0.005)));
    assert_eq!(decided(&machine), [(N::Cogging, 2)]);
}

#[test]
fn a_ripple_beside_cogging_stays_a_ripple() {
    let machine = rig(&(wave("cogging", 6, 0.01) + &wave("torque_ripple", 10, 0.2)));
    assert_eq!(decided(&machine), [(N::Cogging, 1), (N::TorqueRipple, 1)]);
}

#[test]
fn held_out_recordings_choose_nothing() {
    let machine = rig(&(wave("cogging", 6, 0.01) + &wave("cogging", 10, 0.005)));
    let fit = [turned_slowly(&machine, 1.0), turned_slowly(&machine, 1.2)];
    let chosen = |holdout: &[Recording]| {
        let checked = Checked::unchanged(&fit, holdout);
        let prepared = prepare(&rig(""), &checked, Some(0.0), &|_, _| ());
        let search = Search { prepared: &prepared, progress: &|_, _| (), done: Cell::new(0.0) };
        search.forward_selection(search.start(), &mut Tried::default()).white_fit.model.effects
    };
    let of_the_machine = chosen(&[turned_slowly(&machine, 0.8)]);
    assert!(!of_the_machine.is_empty(), "the fitted recordings show something");
    let other = rig("[[effect]]\nname = \"quadratic_drag\"\n[effect.coefficients]\ncoefficient = 0.05\n");
    let mut scrambled = turned_slowly(&other, 0.8);
    scrambled.command.reverse();
    assert_eq!(chosen(&[scrambled]), of_the_machine);
}
