//! The protections against sustained overload, on the board: the heat of the winding and the energy
//! of a stiff wall. Either takes torque back and says so as a limit in force; neither is a fault.

use std::sync::{Arc, Mutex};

use control_core::Config;
use control_core::config::{FrictionLaw, Law, Layer, Parabola, SPRING_BACK, Tissue, Wall};
use control_core::event::{Fault, Limits};
use control_core::units::{
    Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillinewtonMetres, Newtons, Stiffness,
};
use emulator::board::{Board, Drive, MILLISECOND, Nanos, plant};
use fixed::types::I16F16;
use link::Command;
use link::frames::EventKind;
use tests::pc::Pc;
use tests::rig::ZERO_TORQUE;
use tests::scenario::board;

const SECOND: Nanos = 1_000 * MILLISECOND;
/// Steps of the 12-bit converter from zero to full torque.
const SPAN: f64 = 2_047.0;
/// A count of the default device along the needle.
const MM_PER_COUNT: f64 = 0.015_708;
const CONTINUOUS_MNM: f64 = 28.8;
const TICKS_PER_S: f64 = 10_000.0;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

/// One wall of 5.6 N/mm at contact that does not give way within reach.
fn stiff_wall() -> Config {
    let parabola = |vertex: f64, compliance: f64, base: f64| Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons(q(base)),
    };
    let layer = Layer {
        tissue: Tissue::Other,
        depth: Millimetres(q(0.0)),
        wall: Some(Wall {
            elastic: parabola(-5.0, 1.8, -25.0 / 1.8),
            puncture_travel: Millimetres(q(0.4)),
            relief: parabola(1.0, 1.0, 0.0),
            unload: Stiffness(q(1.0)),
            spring_back: SPRING_BACK,
        }),
        friction: FrictionPerMillimetre(q(0.0)),
    };
    let mut config = Config::commissioned_virtual();
    config.patient.law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(0.05)) });
    config.patient.layers = [layer].into_iter().collect();
    config.device.limits.stiffness = Stiffness(q(7.0));
    config
}

/// Returns the time at which a limit was first reported; a fault ends the test.
fn first_told(pc: &Pc, limit: Limits) -> Option<u64> {
    let fault = pc.heard.events.iter().find(|event| matches!(event.kind, EventKind::Fault { .. }));
    assert_eq!(fault, None, "a limit in force is no fault");
    told(pc, limit)
}

/// The tick in which a limit was first reported.
fn told(pc: &Pc, limit: Limits) -> Option<u64> {
    let tells = |kind: EventKind| matches!(kind, EventKind::Limits { in_force } if in_force.contains(limit));
    pc.heard.events.iter().find(|event| tells(event.kind)).map(|event| event.tick)
}

/// Torque of every tick from the start on, in mN·m, and true if the thermal limit was reported.
fn hold_strong(continuous_mnm: f64) -> (Vec<f64>, bool) {
    const FULL_SCALE_MNM: f64 = 60.0;
    let mut config = stiff_wall();
    config.device.full_scale_torque = MillinewtonMetres(q(FULL_SCALE_MNM));
    config.device.limits.torque = MillinewtonMetres(q(FULL_SCALE_MNM));
    config.device.limits.continuous_torque = MillinewtonMetres(q(continuous_mnm));
    config.device.limits.winding_time_s = 2;
    if let Some(wall) = &mut config.patient.layers[0].wall {
        // More than it is pressed in, wherever in its tremor the hand says that depth 0 is.
        wall.puncture_travel = Millimetres(q(0.85));
    }
    // 0.7 mm into 6 N/mm: 4.3 N, 43 mN·m.
    let deep = (0.7 / MM_PER_COUNT) as i64;
    let hand = plant::path(vec![(SECOND, 0), (SECOND + 300 * MILLISECOND, deep)]);
    let mut board = board(plant::by_hand(hand));
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.configure(&mut board, &config);
    pc.must(&mut board, Command::Start);
    board.at_stop(|stopped| stopped.log().written.clear());
    pc.run_ms(&mut board, 9_000);
    assert!(board.at_stop(|stopped| stopped.drive().enabled), "torque stays on");
    let written = board.at_stop(|stopped| std::mem::take(&mut stopped.log().written));
    let torque = |code: u16| (f64::from(ZERO_TORQUE) - f64::from(code)) * FULL_SCALE_MNM / SPAN;
    let torques = written.iter().map(|output| torque(output.code)).collect();
    (torques, first_told(&pc, Limits::THERMAL).is_some())
}

/// The winding by itself, in floating point: the root of the largest mean square over its time
/// constant of 2 s.
fn hottest(torques: &[f64]) -> f64 {
    let (mut heat, mut hottest) = (0.0, 0.0_f64);
    for torque in torques {
        heat += (torque * torque - heat) / (2.0 * TICKS_PER_S);
        hottest = hottest.max(heat);
    }
    hottest.sqrt()
}

