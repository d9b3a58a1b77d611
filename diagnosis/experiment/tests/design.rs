//! Designs for small cases whose answer is known.

use diagnosis::laws::{Effect, EffectName};
use diagnosis::rig::Rig;
use experiment::{Case, Limits, Prediction, Rival, Signal, design};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// A bare roller of a small motor.
fn rig(effects: Vec<Effect>) -> Rig {
    let text = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 1.2e-6\nviscous = 1e-6\ncoulomb = 4e-4\n[actuator]\ngain = 1e-5\n\
                command_unit = \"dac\"\n[encoder]\ncounts_per_unit = 636.6\nturn = 6.283185307179586\n";
    let mut rig = Rig::parse(text, "a test").expect("the rig is right");
    rig.effects = effects;
    rig
}

fn effect(name: EffectName, shape: &[(&str, f64)], coefficients: &[(&str, f64)]) -> Effect {
    let mut effect = Effect::shaped(name, shape);
    effect.coefficients.extend(coefficients.iter().map(|(key, value)| ((*key).to_owned(), *value)));
    effect
}

fn rival(name: &str, probability: f64, effects: Vec<Effect>) -> Rival {
    Rival { name: name.into(), words: name.into(), probability, rig: rig(effects) }
}

fn case(rivals: Vec<Rival>) -> Case {
    let limits = Limits { travel: 60.0, back: 60.0, speed: 65.0, force: 0.02 };
    Case { rivals, disturbance: 2e-5, bandwidth_hz: 40.0, reading_s: 2.5e-3, limits }
}

fn delay_or_lag() -> Case {
    let delay = effect(EffectName::CommandDelay, &[("delay", 2e-3)], &[]);
    let lag = effect(EffectName::ElectricalLag, &[("time_constant", 2e-3)], &[]);
    case(vec![rival("command_delay", 0.5, vec![delay]), rival("electrical_lag", 0.5, vec![lag])])
}

/// Sines alone distinguish these rivals best, and a diagnosis refuses a recording of an axis at
/// rest.
#[test]
fn an_input_travels_however_short_it_has_to_be() {
    for most_s in [6.0, 7.0, 9.0] {
        let design = design(&delay_or_lag(), most_s, 1).expect("the limits are wide");
        let input = &design.chosen.input;
        assert!(input.segments.iter().any(|segment| segment.signal.travels()), "{:?}", input.segments);
        assert!(input.seconds() <= most_s, "{} s of {most_s}", input.seconds());
    }
}

#[test]
fn fast_forces_distinguish_a_delay_from_a_lag() {
    let design = design(&delay_or_lag(), 12.0, 1).expect("the limits are wide");
    // Ramps end at once, which is as fast as sines of some hundred hertz.
    let is_fast = |signal: &Signal| match signal {
        Signal::Multisine { frequencies, .. } => frequencies.last().is_some_and(|hertz| *hertz >= 50),
        Signal::Ramps { .. } => true,
        _ => false,
    };
    let input = &design.chosen.input;
    assert!(input.segments.iter().any(|segment| is_fast(&segment.signal)), "{input:?}");
    assert!(input.segments.iter().any(|segment| segment.signal.travels()), "{input:?}");
    assert!(design.chosen.nearest().expect("two rivals").nats > 10.0, "{:?}", design.chosen.pairs);
    assert!(design.inseparable.is_empty());
    assert!(design.runners_up.iter().all(|other| other.criterion <= 1.04 * design.chosen.criterion));
}

/// A heavy joint that is logged 200 times a second.
#[test]
fn a_slow_log_of_a_heavy_joint_gets_what_it_can_show() {
    let mut case = delay_or_lag();
    for rival in &mut case.rivals {
        rival.rig.model.inertia = 0.17;
        rival.rig.model.coulomb = Some(0.3);
        rival.rig.model.viscous = Some(0.05);
        rival.rig.actuator.gain = 1.0;
    }
    case.limits = Limits { travel: 3.0, back: 3.0, speed: 3.0, force: 6.0 };
    (case.disturbance, case.bandwidth_hz, case.reading_s) = (0.05, 12.0, 5e-3);
    let design = design(&case, 20.0, 1).expect("the limits are those of a joint");
    let segments = &design.chosen.input.segments;
    assert!(segments.iter().any(|segment| segment.signal.travels()), "{segments:?}");
    for segment in segments {
        if let Signal::Multisine { frequencies, .. } = &segment.signal {
            assert!(frequencies.iter().all(|hertz| *hertz <= 40), "five readings a period: {frequencies:?}");
        }
    }
    let fastest = design.predictions[0].velocity.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    assert!(fastest > 0.1, "it moves by {fastest} rad/s");
}

#[test]
fn rivals_that_are_the_same_cannot_be_distinguished() {
    let lag = || effect(EffectName::ElectricalLag, &[("time_constant", 2e-3)], &[]);
    let case = case(vec![rival("one", 0.5, vec![lag()]), rival("other", 0.5, vec![lag()])]);
    let design = design(&case, 6.0, 1).expect("the limits are wide");
    assert!(!design.decides());
    let sentence = design.limits_in_words().expect("a pair is inseparable");
    assert!(sentence.contains("one from other"), "{sentence}");
}

#[test]
fn a_rival_that_imitates_by_other_values_stays() {
    // The same friction as a value of the rig and as an effect: unequal as they are, equal once
    // refitted.
    let mut less = rival("less", 0.5, Vec::new());
    less.rig.model.coulomb = Some(3.6e-4);
    let case = case(vec![rival("more", 0.5, Vec::new()), less]);
    let design = design(&case, 6.0, 1).expect("the limits are wide");
    assert!(design.chosen.nearest().expect("two rivals").nats < 3.0, "{:?}", design.chosen.pairs);
}

