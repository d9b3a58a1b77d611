use super::*;

fn bounds() -> Bounds {
    Bounds::new(I2F30::from_num(0.0157), I16F16::from_num(10), 16)
}

/// Seconds until the watch finds something, of a needle whose depth in mm and torque in mN·m
/// are these at each look.
fn found(mut at: impl FnMut(f64) -> (f64, f64), seconds: f64) -> Option<(f64, Fault)> {
    let (bounds, mut watch) = (bounds(), Watch::new(0));
    let mut last = 0;
    let ticks = (seconds * 1e4) as u32;
    (0..ticks).find_map(|tick| {
        let time = f64::from(tick) / 1e4;
        let (depth, torque) = at(time);
        let count = (depth / 0.0157) as i32;
        let step = count - core::mem::replace(&mut last, count);
        if step != 0 {
            watch.is_back(step);
        }
        let is_look = tick % LOOK_TICKS == 0;
        let fault = is_look.then(|| {
            watch.take(count, I16F16::from_num(torque));
            let fast = watch.look(&bounds);
            watch.compare();
            fast.or(watch.judge(&bounds))
        });
        fault.flatten().map(|fault| (time, fault))
    })
}

/// From rest, after 20 ms.
fn driven(acceleration: f64, torque: f64) -> Option<(f64, Fault)> {
    let moved = move |time: f64| acceleration / 2.0 * (time - 0.02).max(0.0).powi(2) * 1e3;
    found(move |time| (moved(time), torque), 0.028).map(|(time, fault)| (time - 0.02, fault))
}

#[test]
fn a_needle_driven_the_wrong_way_is_found_within_5_ms() {
    for (newtons, mass) in [(0.5, 0.03), (0.7, 0.03), (1.0, 0.03), (2.8, 0.03), (1.0, 0.05), (0.5, 0.02)] {
        for sign in [-1.0, 1.0] {
            let found = driven(sign * newtons / mass, -sign * 10.0 * newtons);
            let (time, fault) = found.unwrap_or((1.0, Fault::Travel));
            assert!(fault == Fault::WrongWay && time < 0.005, "{newtons} N, {mass} kg: {found:?}");
            let along = driven(sign * newtons / mass, sign * 10.0 * newtons);
            let is_fast = along.is_none_or(|(_, fault)| fault == Fault::Overspeed);
            assert!(is_fast, "along with the motor: {along:?}");
        }
    }
}

#[test]
fn what_a_hand_does_is_left_alone() {
    // A stab: 300 mm/s in 50 ms, against any torque.
    for torque in [-28.0, -10.0, -3.0, -0.5, 0.0] {
        assert_eq!(driven(6.0, torque), None, "{torque} mN·m");
    }
    // A tremor of 10 Hz and a rattle of 60 Hz.
    for (hertz, mm) in [(10.0, 0.1), (60.0, 0.012)] {
        let swing = move |time: f64| mm * (core::f64::consts::TAU * hertz * time).sin();
        assert_eq!(found(move |time| (swing(time), -7.0), 2.0), None, "{hertz} Hz");
    }
}

/// 1 N gives way to 0.4 N under a hand that holds 30 g with 1.5 N/mm: a leap of 20 m/s² against
/// the motor.
#[test]
fn a_wall_that_gives_way_is_left_alone() {
    let leap = |time: f64| {
        let since = time - 0.02;
        if since < 0.0 {
            return (0.0, -10.0);
        }
        let swing = (-80.0 * since).exp() * (223.0 * since).cos();
        (0.4 * (1.0 - swing), -4.0)
    };
    assert_eq!(found(leap, 0.1), None);
}

/// 30 g that a hand leans with 0.4 N on a wall of 5.6 N/mm, knocked by 30 mm/s: it swings at 69
/// Hz with 13 m/s².
#[test]
fn a_needle_knocked_against_a_stiff_wall_is_left_alone() {
    for (amplitude, phase) in
        (3..=7).flat_map(|a| (0..16).map(move |p| (f64::from(a) * 0.01, f64::from(p) * 0.39)))
    {
        let depth = move |time: f64| 0.071 + amplitude * (432.0 * time + phase).sin();
        // Counted from where it begins.
        let at = move |time: f64| (depth(time) - depth(0.0), -56.0 * depth(time).max(0.0));
        assert_eq!(found(at, 0.2), None, "{amplitude} mm, {phase} rad");
    }
}

