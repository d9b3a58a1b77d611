//! Inputs without a design: rounds of some of everything, random multisines, and strokes as in
//! practice.

use super::PlannedRound;
use super::play::Limited;
use device_sim::error::Error;
use experiment::{Input, Limits, Segment, Signal, random_multisine};

/// Strokes of practice: their length in mm, their speed in mm/s, and their part of the time. An
/// epidural is pushed in by 40 to 60 mm in some seconds.
const PRACTICE: [(f64, f64, f64); 2] = [(50.0, 50.0, 0.6), (20.0, 20.0, 0.4)];

/// Part of the device's torque and speed that inputs without a design use: four fifths, less what
/// fixed point rounds up.
const USED: f64 = 0.79;
/// Steps of a staircase.
const STEPS: u8 = 6;

/// Strokes before random multisines, s.
const STROKES_S: f64 = 3.0;

impl Limited {
    /// A round of some of everything.
    pub(super) fn general(&self, why: &str, most_s: f64) -> Result<PlannedRound, Error> {
        let rad = |mm: f64| mm / self.radius_mm();
        let frequencies = vec![3, 5, 9, 14, 21, 32, 47, 68, 97, 139, 197, 281];
        let signals = [
            (self.staircase(rad(5.0), 2.2, 0.4), 0.4),
            (Signal::Ladder { smallest: rad(0.06), ratio: 2.0, steps: 8, speed: rad(12.0) }, 0.35),
            (Signal::Multisine { force: self.sines(self.dry, frequencies.len()), frequencies }, 0.25),
        ];
        self.of_input(&together(signals, most_s), why.to_owned(), None)
    }

    /// The force of each of `lines` sines, N·m: no more than leaves a fifth of the torque when all
    /// of them are at their peaks.
    fn sines(&self, force: f64, lines: usize) -> f64 {
        let (_, _, torque) = self.limits();
        force.min(USED * torque / lines as f64)
    }

    /// A staircase whose fastest step leaves a fifth of the speed; speeds in rad/s.
    fn staircase(&self, slowest: f64, ratio: f64, dwell_s: f64) -> Signal {
        let (_, speed, _) = self.limits();
        let slowest = slowest.min(USED * speed / ratio.powi(i32::from(STEPS) - 1));
        Signal::Staircase { slowest, ratio, steps: STEPS, dwell_s }
    }

    /// A later round of some of everything, with other numbers: other speeds, faster reversals, and
    /// twice the force, all of them `pace` times as much, 0.5 to 1.
    pub(super) fn general_again(&self, why: &str, pace: f64, most_s: f64) -> Result<PlannedRound, Error> {
        let rad = |mm: f64| pace * mm / self.radius_mm();
        let line = |hz: u16| (pace * f64::from(hz)).round() as u16;
        let frequencies = [6, 10, 16, 24, 36, 52, 75, 108, 151, 212, 289, 390].map(line).to_vec();
        let signals = [
            (
                Signal::Multisine {
                    force: self.sines(2.0 * pace * self.dry, frequencies.len()),
                    frequencies,
                },
                0.25,
            ),
            (self.staircase(rad(8.0), 2.0, 0.5), 0.4),
            (Signal::Ladder { smallest: rad(0.1), ratio: 2.0, steps: 8, speed: rad(30.0) }, 0.35),
        ];
        self.of_input(&together(signals, most_s), why.to_owned(), None)
    }

    /// A round of a random multisine.
    pub(super) fn multisine(&self, seed: u64, most_s: f64) -> Result<PlannedRound, Error> {
        let (travel, speed, force) = self.limits();
        // A recording that travels nowhere is refused, so strokes precede the sines.
        let stroke = Signal::Triangle { stroke: 0.1 * travel, speed: 0.1 * speed };
        let strokes = Segment { signal: stroke, seconds: STROKES_S };
        let limits = Limits { travel, back: travel, speed, force };
        let sines = random_multisine(&limits, self.dry, seed, most_s - STROKES_S);
        self.of_input(&Input { segments: vec![strokes, sines] }, "a random multisine".into(), None)
    }

