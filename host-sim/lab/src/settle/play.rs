//! Inputs of the design as excitations of the device, within its limits.

use super::{Asked, in_words};
use crate::characterise;
use crate::characterise::programme::{Programme, ProgrammeStep, TRAVEL_MM};
use control_core::excitation::{self, Excitation, Servo};
use control_core::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres};
use control_core::{Config, Device, TICK_HZ};
use device_setup::servo::{on_roller, servo};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use experiment::{Design, Input, Limits, Segment, Signal, random_multisine};
use fixed::types::I16F16;
use std::f64::consts::TAU;

/// Largest speed of an input along the roller, mm/s: near the fastest steps of `characterise`, 640
/// and 680 mm/s.
const SPEED_MM_PER_S: f64 = 650.0;

/// Strokes of practice: their length in mm, their speed in mm/s, and their part of the time. An
/// epidural is pushed in by 40 to 60 mm in some seconds.
const PRACTICE: [(f64, f64, f64); 2] = [(50.0, 50.0, 0.6), (20.0, 20.0, 0.4)];

/// Part of the device's torque and speed that inputs without a design use: four fifths, less what
/// fixed point rounds up.
const USED: f64 = 0.79;
/// Steps of a staircase.
const STEPS: u8 = 6;
/// The shortest way between two reversals that a device plays, mm.
const SHORTEST_MM: f64 = 0.0101;

/// Strokes before random multisines, s.
const STROKES_S: f64 = 3.0;

/// A device's limits, and what turns an input into excitations within them.
pub(super) struct Limited {
    config: Config,
    radius_mm: f64,
    torque: f64,
    /// The fastest input along the roller, mm/s.
    speed_mm_per_s: f64,
    servo: Servo,
    dry: f64,
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

    /// A round of some of everything.
    pub(super) fn general(&self, why: &str, most_s: f64) -> Result<Asked, Error> {
        let rad = |mm: f64| mm / self.radius_mm;
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
        force.min(USED * self.torque / lines as f64)
    }

    /// A staircase whose fastest step leaves a fifth of the speed; speeds in rad/s.
    fn staircase(&self, slowest: f64, ratio: f64, dwell_s: f64) -> Signal {
        let (_, speed, _) = self.limits();
        let slowest = slowest.min(USED * speed / ratio.powi(i32::from(STEPS) - 1));
        Signal::Staircase { slowest, ratio, steps: STEPS, dwell_s }
    }

    /// A later round of some of everything, with other numbers: other speeds, faster reversals, and
    /// twice the force, all of them `pace` times as much, 0.5 to 1.
    pub(super) fn general_again(&self, why: &str, pace: f64, most_s: f64) -> Result<Asked, Error> {
        let rad = |mm: f64| pace * mm / self.radius_mm;
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
    pub(super) fn multisine(&self, seed: u64, most_s: f64) -> Result<Asked, Error> {
        let (travel, speed, force) = self.limits();
        // A recording that travels nowhere is refused, so strokes precede the sines.
        let stroke = Signal::Triangle { stroke: 0.1 * travel, speed: 0.1 * speed };
        let strokes = Segment { signal: stroke, seconds: STROKES_S };
        let limits = Limits { travel, back: travel, speed, force };
        let sines = random_multisine(&limits, self.dry, seed, most_s - STROKES_S);
        self.of_input(&Input { segments: vec![strokes, sines] }, "a random multisine".into(), None)
    }

    /// A round as practice moves the needle: in and out at a hand's speeds.
    pub(super) fn practice(&self, seconds: f64) -> Result<Asked, Error> {
        let rad = |mm: f64| mm / self.radius_mm;
        let strokes = |(stroke, speed, part): (f64, f64, f64)| {
            (Signal::Triangle { stroke: rad(stroke), speed: rad(speed) }, part)
        };
        let input = together(PRACTICE.map(strokes), seconds);
        self.of_input(&input, "strokes as in practice, for comparison".into(), None)
    }

    /// A round of a designed input.
    pub(super) fn designed(&self, design: Design) -> Result<Asked, Error> {
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
    fn of_input(
        &self,
        input: &Input,
        why: String,
        design: Option<(Box<Design>, Servo)>,
    ) -> Result<Asked, Error> {
        let (design, servo) = design.map_or((None, self.servo), |(design, servo)| (Some(design), servo));
        let programme = |file, input: &Input| {
            let steps = input.segments.iter().map(|segment| self.step(segment, servo)).collect();
            Programme { file, steps }
        };
        let programmes = vec![programme("fit.csv", input), programme("holdout.csv", &input.varied())];
        self.checked(Asked { programmes, words: in_words(input), why, design })
    }

    /// The same, if the device may play it: it is refused here, before anything moves.
    pub(super) fn checked(&self, asked: Asked) -> Result<Asked, Error> {
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

/// Signals one after the other, each for its part of the time.
fn together<const N: usize>(signals: [(Signal, f64); N], seconds: f64) -> Input {
    let segment = |(signal, part): (Signal, f64)| Segment { signal, seconds: part * seconds };
    Input { segments: signals.map(segment).into() }
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

    /// Whatever the mechanism is, the servo's reference and the torque of the sines stay below four
    /// fifths of the device's limits.
    #[test]
    fn what_is_not_designed_leaves_a_fifth_of_the_limits() {
        let limited = limited();
        let rounds =
            [limited.general("", 12.0), limited.general_again("", 1.0, 16.0), limited.practice(12.0)];
        rounds
            .into_iter()
            .for_each(|asked| leaves_a_fifth(&asked.expect("it is within the limits"), &limited));
    }

    fn leaves_a_fifth(asked: &Asked, limited: &Limited) {
        for step in asked.programmes.iter().flat_map(|programme| &programme.steps) {
            let (mm, mm_per_s, torque) = most(&step.excitation.signal);
            assert!(mm <= 0.8 * TRAVEL_MM, "{mm} mm: {:?}", step.excitation.signal);
            assert!(
                mm_per_s <= 0.8 * limited.speed_mm_per_s,
                "{mm_per_s} mm/s: {:?}",
                step.excitation.signal
            );
            assert!(torque <= 0.8e3 * limited.torque, "{torque} mN·m: {:?}", step.excitation.signal);
        }
    }

    #[test]
    fn a_stiff_or_a_slow_device_is_asked_for_no_more_than_it_has() {
        let mut config = configuration();
        // 314 mm/s where it is 2,513 by default.
        config.device.limits.max_counts_per_tick = 2;
        let mut rig = nominal_rig(&characterise::scale(&config).expect("the configuration is sound"));
        rig.model.coulomb = Some(4.0e-3);
        let limited = Limited::new(&rig, config).expect("the configuration is sound");
        assert!((limited.speed_mm_per_s - 314.2).abs() < 0.1, "{} mm/s", limited.speed_mm_per_s);
        let rounds = [limited.general("", 12.0), limited.general_again("", 1.0, 16.0)];
        rounds
            .into_iter()
            .for_each(|asked| leaves_a_fifth(&asked.expect("it is within the limits"), &limited));
    }

    #[test]
    fn a_ladder_of_a_fine_encoder_begins_with_what_the_device_plays() {
        let limited = limited();
        let signal = Signal::Ladder { smallest: 1e-4, ratio: 2.0, steps: 8, speed: 1.0 };
        let input = Input { segments: vec![Segment { signal, seconds: 4.0 }] };
        limited.of_input(&input, String::new(), None).expect("the device plays it");
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
