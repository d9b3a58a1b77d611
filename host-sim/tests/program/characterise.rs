//! The whole way round: the virtual device has an effect in its mechanism that the written rig does
//! not know; it plays its excitations over the link, and the diagnosis of the recordings names the
//! effect.

use control_core::event::State;
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use diagnosis::laws::{Effect, EffectName};
use diagnosis::report::Verdict;
use fixed::types::{I8F24, I16F16};
use lab::characterise::mechanism::BareDevice;
use lab::characterise::programme::{Programme, ProgrammeStep};
use lab::characterise::sequencer::Sequencer;
use lab::characterise::{self, programme, writer};
use link::codec::{self, Decoder, MAX_FRAME};
use link::frames::{Ack, CommandRefusal, DeviceFrame, HostFrame, Numbered};
use std::path::PathBuf;
use std::time::Duration;

/// Characterises a device with `hidden` in its mechanism and diagnoses the recordings.
fn find(hidden: Option<Effect>, folder: &str) -> diagnosis::Outcome {
    let config = characterise::configuration();
    let scale = characterise::scale(&config).expect("the default configuration is sound");
    let nominal = writer::nominal_rig(&scale);
    let programmes = programme::programmes(&nominal, scale.roller_radius_mm);
    characterise::check(&config, &programmes).expect("every excitation is within the limits");
    let mut truth = nominal.clone();
    truth.effects.extend(hidden);
    let mut device = BareDevice::new(&truth, "the test's rig").expect("rotary, in DAC steps");
    let tracks = characterise::on_virtual(&mut device, &programmes, |_| {}).expect("nothing trips");
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let paths = writer::write_all(&dir, &tracks).expect("the folder can be written");
    let [rig, fit, fit2, holdout] = &paths[..] else { panic!("{paths:?}") };
    let request = diagnosis::Request {
        rig: rig.clone(),
        fit: vec![fit.clone(), fit2.clone()],
        effects: None,
        holdout: vec![holdout.clone()],
    };
    let outcome = diagnosis::diagnose(&request, &|_, _| {}).expect("the recordings are sound");
    std::fs::remove_dir_all(&dir).expect("the test's own folder");
    outcome
}

#[test]
#[ignore = "nightly: a minute at 10 kHz and its diagnosis, 20 s"]
fn a_hidden_cogging_is_found_through_the_link() {
    let mut cogging =
        Effect::shaped(EffectName::Cogging, &[("turn", std::f64::consts::TAU), ("order_7", 7.0)]);
    cogging.coefficients.insert("cos_7".into(), 2.0e-4);
    cogging.coefficients.insert("sin_7".into(), 1.0e-4);
    let outcome = find(Some(cogging), "hidden-cogging");
    let report = &outcome.report;
    assert_eq!(report.verdict, Verdict::MissingPhysics, "{}", outcome.summary());
    assert_eq!(report.effects[0].name.to_string(), "cogging", "{}", outcome.summary());
    let found = report.effects[0].parameters["order_7"].value;
    let truth = 5.0_f64.sqrt() * 1.0e-4;
    assert!((found / truth - 1.0).abs() < 0.1, "{found} N·m for {truth} N·m");
}

#[test]
#[ignore = "nightly: a device characterised in real time, 50 s"]
fn a_device_that_is_as_its_rig_says_lacks_nothing() {
    let outcome = find(None, "hidden-nothing");
    assert_eq!(outcome.report.verdict, Verdict::NoMismatch, "{}", outcome.summary());
}

fn mm(length: f64) -> Millimetres {
    Millimetres(I16F16::from_num(length))
}

fn step(signal: Signal, duration_ms: u32) -> ProgrammeStep {
    let servo =
        Servo { stiffness: Stiffness(I16F16::from_num(0.05)), damping: Damping(I8F24::from_num(0.0005)) };
    let excitation = Excitation { signal, duration_ms, servo, travel: mm(100.0), compensated: false };
    ProgrammeStep { excitation, prompt: None }
}

fn strokes(stroke: f64, duration_ms: u32) -> ProgrammeStep {
    let speed = MillimetresPerSecond(I16F16::from_num(50.0));
    step(Signal::Triangle { stroke: mm(stroke), speed }, duration_ms)
}

