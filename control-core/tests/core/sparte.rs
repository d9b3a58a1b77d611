//! The law of Paper 002 against its floating-point twin, and what a hand would notice of it.

mod twin;

use crate::needle::{Needle, force};
use control_core::config::{
    Cutting, Fixture, FrictionLaw, Law, Layer, Lugre, Parabola, SPRING_BACK, Sparte, SpeedMethod, Tissue,
    Wall,
};
use control_core::event::State;
use control_core::plan::Field;
use control_core::units::{
    Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillimetresPerSecond, MillinewtonMetres,
    Milliradians, Newtons, Stiffness,
};
use control_core::{Config, Refusal, TickOutput};
use fixed::types::{I8F24, I16F16};
use proptest::prelude::*;
use twin::Twin;

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn n(value: f64) -> Newtons {
    Newtons(q(value))
}

/// Gives way at `force` after `travel` mm, without a step at contact.
fn wall(force: f64, travel: f64) -> Option<Wall> {
    let parabola = |vertex: f64, compliance: f64| Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons::default(),
    };
    Some(Wall {
        elastic: parabola(0.0, travel * travel / force),
        puncture_travel: Millimetres(q(travel)),
        relief: parabola(travel + 0.5, 1_000.0),
        unload: Stiffness(q(0.05)),
        spring_back: SPRING_BACK,
    })
}

fn layer(tissue: Tissue, depth: f64, wall: Option<Wall>) -> Layer {
    Layer { tissue, depth: Millimetres(q(depth)), wall, friction: FrictionPerMillimetre::default() }
}

/// A shoulder: the cutting forces of the paper's section IV, at a scale that the motor bears.
pub(crate) fn shoulder() -> Config {
    use Tissue::{Bursa, Cartilage, Fat, Muscle, Skin, Tendon};
    let mut config = Config::commissioned_virtual();
    config.device.speed = SpeedMethod::EdgeTiming;
    config.patient.layers = [
        layer(Skin, 0.0, wall(1.2, 3.0)),
        layer(Fat, 2.0, None),
        layer(Muscle, 8.0, None),
        layer(Bursa, 20.0, wall(2.4, 3.0)),
        layer(Tendon, 26.0, None),
        layer(Cartilage, 32.0, None),
    ]
    .into_iter()
    .collect();
    let cutting = [0.8, 1.5, 2.0, 2.5, 3.0, 4.0];
    config.patient.law = Law::Sparte(Sparte {
        tracking: Stiffness(q(1.0)),
        relax_ms: 300,
        after_puncture: q(0.6),
        cutting: cutting
            .iter()
            .map(|&force| Cutting { inwards: n(force), outwards: n(force * 0.3) })
            .collect(),
        friction: Lugre {
            stiffness: Stiffness(q(1.5)),
            damping: Damping(I8F24::from_num(0.000_1)),
            viscous: Damping(I8F24::from_num(0.001)),
            sliding: n(0.3),
            sticking: n(0.35),
            speed: MillimetresPerSecond(q(2.0)),
        },
        fixture: Fixture { per_mrad: n(0.01), largest: Milliradians(200) },
        wall_rate: I16F16::ZERO,
    });
    config.patient.scale = q(0.6);
    config.device.limits.stiffness = Stiffness(q(2.5));
    config
}

fn sparte(config: &mut Config) -> &mut Sparte {
    match &mut config.patient.law {
        Law::Sparte(sparte) => sparte,
        other => panic!("{other:?}"),
    }
}

#[test]
fn every_layer_is_cut_at_the_force_of_the_paper() {
    let mut needle = Needle::new(&shoulder(), STRAIGHT);
    let sliding = 0.3 + 0.001 * 10.0;
    // Deep enough in each layer for the tracking wall to be full, and where no wall is pushed in.
    for (mm, cutting) in [(7.5, 1.5), (19.0, 2.0), (25.8, 2.5), (31.0, 3.0), (38.0, 4.0)] {
        needle.go(mm, 10.0, |_| ());
        let got = force(&needle.tick());
        assert!((got - cutting - sliding).abs() < 0.02, "{mm} mm: {got} N, not {cutting} + {sliding}");
    }
}

