//! The patient is changed while the device runs: the change is taken whole or refused with the
//! reason, and reported to the page and to the recording.

use crate::common::folder;
use control_core::Device;
use control_core::units::MillinewtonMetres;
use device_sim::device::virtual_device::VirtualDevice;
use device_sim::driver::Driver;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use device_sim::session::{self, Control, Source, Subscription};
use recording::messages::Setup;
use recording::read::Recording;
use recording::run_stats::RunStats;
use recording::stretches::stretches;
use recording::write::Recorder;
use server::outlets::Outlets;
use server::patient_manager::PatientManager;
use server::realtime_clock::RealtimeClock;
use server::run_loop::RunLoop;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// Runs an adult on `device` for `seconds`; at the first progress `wanted` is chosen. The patient
/// manager assumes the built-in device.
fn run(device: &Device, wanted: &str, seconds: u64, file: &Path) -> Subscription {
    let profile = Profile::find_for("adult", device).expect("it is built in");
    let believed = Profile::find("adult").expect("it is built in");
    let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
    let (session, publisher) = session::open(profile.scene(Source::Virtual, None));
    let looker = session.subscribe();
    let setup = Setup {
        program: "test".into(),
        source: "virtual".into(),
        profile_toml: profile.source.text.clone(),
        profile_origin: profile.source.origin.clone(),
        procedure: None,
        device_toml: None,
        purpose: None,
    };
    let recorder = Recorder::create(file, &setup).expect("the folder can be written");
    let stop = AtomicBool::new(false);
    let outlets = Outlets::new(publisher, Some(recorder), RunStats::new(Some(seconds * 10_000)));
    let run_loop = RunLoop::new(Driver::new(profile.config.patient.clone()), outlets, &stop);
    let patients = PatientManager::new(believed, Source::Virtual, Some("venepuncture".into()), setup);
    let device = VirtualDevice::new(&profile, procedure);
    let mut choice = Some(Control::Choose { patient: wanted.into() });
    let choose = |samples: u64| {
        if samples > 1_000 {
            choice.take().into_iter().for_each(|choice| session.control(choice));
        }
    };
    run_loop.with_patients(patients).run_in_step(device, RealtimeClock::Free, choose).expect("it runs");
    looker
}

#[test]
fn another_patient_is_taken_whole_and_the_run_goes_on_with_it() {
    let file = folder("patient-taken").join("a.mcap");
    let mut looker = run(&Device::commissioned_virtual(), "firm-skin", 7, &file);
    let batch = looker.drain();
    assert_eq!(batch.scene.expect("another tissue").profile, "firm-skin");
    let patient = batch.patient.expect("an answer");
    assert!(patient.answer.expect("to the wish").taken);
    assert_eq!(patient.profile["name"], "firm-skin");

    let recording = Recording::read(&file).expect("it was recorded");
    assert_eq!(recording.profile().expect("as it began").name, "adult");
    let stretches = stretches(&recording);
    let setups: Vec<_> = stretches.iter().map(|s| s.setup.as_ref()).collect();
    assert!(setups[0].is_none() && setups.last().expect("stretches").is_some(), "{} stretches", setups.len());
    let last = stretches.last().expect("stretches");
    let then = recording.profile_of(last.setup.as_ref().expect("another patient")).expect("it may run");
    assert_eq!(then.name, "firm-skin");
    // Its skin gives way at 1.5 N; the adult's would at 1.0 N.
    let peak = last.samples.iter().map(|s| last.hello.force_n(s.dac)).fold(0.0, f64::max);
    assert!((1.4..1.8).contains(&peak), "{peak} N");
}

#[test]
fn a_refused_patient_changes_nothing_and_gives_its_reason() {
    let file = folder("patient-refused").join("a.mcap");
    // A motor that gives 1.7 N at the roller: enough for an adult, not for firm skin.
    let mut weak = Device::commissioned_virtual();
    weak.limits.torque = MillinewtonMetres(17_i16.into());
    let mut looker = run(&weak, "firm-skin", 7, &file);
    let batch = looker.drain();
    assert_eq!(batch.scene.expect("the first").profile, "adult");
    let patient = batch.patient.expect("an answer");
    let answer = patient.answer.expect("to the wish");
    assert!(!answer.taken && answer.reason.contains("the device refused"), "{answer:?}");
    assert_eq!(patient.profile["name"], "adult");
    let stretches = stretches(&Recording::read(&file).expect("it was recorded"));
    let peak =
        stretches.iter().flat_map(|s| s.samples.iter().map(|x| s.hello.force_n(x.dac))).fold(0.0, f64::max);
    assert!((0.9..1.3).contains(&peak), "the adult's skin is still there: {peak} N");
}
