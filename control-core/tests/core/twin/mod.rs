//! Fixed point against its floating-point twin: over any valid configuration and any walk of the
//! needle the two stay within one step of the converter, and nothing overflows or panics whatever
//! the counts.

mod model;

use control_core::config::{
    Config, DacWidth, Device, FrictionLaw, Law, Layer, MAX_LAYERS, Parabola, SPRING_BACK, SafetyConfig,
    SpeedMethod, Tissue, Wall,
};
use control_core::event::{Fault, State};
use control_core::units::{
    Counts, Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillinewtonMetres, Milliradians,
    Newtons, Stiffness,
};
use control_core::{Controller, LargeOrder, Order, Patient, Plan, TickInput};
use fixed::types::{I8F24, I16F16};
use proptest::prelude::*;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn device() -> impl Strategy<Value = Device> {
    let signs = (any::<bool>(), any::<bool>(), -7..=7_i16);
    (4.0..25.0_f64, 256..=65_535_u16, 10.0..500.0_f64, any::<bool>(), signs).prop_map(
        |(radius, counts, torque, narrow, (encoder_reversed, motor_reversed, dac_zero))| Device {
            encoder_reversed,
            motor_reversed,
            dac_zero,
            roller_radius: Millimetres(q(radius)),
            counts_per_turn: counts,
            full_scale_torque: MillinewtonMetres(q(torque)),
            dac: if narrow { DacWidth::BITS_8 } else { DacWidth::BITS_12 },
            ..Device::commissioned_virtual()
        },
    )
}

fn limits(device: Device) -> impl Strategy<Value = SafetyConfig> {
    let full = device.full_scale_torque.0.to_num::<f64>();
    let winding = (0.05..1.5_f64, 1..100_u16);
    (0.1..=1.0_f64, 0.01..50.0_f64, 10..400_u16, 2..200_u16, 20.0..200.0_f64, 0.5..7.0_f64, winding).prop_map(
        move |(
            share,
            slew,
            fade_in_ms,
            max_counts_per_tick,
            travel,
            stiffness,
            (continuous, winding_time_s),
        )| SafetyConfig {
            torque: MillinewtonMetres(q(full * share)),
            continuous_torque: MillinewtonMetres(q((full * share * continuous).clamp(3.0, 180.0))),
            winding_time_s,
            slew_per_tick: MillinewtonMetres(q(slew)),
            fade_in_ms,
            max_counts_per_tick,
            travel: Millimetres(q(travel)),
            stiffness: Stiffness(q(stiffness)),
            heartbeat_ms: 5_000,
        },
    )
}

fn friction(stiffest: f64, strongest: f64) -> impl Strategy<Value = FrictionLaw> {
    let paper = (1.0..200.0_f64, 1.0..8.0_f64, 5..1_000_u16, 0.01..0.9_f64, [0.01..0.9_f64, 0.01..0.9_f64]);
    let paper =
        paper.prop_map(move |(length, cap, anchor_ms, share, [limit, limit_out])| FrictionLaw::Paper {
            level_length: Millimetres(q(length)),
            level_cap: q(cap),
            anchor_ms,
            stiffness: Stiffness(q((stiffest * share / cap).max(0.001))),
            limit: Newtons(q((strongest * limit).max(0.001))),
            limit_out: Newtons(q((strongest * limit_out).max(0.001))),
        });
    let cone = (0.1..0.6_f64)
        .prop_map(move |share| FrictionLaw::Cone { stiffness: Stiffness(q((stiffest * share).max(0.05))) });
    prop_oneof![paper, cone]
}

/// A wall that is likely to be valid: its slope and force are shares of what is allowed.
fn wall(stiffest: f64, strongest: f64) -> impl Strategy<Value = Option<Wall>> {
    let parts = (0.1..0.5_f64, 0.05..0.8_f64, 0.2..5.0_f64, 0.0..1.0_f64, 0.05..0.4_f64);
    // How far before contact the rising parabola turns, and how much of the relief stays
    // permanently; mostly neither.
    let shapes = (prop_oneof![Just(0.0), 0.0..1.0_f64], prop_oneof![Just(0.0), 0.0..1.0_f64]);
    let wall = (parts, shapes).prop_map(move |((slope, force, beyond, relief, unload), (before, stays))| {
        let (slope, force) = (slope * stiffest, force * strongest);
        // f = ((T + k·T_p)² − (k·T_p)²)/a, of which the force and the slope at the puncture T_p are
        // known.
        let puncture = (2.0 * force * (1.0 + before) / (slope * (1.0 + 2.0 * before))).clamp(0.05, 20.0);
        let compliance = (2.0 * puncture * (1.0 + before) / slope).clamp(0.05, 1_000.0);
        let vertex = -before * puncture;
        let peak = puncture * puncture * (1.0 + 2.0 * before) / compliance;
        let base = stays * relief * peak;
        let relief_compliance = (beyond * beyond / (relief * peak - base).max(0.002)).clamp(0.05, 1_000.0);
        let parabola = |vertex: f64, compliance: f64, base: f64| Parabola {
            vertex: Millimetres(q(vertex)),
            compliance: JogCompliance(q(compliance)),
            base: Newtons(q(base)),
        };
        Wall {
            elastic: parabola(vertex, compliance, -vertex * vertex / compliance),
            puncture_travel: Millimetres(q(puncture)),
            relief: parabola(puncture + beyond, relief_compliance, base),
            unload: Stiffness(q((unload * stiffest).max(0.05))),
            spring_back: SPRING_BACK,
        }
    });
    prop::option::weighted(0.7, wall)
}