/// Force at 2 mm in skin of 1.2 N/(3 mm)², which is pushed in at a speed with λ, N.
fn pushed_in_at(mm_per_s: f64, rate: f64) -> f64 {
    let mut config = shoulder();
    sparte(&mut config).wall_rate = q(rate);
    let mut needle = Needle::new(&config, STRAIGHT);
    needle.go(2.0, mm_per_s, |_| ());
    force(&needle.tick())
}

/// Hunt and Crossley 1975: `F = f(T)·(1 + λv)`, here `1.2·(2/3)² = 0.533 N` times that.
#[test]
fn a_wall_that_is_pushed_in_resists_by_its_rate() {
    let slowly = 1.2 * (2.0_f64 / 3.0).powi(2);
    for mm_per_s in [1.0, 5.0, 20.0] {
        assert!((pushed_in_at(mm_per_s, 0.0) - slowly).abs() < 0.015, "no rate unless it is asked for");
        let (got, wanted) = (pushed_in_at(mm_per_s, 0.008), slowly * (1.0 + 0.008 * mm_per_s));
        assert!((got - wanted).abs() < 0.02, "{mm_per_s} mm/s: {got} N, not {wanted} N");
    }
    // It begins at no force, and a needle that stops feels what it feels without a rate.
    let mut config = shoulder();
    sparte(&mut config).wall_rate = q(0.008);
    let mut needle = Needle::new(&config, STRAIGHT);
    let (mut largest_step, mut before) = (0.0_f64, 0.0);
    needle.go(2.0, 20.0, |out| {
        largest_step = largest_step.max((force(out) - std::mem::replace(&mut before, force(out))).abs());
    });
    assert!(largest_step < 0.02, "a step of {largest_step} N");
    needle.rest(0.2);
    assert!((force(&needle.tick()) - slowly).abs() < 0.015, "at rest {} N", force(&needle.tick()));
}

#[test]
fn a_wall_gives_way_to_less_than_the_cutting_force() {
    let mut needle = Needle::new(&shoulder(), STRAIGHT);
    let (mut before, mut least, mut most) = (0.0, f64::MAX, 0.0_f64);
    let mut has_given_way = false;
    needle.go(4.0, 10.0, |out| {
        has_given_way |= out.transitions.puncture == 1;
        if has_given_way {
            least = least.min(force(out));
            most = most.max(force(out));
        } else {
            before = force(out);
        }
    });
    assert!((before - 1.2).abs() < 0.02, "{before} N before the skin gave way");
    // 0.6 of the fat's 1.5 N, for the tip is in it when the skin has sprung back; then cutting and
    // friction come up.
    assert!((0.88..0.98).contains(&least), "{least} N after it");
    assert!(most > 1.5, "{most} N while cutting");
}

#[test]
fn a_clamped_needle_relaxes_from_the_moment_it_stops() {
    for relax_ms in [100_u16, 300, 1_000] {
        let mut config = shoulder();
        sparte(&mut config).relax_ms = relax_ms;
        let mut needle = Needle::new(&config, STRAIGHT);
        needle.go(15.0, 3.0, |_| ());
        let forces: Vec<f64> = (0..80_000).map(|_| force(&needle.tick())).collect();
        let (first, last) = (forces[0], forces[forces.len() - 1]);
        let left = |now: &f64| *now - last <= (first - last) / std::f64::consts::E;
        let found_ms = forces.iter().position(left).expect("it relaxes") as f64 * 0.1;
        assert!((found_ms / f64::from(relax_ms) - 1.0).abs() < 0.05, "{found_ms} ms, not {relax_ms}");
    }
}

/// In muscle the wall is 2 mm behind the tip; on the way back that stretch goes off with each mm,
/// and friction rubs the other way.
#[test]
fn a_needle_that_turns_round_does_not_rest() {
    let mut needle = Needle::new(&shoulder(), STRAIGHT);
    needle.go(15.0, 4.0, |_| ());
    for mm in [14.5, 14.0, 13.0] {
        needle.go(mm, 4.0, |_| ());
        let (got, wanted) = (force(&needle.tick()), mm - 13.0 - 0.304);
        assert!((got - wanted).abs() < 0.1, "{mm} mm: {got} N, not {wanted} N");
    }
}

