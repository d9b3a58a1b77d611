use super::*;
use heapless::Vec;

#[test]
fn a_quotient_is_the_nearest_of_twenty_bits() {
    let dividends = (0..44).flat_map(|shift| [1_u64 << shift, (3 << shift) + 1, (1 << (shift + 1)) - 1]);
    for (dividend, divisor) in dividends.flat_map(|dividend| [1, 2, 3, 999, 1_000].map(|n| (dividend, n))) {
        let exact = (dividend / u64::from(divisor)).min(i32::MAX as u64) as f64;
        let got = f64::from(quotient(dividend, divisor));
        assert!(got <= exact && exact - got <= exact / f64::from(1 << 20), "{dividend} / {divisor} = {got}");
    }
    assert_eq!(quotient(7, 0), 7, "no divisor counts as one");
    assert_eq!(quotient(u64::MAX, 1), i32::MAX);
}

/// Speed from edges, tick by tick, of a needle at `counts`.
fn speeds(counts: impl IntoIterator<Item = i32>) -> impl Iterator<Item = f64> {
    let scale = Scale::new(I2F30::ONE / 64);
    let mut estimator = SpeedEstimator::new(SpeedMethod::EdgeTiming, Counts(0));
    counts.into_iter().map(move |count| estimator.tick(&scale, Counts(count)).0.to_num())
}

/// Directions that are seen on a way, in mm for each tick.
fn directions(way: impl Iterator<Item = f64>) -> [usize; 3] {
    let mut movement = Movement::default();
    let mut seen = [0; 3];
    for (tick, mm) in way.enumerate() {
        if tick % LOOK_TICKS as usize == 0 {
            movement.look(Millimetres(I16F16::from_num(mm)));
        }
        let place = match movement.direction() {
            Direction::Rests => 0,
            Direction::In => 1,
            Direction::Out => 2,
        };
        seen[place] += 1;
    }
    seen
}

#[test]
fn a_trembling_hand_that_holds_still_rests() {
    // 0.08 mm at 10 Hz is up to 5 mm/s.
    let tremor = |tick: u32| 0.08 * (f64::from(tick) * 0.006_283).sin();
    assert_eq!(directions((0..100_000).map(tremor)), [100_000, 0, 0]);
    // In at 3 mm/s, then held: a quarter of a second later it rests permanently.
    let held = directions((0..50_000).map(|tick| 3e-4 * f64::from(tick.min(10_000)) + tremor(tick)));
    assert!(held[0] > 35_000 && held[2] == 0, "{held:?}");
}

#[test]
fn a_slow_way_is_a_movement_in_its_direction() {
    // 0.2 mm/s in counts of 16 µm, in and then out.
    let count = |mm: f64| (mm / 0.016).floor() * 0.016;
    let way = (0..200_000).map(|tick| count(2e-5 * f64::from(100_000 - (tick - 100_000_i32).abs())));
    let seen = directions(way);
    assert!(seen[1] > 80_000 && seen[2] > 80_000 && seen[0] < 30_000, "{seen:?}");
}

#[test]
fn edges_that_have_left_the_window_do_not_count() {
    // A count every 4 ticks is 39.06 mm/s, then one every 100 ticks; the window holds 128.
    let fast = (1..=400).map(|tick| tick / 4);
    let slow = (1..=1_000).map(|tick| 100 + tick / 100);
    let speeds: Vec<f64, 1_400> = speeds(fast.chain(slow)).collect();
    let near = |tick: usize, wanted: f64| {
        let got = speeds.get(tick).copied().unwrap_or_default();
        assert!((got - wanted).abs() < 0.01 * wanted, "{got} mm/s in tick {tick}, not {wanted}");
    };
    near(399, 156.25 / 4.0);
    near(1_399, 156.25 / 100.0);
    near(899, 156.25 / 100.0);
}

/// A needle that stops at once: what has not moved by a count in a time is slower than a count
/// in that time.
#[test]
fn after_an_abrupt_stop_speed_is_below_one_count_in_that_time() {
    // Three counts in four ticks are 117 mm/s; a count a tick is 156.25.
    let speeds: Vec<f64, 1_400> =
        speeds((1..=400).map(|tick| 3 * tick / 4).chain(core::iter::repeat_n(300, 900))).collect();
    let before = speeds.get(399).copied().unwrap_or_default();
    assert!((before - 117.2).abs() < 2.0, "{before} mm/s");
    for silent in 3..900_u32 {
        let speed = speeds.get(399 + silent as usize).copied().unwrap_or(f64::MAX);
        let bound = 156.25 / f64::from(silent);
        assert!(speed <= bound * 1.001, "{speed} mm/s, {silent} ticks after the last count");
    }
}

#[test]
fn after_a_rest_speed_begins_anew() {
    let rest = core::iter::repeat_n(10, 1_200);
    let speeds: Vec<f64, 2_000> = speeds((1..=10).chain(rest).chain(11..=40)).collect();
    assert_eq!(speeds.get(1_209), Some(&0.0), "at rest");
    assert_eq!(speeds.get(1_210), Some(&0.0), "one edge alone says nothing");
    let speed = speeds.get(1_230).copied().unwrap_or_default();
    assert!((speed - 156.25).abs() < 1.0, "{speed} mm/s, a count a tick");
}

/// The number of ticks wraps after 119 hours: what is 2^32 ticks old is not recent.
#[test]
fn a_rest_of_any_length_ends_without_a_speed() {
    let scale = Scale::new(I2F30::ONE / 64);
    for short_of_a_wrap in [0, 5, 200, 990] {
        let mut estimator = SpeedEstimator::new(SpeedMethod::EdgeTiming, Counts(0));
        let speed = |estimator: &mut SpeedEstimator, count| estimator.tick(&scale, Counts(count)).0;
        for tick in 0..5_000 {
            speed(&mut estimator, tick.min(2_000) / 10);
        }
        // As many ticks more as a rest of 2^32, less a few, still has, if each does what this one
        // does.
        let before = estimator.now;
        speed(&mut estimator, 200);
        let a_tick = estimator.now.wrapping_sub(before);
        let since_the_edge = before.wrapping_sub(estimator.latest.tick);
        let left = since_the_edge.wrapping_neg().wrapping_sub(short_of_a_wrap + 1);
        estimator.now = estimator.now.wrapping_add(a_tick.wrapping_mul(left));
        for tick in 0..short_of_a_wrap + 100 {
            assert_eq!(speed(&mut estimator, 200), 0, "{tick} ticks after a rest {short_of_a_wrap} short");
        }
        assert_eq!(speed(&mut estimator, 201), 0, "one edge alone says nothing: {short_of_a_wrap}");
    }
}
