//! Effects between the command as recorded and the command that makes torque.

use super::Effect;
use std::collections::VecDeque;

/// An effect on the command, with its state. Steps may be of any length: each answer is the mean
/// over its step.
#[derive(Debug, Clone)]
pub(crate) enum CommandLaw {
    /// u′ = 0 for |u| ≤ `half_width`; otherwise u, or with `shift` u − half_width·sgn u.
    Deadband { half_width: f64, shift: bool },
    /// Commands beyond the limit are held at it. With `softness` s > 0 they approach it:
    /// `u/(1 + |u/limit|^(1/s))^s`.
    Clip { limit: f64, softness: f64 },
    /// Commands beyond a line are held at it: the supply's voltage less back-EMF, `limit` where the
    /// axis stands, nothing at `no_load_speed`, rad/s or m/s, and as much more where the drive
    /// brakes.
    Supply { limit: f64, no_load_speed: f64 },
    /// A transport delay, s; the queue holds (length, command) of what is under way.
    Delay { delay: f64, queue: VecDeque<(f64, f64)>, waiting: f64 },
    /// A first-order lag, s.
    Lag { time_constant: f64, state: Option<f64> },
}

impl CommandLaw {
    /// The law of an effect on the command; none where the effect acts elsewhere.
    pub(crate) fn new(effect: &Effect) -> Option<Self> {
        effect.name.definition().command_law(effect)
    }

    /// A transport delay, s.
    pub(crate) fn of_delay(delay: f64) -> Self {
        Self::Delay { delay, queue: VecDeque::new(), waiting: 0.0 }
    }

    /// A first-order lag of a time constant, s.
    pub(crate) fn of_lag(time_constant: f64) -> Self {
        Self::Lag { time_constant, state: None }
    }

    /// The mean effective command over a step of `dt` s during which `command` is held and the axis
    /// moves with `velocity`, rad/s or m/s.
    pub(crate) fn step(&mut self, command: f64, velocity: f64, dt: f64) -> f64 {
        match self {
            Self::Deadband { half_width, shift } => {
                if command.abs() <= *half_width {
                    0.0
                } else if *shift {
                    command - command.signum() * *half_width
                } else {
                    command
                }
            }
            Self::Clip { limit, softness } => clip(command, *limit, *softness),
            Self::Supply { limit, no_load_speed } => {
                let taken = velocity / *no_load_speed;
                command.clamp(-*limit * (1.0 + taken), *limit * (1.0 - taken))
            }
            Self::Delay { delay, queue, waiting } => {
                if queue.is_empty() {
                    // Before the first row the command is taken to have stood still.
                    queue.push_back((*delay, command));
                    *waiting = *delay;
                }
                queue.push_back((dt, command));
                *waiting += dt;
                let (mut left, mut sum) = (dt, 0.0);
                while left > 0.0 {
                    let Some((length, value)) = queue.front_mut() else { break };
                    let taken = left.min(*length);
                    sum += taken * *value;
                    left -= taken;
                    *length -= taken;
                    if *length <= 0.0 {
                        queue.pop_front();
                    }
                }
                if dt > 0.0 { sum / dt } else { command }
            }
            Self::Lag { time_constant, state } => {
                let before = state.unwrap_or(command);
                let ratio = dt / time_constant.max(1e-12);
                let rest = (-ratio).exp();
                let mean = if ratio > 1e-9 { (1.0 - rest) / ratio } else { 1.0 };
                *state = Some(command + (before - command) * rest);
                command + (before - command) * mean
            }
        }
    }
}

/// A command held at a limit, which it approaches where `softness` is above zero.
fn clip(command: f64, limit: f64, softness: f64) -> f64 {
    if softness <= 0.0 {
        return command.clamp(-limit, limit);
    }
    let (power, ratio) = (softness.recip(), command.abs() / limit);
    // The smaller of the two and their ratio, so that no power overflows.
    let (least, over) = if ratio < 1.0 { (command.abs(), ratio) } else { (limit, ratio.recip()) };
    (least / (1.0 + over.powf(power)).powf(softness)).copysign(command)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_soft_clip_passes_what_is_small_and_never_exceeds_its_limit() {
        // At the limit itself a power of 8 leaves 2^(-1/8) of it.
        assert!((clip(0.5, 0.5, 0.125) - 0.5 * 0.917_004_043_204_671_2).abs() < 1e-15);
        assert!((clip(-0.1, 0.5, 0.125) + 0.1).abs() < 1e-6, "{}", clip(-0.1, 0.5, 0.125));
        assert_eq!(clip(-1e300, 0.5, 1e-3), -0.5);
        assert_eq!((clip(2.0, 0.5, 0.0), clip(0.4, 0.5, 0.0)), (0.5, 0.4));
        assert_eq!(clip(0.0, 0.5, 0.1), 0.0);
    }

    /// From the circuit: the current is (voltage - k·speed)/R, so a supply of 24 V behind 2 Ω with
    /// 0.4 V·s/rad drives 12 A at rest, none at 60 rad/s, and 18 A where it brakes from 30.
    #[test]
    fn a_supply_drives_the_current_that_its_voltage_can() {
        let most = |sign: f64, speed: f64| (sign * 24.0 - 0.4 * speed) / 2.0;
        let mut law = CommandLaw::Supply { limit: 12.0, no_load_speed: 60.0 };
        for speed in [0.0, 30.0, -30.0, 60.0] {
            for sign in [1.0, -1.0] {
                let passed = law.step(sign * 1e3, speed, 1e-3);
                assert!((passed - most(sign, speed)).abs() < 1e-12, "{passed} at {speed} rad/s");
            }
        }
        assert_eq!(law.step(5.0, 30.0, 1e-3), 5.0, "what the supply can do passes whole");
    }
}
