//! The plant against physics that can be worked out by hand.

use std::f64::consts::TAU;

use super::case::build;
use super::drive::{Drive, Segment, Tones};
use super::family::Needs;
use super::files;
use super::machine::Machine;
use super::plant::{Harmonic, Plant, Presliding, Train};
use super::series::Series;
use super::simulate::{Believed, Row, Run, STEP, simulate};
use super::spec::Spec;
use crate::key::Category;
use crate::rng::Rng;

fn bare(inertia: f64) -> Plant {
    let mut plant = Machine::draw(&mut Rng::new(1), Needs::default(), true).plant;
    plant.inertia = inertia;
    plant.viscous = 0.0;
    plant.dry.coulomb = 0.0;
    plant.gain = 1.0;
    plant.offset = 0.0;
    plant.weight = 0.0;
    plant.turn = TAU;
    plant.counts_per_unit = 1e9;
    plant
}

fn open(rate: f64, seconds: f64, drive: Drive) -> Run {
    Run {
        times: (0..(rate * seconds) as usize).map(|i| i as f64 / rate).collect(),
        segments: vec![Segment { from: 0.0, length: seconds, drive, control: None }],
        return_speed: 1.0,
        noise_counts: 0.0,
        warm: 0.0,
        limit: 1e9,
        command_step: 1e-12,
        tilt: Series::default(),
        force: Series::default(),
        disturbance: Series::default(),
        offset: 0.0,
        start: 0.0,
        zero_counts: 0.0,
        speed_bound: 1e9,
        random: Rng::new(5),
    }
}

fn believed(plant: &Plant) -> Believed {
    Believed {
        inertia: plant.inertia,
        viscous: plant.viscous,
        coulomb: plant.dry.coulomb,
        gain: plant.gain,
        offset: plant.offset,
        weight: plant.weight,
    }
}

fn play(plant: &Plant, run: &Run) -> Vec<Row> {
    simulate(plant, &believed(plant), run, STEP).expect("the run is bounded")
}

fn levels(list: &[(f64, f64)]) -> Drive {
    Drive { levels: list.to_vec(), ..Drive::default() }
}

#[test]
fn energy_is_kept_without_dissipation() {
    let mut plant = bare(2.0);
    plant.spring = Some((8.0, 0.0, 0.0));
    let mut run = open(1000.0, 20.0, Drive::default());
    run.start = 0.5;
    let energy = |r: &Row| 0.5 * 2.0 * r.v * r.v + 0.5 * 8.0 * r.q * r.q;
    let rows = play(&plant, &run);
    let first = energy(&rows[0]);
    let worst = rows.iter().map(|r| (energy(r) / first - 1.0).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-7, "energy off by {worst:e} of itself");
    // Natural frequency 1/π Hz: after 20 s the phase is 40 rad.
    let last = rows.last().unwrap();
    assert!((last.q - 0.5 * (2.0 * last.time).cos()).abs() < 1e-6);
}

#[test]
fn constant_force_gives_the_parabola() {
    let rows = play(&bare(0.5), &open(500.0, 2.0, levels(&[(3.0, 10.0)])));
    let last = rows.last().unwrap();
    assert!((last.q - 0.5 * 6.0 * last.time.powi(2)).abs() < 1e-9 * last.q);
    assert!(rows.iter().all(|r| r.missing.abs() < 1e-9), "the believed model is the plant");
}

#[test]
fn stick_holds_below_friction_and_slides_by_the_excess_above() {
    let mut plant = bare(1.0);
    plant.dry.coulomb = 2.0;
    let rows = play(&plant, &open(1000.0, 4.0, levels(&[(1.999, 2.0), (3.0, 1.0), (0.0, 5.0)])));
    assert!(rows.iter().filter(|r| r.time < 2.0).all(|r| r.q == 0.0 && r.v == 0.0));
    let at = |t: f64| rows[(t * 1000.0).round() as usize];
    assert!((at(2.5).v - 0.5).abs() < 1e-6, "accelerates at (3 − 2)/1");
    assert!((at(3.25).v - 0.5).abs() < 1e-4, "decelerates at 2/1");
    assert!(at(3.9).v == 0.0 && !at(3.9).moving, "and stays at rest");
}