#[test]
fn no_rival_leaves_the_limits_less_a_fifth() {
    let mut case = delay_or_lag();
    case.limits = Limits { travel: 2.0, back: 2.0, speed: 5.0, force: 0.004 };
    let design = design(&case, 12.0, 3).expect("some inputs are within the limits");
    for (prediction, rival) in design.predictions.iter().zip(&design.case.rivals) {
        // The same with other numbers is played too, to judge.
        let judges = design.chosen.input.varied();
        let judged = Prediction::new(rival, &judges, design.servo, &design.case.limits);
        for motion in [prediction, &judged] {
            let most = |column: &[f64]| column.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            assert!(most(&motion.position) <= 1.6 && most(&motion.velocity) <= 4.0);
            assert!(most(&motion.command) * rival.rig.actuator.gain <= 0.0032);
        }
    }
}

#[test]
fn an_input_that_begins_at_a_stop_does_not_go_behind_it() {
    let mut case = delay_or_lag();
    case.limits = Limits { travel: 60.0, back: 0.5, speed: 65.0, force: 0.02 };
    let design = design(&case, 12.0, 3).expect("strokes go ahead only");
    for prediction in &design.predictions {
        let least = prediction.position.iter().copied().fold(0.0, f64::min);
        assert!(least >= -0.4, "{least} rad");
    }
}

#[test]
fn what_may_not_move_decides_nothing() {
    let mut case = delay_or_lag();
    case.limits.travel = 1e-6;
    let design = design(&case, 12.0, 1).expect("holding still is within every limit");
    assert!(!design.decides() && design.tried.1 > 0);
}

/// The columns of a CSV file by its header.
fn columns(text: &str) -> BTreeMap<String, Vec<f64>> {
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect()).collect();
    let column = |at: usize| rows.iter().map(|row| row[at]).collect();
    header.iter().enumerate().map(|(at, name)| ((*name).to_owned(), column(at))).collect()
}

/// The files as another machine gets them: the command, played without our plant by a roller with
/// inertia and viscous friction whose command comes 2 ms late, gives the motion that was predicted,
/// and the reference is one that the limits allow.
#[test]
fn the_files_give_another_machine_the_predicted_motion() {
    let mut case = delay_or_lag();
    case.rivals.iter_mut().for_each(|rival| rival.rig.model.coulomb = Some(0.0));
    let design = design(&case, 9.0, 1).expect("the limits are wide");
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("experiment-files");
    let files = design.write(&folder).expect("there is space");
    assert!(files.iter().all(|file| file.is_file()), "{files:?}");
    let read = |name: &str| columns(&std::fs::read_to_string(folder.join(name)).expect("it was written"));
    let (command, reference, predicted) = (read("command.csv"), read("reference.csv"), read("predicted.csv"));
    let rows = (design.chosen.input.seconds() * 1e4).round() as usize;
    for file in [&command, &reference] {
        let time = &file["time_s"];
        assert_eq!(time.len(), rows);
        assert!(time.iter().enumerate().all(|(row, time)| (time - 1e-4 * row as f64).abs() < 1e-9));
    }
    assert!(reference["reference"].iter().all(|place| place.abs() <= 0.8 * case.limits.travel));
    assert!(reference["force"].iter().all(|force| force.abs() <= 0.8 * case.limits.force));
    let (inertia, viscous, gain, late) = (1.2e-6, 1e-6, 1e-5, 20);
    let (mut place, mut speed, mut apart) = (0.0_f64, 0.0_f64, 0.0_f64);
    let mut farthest = 0.0_f64;
    for row in 0..rows {
        if row % 10 == 0 {
            let said = predicted["command_delay_position"][row / 10];
            apart = apart.max((said - place).abs());
            farthest = farthest.max(said.abs());
        }
        let force = if row < late { 0.0 } else { gain * command["command"][row - late] };
        // J·dv/dt = F − b·v, to the letter for a constant force.
        let (last, decay) = (force / viscous, (-viscous * 1e-4 / inertia).exp());
        place += last * 1e-4 + (speed - last) * (1.0 - decay) * inertia / viscous;
        speed = last + (speed - last) * decay;
    }
    assert!(farthest > 1.0, "it moves by {farthest} rad");
    assert!(apart < 1e-3 * farthest, "{apart} rad of {farthest} rad");
}

/// The page holds every rival with the odds of its nearest pair, the runners-up, and the curves.
#[test]
fn the_page_shows_rivals_odds_runners_up_and_evidence() {
    let design = design(&delay_or_lag(), 9.0, 1).expect("the limits are wide");
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("experiment-page");
    design.write(&folder).expect("there is space");
    let page = std::fs::read_to_string(folder.join("experiment.html")).expect("it was written");
    for rival in &design.case.rivals {
        assert!(page.contains(&format!("({})", rival.name)), "{} is missing", rival.name);
    }
    assert!(page.contains(" to 1"), "the odds are missing");
    let runners_up = design.runners_up.len();
    assert!(runners_up > 0 && page.contains(&format!("runner-up {runners_up}")), "{runners_up} runners-up");
    // Evidence, position and command, each with a curve a rival or more.
    assert!(page.matches("<svg").count() >= 3 && page.matches("<path").count() >= 6, "{page}");
}
