//! Inputs as excitations of the device, within its limits.

use super::{PlannedRound, in_words};
use crate::characterise;
use crate::characterise::programme::{Programme, ProgrammeStep, TRAVEL_MM};
use control_core::excitation::{self, Excitation, Servo};
use control_core::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres};
use control_core::{Config, Device, TICK_HZ};
use device_setup::servo::{on_roller, servo};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use experiment::{Design, Input, Segment, Signal};
use fixed::types::I16F16;
use std::f64::consts::TAU;

/// Largest speed of an input along the roller, mm/s: near the fastest steps of `characterise`, 640
/// and 680 mm/s.
const SPEED_MM_PER_S: f64 = 650.0;
/// The shortest way between two reversals that a device plays, mm.
const SHORTEST_MM: f64 = 0.0101;

/// A device's limits, and what turns an input into excitations within them.
pub(super) struct Limited {
    config: Config,
    radius_mm: f64,
    torque: f64,
    /// The fastest input along the roller, mm/s.
    speed_mm_per_s: f64,
    servo: Servo,
    /// Dry friction, N·m.
    pub(super) dry: f64,
}

impl Limited {
    pub(super) fn new(rig: &Rig, config: Config) -> Result<Self, Error> {
        let hello = characterise::scale(&config)?;
        let radius_mm = hello.roller_radius_mm;
        Ok(Self {
            radius_mm,
            torque: config.device.limits.torque.0.to_num::<f64>() * 1e-3,
            speed_mm_per_s: SPEED_MM_PER_S.min(fastest_mm_per_s(&config.device, radius_mm)),
            servo: servo(rig.model.inertia, radius_mm),
            dry: rig.model.coulomb.unwrap_or(4.0e-4),
            config,
        })
    }

    pub(super) fn radius_mm(&self) -> f64 {
        self.radius_mm
    }

    /// Travel in rad, speed in rad/s and torque in N·m.
    pub(super) fn limits(&self) -> (f64, f64, f64) {
        (TRAVEL_MM / self.radius_mm, self.speed_mm_per_s / self.radius_mm, self.torque)
    }

    /// A round of a designed input.
    pub(super) fn designed(&self, design: Design) -> Result<PlannedRound, Error> {
        let why = design.chosen.nearest().map_or(String::new(), |pair| {
            format!(
                "of {} inputs it best tells {} rivals apart; the nearest pair, {} and {}, by {:.0} nats",
                design.tried.0,
                design.case.rivals.len(),
                pair.truth,
                pair.rival,
                pair.nats
            )
        });
        let input = design.chosen.input.clone();
        // The predictions, and with them the limits, are of the design's own servo.
        let servo = on_roller(design.servo, self.radius_mm);
        self.of_input(&input, why, Some((Box::new(design), servo)))
    }

    /// An input twice: once to fit, once with other numbers to judge.
    pub(super) fn of_input(
        &self,
        input: &Input,
        why: String,
        design: Option<(Box<Design>, Servo)>,
    ) -> Result<PlannedRound, Error> {
        let (design, servo) = design.map_or((None, self.servo), |(design, servo)| (Some(design), servo));
        let programme = |file, input: &Input| {
            let steps = input.segments.iter().map(|segment| self.step(segment, servo)).collect();
            Programme { file, steps }
        };
        let programmes = vec![programme("fit.csv", input), programme("holdout.csv", &input.varied())];
        self.checked(PlannedRound { programmes, words: in_words(input), why, design })
    }

    /// The same, if the device may play it: it is refused here, before anything moves.
    pub(super) fn checked(&self, asked: PlannedRound) -> Result<PlannedRound, Error> {
        characterise::check(&self.config, &asked.programmes)?;
        Ok(asked)
    }