#[test]
fn two_masses_ring_at_the_known_frequency() {
    let mut plant = bare(3.0);
    // Motor 1, load 2, k 500: sqrt(k·(1/1 + 1/2)) = 27.39 rad/s.
    plant.train =
        Train::Spring { load_share: 2.0 / 3.0, friction_share: 0.0, stiffness: 500.0, damping: 0.0 };
    let rows = play(&plant, &open(2000.0, 8.0, levels(&[(10.0, 0.005), (0.0, 20.0)])));
    let drift = rows.last().unwrap().q / rows.last().unwrap().time;
    let wave: Vec<f64> = rows.iter().map(|r| r.v - drift).collect();
    let crossings: Vec<f64> = (1..wave.len())
        .filter(|&i| wave[i - 1] < 0.0 && wave[i] >= 0.0)
        .map(|i| rows[i - 1].time - wave[i - 1] / (wave[i] - wave[i - 1]) * 5e-4)
        .collect();
    let period = (crossings[crossings.len() - 1] - crossings[1]) / (crossings.len() - 2) as f64;
    let expected = (500.0_f64 * 1.5).sqrt();
    assert!((TAU / period / expected - 1.0).abs() < 1e-3, "{} against {expected}", TAU / period);
    // The motor stands still at the antiresonance sqrt(k/J_load): force there, and the motor hardly
    // moves.
    let anti = (500.0_f64 / 2.0).sqrt() / TAU;
    plant.viscous = 1.0;
    let motion = |hz: f64| {
        let tones = Tones { tones: vec![(1.0, hz, 0.0)] };
        let rows = play(&plant, &open(1000.0, 60.0, Drive { tones, ..Drive::default() }));
        let tail: Vec<f64> = rows[30_000..].iter().map(|r| r.v).collect();
        let mean = tail.iter().sum::<f64>() / tail.len() as f64;
        crate::signal::rms(&tail.iter().map(|v| v - mean).collect::<Vec<_>>())
    };
    let (at, beside) = (motion(anti), motion(0.6 * anti));
    assert!(at * 20.0 < beside, "{at} against {beside}");
}

#[test]
fn backlash_lets_the_motor_run_free_by_the_gap() {
    let mut plant = bare(1.0);
    plant.dry.coulomb = 0.06;
    plant.viscous = 2.0;
    plant.train =
        Train::Gap { load_share: 0.5, friction_share: 0.5, gap: 0.1, stiffness: 2e5, damping: 200.0 };
    // The motor creeps over half the gap at 0.02; the load's friction holds the rest of the force,
    // 0.02.
    let rows = play(&plant, &open(1000.0, 30.0, levels(&[(0.05, 60.0)])));
    let rest = rows.last().unwrap();
    assert!((rest.q - 0.05).abs() < 3e-3, "stands at {}", rest.q);
}

#[test]
fn cogging_amplitude_is_found_by_a_fourier_sum_over_the_angle() {
    let mut plant = bare(1e-3);
    plant.viscous = 1e-2;
    plant.cogging = vec![
        Harmonic { order: 7.0, amplitude: 2e-3, phase: 0.4 },
        Harmonic { order: 14.0, amplitude: 5e-4, phase: 2.0 },
    ];
    let rows = play(&plant, &open(20_000.0, 8.0, levels(&[(0.1, 100.0)])));
    // Whole turns only, weighted by the angle passed.
    let from = 40_000;
    let turns = ((rows[rows.len() - 1].q - rows[from].q) / TAU).floor();
    let end = rows[from].q + turns * TAU;
    for (order, expected) in [(7.0, 2e-3), (14.0, 5e-4), (9.0, 0.0)] {
        let (mut a, mut b) = (0.0, 0.0);
        for pair in rows[from..].windows(2).take_while(|p| p[1].q < end) {
            let (width, middle) = (pair[1].q - pair[0].q, 0.5 * (pair[1].q + pair[0].q));
            a += pair[0].missing * (order * middle).sin() * width;
            b += pair[0].missing * (order * middle).cos() * width;
        }
        let amplitude = a.hypot(b) * 2.0 / (turns * TAU);
        assert!((amplitude - expected).abs() < 2e-5, "order {order}: {amplitude:e}");
    }
}