    /// A round as practice moves the needle: in and out at a hand's speeds.
    pub(super) fn practice(&self, seconds: f64) -> Result<PlannedRound, Error> {
        let rad = |mm: f64| mm / self.radius_mm();
        let strokes = |(stroke, speed, part): (f64, f64, f64)| {
            (Signal::Triangle { stroke: rad(stroke), speed: rad(speed) }, part)
        };
        let input = together(PRACTICE.map(strokes), seconds);
        self.of_input(&input, "strokes as in practice, for comparison".into(), None)
    }
}

/// Signals one after the other, each for its part of the time.
fn together<const N: usize>(signals: [(Signal, f64); N], seconds: f64) -> Input {
    let segment = |(signal, part): (Signal, f64)| Segment { signal, seconds: part * seconds };
    Input { segments: signals.map(segment).into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::characterise::programme::TRAVEL_MM;
    use crate::characterise::writer::nominal_rig;
    use crate::characterise::{configuration, scale};
    use control_core::excitation;
    use fixed::types::I16F16;

    /// Whatever the mechanism is, the servo's reference and the torque of the sines stay below four
    /// fifths of the device's limits.
    #[test]
    fn what_is_not_designed_leaves_a_fifth_of_the_limits() {
        let hello = scale(&configuration()).expect("the configuration is sound");
        let limited =
            Limited::new(&nominal_rig(&hello), configuration()).expect("the configuration is sound");
        let rounds =
            [limited.general("", 12.0), limited.general_again("", 1.0, 16.0), limited.practice(12.0)];
        rounds
            .into_iter()
            .for_each(|asked| leaves_a_fifth(&asked.expect("it is within the limits"), &limited));
    }

    fn leaves_a_fifth(asked: &PlannedRound, limited: &Limited) {
        let (_, most_per_s, most_torque) = limited.limits();
        for step in asked.programmes.iter().flat_map(|programme| &programme.steps) {
            let (mm, mm_per_s, torque) = most(&step.excitation.signal);
            assert!(mm <= 0.8 * TRAVEL_MM, "{mm} mm: {:?}", step.excitation.signal);
            assert!(
                mm_per_s <= 0.8 * most_per_s * limited.radius_mm(),
                "{mm_per_s} mm/s: {:?}",
                step.excitation.signal
            );
            assert!(torque <= 0.8e3 * most_torque, "{torque} mN·m: {:?}", step.excitation.signal);
        }
    }

    #[test]
    fn a_stiff_or_a_slow_device_is_asked_for_no_more_than_it_has() {
        let mut config = configuration();
        // 314 mm/s where it is 2,513 by default.
        config.device.limits.max_counts_per_tick = 2;
        let mut rig = nominal_rig(&scale(&config).expect("the configuration is sound"));
        rig.model.coulomb = Some(4.0e-3);
        let limited = Limited::new(&rig, config).expect("the configuration is sound");
        let fastest = limited.limits().1 * limited.radius_mm();
        assert!((fastest - 314.2).abs() < 0.1, "{fastest} mm/s");
        let rounds = [limited.general("", 12.0), limited.general_again("", 1.0, 16.0)];
        rounds
            .into_iter()
            .for_each(|asked| leaves_a_fifth(&asked.expect("it is within the limits"), &limited));
    }

    /// The farthest reference in mm, its largest speed in mm/s, and the largest torque in mN·m, if
    /// all sines are at their peaks.
    fn most(signal: &excitation::Signal) -> (f64, f64, f64) {
        let largest =
            |first: f64, ratio: I16F16, steps: u8| first * ratio.to_num::<f64>().powi(i32::from(steps) - 1);
        match signal {
            excitation::Signal::SpeedStaircase { slowest, ratio, steps, dwell_ms } => {
                let speed = largest(slowest.0.to_num(), *ratio, *steps);
                (speed * f64::from(*dwell_ms) * 1e-3, speed, 0.0)
            }
            excitation::Signal::Triangle { stroke, speed } => (stroke.0.to_num(), speed.0.to_num(), 0.0),
            excitation::Signal::ReversalLadder { smallest, ratio, steps, speed } => {
                (largest(smallest.0.to_num(), *ratio, *steps), speed.0.to_num(), 0.0)
            }
            excitation::Signal::Multisine { torque, frequencies } => {
                let each: f64 = torque.0.to_num();
                (0.0, 0.0, each * frequencies.len() as f64)
            }
            other => panic!("{other:?} is in no such round"),
        }
    }
}