#[test]
fn a_trembling_hand_that_rests_reads_as_friction() {
    let mut needle = Needle::new(&shoulder(), STRAIGHT);
    needle.go(15.0, 10.0, |_| ());
    needle.rest(0.5);
    let at = needle.at_mm;
    for tick in 0..30_000 {
        needle.at_mm = at + 0.08 * (f64::from(tick) * 0.006_283).sin();
        let state = needle.tick().sample.state;
        assert_eq!(state, State::Friction as u8, "tick {tick}");
    }
}

#[test]
fn a_needle_that_stops_is_held_by_friction() {
    let mut needle = Needle::new(&shoulder(), STRAIGHT);
    needle.go(15.0, 10.0, |_| ());
    let moving = force(&needle.tick());
    let soon = force(&needle.rest(0.1));
    let late = force(&needle.rest(3.0));
    // Cutting 2.0 N relaxes to 0.3 N; the bristles keep their 0.3 N.
    assert!(moving > 2.25 && soon < moving - 0.2 && soon > 1.2, "{moving} N, then {soon} N");
    assert!((late - 0.6).abs() < 0.06, "{late} N after three seconds: not zero");
    assert!((force(&needle.rest(3.0)) - late).abs() < 0.001, "and it stays");
}

#[test]
fn on_the_way_out_forces_have_magnitudes_of_their_own() {
    let mut needle = Needle::new(&shoulder(), STRAIGHT);
    needle.go(15.0, 10.0, |_| ());
    let mut last = None;
    needle.go(10.0, 10.0, |out| last = Some(*out));
    let out = last.expect("it moved");
    // A third of the muscle's cutting, and friction.
    assert!((force(&out) + 2.0 * 0.3 + 0.31).abs() < 0.02, "{} N", force(&out));
    assert_eq!(out.sample.state, State::Withdrawal as u8);
}

#[test]
fn the_fixture_holds_the_direction_up_to_its_largest_angle() {
    let mut needle = Needle::new(&shoulder(), STRAIGHT);
    needle.go(10.0, 10.0, |_| ());
    assert_eq!(needle.tick().lateral, Newtons::default());
    let turned = |needle: &mut Needle, mrad: i16| {
        needle.tilt = Milliradians(1_571 - mrad);
        let (mut barriers, mut last) = (0, needle.tick());
        for _ in 0..10_000 {
            last = needle.tick();
            barriers += usize::from(last.transitions.barrier);
        }
        (last.lateral.0.to_num::<f64>(), barriers)
    };
    let (lateral, barriers) = turned(&mut needle, 100);
    assert!((lateral + 1.0).abs() < 0.02 && barriers == 0, "{lateral} N, {barriers} barriers");
    let (lateral, barriers) = turned(&mut needle, 250);
    assert!((lateral + 2.0).abs() < 0.02 && barriers == 1, "{lateral} N, {barriers} barriers");
    assert_eq!(turned(&mut needle, 190).1, 0, "not let go yet");
    assert_eq!((turned(&mut needle, 100).1, turned(&mut needle, 250).1), (0, 1), "reported again");
}

#[test]
fn more_than_the_motors_force_needs_a_declared_scale() {
    let mut config = shoulder();
    config.patient.scale = I16F16::ONE;
    let refused = config.plan().err();
    assert!(matches!(refused, Some(Refusal::TooStiff { .. } | Refusal::TooStrong { .. })), "{refused:?}");
    config.device.limits.stiffness = Stiffness(q(5.0));
    let refused = config.plan().err();
    assert!(
        matches!(refused, Some(Refusal::TooStrong { layer: 3, .. })),
        "2.5 N in the bursa and 0.4 N of friction: {refused:?}"
    );
    config.device.roller_radius = Millimetres(q(6.0));
    assert!(config.plan().is_ok(), "a smaller roller bears it");
    // What is given to the hand is the declared share of it.
    let config = shoulder();
    let mut needle = Needle::new(&config, STRAIGHT);
    needle.rest(0.5);
    needle.go(38.0, 10.0, |_| ());
    let out = needle.tick();
    let steps = f64::from(out.dac.0) - 2048.0;
    let given = -steps * 28.8 / 2047.0 / 10.0;
    assert!((given - 0.6 * force(&out)).abs() < 0.01, "{given} N of {} N", force(&out));
}