fn layers(stiffest: f64, strongest: f64, travel: f64) -> impl Strategy<Value = Vec<Layer>> {
    let layer = (wall(stiffest, strongest), 0.0..0.3_f64, 0.1..10.0_f64);
    prop::collection::vec(layer, 1..=MAX_LAYERS).prop_map(move |parts| {
        let mut top = 0.0;
        let place = |(wall, friction, gap): (Option<Wall>, f64, f64)| {
            top += gap;
            let layer = Layer {
                tissue: Tissue::Other,
                depth: Millimetres(q(top)),
                wall,
                friction: FrictionPerMillimetre(q(friction * strongest / travel)),
            };
            top += wall.map_or(0.0, |w| w.puncture_travel.0.to_num::<f64>());
            layer
        };
        parts.into_iter().map(place).collect()
    })
}

/// Any configuration that is not refused.
fn valid_config() -> impl Strategy<Value = (Config, Plan)> {
    let config =
        device().prop_flat_map(|device| (Just(device), limits(device))).prop_flat_map(|(device, limits)| {
            let stiffest = limits.stiffness.0.to_num::<f64>();
            let strongest = limits.torque.0.to_num::<f64>() / device.roller_radius.0.to_num::<f64>();
            let travel = limits.travel.0.to_num::<f64>();
            let speed = prop_oneof![Just(SpeedMethod::Window), Just(SpeedMethod::EdgeTiming)];
            let laws =
                (friction(stiffest, strongest), layers(stiffest, strongest, travel), speed, 0..=8_389_i32);
            laws.prop_map(move |(friction, layers, speed, damping)| Config {
                device: Device {
                    limits,
                    speed,
                    damping: Damping(I8F24::from_bits(damping)),
                    // The observer decides by the sign of an energy; `passivity.rs` tests it by
                    // itself.
                    passivity_damping: Damping::default(),
                    ..device
                },
                patient: Patient {
                    law: Law::Jog(friction),
                    layers: layers.into_iter().collect(),
                    ..Patient::default()
                },
            })
        });
    config.prop_filter_map("refused", |config| config.plan().ok().map(|plan| (config, plan)))
}

/// Legs of a walk: counts a tick (as a share of the largest) and ticks.
fn legs() -> impl Strategy<Value = Vec<(f64, u16)>> {
    let slow = (-0.05..0.12_f64, 1..400_u16);
    let fast = (-1.0..1.0_f64, 1..60_u16);
    let rest = (Just(0.0), 1..1_500_u16);
    prop::collection::vec(prop_oneof![4 => slow, 2 => fast, 1 => rest], 1..24)
}

/// Legs of a speed each, at most `largest` counts a tick, joined as a hand joins them: with an
/// acceleration that no watch takes for a motor that is wired wrongly, and a rest before either
/// end.
fn walk(legs: &[(f64, u16)], largest: f64, furthest: i32) -> Vec<i32> {
    const PER_TICK: f64 = 0.004;
    let (mut at, mut speed, mut counts) = (0.0_f64, 0.0_f64, Vec::new());
    for (share, ticks) in legs {
        for _ in 0..*ticks {
            let stops_at = at + speed * speed.abs() / (2.0 * PER_TICK);
            let wanted = share * largest;
            let is_end = stops_at.abs() + 4.0 * largest >= f64::from(furthest) && stops_at * wanted > 0.0;
            let wanted = if is_end { 0.0 } else { wanted };
            speed += (wanted - speed).clamp(-PER_TICK, PER_TICK);
            at = (at + speed).clamp(f64::from(-furthest), f64::from(furthest));
            counts.push(at.round() as i32);
        }
    }
    counts
}