    fn step(&self, segment: &Segment, servo: Servo) -> ProgrammeStep {
        let mm = |rad: f64| I16F16::saturating_from_num(rad * self.radius_mm);
        let torque = |newton_metres: f64| MillinewtonMetres(I16F16::saturating_from_num(newton_metres * 1e3));
        let ms = |seconds: f64| (seconds * 1e3).round().clamp(0.0, 65_535.0) as u16;
        let signal = match &segment.signal {
            Signal::Staircase { slowest, ratio, steps, dwell_s } => excitation::Signal::SpeedStaircase {
                slowest: MillimetresPerSecond(mm(*slowest)),
                ratio: I16F16::saturating_from_num(*ratio),
                steps: *steps,
                dwell_ms: ms(*dwell_s),
            },
            Signal::Triangle { stroke, speed } => excitation::Signal::Triangle {
                stroke: Millimetres(mm(*stroke)),
                speed: MillimetresPerSecond(mm(*speed)),
            },
            Signal::Ladder { smallest, ratio, steps, speed } => excitation::Signal::ReversalLadder {
                // A fine encoder shows shorter ways than a device plays.
                smallest: Millimetres(I16F16::saturating_from_num(
                    (*smallest * self.radius_mm).max(SHORTEST_MM),
                )),
                ratio: I16F16::saturating_from_num(*ratio),
                steps: *steps,
                speed: MillimetresPerSecond(mm(*speed)),
            },
            Signal::Multisine { force, frequencies } => excitation::Signal::Multisine {
                torque: torque(*force),
                frequencies: frequencies.iter().copied().take(excitation::MAX_LINES).collect(),
            },
            Signal::Ramps { force, ramp_s } => {
                excitation::Signal::BreakawayRamps { torque: torque(*force), ramp_ms: ms(*ramp_s) }
            }
            Signal::Hold => excitation::Signal::Hold,
        };
        let excitation = Excitation {
            signal,
            duration_ms: (segment.seconds * 1e3).round() as u32,
            servo,
            travel: Millimetres(I16F16::from_num(TRAVEL_MM)),
            compensated: false,
        };
        ProgrammeStep { excitation, prompt: None }
    }
}

