//! The plant against mechanics on paper: energy, terminal speed, slip above the grip, weight,
//! sameness.

use device_sim::device::device_config::DeviceConfig;
use device_sim::plant::bearing::Bearing;
use device_sim::plant::hand::Grip;
use device_sim::plant::motor::Motor;
use device_sim::plant::{GRAVITY, Plant, PlantConfig};
use std::path::Path;

const NO_HAND: Grip = Grip { stiffness_n_per_m: 0.0, damping_n_s_per_m: 0.0, tremor_rms_m: 0.0, seed: 0 };
const FREE: Bearing = Bearing { viscous: 0.0, coulomb: 0.0, breakaway: 0.0 };

fn config() -> PlantConfig {
    PlantConfig::new(0.010, 4000, 0.0288)
}

#[test]
fn without_friction_energy_is_kept_and_with_it_never_gained() {
    let spring = Grip { stiffness_n_per_m: 1000.0, ..NO_HAND };
    let frictionless = PlantConfig { bearing: FREE, coat_damping: 0.0, ..config() };
    let total = |plant: &Plant| plant.energy() + 0.5 * 1000.0 * (0.002 - plant.tip()).powi(2);
    let mut plant = Plant::new(frictionless, spring, 0.0);
    let begin = total(&plant);
    for tick in 0..100_000 {
        plant.tick(0.0, false, Some((0.002, 0.0)));
        let now = total(&plant);
        assert!((now / begin - 1.0).abs() < 0.02, "tick {tick}: {now} J of {begin} J");
    }

    let mut plant = Plant::new(config(), spring, 0.0);
    let mut before = total(&plant);
    for tick in 0..20_000 {
        plant.tick(0.0, false, Some((0.002, 0.0)));
        let now = total(&plant);
        // Symplectic steps let the stored energy ripple by the step times the fastest pole; it may
        // not grow.
        assert!(now <= before + 2e-3 * begin, "tick {tick}: {now} J after {before} J");
        before = now.min(before);
    }
    assert_eq!(plant.speed(), 0.0, "dry friction brings it to rest");
}

#[test]
fn a_free_roller_settles_where_friction_balances_the_torque() {
    let light = PlantConfig { needle_mass: 1e-3, ..config() };
    let mut plant = Plant::new(light, NO_HAND, 0.0);
    let share = 0.02;
    for _ in 0..300_000 {
        plant.tick(share, true, None);
    }
    let expected = (share * 0.0288 - 4.0e-4) / 1.2e-6;
    assert!((plant.speed() / expected - 1.0).abs() < 1e-3, "{} rad/s, on paper {expected}", plant.speed());
}

/// Paper 001: 24 V, 0.6 A, 28.8 mN·m. The hand holds the needle, and the amplifier gives all that
/// it has.
#[test]
fn the_papers_motor_takes_its_current_for_its_torque() {
    let part = DeviceConfig::read(Path::new("paper-001")).expect("it comes with the program");
    let winding = part.winding.expect("it has one");
    let held = |motor: Motor| {
        let grip = Grip { stiffness_n_per_m: 4_000.0, damping_n_s_per_m: 20.0, ..NO_HAND };
        let mut plant = Plant::new(PlantConfig { motor, ..config() }, grip, 0.0);
        for _ in 0..5_000 {
            plant.tick(1.0, true, Some((0.0, 0.0)));
        }
        (plant.current(), plant.torque() * 1e3, plant.hand_force())
    };
    let (current, torque, force) = held(winding.motor(0.0288));
    assert!((current - 0.6).abs() < 1e-3 && (torque - 28.8).abs() < 0.02, "{current} A, {torque} mN·m");
    // 28.8 mN·m on a roller of 10 mm; the bearing's friction holds the rest.
    assert!((force + 2.88).abs() < 0.1, "{force} N");
    let (current, torque, _) = held(config().motor);
    assert!((current - 1.231).abs() < 2e-3 && (torque - 28.8).abs() < 0.02, "{current} A, {torque} mN·m");
}

#[test]
fn the_needle_slips_above_the_grip_and_not_below_it() {
    let grip = Grip { stiffness_n_per_m: 1000.0, damping_n_s_per_m: 10.0, ..NO_HAND };
    // The motor holds the roller against the hand, as a wall would.
    let pull = |grip_force: f64, hand_mm: f64| {
        let mut plant = Plant::new(PlantConfig { grip_force, ..config() }, grip, 0.0);
        for _ in 0..20_000 {
            // A stiff position loop acts as the wall.
            let set = (-f64::from(plant.count()) * 0.05 - plant.speed() * 0.02).clamp(-1.0, 1.0);
            plant.tick(set, true, Some((hand_mm * 1e-3, 0.0)));
        }
        let roller = f64::from(plant.count()) * std::f64::consts::TAU * 0.010 / 4000.0;
        (plant.tip() - roller, plant.hand_force())
    };
    let (slip, force) = pull(4.0, 2.0);
    assert!(slip < 1e-4 && force > 1.5, "held: {slip} m at {force} N");
    let (slip, force) = pull(1.0, 2.0);
    assert!((force - 1.0).abs() < 0.02, "it slips at the grip's 1 N, not at {force} N");
    // The hand is 2 mm ahead, and its grip is stretched by 1 mm. The position loop that acts as the
    // wall yields a tenth of the other millimetre.
    assert!((0.8e-3..1e-3).contains(&slip), "the hand's other millimetre is slip: {slip} m");
}

#[test]
fn weight_helps_by_the_sine_of_the_tilt() {
    let bare = PlantConfig { bearing: FREE, ..config() };
    for tilt in [0.0_f64, 0.3, -0.7, 1.2] {
        let mut plant = Plant::new(bare, NO_HAND, 0.0);
        plant.set_tilt(tilt);
        for _ in 0..1_000 {
            plant.tick(0.0, false, None);
        }
        let moving = bare.needle_mass + bare.inertia / bare.roller_radius.powi(2);
        let expected = bare.needle_mass * GRAVITY * tilt.sin() / moving * 0.1;
        assert!(
            (plant.tip_speed() - expected).abs() < 2e-3,
            "{} m/s, on paper {expected}",
            plant.tip_speed()
        );
    }
}

#[test]
fn dry_friction_holds_a_needle_that_weighs_less() {
    let mut plant = Plant::new(config(), NO_HAND, 0.0);
    plant.set_tilt(0.4);
    for _ in 0..20_000 {
        plant.tick(0.0, false, None);
    }
    // 0.038 N of weight hang on 0.048 N of breakaway: only the coat gives.
    assert_eq!(plant.speed(), 0.0);
    assert!(plant.tip() < 1e-5, "{} m", plant.tip());
}

#[test]
fn the_same_inputs_give_the_same_bits() {
    let run = || {
        let grip = Grip { stiffness_n_per_m: 800.0, damping_n_s_per_m: 5.0, tremor_rms_m: 5e-5, seed: 3 };
        let mut plant = Plant::new(config(), grip, -0.005);
        for tick in 0..50_000 {
            let time = f64::from(tick) * 1e-4;
            plant.tick((time * 7.0).sin() * 0.1, tick > 100, Some((0.01 * time, 0.01)));
        }
        (plant.tip().to_bits(), plant.speed().to_bits(), plant.hand_force().to_bits(), plant.count())
    };
    assert_eq!(run(), run());
}
