//! The protections that only show over time: the winding's heat and the energy of a stiff wall.
//! Each is also seen to matter: without it the bound that it holds is broken.

use control_core::config::{Config, FrictionLaw, Law, Layer, Parabola, SPRING_BACK, Tissue, Wall};
use control_core::event::Limits;
use control_core::excitation::Segments;
use control_core::units::{
    Counts, Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillinewtonMetres, Milliradians,
    Newtons, Stiffness,
};
use control_core::{Controller, Order, Patient, TickInput, TickOutput};
use fixed::types::I16F16;

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn parabola(vertex: f64, compliance: f64, base: f64) -> Parabola {
    Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons(q(base)),
    }
}

fn layer(depth_mm: f64, wall: Wall, friction_n_per_mm: f64) -> Layer {
    Layer {
        tissue: Tissue::Other,
        depth: Millimetres(q(depth_mm)),
        wall: Some(wall),
        friction: FrictionPerMillimetre(q(friction_n_per_mm)),
    }
}

/// Walls, and friction that holds with `hold` N/mm, on a device that takes the stiffest.
fn tissue(layers: &[Layer], hold: f64) -> Config {
    let friction = FrictionLaw::Cone { stiffness: Stiffness(q(hold)) };
    let layers = layers.iter().copied().collect();
    let patient = Patient { law: Law::Jog(friction), layers, ..Patient::default() };
    let mut config = Config { patient, ..Config::commissioned_virtual() };
    config.device.limits.stiffness = Stiffness(q(7.0));
    // What rings is faster than a hand: the protection against that is not the one that is looked
    // at here.
    config.device.limits.max_counts_per_tick = 200;
    config
}

/// One that does not give way within reach.
fn stiff() -> Wall {
    Wall {
        // (T + 5)²/1.8 − 13.9: 5.6 N/mm at contact, and hardly more where the test presses.
        elastic: parabola(-5.0, 1.8, -25.0 / 1.8),
        puncture_travel: Millimetres(q(0.35)),
        relief: parabola(1.0, 1.0, 0.0),
        unload: Stiffness(q(1.0)),
        spring_back: SPRING_BACK,
    }
}

/// One stiff wall that does not give way within reach.
fn stiff_wall() -> Config {
    tissue(&[layer(0.0, stiff(), 0.0)], 0.05)
}

/// The same at the end of 30 mm of tissue behind a skin that gives way: 0.3 N of friction.
fn stiff_wall_in_tissue() -> Config {
    let skin = Wall {
        elastic: parabola(0.0, 2.0, 0.0),
        puncture_travel: Millimetres(q(1.0)),
        relief: parabola(2.0, 4.0, 0.05),
        unload: Stiffness(q(0.5)),
        spring_back: SPRING_BACK,
    };
    tissue(&[layer(0.0, skin, 0.01), layer(30.0, stiff(), 0.0)], 0.5)
}

/// 30 g of needle and roller under a light hand, stepped at 10 µs.
struct Needle {
    position_m: f64,
    speed_m_per_s: f64,
}

impl Needle {
    fn step(&mut self, aim: f64, resisting_n: f64) {
        let (mass, spring, hand_damping, damping, dt) = (0.030, 100.0, 0.02, 0.02, 1e-5);
        for _ in 0..10 {
            let hand = spring * (aim - self.position_m) - hand_damping * self.speed_m_per_s;
            self.speed_m_per_s += (hand - damping * self.speed_m_per_s - resisting_n) / mass * dt;
            self.position_m += self.speed_m_per_s * dt;
        }
    }
}

/// A needle against a wall at `wall_mm`, brought there at 20 mm/s, on which a hand leans over a
/// second against `friction_n` and which is knocked after two: its deviation in the last half
/// second of three, in µm, and how often the observer was in force.
fn ringing(config: &Config, wall_mm: f64, friction_n: f64) -> (f64, usize) {
    let plan = config.plan().expect("a sound wall");
    let per_count_m = plan.mm_per_count().to_num::<f64>() / 1000.0;
    let zero = f64::from(plan.zero_torque_code().0);
    let mut c = Controller::new(plan);
    c.order(Order::Start);
    let mut needle = Needle { position_m: 0.0, speed_m_per_s: 0.0 };
    let (mut track, mut in_force) = (Vec::new(), 0);
    let brought = (wall_mm * 500.0) as i32;
    for tick in -brought..30_000 {
        c.order(Order::Heartbeat);
        // 0.4 N more than friction: 60 µm into the wall.
        let hand_n = friction_n + 0.4 * (f64::from(tick) / 10_000.0).min(1.0);
        if tick == 20_000 {
            needle.speed_m_per_s += 0.03;
        }
        let count = Counts((needle.position_m / per_count_m).floor() as i32);
        let output = c.tick(TickInput { count, tilt: STRAIGHT });
        if tick < 0 {
            needle.position_m = wall_mm / 1e3 + f64::from(tick) * 2e-6;
            continue;
        }
        in_force += usize::from(output.limits.contains(Limits::PASSIVITY));
        if output.tripped.is_some() {
            // What rings like this is taken for a motor that runs away.
            break;
        }
        // 28.8 mN·m over 2,047 steps at 10 mm.
        let aim = wall_mm / 1e3 + hand_n / 100.0;
        needle.step(aim, (zero - f64::from(output.dac.0)) * 28.8 / 2047.0 / 10.0);
        track.push(needle.position_m * 1e6);
    }
    let tail = track.get(25_000..).unwrap_or(&track[track.len().saturating_sub(500)..]);
    let mean = tail.iter().sum::<f64>() / tail.len() as f64;
    ((tail.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / tail.len() as f64).sqrt(), in_force)
}