/// Strokes to 30 mm and back to 20, ramps of torque there, and strokes from there.
fn three_steps() -> Vec<ProgrammeStep> {
    let ramps = Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(0.3)), ramp_ms: 100 };
    vec![strokes(30.0, 800), step(ramps, 400), strokes(20.0, 600)]
}

#[test]
fn steps_without_a_prompt_play_as_one_sequence() {
    let mut device = BareDevice::new(
        &writer::nominal_rig(&characterise::scale(&characterise::configuration()).expect("sound")),
        "the test's rig",
    )
    .expect("rotary, in DAC steps");
    let programme = Programme { file: "fit.csv", steps: three_steps() };
    let tracks = characterise::on_virtual(&mut device, &[programme], |_| {}).expect("nothing trips");
    let track = &tracks[0];
    let played = track.samples.iter().take_while(|sample| sample.state == State::Excitation as u8).count();
    assert_eq!(played, 18_000, "1.8 s without a tick of rest");
    let after = track.samples[played..].iter().filter(|sample| sample.state != State::Idle as u8).count();
    assert_eq!(after, 0, "and nothing after it");
    // The reference that is written down is the one that the motor followed: it goes on where it
    // was.
    let hello = characterise::scale(&characterise::configuration()).expect("sound");
    let mm_per_count = hello.mm_per_count;
    let begin = f64::from(track.samples[0].count);
    for (tick, wanted) in [(5_999, 30.0), (7_999, 20.0), (11_999, 20.0), (15_999, 40.0), (17_999, 30.0)] {
        let reference = (track.reference[tick] - begin) * mm_per_count;
        assert!((reference - wanted).abs() < 0.1, "tick {tick}: {reference} mm for {wanted}");
        let motor = (f64::from(track.samples[tick].count) - begin) * mm_per_count;
        assert!((motor - wanted).abs() < 3.0, "tick {tick}: the motor is at {motor} mm for {wanted}");
    }
}

#[test]
fn a_programme_is_parted_where_one_sequence_does_not_hold_it() {
    let plan = characterise::configuration().plan().expect("sound");
    let parts = |steps: Vec<ProgrammeStep>| Programme { file: "fit.csv", steps }.parts(&plan);
    let prompted = || ProgrammeStep { prompt: Some("tilt"), ..strokes(10.0, 100) };
    assert_eq!(parts(three_steps()), [3]);
    assert_eq!(parts(vec![]), [0; 0]);
    let mut with_prompt = three_steps();
    with_prompt.insert(1, prompted());
    assert_eq!(parts(with_prompt), [1, 1, 2], "a person has a part in the second");
    assert_eq!(parts(vec![prompted(), prompted()]), [1, 1]);
    assert_eq!(parts(vec![strokes(10.0, 100); 10]), [8, 2], "more than the device holds");
    assert_eq!(parts(vec![strokes(10.0, 50_000); 3]), [2, 1], "more than two minutes");
    // Each ends 60 mm further out.
    assert_eq!(parts(vec![strokes(60.0, 1_200); 3]), [1, 1, 1], "further than its travel");
    assert_eq!(parts(vec![strokes(101.0, 100), strokes(10.0, 100)]), [1, 1], "the device refuses the first");
}

#[test]
fn a_device_of_an_older_protocol_says_what_to_do() {
    let programme = Programme { file: "fit.csv", steps: three_steps() };
    let mut sequencer = Sequencer::new(characterise::configuration(), &programme).expect("sound");
    sequencer.connected(Duration::ZERO);
    let mut decoder = Decoder::default();
    let bytes = sequencer.transmit(Duration::ZERO, |_| {}).to_vec();
    let hello =
        bytes.iter().find_map(|byte| decoder.push::<HostFrame>(*byte)).expect("a hello").expect("whole");
    let ack = Ack { id: hello.id, result: Err(CommandRefusal::Version) };
    let mut out = [0; MAX_FRAME];
    let length =
        codec::encode(&Numbered { sequence: 0, frame: DeviceFrame::Ack(ack) }, &mut out).expect("it fits");
    sequencer.receive(Duration::ZERO, &out[..length]);
    sequencer.transmit(Duration::from_millis(1), |_| {});
    assert!(sequencer.is_over());
    let said = sequencer.finish().expect_err("there is no recording").to_string();
    assert!(said.contains("flash the firmware"), "{said}");
}
