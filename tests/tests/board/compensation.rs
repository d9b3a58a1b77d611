//! Compensation cancels the mechanism's own forces as they were found: on the flash image, and for
//! a minute at rest with the same core on this machine. `fixtures/hidden-found.toml` is what the
//! diagnosis made of `fixtures/hidden.toml` (`docs/guide/compensation.md` has the commands).

use std::path::Path;

use control_core::compensation::Compensation;
use control_core::controller::TickInput;
use control_core::excitation::{Excitation, Signal};
use control_core::units::{Counts, Millimetres, MillimetresPerSecond, Milliradians};
use control_core::{Config, Controller, Device, LargeOrder, Order, Patient};
use diagnosis::rig::Rig;
use emulator::board::{Board, MILLISECOND, Nanos};
use fixed::types::I16F16;
use lab::compensate::angle;
use lab::compensate::coefficients::{Found, found};
use link::Command;
use tests::mechanism::{Mechanism, SharedMechanism, Way};
use tests::pc::Pc;
use tests::scenario::board;

/// The rotor's angle at depth 0, and the tilt of the emulated board, rad.
const ROTOR: f64 = 1.234;
const TILT: f64 = std::f64::consts::FRAC_PI_6;
const PARTS: usize = 10;

fn what_was_found() -> Found {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/hidden-found.toml");
    let rig = Rig::read(&path).expect("what the diagnosis found");
    found(&rig, &Device::commissioned_virtual(), 1.0).expect("it can be fed forward")
}

fn config(compensation: Compensation) -> Config {
    Config {
        device: Device { compensation, ..Device::commissioned_virtual() },
        ..Config::commissioned_virtual()
    }
}

/// In through skin and vein, held, and out again; times from the start of the hand.
fn insertion() -> Way {
    vec![(0.2, 0.0), (0.6, -0.002), (3.2, 0.012), (4.7, 0.012), (7.3, -0.002)]
}

/// The phases, each with its first and last time.
const PHASES: [(&str, f64, f64); 3] = [("insertion", 0.6, 3.2), ("hold", 3.3, 4.7), ("withdrawal", 4.7, 7.3)];

struct Felt {
    phases: [f64; 3],
    tenths: [f64; PARTS],
}

impl Felt {
    fn all(&self) -> f64 {
        (self.phases.iter().map(|rms| rms * rms).sum::<f64>() / 3.0).sqrt()
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count): (f64, f64), x| (sum + x * x, count + 1.0));
    (sum / count.max(1.0)).sqrt()
}

/// Forces of the hand less the law's, by time since the hand began and by depth.
fn felt(rows: &[(f64, f64, f64)]) -> Felt {
    let phases = PHASES
        .map(|(_, from, to)| rms(rows.iter().filter(|row| (from..to).contains(&row.0)).map(|row| row.2)));
    let tenths = std::array::from_fn(|tenth| {
        let within = |depth: f64| ((depth + 0.002) / 0.014 * PARTS as f64).floor() == tenth as f64;
        rms(rows.iter().filter(|row| (0.6..7.3).contains(&row.0) && within(row.1)).map(|row| row.2))
    });
    Felt { phases, tenths }
}

/// Finds the rotor's angle on the board, as `host-sim compensate` does: by a slow turn.
fn find_angle(board: &mut Board, pc: &mut Pc, found: &Found) -> i32 {
    let stroke = 65.0;
    let turn = Excitation {
        signal: Signal::Triangle {
            stroke: Millimetres(I16F16::from_num(stroke)),
            speed: MillimetresPerSecond(I16F16::from_num(20.0)),
        },
        duration_ms: (2.0 * stroke / 20.0 * 1e3) as u32,
        servo: device_setup::servo::servo(found.inertia, 10.0),
        travel: Millimetres(I16F16::from_num(150)),
        compensated: false,
    };
    let from = pc.heard.samples.len();
    pc.must(board, Command::Excite(turn));
    pc.run_ms(board, 6_600);
    let played: Vec<_> = pc.heard.samples[from..].iter().map(|(_, s)| *s).filter(|s| s.state == 6).collect();
    let per_code = 0.0288 / 2_047.0;
    let angle =
        angle::find(&played, &found.waves, (4_000.0, per_code, 2_048.0, found.inertia)).expect("it shows");
    println!("the rotor's angle is zero at {} counts, agreement {:.3}", angle.count, angle.agreement);
    angle.count
}

/// Returns the force beyond the law that the hand feels on the flash image.
fn felt_on_board(found: Option<&Found>) -> Felt {
    let mechanism = SharedMechanism::new(Mechanism::new(ROTOR, TILT));
    let mut board = board(mechanism.plant());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Zero);
    pc.configure(&mut board, &config(found.map_or(Compensation::NONE, |found| found.compensation)));
    if let Some(found) = found {
        let count = find_angle(&mut board, &mut pc, found);
        pc.must(&mut board, Command::Index(Some(count)));
    }
    // Back to depth 0 by hand, then started.
    let depth = mechanism.with(|m| m.depth());
    mechanism.with(|m| m.lead(Some(vec![(0.0, depth), (0.3, 0.0)])));
    pc.run_ms(&mut board, 400);
    pc.must(&mut board, Command::Start);
    pc.run_ms(&mut board, 600);
    let begin = board.now();
    mechanism.with(|m| m.lead(Some(insertion())));
    let _ = mechanism.take_moments();
    let mut poses = Vec::new();
    while board.now() < begin + 7_400 * MILLISECOND {
        pc.run_ms(&mut board, 1);
        poses.extend(pc.heard.pose.take().map(|pose| (board.now(), pose)));
    }
    assert!(
        !pc.heard_event(|kind| matches!(kind, link::frames::EventKind::Fault { .. })),
        "{:?}",
        pc.heard.events
    );
    // A pose comes a moment after its tick; the quickest says when ticks are.
    let first: Nanos =
        poses.iter().map(|(at, pose)| at - pose.tick * 100_000).min().expect("there are poses");
    let moments = mechanism.take_moments();
    let rows: Vec<_> = poses
        .iter()
        .filter_map(|(_, pose)| {
            let at = first + pose.tick * 100_000;
            let moment = moments.get(moments.partition_point(|moment| moment.at < at))?;
            let beyond = moment.hand_force - pose.force.0.to_num::<f64>();
            (at >= begin).then(|| ((at - begin) as f64 / 1e9, moment.depth, beyond))
        })
        .collect();
    felt(&rows)
}

