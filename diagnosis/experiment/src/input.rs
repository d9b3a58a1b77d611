//! Inputs: signals one after the other, those that the device can play
//! (`control_core::excitation`), in the coordinate of a rig.

use crate::case::Limits;
use std::f64::consts::{PI, TAU};

/// Natural frequency of the servo that follows a reference, rad/s: a device's speed estimate is 6
/// ms late, which leaves it well damped.
const SERVO_RAD_PER_S: f64 = 50.0;
/// Its damping ratio.
const SERVO_DAMPING_RATIO: f64 = 0.9;

/// A soft position servo: force = stiffness·(r − q) + damping·(ṙ − q̇).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo {
    /// N·m/rad or N/m.
    pub stiffness: f64,
    /// N·m·s/rad or N·s/m.
    pub damping: f64,
}

impl Servo {
    /// The servo for an inertia in kg·m² or kg.
    pub fn of(inertia: f64) -> Self {
        Self::of_frequency(inertia, SERVO_RAD_PER_S)
    }

    /// The same for a machine with limits, softer if a reversal at its speed would take more than
    /// its force.
    pub(crate) fn within(inertia: f64, limits: &Limits) -> Self {
        let reversal = 4.0 * SERVO_DAMPING_RATIO * inertia * limits.speed;
        Self::of_frequency(inertia, SERVO_RAD_PER_S.min(limits.force / reversal))
    }

    fn of_frequency(inertia: f64, rad_per_s: f64) -> Self {
        Self {
            stiffness: inertia * rad_per_s * rad_per_s,
            damping: 2.0 * SERVO_DAMPING_RATIO * inertia * rad_per_s,
        }
    }
}

/// A signal. Those with a reference need the servo; the others add a force while the servo holds
/// the place of the start.
#[derive(Clone, Debug, PartialEq)]
pub enum Signal {
    /// Constant speeds, each there and back, each `ratio` times the one before.
    Staircase {
        /// The first speed, rad/s or m/s.
        slowest: f64,
        /// From one speed to the next.
        ratio: f64,
        /// Number of speeds.
        steps: u8,
        /// Time at a speed, one way, s.
        dwell_s: f64,
    },
    /// There and back at one speed.
    Triangle {
        /// From one end to the other, rad or m.
        stroke: f64,
        /// rad/s or m/s.
        speed: f64,
    },
    /// Reversals of growing amplitude at one speed.
    Ladder {
        /// The first amplitude, rad or m.
        smallest: f64,
        /// From one amplitude to the next.
        ratio: f64,
        /// Number of amplitudes.
        steps: u8,
        /// rad/s or m/s.
        speed: f64,
    },
    /// Sines of equal force with Schroeder's phases.
    Multisine {
        /// Amplitude of each sine, N·m or N.
        force: f64,
        /// Hz.
        frequencies: Vec<u16>,
    },
    /// A force that rises from zero and falls back to it at once, there and back.
    Ramps {
        /// The largest force, N·m or N.
        force: f64,
        /// From zero to the largest, s.
        ramp_s: f64,
    },
    /// Nothing but the servo at the place of the start.
    Hold,
}

/// A signal for a time.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// The signal.
    pub signal: Signal,
    /// Its length, s.
    pub seconds: f64,
}

/// Segments, one after the other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Input {
    /// In order.
    pub segments: Vec<Segment>,
}

/// The target at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Target {
    /// From the place of the start, rad or m.
    pub(crate) position: f64,
    /// rad/s or m/s.
    pub(crate) speed: f64,
    /// In addition to the servo's, N·m or N.
    pub(crate) force: f64,
}

impl Signal {
    /// Returns the target at a time from the start of the signal.
    pub(crate) fn at(&self, time: f64) -> Target {
        match self {
            Self::Staircase { slowest, ratio, steps, dwell_s } => {
                let whole = time.rem_euclid(2.0 * dwell_s * f64::from(*steps));
                let step = (whole / (2.0 * dwell_s)).floor();
                back_and_forth(slowest * ratio.powf(step), *dwell_s, whole - 2.0 * dwell_s * step)
            }
            Self::Triangle { stroke, speed } => {
                let leg_s = stroke / speed;
                back_and_forth(*speed, leg_s, time.rem_euclid(2.0 * leg_s))
            }
            Self::Ladder { smallest, ratio, steps, speed } => {
                let leg_s = |step: u8| smallest * ratio.powi(i32::from(step)) / speed;
                let whole: f64 = (0..*steps).map(|step| 2.0 * leg_s(step)).sum();
                let mut time = time.rem_euclid(whole);
                for step in 0..*steps {
                    if time < 2.0 * leg_s(step) {
                        return back_and_forth(*speed, leg_s(step), time);
                    }
                    time -= 2.0 * leg_s(step);
                }
                Target::default()
            }
            Self::Multisine { force, frequencies } => {
                let count = frequencies.len().max(1) as f64;
                let line = |(i, hertz): (usize, &u16)| {
                    let phase = PI * (i * i) as f64 / count;
                    force * (TAU * f64::from(*hertz) * time + phase).sin()
                };
                Target { force: frequencies.iter().enumerate().map(line).sum(), ..Target::default() }
            }
            Self::Ramps { force, ramp_s } => {
                let whole = time.rem_euclid(2.0 * ramp_s);
                let part = whole.rem_euclid(*ramp_s) / ramp_s;
                let sign = if whole < *ramp_s { 1.0 } else { -1.0 };
                Target { force: sign * force * part, ..Target::default() }
            }
            Self::Hold => Target::default(),
        }
    }

