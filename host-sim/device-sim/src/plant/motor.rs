//! A DC motor behind a servo amplifier in current mode: electrical pole, supply and current limits,
//! enable line.

use super::{STEP_S, settled};

/// The parameters of motor and amplifier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    /// Terminal resistance, Ω.
    pub resistance: f64,
    /// Terminal inductance, H.
    pub inductance: f64,
    /// Torque constant, N·m/A, and by the same token V·s/rad.
    pub torque_constant: f64,
    /// Supply of the amplifier, V.
    pub supply: f64,
    /// Largest current of the amplifier, A.
    pub current_limit: f64,
    /// Gain of the amplifier's current loop, V/A; its bandwidth is this over the inductance.
    pub current_gain: f64,
    /// Torque asked for by a full-scale set value, N·m.
    pub full_scale_torque: f64,
}

impl Motor {
    /// A 24 V winding of RE25 class behind a four-quadrant amplifier with a current loop of about 1
    /// kHz.
    pub fn re25(full_scale_torque: f64) -> Self {
        Self {
            resistance: 2.32,
            inductance: 0.24e-3,
            torque_constant: 0.023_4,
            supply: 24.0,
            current_limit: 2.0,
            current_gain: 1.5,
            full_scale_torque,
        }
    }
}

/// The amplifier's one state.
#[derive(Clone, Copy, Debug, Default)]
pub struct Amplifier {
    current: f64,
}

impl Motor {
    /// The current in A that a set value of −1 to 1 asks for, within the limit.
    pub(crate) fn wanted_current(&self, set_value: f64) -> f64 {
        let asked = set_value * self.full_scale_torque / self.torque_constant;
        asked.clamp(-self.current_limit, self.current_limit)
    }
}

impl Amplifier {
    /// One physics step; the torque in N·m. `wanted` is the current asked for in A, or `None` where
    /// the enable line is low; `speed` the rotor's in rad/s.
    #[inline]
    pub fn step(&mut self, motor: &Motor, wanted: Option<f64>, speed: f64) -> f64 {
        let back = motor.torque_constant * speed;
        let rate = STEP_S / motor.inductance;
        if let Some(wanted) = wanted {
            let drop = motor.resistance * self.current + back;
            let voltage = motor.current_gain * (wanted - self.current) + drop;
            self.current = settled(self.current + rate * (voltage.clamp(-motor.supply, motor.supply) - drop));
        } else {
            // The bridge is open: current decays through the diodes against the supply and does not
            // turn round.
            let fall = rate * (motor.supply + motor.resistance * self.current.abs());
            self.current = self.current.signum() * (self.current.abs() - fall).max(0.0);
        }
        self.torque(motor)
    }

    /// The torque in N·m.
    pub fn torque(&self, motor: &Motor) -> f64 {
        motor.torque_constant * self.current
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_steps_follow_the_electrical_pole_large_ones_the_supply() {
        let motor = Motor::re25(0.0288);
        let mut amplifier = Amplifier::default();
        let pole = motor.inductance / motor.current_gain;
        let wanted = 0.01 * motor.full_scale_torque;
        let mut seen = None;
        for step in 1..200_u32 {
            let torque = amplifier.step(&motor, Some(motor.wanted_current(0.01)), 0.0);
            if torque > wanted * (1.0 - (-1.0_f64).exp()) {
                seen = seen.or(Some(f64::from(step) * STEP_S));
            }
        }
        let seen = seen.expect("it gets there");
        assert!((seen - pole).abs() <= STEP_S, "63 % after {seen} s, L/k is {pole} s");
        assert!((amplifier.torque(&motor) / wanted - 1.0).abs() < 1e-4);

        // A slow supply: the current can rise no faster than (V − R·i)/L, and ends at V/R.
        let weak = Motor { supply: 1.0, ..motor };
        let mut amplifier = Amplifier::default();
        for step in 1..=2_000_u32 {
            amplifier.step(&weak, Some(weak.wanted_current(1.0)), 0.0);
            // Euler's steps run ahead of the exponential by at most a step.
            let time = f64::from(step + 1) * STEP_S;
            let bound =
                weak.supply / weak.resistance * (1.0 - (-time * weak.resistance / weak.inductance).exp());
            assert!(amplifier.current <= bound * 1.01, "{} A at {time} s", amplifier.current);
        }
        assert!((amplifier.current - weak.supply / weak.resistance).abs() < 1e-3);
    }

    #[test]
    fn torque_is_zero_when_disabled_and_limited_when_enabled() {
        let motor = Motor::re25(0.0288);
        let mut amplifier = Amplifier::default();
        for _ in 0..100 {
            assert_eq!(amplifier.step(&motor, None, 100.0), 0.0);
        }
        let small = Motor { current_limit: 0.5, ..motor };
        for _ in 0..1_000 {
            amplifier.step(&small, Some(small.wanted_current(-1.0)), 0.0);
        }
        assert!((amplifier.current + 0.5).abs() < 1e-6);
        let mut steps = 0;
        while amplifier.step(&small, None, 0.0) != 0.0 {
            steps += 1;
        }
        assert!(steps < 10, "dropping enable takes the torque away at once, not after {steps} steps");
    }
}