fn without_observer(config: &Config) -> Config {
    let mut without = config.clone();
    without.device.passivity_damping = Damping::default();
    without
}

#[test]
fn a_stiff_wall_rings_without_the_observer_and_is_quiet_with_it() {
    // Friction takes energy all the way to the wall in tissue: no credit of the wall's.
    for (with, wall_mm, friction_n) in [(stiff_wall(), 0.0, 0.0), (stiff_wall_in_tissue(), 30.0, 0.3)] {
        let (quiet, in_force) = ringing(&with, wall_mm, friction_n);
        let (loud, never) = ringing(&without_observer(&with), wall_mm, friction_n);
        println!(
            "at {wall_mm} mm: deviation without the observer {loud:.1} µm, with it {quiet:.1} µm; in force for {in_force} ticks"
        );
        assert!(loud > 50.0, "at {wall_mm} mm it should ring without the observer: {loud} µm");
        assert!(quiet < 8.0, "at {wall_mm} mm it should be quiet with it: {quiet} µm, one count is 15.7 µm");
        assert!(in_force > 0 && never == 0);
    }
}

/// A strong wall, and the count 0.7 mm into its 6 N/mm: about 5 N, 50 mN·m.
fn strong(continuous_mnm: f64) -> (Config, i32) {
    let mut config = stiff_wall();
    config.device.full_scale_torque = MillinewtonMetres(q(60.0));
    config.device.limits.torque = MillinewtonMetres(q(60.0));
    config.device.limits.continuous_torque = MillinewtonMetres(q(continuous_mnm));
    config.device.limits.winding_time_s = 2;
    if let Some(wall) = &mut config.patient.layers[0].wall {
        wall.puncture_travel = Millimetres(q(0.75));
    }
    let count = (0.7 / config.plan().expect("sound").mm_per_count().to_num::<f64>()) as i32;
    (config, count)
}

/// Holds a strong wall for `seconds`; every tick's torque in mN·m and limits go to `see`.
fn hold_strong(continuous_mnm: f64, seconds: usize, mut see: impl FnMut(f64, &TickOutput)) {
    let (config, count) = strong(continuous_mnm);
    let (plan, count) = (config.plan().expect("sound"), Counts(count));
    let zero = f64::from(plan.zero_torque_code().0);
    let mut c = Controller::new(plan);
    c.tick(TickInput { count, tilt: STRAIGHT });
    c.order(Order::Start);
    for tick in 0..seconds * 10_000 {
        c.order(Order::Heartbeat);
        // A hand has a tremor: without it the encoder would pass for dead.
        let count = Counts(count.0 + [0, 1, 2, 1][tick / 250 % 4]);
        let output = c.tick(TickInput { count, tilt: STRAIGHT });
        see((zero - f64::from(output.dac.0)) * 60.0 / 2047.0, &output);
    }
}

/// Nobody knows how warm a motor is whose device has just been given power. The torque after a rest
/// of that long, of a wall that asks for some 45 mN·m.
#[test]
fn an_unknown_heat_allows_the_continuous_torque_until_cooled() {
    for (rest_s, is_held) in [(0.0, true), (1.4, true), (2.6, false)] {
        let (config, count) = strong(28.8);
        let plan = config.plan().expect("sound");
        let zero = f64::from(plan.zero_torque_code().0);
        let mut c = Controller::with(Segments::new(), plan, None);
        let mut most = 0.0_f64;
        for tick in 0..((rest_s + 0.5) * 1e4) as i32 {
            c.order(Order::Heartbeat);
            if tick == (rest_s * 1e4) as i32 {
                c.order(Order::Start);
            }
            let count = Counts(count + [0, 1, 2, 1][tick as usize / 250 % 4]);
            let output = c.tick(TickInput { count, tilt: STRAIGHT });
            most = most.max((zero - f64::from(output.dac.0)) * 60.0 / 2047.0);
        }
        let as_held = (28.7..28.9).contains(&most);
        assert!(as_held == is_held && most > 28.7, "{most} mN·m after {rest_s} s of 2 s");
    }
}

#[test]
fn torque_falls_before_the_winding_reaches_its_limit() {
    // The winding by itself, in floating point: the mean square over its time constant.
    let (mut heat, mut hottest, mut last, mut told, mut faults) = (0.0, 0.0_f64, 0.0, false, 0);
    hold_strong(28.8, 20, |torque, output| {
        heat += (torque * torque - heat) / 20_000.0;
        hottest = hottest.max(heat);
        last = torque;
        told |= output.limits.contains(Limits::THERMAL);
        faults += usize::from(output.tripped.is_some());
    });
    assert!(hottest.sqrt() <= 28.8 * 1.001, "{} mN·m over the time constant", hottest.sqrt());
    assert!((last - 28.8).abs() < 0.5, "{last} mN·m in the end");
    assert!(told && faults == 0, "it is a limit in force, not a fault");

    let (mut heat, mut told) = (0.0, false);
    hold_strong(60.0, 20, |torque, output| {
        heat += (torque * torque - heat) / 20_000.0;
        told |= output.limits.contains(Limits::THERMAL);
    });
    assert!(heat.sqrt() > 40.0 && !told, "without the limit the winding reaches {}", heat.sqrt());
}
