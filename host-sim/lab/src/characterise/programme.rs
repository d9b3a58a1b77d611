//! The excitations of each recording. Amplitudes follow from the nominal mechanism: dry friction
//! sets the torques, inertia the servo's gains. The held-out recording mixes the same signals with
//! other numbers, so that a model fitted to the others must predict instead of repeating.

use control_core::Plan;
use control_core::excitation::{Excitation, Sequence, Servo, Signal};
use control_core::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres};
use device_setup::servo::servo;
use diagnosis::rig::Rig;
use fixed::types::I16F16;
use std::time::Duration;

/// Furthest that the roller turns from where it began, mm along its surface.
pub(crate) const TRAVEL_MM: f64 = 600.0;
/// The instruction to the person at the device while the motor holds.
const TILT_PROMPT: &str = "tilt the device slowly: level, needle down by 60°, level, up by 60°, level";

/// One recording.
#[derive(Clone, Debug)]
pub struct Programme {
    /// Name of the file.
    pub file: &'static str,
    /// The steps, in order.
    pub steps: Vec<ProgrammeStep>,
}

/// One excitation of a recording.
#[derive(Clone, Debug)]
pub struct ProgrammeStep {
    /// The excitation that the device plays.
    pub excitation: Excitation,
    /// The instruction to a person meanwhile.
    pub prompt: Option<&'static str>,
}

impl ProgrammeStep {
    /// Returns the tilt by a person who follows the prompt, `into` the step, in rad; the virtual
    /// device tilts this way.
    pub fn tilt_at(&self, into: Duration) -> f64 {
        let whole = f64::from(self.excitation.duration_ms) * 1e-3;
        match self.prompt {
            Some(_) => 60_f64.to_radians() * (std::f64::consts::TAU * into.as_secs_f64() / whole).sin(),
            None => 0.0,
        }
    }
}

impl Programme {
    /// Returns the number of steps of each part in order. A part plays without a rest between its
    /// steps: as many as the device takes as one sequence under `plan`, and alone a step with a
    /// prompt, which takes a person's time.
    pub fn parts(&self, plan: &Plan) -> Vec<usize> {
        let mut parts: Vec<usize> = Vec::new();
        let mut sequence = Sequence::new();
        for step in &self.steps {
            let place = sequence.segments().len();
            let follows = place > 0
                && step.prompt.is_none()
                && sequence.upload(place as u8, step.excitation.clone(), plan).is_ok();
            match parts.last_mut().filter(|_| follows) {
                Some(part) => *part += 1,
                None => {
                    parts.push(1);
                    sequence.forget();
                    if step.prompt.is_none() {
                        // One that the device refuses is refused by it, alone.
                        let _ = sequence.upload(0, step.excitation.clone(), plan);
                    }
                }
            }
        }
        parts
    }

    /// Length in s.
    pub fn seconds(&self) -> f64 {
        self.steps.iter().map(|s| f64::from(s.excitation.duration_ms)).sum::<f64>() * 1e-3
    }
}

/// The three recordings for a mechanism whose nominal simulation is `rig`, with a roller of
/// `radius_mm`.
pub fn programmes(rig: &Rig, radius_mm: f64) -> Vec<Programme> {
    let kit = Kit::new(rig, radius_mm);
    vec![
        Programme {
            file: "fit.csv",
            steps: vec![
                kit.staircase(5.0, 2.0, 8, 600, 2),
                kit.triangle(190.0, 40.0, 20_000),
                kit.ladder(0.05, 2.0, 10, 12.0, 12_000),
                kit.multisine(1.0, 8_000),
                kit.ramps(3.0, 500, 4_000),
            ],
        },
        Programme {
            file: "fit2.csv",
            steps: vec![
                kit.tilt(12_000),
                kit.staircase(7.0, 1.9, 8, 500, 2),
                kit.triangle(240.0, 25.0, 20_000),
                kit.ladder(0.07, 2.1, 9, 8.0, 12_000),
                kit.multisine(0.7, 6_000),
            ],
        },
        Programme {
            file: "holdout.csv",
            steps: vec![
                kit.triangle(150.0, 60.0, 12_000),
                kit.staircase(6.0, 2.2, 7, 550, 2),
                kit.ladder(0.06, 1.9, 10, 10.0, 10_000),
                kit.multisine(0.85, 6_000),
                kit.ramps(2.5, 400, 3_000),
                kit.tilt(10_000),
            ],
        },
    ]
}

/// The quantities that determine the amplitudes.
struct Kit {
    servo: Servo,
    /// Nominal dry friction in mN·m.
    dry_mnm: f64,
}

impl Kit {
    fn new(rig: &Rig, radius_mm: f64) -> Self {
        Self {
            servo: servo(rig.model.inertia, radius_mm),
            dry_mnm: rig.model.coulomb.unwrap_or(4.0e-4).max(1.0e-4) * 1e3,
        }
    }

    fn step(&self, signal: Signal, duration_ms: u32) -> ProgrammeStep {
        let travel = Millimetres(I16F16::from_num(TRAVEL_MM));
        let excitation = Excitation { signal, duration_ms, servo: self.servo, travel, compensated: false };
        ProgrammeStep { excitation, prompt: None }
    }

    fn staircase(&self, slowest: f64, ratio: f64, steps: u8, dwell_ms: u16, rounds: u32) -> ProgrammeStep {
        let signal = Signal::SpeedStaircase {
            slowest: MillimetresPerSecond(I16F16::from_num(slowest)),
            ratio: I16F16::from_num(ratio),
            steps,
            dwell_ms,
        };
        self.step(signal, 2 * rounds * u32::from(steps) * u32::from(dwell_ms))
    }

    fn triangle(&self, stroke: f64, speed: f64, duration_ms: u32) -> ProgrammeStep {
        let signal = Signal::Triangle {
            stroke: Millimetres(I16F16::from_num(stroke)),
            speed: MillimetresPerSecond(I16F16::from_num(speed)),
        };
        self.step(signal, duration_ms)
    }

    fn ladder(&self, smallest: f64, ratio: f64, steps: u8, speed: f64, duration_ms: u32) -> ProgrammeStep {
        let signal = Signal::ReversalLadder {
            smallest: Millimetres(I16F16::from_num(smallest)),
            ratio: I16F16::from_num(ratio),
            steps,
            speed: MillimetresPerSecond(I16F16::from_num(speed)),
        };
        self.step(signal, duration_ms)
    }

    /// Twelve sines, each of `share` of the dry friction, from below the servo to where a delay and
    /// a lag part.
    fn multisine(&self, share: f64, duration_ms: u32) -> ProgrammeStep {
        let frequencies = [5, 9, 14, 21, 32, 47, 68, 97, 139, 197, 281, 397].into_iter().collect();
        let torque = MillinewtonMetres(I16F16::from_num(share * self.dry_mnm));
        self.step(Signal::Multisine { torque, frequencies }, duration_ms)
    }

    /// Ramps to `times` the dry friction.
    fn ramps(&self, times: f64, ramp_ms: u16, duration_ms: u32) -> ProgrammeStep {
        let torque = MillinewtonMetres(I16F16::from_num(times * self.dry_mnm));
        self.step(Signal::BreakawayRamps { torque, ramp_ms }, duration_ms)
    }

    /// A slow triangle while a person tilts the device: a motor that moves shows the weight, one
    /// that sticks hides it.
    fn tilt(&self, duration_ms: u32) -> ProgrammeStep {
        ProgrammeStep { prompt: Some(TILT_PROMPT), ..self.triangle(30.0, 30.0, duration_ms) }
    }
}