#[test]
fn lugre_is_elastic_for_small_moves_and_slides_at_coulomb_level() {
    let mut plant = bare(1.0);
    plant.dry.coulomb = 2.0;
    plant.dry.presliding = Some(Presliding::LuGre { stiffness: 1000.0, damping: 20.0 });
    let drive = Drive { ramps: true, ..levels(&[(1.0, 4.0), (0.0, 4.0)]) };
    let rows = play(&plant, &open(1000.0, 8.0, drive));
    let at = |t: f64| rows[(t * 1000.0).round() as usize];
    // Slowly loaded from rest: F = F_c·(1 − exp(−σ x/F_c)).
    let expected = -2.0 / 1000.0 * (1.0_f64 - 0.5).ln();
    assert!((at(3.999).q / expected - 1.0).abs() < 0.02, "{} against {expected}", at(3.999).q);
    let back = at(7.9).q / at(3.999).q;
    assert!((0.05..0.5).contains(&back), "some of it stays: {back}");
    let rows = play(&plant, &open(1000.0, 3.0, levels(&[(5.0, 10.0)])));
    let (a, b) = (rows[1000], rows[2000]);
    assert!(((b.v - a.v) / (b.time - a.time) - 3.0).abs() < 1e-3);
}

#[test]
fn the_encoder_floors_to_counts() {
    let mut plant = bare(1.0);
    plant.counts_per_unit = 100.0;
    let mut run = open(100.0, 3.0, levels(&[(0.3, 100.0)]));
    run.zero_counts = 12.25;
    for r in play(&plant, &run) {
        assert_eq!(r.counts, (r.q * 100.0 + 12.25).floor());
    }
}

#[test]
fn the_command_is_held_from_its_row_to_the_next_on_any_clock() {
    let plant = bare(2.0);
    let mut run = open(50.0, 4.0, Drive::default());
    let mut rng = Rng::new(2);
    run.times.iter_mut().for_each(|t| *t += 0.008 * rng.unit());
    run.segments[0].drive.tones = Tones { tones: vec![(3.0, 1.3, 0.2)] };
    for pair in play(&plant, &run).windows(2) {
        let (a, b) = (pair[0], pair[1]);
        assert!((b.v - a.v - a.command / 2.0 * (b.time - a.time)).abs() < 1e-9);
    }
}

#[test]
fn a_delay_moves_the_force_by_exactly_itself() {
    let mut plant = bare(1.0);
    plant.delay = 0.0123;
    let rows = play(&plant, &open(1000.0, 0.2, levels(&[(1.0, 9.0)])));
    // Force from 0.0123 s on: v = t − 0.0123.
    let last = rows.last().unwrap();
    assert!((last.v - (last.time - 0.0123)).abs() < 1.1e-5, "{}", last.v);
}

#[test]
fn a_lag_charges_exponentially() {
    let mut plant = bare(1.0);
    plant.lag = 0.02;
    let rows = play(&plant, &open(1000.0, 0.2, levels(&[(1.0, 9.0)])));
    let r = rows[100];
    let expected = r.time - 0.02 * (1.0 - (-r.time / 0.02).exp());
    assert!((r.v - expected).abs() < 1e-5, "{} {expected}", r.v);
}

fn spec(category: Category, hidden: Vec<&'static str>, strength: f64) -> Spec {
    Spec { id: 1, category, hidden, strength, repeat: 0, poor: None, recorder: None }
}

#[test]
fn a_seed_gives_the_same_files_and_another_seed_others() {
    let write = |seed: u64, tag: &str| {
        let dir = std::env::temp_dir().join(format!("proof-seed-{}-{tag}", std::process::id()));
        let case = build(&spec(Category::Single, vec!["cogging"], 3.0), seed, true).unwrap();
        let paths = files::write_case(&case, &dir).unwrap();
        let text = |p: &std::path::Path| std::fs::read_to_string(p).unwrap();
        let all = [text(&paths.rig), text(&paths.fit[0]), text(&paths.fit[1]), text(&paths.holdout[0])];
        std::fs::remove_dir_all(&dir).unwrap();
        all
    };
    let first = write(4, "a");
    assert_eq!(first, write(4, "b"));
    assert_ne!(first, write(5, "c"));
}

#[test]
fn a_case_has_the_level_of_its_recordings_and_a_null_none() {
    for (name, strength) in [
        ("stribeck_friction", 3.0),
        ("command_delay", 10.0),
        ("tilt_gravity", 1.0),
        ("command_saturation", 10.0),
    ] {
        let case = build(&spec(Category::Single, vec![name], strength), 8, true).unwrap();
        let reached = case.together.effect / case.together.noise;
        // At most what was asked for; less where the recordings drawn show no more.
        assert!(reached < 1.3 * strength, "{name}: {reached} for {strength}");
        match case.category {
            Category::Single => assert!((reached / case.level).ln().abs() < 1.2, "{name}: {reached}"),
            other => {
                assert!(other == Category::CannotTell && reached < 0.7, "{name}: {reached} is {other:?}")
            }
        }
    }
    let null = build(&spec(Category::Null, vec![], 0.0), 8, true).unwrap();
    assert!(null.together.effect < 1e-2 * null.together.noise, "{:?}", null.together);
}

