//! The stiffness that a device bears: walls as stiff are quiet on it after a knock, and on those
//! that bear less stiffer ones ring.

use control_core::config::{
    Config, Device, FrictionLaw, Law, Layer, Mechanism, Parabola, SPRING_BACK, Tissue, Wall,
};
use control_core::units::{
    Counts, Damping, FrictionPerMillimetre, Grams, JogCompliance, Millimetres, Milliradians, Newtons,
    Stiffness,
};
use control_core::{Controller, Order, Patient, TickInput};
use fixed::types::I16F16;
use std::collections::VecDeque;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn mechanism(dry_friction_n: f64, mass_g: f64, delay_us: u16) -> Mechanism {
    Mechanism { mass: Grams(q(mass_g)), dry_friction: Newtons(q(dry_friction_n)), delay_us }
}

/// A wall of `slope` N/mm on a device that is said to have `mechanism`, without the passivity
/// observer.
fn wall(slope: f64, mechanism: Mechanism) -> Config {
    let parabola = |vertex: f64, compliance: f64, base: f64| Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons(q(base)),
    };
    // (T + 5)²/a − 25/a, 10/a at contact.
    let compliance = 10.0 / slope;
    let layer = Layer {
        tissue: Tissue::Other,
        depth: Millimetres(q(0.0)),
        wall: Some(Wall {
            elastic: parabola(-5.0, compliance, -25.0 / q(compliance).to_num::<f64>()),
            puncture_travel: Millimetres(q(0.3)),
            relief: parabola(1.0, 20.0, 0.0),
            unload: Stiffness(q(0.5)),
            spring_back: SPRING_BACK,
        }),
        friction: FrictionPerMillimetre(q(0.0)),
    };
    let law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(0.05)) });
    let patient = Patient { law, layers: [layer].into_iter().collect(), ..Patient::default() };
    let mut device =
        Device { mechanism, passivity_damping: Damping::default(), ..Device::commissioned_virtual() };
    device.limits.stiffness = Stiffness(q(1.1 * slope));
    device.limits.max_counts_per_tick = 200;
    Config { device, patient }
}

/// A needle of this mechanism that a hand leans on the wall with 0.15 N and that is knocked by 42
/// mm/s: its deviation in the last fifth of a second, in µm; `None` where the device took it for a
/// fault.
fn deviation(config: &Config, needle: &Mechanism) -> Option<f64> {
    const STEP_US: usize = 10;
    let plan = config.plan().unwrap_or_else(|why| panic!("{why}"));
    let count_m = plan.mm_per_count().to_num::<f64>() / 1000.0;
    let zero = f64::from(plan.zero_torque_code().0);
    let (mass, dry) = (needle.mass.0.to_num::<f64>() / 1000.0, needle.dry_friction.0.to_num::<f64>());
    let mut c = Controller::new(plan);
    c.order(Order::Start);
    let mut late: VecDeque<f64> = vec![0.0; usize::from(needle.delay_us) / STEP_US].into();
    let (mut position, mut speed, mut track) = (0.0_f64, 0.0_f64, Vec::new());
    for tick in 0..14_000 {
        c.order(Order::Heartbeat);
        let count = Counts((position / count_m).floor() as i32);
        let output = c.tick(TickInput { count, tilt: Milliradians(1_571) });
        if output.tripped.is_some() {
            return None;
        }
        // Torque has faded in when the hand begins to lean.
        let leans_n = 0.15 * ((f64::from(tick) - 4_000.0) / 4_000.0).clamp(0.0, 1.0);
        if tick == 9_000 {
            speed += 0.042;
        }
        // 28.8 mN·m over 2,047 steps at 10 mm.
        let resisting = (zero - f64::from(output.dac.0)) * 28.8 / 2047.0 / 10.0;
        for _ in 0..100 / STEP_US {
            late.push_back(resisting);
            let free = leans_n - late.pop_front().unwrap_or_default();
            let pushed = speed + free / mass * 1e-5;
            let stops = dry / mass * 1e-5;
            speed = if pushed.abs() <= stops { 0.0 } else { pushed - stops.copysign(pushed) };
            position += speed * 1e-5;
        }
        track.push(position * 1e6);
    }
    let tail = &track[12_000..];
    let mean = tail.iter().sum::<f64>() / tail.len() as f64;
    Some((tail.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / tail.len() as f64).sqrt())
}

/// The stiffest that a plan takes, N/mm.
fn stiffest(mechanism: Mechanism) -> f64 {
    let slopes = (5..=63).map(|step| f64::from(step) * 0.1);
    let taken = slopes.take_while(|&slope| wall(slope, mechanism).plan().is_ok());
    taken.last().expect("half a newton a millimetre at least")
}

#[test]
fn a_wall_as_stiff_as_the_mechanism_bears_is_quiet() {
    for mechanism in [
        mechanism(0.06, 30.0, 100),
        mechanism(0.02, 30.0, 100),
        mechanism(0.03, 30.0, 300),
        mechanism(0.06, 120.0, 200),
        mechanism(0.06, 3.0, 300),
    ] {
        let slope = stiffest(mechanism);
        let deviation = deviation(&wall(slope, mechanism), &mechanism);
        println!("{mechanism:?}: {slope:.1} N/mm, {deviation:?} µm");
        assert!(deviation.is_some_and(|deviation| deviation < 8.0), "{mechanism:?}: {deviation:?} µm");
    }
}

#[test]
fn one_that_is_stiffer_by_three_times_rings() {
    let said = mechanism(0.06, 30.0, 100);
    for is in [mechanism(0.01, 30.0, 100), mechanism(0.02, 30.0, 300)] {
        let slope = 3.0 * stiffest(is);
        let deviation = deviation(&wall(slope, said), &is);
        println!("{is:?}: {slope:.1} N/mm, {deviation:?} µm");
        assert!(deviation.is_none_or(|deviation| deviation > 15.0), "{is:?}: {deviation:?} µm");
    }
}