/// The fastest that a device may turn, mm/s along its roller: faster, its encoder seems to jump.
fn fastest_mm_per_s(device: &Device, radius_mm: f64) -> f64 {
    let counts_per_s = f64::from(device.limits.max_counts_per_tick) * f64::from(TICK_HZ);
    TAU * radius_mm * counts_per_s / f64::from(device.counts_per_turn)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::characterise::configuration;
    use crate::characterise::writer::nominal_rig;
    use crate::settle::{Plant, Subject};

    fn limited() -> Limited {
        let hello = characterise::scale(&configuration()).expect("the configuration is sound");
        Limited::new(&nominal_rig(&hello), configuration()).expect("the configuration is sound")
    }

    #[test]
    fn an_input_beyond_the_torque_ceiling_is_refused() {
        let limited = limited();
        let signal = Signal::Ramps { force: 1.1 * limited.torque, ramp_s: 0.5 };
        let input = Input { segments: vec![Segment { signal, seconds: 2.0 }] };
        let refused = limited.of_input(&input, String::new(), None).err().expect("it is refused");
        assert!(refused.to_string().starts_with("this excitation is refused: "), "{refused}");
    }

    #[test]
    fn an_input_beyond_the_travel_is_refused() {
        let limited = limited();
        let (travel, speed, _) = limited.limits();
        let signal = Signal::Triangle { stroke: 1.2 * travel, speed };
        let input = Input { segments: vec![Segment { signal, seconds: 2.0 }] };
        assert!(limited.of_input(&input, String::new(), None).is_err());
        let general = limited.general("", 12.0).expect("the first round is within the limits");
        let seconds: f64 = general.programmes.iter().map(Programme::seconds).sum();
        assert!((seconds - 24.0).abs() < 0.01, "{seconds} s");
    }

    #[test]
    fn a_ladder_of_a_fine_encoder_begins_with_what_the_device_plays() {
        let limited = limited();
        let signal = Signal::Ladder { smallest: 1e-4, ratio: 2.0, steps: 8, speed: 1.0 };
        let input = Input { segments: vec![Segment { signal, seconds: 4.0 }] };
        limited.of_input(&input, String::new(), None).expect("the device plays it");
    }

    /// Plays `input` as it is and varied on a machine whose motor gives `gain` N·m for a DAC step,
    /// with `effects` concealed in it.
    fn played(input: &Input, gain: f64, effects: &str) -> Result<(), String> {
        let text = format!(
            "format = 1\nname = \"concealed\"\nkind = \"rotary\"\n\
             [model]\ninertia = 1.4e-6\nviscous = 1.1e-6\ncoulomb = 4.2e-4\n\
             [actuator]\ngain = {gain:e}\ncommand_unit = \"dac\"\nlimit = 2047.0\n\
             [encoder]\ncounts_per_unit = 636.6197772990716\nturn = 6.283185307179586\n{effects}"
        );
        let rig = Rig::parse(&text, "concealed").expect("a rig");
        let mut subject = Subject::Virtual(Box::new(Plant { rig, file: "concealed".into() }));
        let asked = limited().of_input(input, String::new(), None).expect("it is within the limits");
        let tracks = subject.play(&asked.programmes, |_| {});
        tracks.map(drop).map_err(|error| error.to_string())
    }

    fn multisine(newton_metres: f64, frequencies: [u16; 12]) -> Input {
        let signal = Signal::Multisine { force: newton_metres, frequencies: frequencies.into() };
        Input { segments: vec![Segment { signal, seconds: 2.0 }] }
    }

    const GAIN: f64 = 1.4e-5;

    /// The motor stops at a reversal, its load flies on through the gap and knocks the motor on
    /// against its torque.
    #[test]
    fn a_load_that_knocks_in_its_gap_is_no_swapped_lead() {
        for (coast, contact, ratio) in [(237.8, 186.5, 0.87), (150.0, 100.0, 1.0), (240.0, 250.0, 0.4)] {
            let gap = format!(
                "[[effect]]\nname = \"backlash\"\ncoefficients = {{ inertia_ratio = {:e} }}\n\
                 shape = {{ gap = 0.0422, coast = {coast}, contact_hz = {contact}, ratio = {ratio}, dry = 285.7, \
                 viscous = 0.857, per_command = 10.05 }}\n",
                ratio * GAIN
            );
            let speeds = Signal::Staircase { slowest: 0.5, ratio: 2.2, steps: 6, dwell_s: 0.4 };
            let reversals = Signal::Ladder { smallest: 0.006, ratio: 2.0, steps: 8, speed: 1.2 };
            let segment = |signal, seconds| Segment { signal, seconds };
            let input = Input { segments: vec![segment(speeds, 4.8), segment(reversals, 4.2)] };
            assert_eq!(played(&input, GAIN, &gap), Ok(()), "{contact} Hz, {ratio}");
        }
    }

    /// A torque that swings faster than its delay drives the motor against what is asked for at
    /// that moment.
    #[test]
    fn a_motor_that_obeys_late_is_no_swapped_lead() {
        let frequencies = [5, 8, 11, 17, 24, 36, 59, 76, 116, 177, 286, 421];
        for delay in [0.001, 0.00285, 0.004] {
            let late = format!("[[effect]]\nname = \"command_delay\"\nshape = {{ delay = {delay} }}\n");
            assert_eq!(played(&multisine(1.33e-3, frequencies), GAIN, &late), Ok(()), "{delay} s");
        }
    }

    /// An unbalanced roller rests where sines of up to half a kilohertz shake it over one edge of
    /// the encoder.
    #[test]
    fn a_motor_shaken_over_one_count_is_no_dead_channel() {
        let late = "[[effect]]\nname = \"command_delay\"\nshape = { delay = 0.00186 }\n\
                    [[effect]]\nname = \"mass_imbalance\"\nshape = { turn = 6.283185307179586 }\n\
                    coefficients = { cos_1 = 0.00014, sin_1 = -5.46e-5 }\n";
        let frequencies = [62, 70, 88, 110, 126, 156, 187, 238, 282, 336, 414, 492];
        assert_eq!(played(&multisine(1.31e-3, frequencies), GAIN, late), Ok(()));
    }

    /// Every kind of signal with the servo that follows it: the motor runs away from where it
    /// should be.
    #[test]
    fn swapped_leads_end_an_input_as_what_they_are() {
        let limited = limited();
        let general = [
            Signal::Staircase { slowest: 0.5, ratio: 2.2, steps: 6, dwell_s: 0.4 },
            Signal::Triangle { stroke: 23.7, speed: 23.7 },
            Signal::Ladder { smallest: 0.006, ratio: 2.0, steps: 8, speed: 1.2 },
            Signal::Multisine { force: limited.dry, frequencies: vec![3, 5, 9, 14, 21, 32] },
            Signal::Ramps { force: 3.0 * limited.dry, ramp_s: 0.25 },
        ];
        for signal in general {
            let input = Input { segments: vec![Segment { signal: signal.clone(), seconds: 2.0 }] };
            let ended = played(&input, -GAIN, "").expect_err("it runs away");
            assert!(ended.contains("sped up against the motor"), "{signal:?}: {ended}");
        }
    }
}