#[test]
fn loops_return_from_another_start_open_stretches_do_not() {
    let m = Machine::draw(&mut Rng::new(3), Needs { rotary: Some(true), ..Needs::default() }, true);
    let kinds = [super::excite::Kind::Multisine, super::excite::Kind::Triangle];
    let segments = super::excite::programme(&kinds, &m, &mut Rng::new(7));
    assert!(segments[0].control.is_none() && segments[1].control.is_some());
    assert!((segments[1].from + segments[1].length - m.duration).abs() < 1e-9);
    // At the change the loop is asked for where the machine is, then for its own place.
    let away = 0.3 * m.travel;
    let (first, later) =
        (segments[1].reference(0.0, away, m.top_speed), segments[1].reference(1e3, away, m.top_speed));
    assert!((first.0 - away).abs() < 1e-9 && (later.0 - segments[1].drive.reference(1e3).0).abs() < 1e-9);
}

#[test]
fn stamps_err_and_still_increase() {
    use super::clock::Stamping;
    let times: Vec<f64> = (0..5000).map(|i| f64::from(i) * 1.07e-4).collect();
    let off = |stamping: Stamping| {
        let stamps = stamping.of(&times, &mut Rng::new(2));
        assert!(stamps.windows(2).all(|w| w[1] > w[0]), "{stamping:?}");
        stamps.iter().zip(&times).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    assert!(off(Stamping::True) < 1e-6);
    assert!((1e-5..5e-5).contains(&off(Stamping::Noisy(1e-5))));
    assert!((4e-5..6e-5).contains(&off(Stamping::Rounded(1e-4))));
    assert!((9e-5..1.2e-4).contains(&off(Stamping::Fast(2e-4))));
}

#[test]
fn counts_are_lost_one_way_or_both() {
    use super::plant::LostCounts;
    let ends = |both_ways: bool| -> Vec<f64> {
        let mut plant = bare(1.0);
        plant.counts_per_unit = 1000.0;
        plant.lost = Some(LostCounts { burst: 5.0, both_ways, rate: 50.0, above_speed: 0.0 });
        let rows = play(&plant, &open(500.0, 4.0, levels(&[(1.0, 9.0)])));
        rows.windows(2).map(|w| (w[1].reading_error - w[0].reading_error) * 1000.0).collect()
    };
    let (one, both) = (ends(false), ends(true));
    assert!(one.iter().all(|x| *x < 2.0) && one.iter().any(|x| *x < -2.0));
    assert!(both.iter().any(|x| *x > 2.0) && both.iter().any(|x| *x < -2.0));
}

#[test]
fn readings_have_the_given_noise_and_warm_machines_drift() {
    let mut plant = bare(1.0);
    plant.counts_per_unit = 1000.0;
    let mut run = open(500.0, 8.0, Drive::default());
    run.noise_counts = 2.0;
    let errors: Vec<f64> = play(&plant, &run).iter().map(|r| r.counts).collect();
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let sd = (errors.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / errors.len() as f64).sqrt();
    assert!((sd - 2.0).abs() < 0.15, "{sd}");
    plant.gain_drift = Some(super::plant::Drift {
        change: -0.5,
        time_constant: 1.0,
        law: super::plant::DriftLaw::Exponential,
    });
    let mut warm = open(500.0, 1.0, levels(&[(1.0, 9.0)]));
    let cold = play(&plant, &warm).last().unwrap().v;
    warm.warm = 10.0;
    let settled = play(&plant, &warm).last().unwrap().v;
    assert!(settled < 0.51 * warm.times.last().unwrap() && cold > 1.2 * settled, "{cold} {settled}");
}

#[test]
fn each_half_of_a_pair_shows_with_a_missing_friction() {
    // The friction that the rig lacks must not lend its strength to the asymmetry of it.
    for seed in [1, 4] {
        let pair = spec(Category::Pair, vec!["coulomb_friction", "asymmetric_friction"], 10.0);
        let case = build(&pair, seed, true).expect("a machine shows it");
        let asymmetry = case
            .truths
            .iter()
            .filter(|p| p.effect == "asymmetric_friction")
            .map(|p| p.value.abs())
            .fold(0.0, f64::max);
        assert!(asymmetry > 0.2, "seed {seed}: asymmetry {asymmetry}");
    }
}
