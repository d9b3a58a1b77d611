use super::*;

fn n(newtons: f64) -> Newtons {
    Newtons(I16F16::from_num(newtons))
}

fn mm(millimetres: f64) -> Millimetres {
    Millimetres(I16F16::from_num(millimetres))
}

/// 0.02 N·s/mm: 25 N for a millimetre in a bounce.
fn damping() -> BounceDamping {
    BounceDamping::new(Damping(I8F24::from_num(0.02)))
}

#[test]
fn damping_takes_its_share_and_never_turns_the_force_round() {
    for sign in [-1.0, 1.0] {
        let moved = I16F16::from_num(-0.04 * sign);
        let Newtons(left) = reduced(damping(), moved, n(3.0 * sign));
        assert!((left.to_num::<f64>() - 2.0 * sign).abs() < 1e-3, "{left}");
        assert_eq!(reduced(damping(), moved, n(0.5 * sign)), n(0.0));
    }
}

fn wall(newtons: f64) -> Elements {
    Elements { walls: n(newtons), ..Elements::NONE }
}

/// A wall that pushes the needle before it from the first tick on gives energy that nobody put
/// in.
#[expect(clippy::float_arithmetic, reason = "a test")]
fn pushed(force: f64, from: f64, step: f64, ticks: i32) -> (Observer, usize) {
    let mut observer = Observer::new(mm(from));
    let reduced = (1..=ticks).filter(|&tick| {
        let depth = mm(from + step * f64::from(tick));
        observer.tick(damping(), depth, wall(force), false).1
    });
    let reduced = reduced.count();
    (observer, reduced)
}

#[test]
fn only_a_force_that_gives_more_than_it_got_is_reduced() {
    // In the first tick no force has done anything yet.
    assert_eq!(pushed(1.0, 5.0, -0.01, 20).1, 19, "pushed out");
    assert_eq!(pushed(-1.0, 5.0, 0.01, 20).1, 19, "pulled in");
    assert_eq!(pushed(1.0, 5.0, 0.01, 20).1, 0, "pressed in");
    assert_eq!(pushed(1.0, 5.0, 0.0, 20).1, 0, "held");
}

#[test]
fn without_damping_nothing_is_reduced() {
    let mut observer = Observer::new(mm(5.0));
    let off = BounceDamping::new(Damping::default());
    for tick in 1..20 {
        let depth = mm(5.0 - 0.01 * f64::from(tick));
        assert_eq!(observer.tick(off, depth, wall(1.0), false), (n(1.0), false));
    }
}

#[test]
fn what_was_put_in_may_come_out_again() {
    let (mut observer, _) = pushed(1.0, 5.0, 0.01, 20);
    let back = (0..18).filter(|&tick| {
        let depth = mm(5.2 - 0.01 * f64::from(tick));
        observer.tick(damping(), depth, wall(1.0), false).1
    });
    assert_eq!(back.count(), 0);
}

#[test]
fn a_force_next_to_nothing_begins_a_new_count() {
    let (mut observer, _) = pushed(1.0, 5.0, -0.01, 20);
    assert!(observer.walls.is_negative());
    observer.tick(damping(), mm(4.8), wall(0.006), false);
    assert!(observer.walls.is_negative(), "6 mN are something");
    observer.tick(damping(), mm(4.8), wall(0.004), false);
    assert_eq!(observer.walls, Energy::default());
}

/// Returns the needle's depth at `tick` of its way from `from`.
#[expect(clippy::float_arithmetic, reason = "a test")]
fn at(from: f64, step: f64, tick: i32) -> Millimetres {
    mm(from + step * f64::from(tick))
}

/// 1 N of friction over 5 mm, and then a wall that gives what nobody put into it.
#[test]
fn what_friction_took_is_no_credit_of_a_wall() {
    let mut observer = Observer::new(mm(0.0));
    for tick in 1..=500 {
        let rubbed = Elements { friction: n(1.0), ..Elements::NONE };
        assert_eq!(observer.tick(damping(), at(0.0, 0.01, tick), rubbed, false), (n(1.0), false));
    }
    let both = Elements { walls: n(1.0), friction: n(0.2) };
    let reduced = (1..=20).filter(|&tick| observer.tick(damping(), at(5.0, -0.01, tick), both, false).1);
    assert!(reduced.count() > 15);
}