/// Steps in a row, each of which undoes the one before, from which the watch on the encoder may
/// hold the torque for 10 ms whatever the law says. The watch's own tests are in `runaway.rs`.
const TO_AND_FRO: u32 = 3;

/// The walk up to where its counts go to and fro.
fn until_to_and_fro(mut walk: Vec<i32>) -> Vec<i32> {
    let (mut last, mut in_a_row) = (0, 0);
    let turns = |pair: &[i32]| {
        let step = pair[1] - pair[0];
        if step != 0 {
            in_a_row = if step == -last { in_a_row + 1 } else { 0 };
            last = step;
        }
        in_a_row >= TO_AND_FRO
    };
    if let Some(end) = walk.windows(2).position(turns) {
        walk.truncate(end + 1);
    }
    walk
}

proptest! {
    // More with PROPTEST_CASES.
    #![proptest_config(ProptestConfig { cases: ProptestConfig::default().cases.max(2_000), max_global_rejects: u32::MAX, max_shrink_iters: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn fixed_point_stays_within_one_step_of_its_twin(
        (config, plan) in valid_config(),
        legs in legs(),
        tilts in prop::collection::vec(60..1_700_i16, 1..4),
    ) {
        let mm_per_count = plan.mm_per_count().to_num::<f64>();
        let furthest = (config.device.limits.travel.0.to_num::<f64>() / mm_per_count) as i32 - 1;
        // A sixth is too fast.
        let largest = f64::from(config.device.limits.max_counts_per_tick) / 6.5;
        let mut twin = model::Twin::new(&config, mm_per_count);
        let mut controller = Controller::new(plan);
        controller.order(Order::Start);
        let zero = f64::from(config.device.dac.mid_scale() as i16 + config.device.dac_zero);
        let sign = |reversed: bool| if reversed { -1 } else { 1 };
        let (counts_sign, codes_sign) =
            (sign(config.device.encoder_reversed), sign(config.device.motor_reversed));
        for (tick, count) in until_to_and_fro(walk(&legs, largest, furthest)).into_iter().enumerate() {
            // The needle turns now and then.
            let tilt = Milliradians(tilts[tick / 2_000 % tilts.len()]);
            controller.order(Order::Heartbeat);
            let output = controller.tick(TickInput { count: Counts(count * counts_sign), tilt });
            prop_assert_eq!(output.tripped, None);
            let (got, wanted) = ((f64::from(output.dac.0) - zero) * f64::from(codes_sign), twin.tick(count, &output));
            let allowed = 1.0 + twin.steps_of_heat();
            prop_assert!((got - wanted).abs() <= allowed, "tick {tick}, count {count}: {got} for {wanted}");
        }
    }

    #[test]
    fn no_sequence_of_counts_and_orders_panics(
        (_, plan) in valid_config(),
        steps in prop::collection::vec((any::<i32>(), 0_u32..32, 0_u8..12, any::<i16>()), 1..600),
    ) {
        let mut controller = Controller::new(plan.clone());
        let limit = plan.device().dac.span();
        for (count, shift, order, tilt) in steps {
            match order {
                0 => controller.order(Order::Stop),
                1 => controller.order(Order::Zero),
                2 => controller.order(LargeOrder::Configure(plan.clone())),
                3 => controller.order(Order::Trip(Fault::Tilt)),
                4..=7 => controller.order(Order::Start),
                _ => controller.order(Order::Heartbeat),
            }
            let output = controller.tick(TickInput { count: Counts(count >> shift), tilt: Milliradians(tilt) });
            let zero = plan.zero_torque_code().0;
            prop_assert!(output.dac.0.abs_diff(zero) <= limit);
            let powered = State::from_code(output.sample.state).is_some_and(State::is_powered);
            prop_assert_eq!(powered, output.enable);
            prop_assert!(output.enable || output.dac.0 == zero, "torque without the amplifier");
        }
    }

    #[test]
    fn a_count_is_the_circumference_over_the_counts(radius in 4.0..25.0_f64, counts in 256..=65_535_u16) {
        let mut config = Config::commissioned_virtual();
        config.device.roller_radius = Millimetres(q(radius));
        config.device.counts_per_turn = counts;
        config.device.limits.stiffness = Stiffness(q(7.0));
        if let Ok(plan) = config.plan() {
            let exact = 2.0 * std::f64::consts::PI * q(radius).to_num::<f64>() / f64::from(counts);
            prop_assert!((plan.mm_per_count().to_num::<f64>() - exact).abs() < 2e-9);
        }
    }
}