/// Takes more than 5 s: an insertion at a hand's speed twice, and the slow turn that finds the
/// rotor's angle, 25 s of the board.
#[test]
fn a_hand_feels_a_quarter_of_the_mechanism() {
    let found = what_was_found();
    let (before, after) = (felt_on_board(None), felt_on_board(Some(&found)));
    for ((name, ..), (before, after)) in PHASES.iter().zip(before.phases.iter().zip(&after.phases)) {
        println!("| {name} | {:.1} mN | {:.1} mN |", before * 1e3, after * 1e3);
    }
    println!("| all | {:.1} mN | {:.1} mN |", before.all() * 1e3, after.all() * 1e3);
    for (tenth, (before, after)) in before.tenths.iter().zip(&after.tenths).enumerate() {
        println!("| tenth {tenth} | {:.1} mN | {:.1} mN |", before * 1e3, after * 1e3);
    }
    assert!(before.all() > 0.08, "there is something to take away: {} N", before.all());
    assert!(after.all() <= before.all() / 4.0, "{} of {} N", after.all(), before.all());
    for (tenth, (before, after)) in before.tenths.iter().zip(&after.tenths).enumerate() {
        assert!(after <= before, "tenth {tenth}: {after} N after {before} N");
    }
}

/// The same core on this machine, tick by tick: counts and codes of so many seconds at rest.
fn at_rest(patient: Patient, way: Option<Way>, seconds: u32) -> (Vec<i32>, Vec<u16>) {
    let found = what_was_found();
    let mut config = config(found.compensation);
    config.patient = patient;
    let mut mechanism = Mechanism::new(ROTOR, TILT);
    let mut controller = Controller::new(config.plan().expect("it may run"));
    let index = -(ROTOR / std::f64::consts::TAU * 4_000.0).round() as i32;
    controller.order(LargeOrder::Index(Some(Counts(index))));
    controller.order(Order::Start);
    mechanism.lead(way);
    let (mut counts, mut codes) = (Vec::new(), Vec::new());
    for _ in 0..seconds * 10_000 {
        controller.order(Order::Heartbeat);
        let count = mechanism.count() as i32;
        let tilt = Milliradians((TILT * 1e3).round() as i16);
        let output = controller.tick(TickInput { count: Counts(count), tilt });
        assert_eq!(output.tripped, None, "after {} ticks", counts.len());
        let share = if output.enable { (f64::from(output.dac.0) - 2_048.0) / 2_047.0 } else { 0.0 };
        mechanism.run(1e-4, share);
        counts.push(count);
        codes.push(output.dac.0);
    }
    (counts, codes)
}

#[test]
fn a_minute_at_rest_is_rest() {
    let skin = vec![(0.0, 0.0), (0.5, 0.001_5)];
    let cases = [
        ("let go", Patient::nobody(), None),
        ("held in the air", Patient::nobody(), Some(vec![(0.0, 0.0)])),
        ("led and then held in the air", Patient::nobody(), Some(vec![(0.0, 0.0), (0.5, 0.009)])),
        ("held in skin", Patient::default(), Some(skin)),
    ];
    for (what, patient, way) in cases {
        let (counts, codes) = at_rest(patient, way, 60);
        // After the gains have risen and the hand has come to rest.
        let (counts, codes) = (&counts[20_000..], &codes[20_000..]);
        let moves = counts.windows(2).filter(|pair| pair[0] != pair[1]).count();
        let span = codes.iter().max().expect("codes") - codes.iter().min().expect("codes");
        println!("| {what} | {moves} counts in 58 s, codes within {span} |");
        assert!(moves <= 1, "{what}: {moves} counts");
        assert!(span <= 8, "{what}: codes move by {span}");
    }
}

/// A shorter piece on the flash image, let go in the air after the hand has led the needle.
#[test]
fn on_the_board_it_rests_as_well() {
    let found = what_was_found();
    let mechanism = SharedMechanism::new(Mechanism::new(ROTOR, TILT));
    let mut board = board(mechanism.plant());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Zero);
    let mut config = config(found.compensation);
    config.patient = Patient::nobody();
    pc.configure(&mut board, &config);
    let index = -(ROTOR / std::f64::consts::TAU * 4_000.0).round() as i32;
    pc.must(&mut board, Command::Index(Some(index)));
    pc.must(&mut board, Command::Start);
    mechanism.with(|m| m.lead(Some(vec![(0.0, 0.0), (0.5, 0.009)])));
    pc.run_ms(&mut board, 1_000);
    mechanism.with(|m| m.lead(None));
    pc.run_ms(&mut board, 500);
    let from = pc.heard.samples.len();
    pc.run_ms(&mut board, 4_000);
    let counts: Vec<i32> = pc.heard.samples[from..].iter().map(|(_, sample)| sample.count).collect();
    let moves = counts.windows(2).filter(|pair| pair[0] != pair[1]).count();
    println!("| let go on the board | {moves} counts in 4 s |");
    assert!(counts.len() > 35_000 && moves <= 1, "{moves} counts in {} ticks", counts.len());
}