#[test]
fn each_value_has_a_range() {
    let field = |change: &dyn Fn(&mut Sparte)| {
        let mut config = shoulder();
        change(sparte(&mut config));
        match config.plan().err() {
            Some(Refusal::OutOfRange { field, .. } | Refusal::Count { field, .. }) => Some(field),
            None => None,
            Some(other) => panic!("{other:?}"),
        }
    };
    assert_eq!(field(&|_| ()), None);
    assert_eq!(field(&|s| s.tracking.0 = q(0.04)), Some(Field::TrackingStiffness));
    assert_eq!(field(&|s| s.relax_ms = 9), Some(Field::RelaxMs));
    assert_eq!(field(&|s| s.friction.stiffness.0 = q(0.04)), Some(Field::BristleStiffness));
    assert_eq!(field(&|s| s.friction.sticking = n(0.29)), Some(Field::StickingFriction));
    assert_eq!(field(&|s| s.friction.sliding = n(0.009)), Some(Field::SlidingFriction));
    assert_eq!(field(&|s| s.friction.speed.0 = q(0.09)), Some(Field::StribeckSpeed));
    assert_eq!(field(&|s| s.fixture.per_mrad = n(-0.01)), Some(Field::LateralForce));
    assert_eq!(field(&|s| s.fixture.largest = Milliradians(0)), Some(Field::LargestAngle));
    assert_eq!(field(&|s| s.cutting[2].outwards = n(-0.1)), Some(Field::CuttingForce));
    assert_eq!(field(&|s| s.cutting.truncate(5)), Some(Field::CuttingForce));
    // The bursa gives way at 2.4 N: 0.02 N·s/mm are 0.0083 s/mm of that.
    assert_eq!(field(&|s| s.wall_rate = q(0.0085)), Some(Field::WallRate));
    assert_eq!(field(&|s| s.wall_rate = q(-0.001)), Some(Field::WallRate));
    let mut config = shoulder();
    config.patient.scale = q(0.09);
    assert!(matches!(config.plan().err(), Some(Refusal::OutOfRange { field: Field::Scale, .. })));
    config.patient.law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(1.0)) });
    config.patient.scale = q(0.1);
    assert!(config.plan().is_ok());
    config.device.limits.torque = MillinewtonMetres(q(28.8));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn fixed_point_follows_its_twin(
        legs in prop::collection::vec((-3.0..36.0_f64, 0.5..60.0_f64, 0.0..0.1_f64), 1..6),
        stiffness in 0.3..1.5_f64,
        tracking in 0.3..1.2_f64,
        sliding in 0.05..0.4_f64,
        extra in 0.0..0.2_f64,
        relax_ms in 10..2_000_u16,
        speed in 0.2..20.0_f64,
        rate in prop_oneof![Just(0.0), 0.0..0.008_f64],
    ) {
        let mut config = shoulder();
        let law = sparte(&mut config);
        law.tracking.0 = q(tracking);
        law.relax_ms = relax_ms;
        law.friction.stiffness.0 = q(stiffness);
        (law.friction.sliding, law.friction.sticking) = (n(sliding), n(sliding + extra));
        law.friction.speed.0 = q(speed);
        law.wall_rate = q(rate);
        prop_assume!(config.plan().is_ok());
        let (mut needle, mut twin) = (Needle::new(&config, STRAIGHT), Twin::new(&config));
        let mut worst = 0.0_f64;
        let mut see = |out: &TickOutput| {
            let wanted = twin.tick(out);
            worst = worst.max((force(out) - wanted).abs());
        };
        let first = needle.tick();
        see(&first);
        for (mm, mm_per_s, rest) in legs {
            needle.go(mm, mm_per_s, &mut see);
            for _ in 0..(rest * 1e4) as usize {
                let out = needle.tick();
                see(&out);
            }
        }
        prop_assume!(!twin.is_tied);
        prop_assert!(worst < 3e-3, "{} N", worst);
    }
}