    /// True if the signal moves the axis whatever its friction: recordings at rest are refused.
    pub fn travels(&self) -> bool {
        matches!(self, Self::Staircase { .. } | Self::Triangle { .. })
    }

    /// The signal in words; `unit` is that of the coordinate, `force` that of the force.
    pub fn in_words(&self, unit: &str, force: &str) -> String {
        match self {
            Self::Staircase { slowest, ratio, steps, .. } => format!(
                "staircase of {steps} speeds, {} to {} {unit}/s",
                short(*slowest),
                short(slowest * ratio.powi(i32::from(*steps) - 1))
            ),
            Self::Triangle { stroke, speed } => {
                format!("strokes of {} {unit} at {} {unit}/s", short(*stroke), short(*speed))
            }
            Self::Ladder { smallest, ratio, steps, speed } => format!(
                "ladder of reversals, {} to {} {unit} at {} {unit}/s",
                short(*smallest),
                short(smallest * ratio.powi(i32::from(*steps) - 1)),
                short(*speed)
            ),
            Self::Multisine { force: each, frequencies } => format!(
                "multisine of {} lines, {} to {} Hz, {} {force} each",
                frequencies.len(),
                frequencies.first().unwrap_or(&0),
                frequencies.last().unwrap_or(&0),
                short(*each)
            ),
            Self::Ramps { force: most, .. } => format!("ramps of force to {} {force}", short(*most)),
            Self::Hold => "hold".to_owned(),
        }
    }
}

/// Out for `leg_s` at `speed` and back.
fn back_and_forth(speed: f64, leg_s: f64, time: f64) -> Target {
    let (position, speed) =
        if time < leg_s { (speed * time, speed) } else { (speed * (2.0 * leg_s - time), -speed) };
    Target { position, speed, force: 0.0 }
}

/// A number with three digits.
pub(crate) fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let decimals = (2.0 - x.abs().log10().floor()).clamp(0.0, 9.0) as usize;
    let text = format!("{x:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

impl Input {
    /// Its length, s.
    pub fn seconds(&self) -> f64 {
        self.segments.iter().map(|segment| segment.seconds).sum()
    }

    /// The input in words.
    pub fn in_words(&self, unit: &str, force: &str) -> String {
        let one = |s: &Segment| format!("{} ({} s)", s.signal.in_words(unit, force), short(s.seconds));
        self.segments.iter().map(one).collect::<Vec<_>>().join(", then ")
    }

    /// A similar input with other numbers, to judge what was fitted to this one: strokes, speeds
    /// and forces by a factor below one, sines at their neighbours' frequencies.
    pub fn varied(&self) -> Self {
        const LESS: f64 = 0.83;
        let vary = |segment: &Segment| {
            let mut segment = segment.clone();
            match &mut segment.signal {
                Signal::Staircase { slowest, .. } => *slowest *= LESS,
                Signal::Triangle { stroke, speed } => {
                    *stroke *= LESS;
                    *speed *= LESS;
                }
                Signal::Ladder { smallest, speed, .. } => {
                    *smallest *= LESS;
                    *speed *= LESS;
                }
                Signal::Multisine { force, frequencies } => {
                    *force *= LESS;
                    frequencies.iter_mut().for_each(|hertz| *hertz += (*hertz / 8).max(1));
                }
                Signal::Ramps { force, .. } => *force *= LESS,
                Signal::Hold => {}
            }
            segment
        };
        Self { segments: self.segments.iter().map(vary).collect() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reference_returns_to_the_place_of_the_start() {
        for signal in [
            Signal::Staircase { slowest: 0.1, ratio: 2.0, steps: 3, dwell_s: 0.5 },
            Signal::Triangle { stroke: 1.5, speed: 1.0 },
            Signal::Ladder { smallest: 0.25, ratio: 2.0, steps: 2, speed: 0.5 },
        ] {
            assert!(signal.at(3.0).position.abs() < 1e-9, "{signal:?}");
            assert!(signal.at(0.2).position > 0.01);
            // The speed is the slope of the position.
            let slope = (signal.at(0.301).position - signal.at(0.3).position) / 1e-3;
            assert!((slope - signal.at(0.3).speed).abs() < 1e-9, "{signal:?}");
        }
        let ramps = Signal::Ramps { force: 2.0, ramp_s: 0.5 };
        assert!((ramps.at(0.25).force - 1.0).abs() < 1e-9 && (ramps.at(0.75).force + 1.0).abs() < 1e-9);
    }

    #[test]
    fn numbers_have_three_digits() {
        assert_eq!(
            [short(12.3456), short(0.001_234_5), short(2.0), short(1234.0)],
            ["12.3", "0.00123", "2", "1234"]
        );
    }
}