#[test]
fn friction_gives_back_no_more_than_its_hold_stores() {
    let mut observer = Observer::new(mm(0.0));
    let rubbed = Elements { friction: n(1.0), ..Elements::NONE };
    for tick in 1..=500 {
        observer.tick(damping(), at(0.0, 0.01, tick), rubbed, false);
    }
    // Half a millijoule: 50 steps of 0.01 mm under 1 N, and one that has not acted yet.
    let back = (1..=200).filter(|&tick| !observer.tick(damping(), at(5.0, -0.01, tick), rubbed, false).1);
    assert_eq!(back.count(), 50);
}

#[test]
fn a_wall_that_gives_way_keeps_no_credit() {
    for has_given_way in [false, true] {
        let (mut observer, _) = pushed(1.0, 5.0, 0.01, 20);
        observer.tick(damping(), mm(5.2), wall(1.0), has_given_way);
        let back = (1..18).filter(|&tick| observer.tick(damping(), at(5.2, -0.01, tick), wall(1.0), false).1);
        assert_eq!(back.count() > 0, has_given_way);
    }
}

/// A wall that was pressed in while a limit left a tenth of its force has stored a tenth.
#[test]
fn what_a_limit_held_back_is_no_credit() {
    let mut observer = Observer::new(mm(5.0));
    for tick in 1..=20 {
        observer.tick(damping(), at(5.0, 0.01, tick), wall(1.0), false);
        observer.held_back(I16F16::from_num(0.9));
    }
    let back = (1..18).filter(|&tick| observer.tick(damping(), at(5.2, -0.01, tick), wall(1.0), false).1);
    assert!(back.count() > 10);
}

#[test]
fn what_is_missing_of_a_force_is_the_walls() {
    let held_back = |walls: f64, missing: f64| {
        let given = Elements { walls: n(walls), friction: n(0.5) };
        let mut observer = Observer { given, ..Observer::default() };
        observer.held_back(I16F16::from_num(missing));
        (observer.given.walls, observer.given.friction)
    };
    for (walls, missing, left) in [
        (2.0, 0.0, 2.0),
        (2.0, 1.5, 0.5),
        (2.0, 2.5, 0.0),
        (-2.0, -0.5, -1.5),
        (-2.0, -9.0, 0.0),
        (2.0, -1.0, 2.0),
    ] {
        assert_eq!(held_back(walls, missing), (n(left), n(0.5)));
    }
}

#[test]
fn a_compensation_gives_at_most_its_store_and_friction() {
    let (store, torque, friction) = (10 << 16, I16F16::from_num(1), I16F16::from_num(0.5));
    let pushed = |friction, wanted: i32| {
        let mut account = Account::default();
        let wanted = I16F16::from_num(wanted);
        (0..100).filter(|_| account.allow(store, torque, friction, 1, wanted).1).count()
    };
    // Half a mN·m·count a tick is left, and 10 are allowed: the 21st is more.
    assert_eq!(pushed(friction, 1), 80);
    assert_eq!(pushed(friction, -1), 0, "what holds the needle back may stay");
    assert_eq!(pushed(torque, 1), 0, "friction takes all of it");
}

#[test]
fn only_a_compensation_that_pumps_energy_is_cut() {
    // To and fro over a spring that is late by a count: each turn gives more than it took.
    let run = |late: i32| {
        let mut account = Account::default();
        let spring = |place: i32| I16F16::from_num(-place);
        let (mut before, mut place, mut held) = (I16F16::ZERO, -10, 0);
        for tick in 0..4_000_i32 {
            let way = if tick % 40 < 20 { 1 } else { -1 };
            place += way;
            let wanted = spring(place - late * way);
            let (given, is_held) = account.allow(60 << 16, before, I16F16::ZERO, way, wanted);
            (before, held) = (given, held + i32::from(is_held));
        }
        held
    };
    assert_eq!(run(0), 0);
    assert!(run(2) > 100, "{}", run(2));
}