/// Takes more than 5 s: four time constants of the winding, with the limit and without.
#[test]
fn torque_falls_before_the_continuous_limit_is_exceeded() {
    let (torques, told) = hold_strong(CONTINUOUS_MNM);
    let (peak, last) = (torques.iter().fold(0.0_f64, |a, b| a.max(*b)), torques[torques.len() - 1]);
    println!(
        "| sustained torque | peak {peak:.1}, in the end {last:.1}, over the time constant {:.2} mN·m |",
        hottest(&torques)
    );
    assert!(peak > 1.4 * CONTINUOUS_MNM, "more than the continuous torque is there for a while");
    assert!(hottest(&torques) <= 1.001 * CONTINUOUS_MNM, "{} mN·m", hottest(&torques));
    assert!((last - CONTINUOUS_MNM).abs() < 0.5, "{last} mN·m in the end");
    assert!(told, "the limit is told");

    let (torques, told) = hold_strong(60.0);
    println!("| sustained torque without the limit | {:.2} mN·m |", hottest(&torques));
    assert!(hottest(&torques) > 1.3 * CONTINUOUS_MNM && !told, "without the limit it gets too hot");
}

/// 30 g of needle and roller under a light hand, which leans on the wall over a second with 0.4 N
/// and is knocked once.
struct Needle {
    at: Nanos,
    leans_from: Nanos,
    position_m: f64,
    speed_m_per_s: f64,
    /// The needle's position at every step with torque on, in µm.
    track: Arc<Mutex<Vec<f64>>>,
}

impl Needle {
    const STEP: Nanos = 10_000;
    const KNOCKED_AFTER: Nanos = 2 * SECOND;

    fn advance(&mut self, pushed_n: f64) {
        let (mass_kg, spring, hand_damping, damping, dt) = (0.030, 100.0, 0.02, 0.02, 1e-5);
        let leaning = (self.at.saturating_sub(self.leans_from) as f64 / SECOND as f64).min(1.0);
        let hand_n = spring * (0.004 * leaning - self.position_m) - hand_damping * self.speed_m_per_s;
        self.speed_m_per_s += (hand_n - damping * self.speed_m_per_s + pushed_n) / mass_kg * dt;
        if self.at == self.leans_from + Self::KNOCKED_AFTER {
            self.speed_m_per_s += 0.03;
        }
        self.position_m += self.speed_m_per_s * dt;
        self.at += Self::STEP;
    }

    fn step(&mut self, at: Nanos, drive: Drive) -> i64 {
        let code = drive.code.filter(|_| drive.enabled).unwrap_or(ZERO_TORQUE);
        // Torque in the insertion direction over 10 mm of roller.
        let pushed_n = (f64::from(code) - f64::from(ZERO_TORQUE)) * CONTINUOUS_MNM / SPAN / 10.0;
        while self.at < at {
            self.advance(pushed_n);
            if drive.enabled {
                self.track.lock().expect("nobody panicked").push(self.position_m * 1e6);
            }
        }
        (self.position_m * 1e3 / MM_PER_COUNT).floor() as i64
    }
}

/// A wall under a hand that leans on it.
struct Ringing {
    /// Deviation of the needle at the end, in µm: in the last half second, or in 50 ms before a
    /// fault.
    deviation: f64,
    /// The time at which the observer was reported to be active.
    told: Option<u64>,
    fault: Option<Fault>,
}

fn ringing(config: Config) -> Ringing {
    let track = Arc::new(Mutex::new(Vec::new()));
    let mut board: Board = board(plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.configure(&mut board, &config);
    pc.must(&mut board, Command::Start);
    let now = board.now();
    let leans_from = now.next_multiple_of(Needle::STEP);
    let mut needle =
        Needle { at: leans_from, leans_from, position_m: 0.0, speed_m_per_s: 0.0, track: track.clone() };
    board.at_stop(|stopped| {
        stopped.set_plant(Box::new(move |at: Nanos, drive: Drive| needle.step(at, drive)));
    });
    pc.run_ms(&mut board, 3_000);
    let track = track.lock().expect("nobody panicked");
    let fault = pc.heard.events.iter().find_map(|event| match event.kind {
        EventKind::Fault { cause } => Some(cause),
        _ => None,
    });
    let steps = if fault.is_some() { 5_000 } else { 50_000 };
    let tail = &track[track.len().checked_sub(steps).expect("torque was on")..];
    let mean = tail.iter().sum::<f64>() / tail.len() as f64;
    let variance = tail.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / tail.len() as f64;
    Ringing { deviation: variance.sqrt(), told: told(&pc, Limits::PASSIVITY), fault }
}

#[test]
fn a_stiff_wall_rings_without_the_observer_and_is_quiet_with_it() {
    let quiet = ringing(stiff_wall());
    let mut unobserved = stiff_wall();
    unobserved.device.passivity_damping = Damping::default();
    let loud = ringing(unobserved);
    println!("| ringing wall | {:.1} µm, with the observer {:.1} µm |", loud.deviation, quiet.deviation);
    // What rings like this may be taken for a motor that drives the wrong way; for a dead channel
    // it may not.
    assert!(matches!(loud.fault, None | Some(Fault::WrongWay)), "{:?}", loud.fault);
    assert!(loud.deviation > 50.0, "it should ring without the observer: {} µm", loud.deviation);
    assert_eq!(quiet.fault, None, "a limit in force is no fault");
    assert!(quiet.deviation < 8.0, "it should be quiet: {} µm, one count is 15.7 µm", quiet.deviation);
    assert!(quiet.told.is_some() && loud.told.is_none(), "the observer is a limit in force");
}
