//! The maps of the command that no plant of the generator has, and the counts that are lost: each
//! map is written here forward, from its definition, and has to make the recorded command of the
//! concealed one.

use super::banded_recording::State;
use super::conceal::{Changed, Concealed, conceal};
use super::rig_file::RigFile;
use super::shapes::HiddenLaw;
use crate::dynamics::recording::Recording;

const ROW_S: f64 = 2e-3;
const ROWS: usize = 20_000;
const COUNTS: f64 = 1e6;

/// A recording that swings over 8 rad under commands between -2 and 2.
fn recording() -> Recording {
    let time: Vec<f64> = (0..ROWS).map(|i| i as f64 * ROW_S).collect();
    let place = |t: f64| 4.0 * (0.7 * t).sin();
    Recording {
        command: time.iter().map(|t| 1.5 * (4.0 * t).sin() + 0.5 * (11.0 * t + 0.4).sin()).collect(),
        counts: time.iter().map(|t| (COUNTS * place(*t)).round()).collect(),
        tilt: vec![0.0; ROWS],
        force: vec![0.0; ROWS],
        time,
    }
}

fn concealed(law: HiddenLaw, size: f64) -> (Recording, Changed, f64) {
    let original = recording();
    let text = "kind = \"rotary\"\n[model]\ninertia = 0.02\nviscous = 0.05\ncoulomb = 0.1\n[actuator]\ngain = 0.5\n\
        [encoder]\ncounts_per_unit = 1e6\nabsolute = true\n";
    let rig = RigFile::parse(text).expect("a rig");
    let state = State::of(&original, &rig);
    let strongest = original.command.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
    let effect = Concealed { law, size, fast: state.fast, travel: state.travel(), strongest, seed: 3 };
    let changed = conceal(&effect, &original, &state, &rig, 0);
    (original, changed, strongest)
}

/// Checks a map without a memory, whose argument is the concealed command.
fn assert_mapped(name: &str, (original, changed): (&Recording, &Changed), map: impl Fn(f64) -> f64) {
    let mut moved = 0.0_f64;
    for (u, sent) in original.command.iter().zip(&changed.command) {
        assert!((map(*sent) - u).abs() < 1e-9, "{name}: {} of {sent}, not {u}", map(*sent));
        moved = moved.max((sent - u).abs());
    }
    assert!(moved > 0.05, "{name}: the command is hardly another, by {moved} at most");
}

#[test]
fn a_soft_clip_is_inverted() {
    for (power, size) in [(2.0, 0.8), (4.0, 2.0), (8.0, 5.0)] {
        let (original, changed, strongest) = concealed(HiddenLaw::Clip(power), size);
        let limit = strongest * (1.0 + 1.0 / size);
        let clipped = |sent: f64| sent / (1.0 + (sent.abs() / limit).powf(power)).powf(1.0 / power);
        assert_mapped("clip", (&original, &changed), clipped);
    }
}

#[test]
fn a_dead_band_that_leaks_is_inverted() {
    for leak in [0.1, 0.4] {
        let (original, changed, _) = concealed(HiddenLaw::Deadband(leak), 0.3);
        let passed = |sent: f64| leak * sent + (1.0 - leak) * (sent - sent.clamp(-0.3, 0.3));
        assert_mapped("deadband", (&original, &changed), passed);
    }
}

/// Copper of one time constant, heated by the square of the current that the drive was asked for,
/// loses the part `loss` of the gain at the mean heat.
#[test]
fn a_drive_that_heats_with_its_current_is_inverted() {
    let (loss, seconds) = (0.1, 5.0);
    let (original, changed, _) = concealed(HiddenLaw::Heating { seconds, by_current: true }, loss);
    let mean = original.command.iter().map(|u| u * u).sum::<f64>() / ROWS as f64;
    let (mut warmth, mut hottest) = (0.0, 0.0_f64);
    for (u, sent) in original.command.iter().zip(&changed.command) {
        let force = sent * (1.0 - loss * warmth);
        assert!((force - u).abs() < 1e-3, "{force} of {sent}, not {u}, at a warmth of {warmth}");
        // Fine steps of the heat's own equation: the current is held over a row.
        for _ in 0..10 {
            warmth += (sent * sent / mean - warmth) / seconds * ROW_S / 10.0;
        }
        hottest = hottest.max(warmth);
    }
    assert!((1.0..1.5).contains(&hottest), "a warmth of {hottest} is the limit of what is concealed");
}

#[test]
fn counts_are_lost_against_the_motion_as_often_as_drawn() {
    let (burst, rate, above) = (40.0, 2.0, 1.0);
    let (original, changed, _) = concealed(HiddenLaw::LostCounts { rate, above }, burst);
    let lost: Vec<f64> = original.counts.iter().zip(&changed.counts).map(|(a, b)| a - b).collect();
    let speed = |t: f64| 2.8 * (0.7 * t).cos();
    let (mut bursts, mut fast_s) = (0, 0.0);
    for i in 1..ROWS {
        let (step, v) = (lost[i] - lost[i - 1], speed(original.time[i]));
        fast_s += if v.abs() > above { ROW_S } else { 0.0 };
        if step != 0.0 {
            bursts += 1;
            assert!(v.abs() > 0.99 * above, "{step} counts at {v} rad/s");
            assert!(step * v > 0.0, "{step} counts at {v} rad/s are won");
            assert!((0.6 * burst - 1.0..=1.4 * burst + 1.0).contains(&step.abs()), "{step} counts at once");
        }
    }
    // Four standard deviations of a Poisson number.
    let expected = rate * fast_s;
    assert!((f64::from(bursts) - expected).abs() < 4.0 * expected.sqrt(), "{bursts} for {expected}");
}