/// A light tap on a needle that is pressed with 0.4 N: 30 mm/s at once, at any place between
/// two looks and two counts, which a hand of 30 g then loses in 20 ms.
#[test]
fn a_tap_is_left_alone() {
    for (late, place) in (0..8).flat_map(|late| (0..8).map(move |place| (f64::from(late), f64::from(place))))
    {
        let at = move |time: f64| {
            let since = (time - 0.02 - late * 1e-4).max(0.0);
            (place * 0.002 + 0.6 * (1.0 - (-since / 0.02).exp()), -4.0)
        };
        assert_eq!(found(at, 0.1), None, "{late} {place}");
    }
}

#[test]
fn too_fast_is_too_fast_whoever_drives_it() {
    let at = |speed: f64| found(move |time| (speed * (time - 0.02).max(0.0), 0.0), 0.1);
    assert_eq!(at(380.0), None);
    let (time, fault) = at(450.0).unwrap_or((1.0, Fault::Travel));
    assert!(fault == Fault::Overspeed && time < 0.0235, "{time}");
}

/// 30 g with 0.02 N of dry friction against a wall of 5.6 N/mm, whose force is a tick late and
/// steps by 0.09 N at each count. A hand leans on it with half of that over the first count.
/// The torque is held where turns are in doubt, or never.
fn chattered(holds: bool) -> Option<(f64, Fault)> {
    let mut watch = Watch::new(0);
    let (mut depth, mut speed, mut last, mut given) = (-1e-5, 0.2, 0, 0.0);
    (0..5_000).find_map(|tick| {
        let count = (depth / 0.0157_f64).floor() as i32 + 1;
        let step = count - core::mem::replace(&mut last, count);
        if step != 0 {
            watch.is_back(step);
        }
        // mm, mm/s, mN·m at 10 mm.
        let free = 44.0 + given * 100.0;
        let moved = speed + (free - f64::copysign(20.0, speed)) / 0.03 * 1e-4;
        speed = if moved * speed < 0.0 && free.abs() <= 20.0 { 0.0 } else { moved };
        depth += speed * 1e-4;
        let wanted = I16F16::from_num(-0.88 * f64::from(count));
        let torque = if holds { watch.steady(wanted, I16F16::from_num(given)) } else { wanted };
        given = torque.to_num();
        let fault = (tick % LOOK_TICKS == 0).then(|| {
            watch.take(count, torque);
            watch.judge(&bounds())
        });
        fault.flatten().map(|fault| (f64::from(tick) / 1e4, fault))
    })
}

#[test]
fn a_wall_that_chatters_over_one_count_is_no_dead_channel() {
    assert_eq!(chattered(true), None);
    let fault = chattered(false).map(|(_, fault)| fault);
    assert_eq!(fault, Some(Fault::EncoderChannel), "by its counts alone it is one");
}

/// 20 mm/s past a dead channel, with the torque held: the hand moves on.
#[test]
fn a_dead_channel_goes_on_while_the_torque_is_held() {
    let (bounds, mut watch) = (bounds(), Watch::new(0));
    let mut last = 0;
    let found = (0..1_000).find_map(|tick| {
        let count = tick / 16 % 2;
        let step = count - core::mem::replace(&mut last, count);
        if step != 0 {
            watch.is_back(step);
        }
        let torque = watch.steady(I16F16::from_num(-5 - count), I16F16::from_num(-6 + count));
        let fault = (tick % 8 == 0).then(|| {
            watch.take(count, torque);
            watch.look(&bounds).or(watch.judge(&bounds))
        });
        fault.flatten().map(|fault| (tick, fault))
    });
    let (tick, fault) = found.unwrap_or((1_000, Fault::Travel));
    assert!(fault == Fault::EncoderChannel && tick < 200, "{fault:?} in tick {tick}");
}

#[test]
fn counts_that_go_to_and_fro_are_a_dead_channel() {
    // An edge every 1.5 ms: 20 mm/s where two counts are 31 µm.
    let dither = |apart: f64| move |time: f64| (0.016 * ((time / apart) as i64 % 2) as f64, -5.0);
    let (time, fault) = found(dither(0.0015), 0.1).unwrap_or((1.0, Fault::Travel));
    assert!(fault == Fault::EncoderChannel && time < 0.02, "{time}");
    assert_eq!(found(dither(0.025), 5.0), None, "a tremor of half a count");
}
