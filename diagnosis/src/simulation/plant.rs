//! A patched rig run forward: nominal model, friction that sticks, and every effect of the rig.

use crate::data::rig::Rig;
use crate::laws::{CommandLaw, Law, State};

/// The inputs of the plant from outside during a step.
#[derive(Debug, Clone, Copy, Default)]
pub struct Surroundings {
    /// Inclination below the horizontal, rad.
    pub tilt: f64,
    /// Generalised force on the coordinate, N·m or N.
    pub external: f64,
}

/// The plant of a rig. Steps should be short against its time constants: 0.1 ms or less.
#[derive(Debug, Clone)]
pub struct Plant {
    rig: Rig,
    commands: Vec<CommandLaw>,
    laws: Vec<(Law, Vec<f64>)>,
    scratch: Vec<f64>,
    position: f64,
    velocity: f64,
    time: f64,
    /// The lag of the reading behind the position in the sensor's filter that the rig declares.
    lag: f64,
    sensor: f64,
}

impl Plant {
    /// A plant at rest at position zero. Before the first step the command is taken to have stood
    /// still.
    pub fn new(rig: &Rig) -> Self {
        let of_effects = rig.effects.iter().filter_map(CommandLaw::new);
        let commands = rig.known_command_laws().into_iter().chain(of_effects).collect();
        let laws: Vec<(Law, Vec<f64>)> = rig
            .effects
            .iter()
            .filter_map(|effect| {
                let law = Law::new(effect)?;
                let coefficients = law.names().iter().map(|name| effect.coefficient(name)).collect();
                Some((law, coefficients))
            })
            .collect();
        let most = laws.iter().map(|(_, c)| c.len()).max().unwrap_or(0);
        Self {
            rig: rig.clone(),
            commands,
            laws,
            scratch: vec![0.0; most],
            position: 0.0,
            velocity: 0.0,
            time: 0.0,
            lag: 0.0,
            sensor: 0.0,
        }
    }

    /// The same, but its drive got a command of zero before the first step.
    pub fn unpowered(rig: &Rig) -> Self {
        let mut plant = Self::new(rig);
        plant.commands.iter_mut().for_each(|law| {
            law.step(0.0, 0.0, 0.0);
        });
        plant
    }

    /// One step of `dt` s with `command` held.
    pub fn step(&mut self, command: f64, around: Surroundings, dt: f64) {
        let limit = self.rig.actuator.limit.unwrap_or(f64::INFINITY);
        let mut effective = command.clamp(-limit, limit);
        for law in &mut self.commands {
            effective = law.step(effective, self.velocity, dt);
        }
        let (free, dry) = self.forces(effective, around, dt);
        let before = self.velocity;
        self.velocity = self.velocity_after(free, dry.max(0.0), dt);
        // The mean speed of the step: with the last one the reading would be half a step early,
        // which shows without noise.
        let mean = 0.5 * (before + self.velocity);
        self.position += mean * dt;
        if let Some(filter) = self.filter_s() {
            let settled = filter * mean;
            self.lag = settled + (self.lag - settled) * (-dt / filter).exp();
        }
        self.time += dt;
    }

    /// The force on the axis without its dry friction, and how much dry friction there is.
    fn forces(&mut self, effective: f64, around: Surroundings, dt: f64) -> (f64, f64) {
        let drive = self.rig.actuator.gain * effective;
        let model = &self.rig.model;
        // While stuck the laws see the direction in which the drive pushes, so that breakaway is
        // against friction.
        let push = drive + around.external;
        let velocity = if self.velocity == 0.0 { push.signum() * f64::MIN_POSITIVE } else { self.velocity };
        let state = State {
            position: self.position,
            velocity,
            rest: false,
            drive,
            command: effective,
            tilt: around.tilt,
            external: around.external,
            bias: model.offset.unwrap_or(0.0) / model.inertia,
            time: self.time,
            dt,
            ..State::default()
        };
        let mut dry = model.coulomb.unwrap_or(0.0);
        let mut free = push - model.viscous.unwrap_or(0.0) * self.velocity + model.offset.unwrap_or(0.0)
            - model.gravity.unwrap_or(0.0) * (self.position - model.gravity_zero.unwrap_or(0.0)).sin()
            + model.weight.unwrap_or(0.0) * around.tilt.sin();
        self.sensor = 0.0;
        for (law, coefficients) in &mut self.laws {
            let terms = &mut self.scratch[..coefficients.len()];
            law.terms(&state, terms);
            let sum: f64 = terms.iter().zip(&*coefficients).map(|(term, c)| term * c).sum();
            if law.in_sensor() {
                self.sensor += sum;
            } else if law.is_dry() {
                // A force against the motion that can hold the axis at rest.
                dry -= sum * velocity.signum();
            } else {
                // A jump of a table at rest is dry friction.
                let holds = law.dry_part(&state) * coefficients[0];
                dry += holds;
                free += sum + holds * velocity.signum();
            }
        }
        (free, dry)
    }

    /// The velocity after a step. Dry friction stops the axis; it never turns it round within a
    /// step.
    fn velocity_after(&self, free: f64, dry: f64, dt: f64) -> f64 {
        let inertia = self.rig.model.inertia;
        if self.velocity == 0.0 {
            return if free.abs() > dry {
                (free - free.signum() * dry) / inertia * dt
            } else {
                self.velocity
            };
        }
        let next = self.velocity + (free - self.velocity.signum() * dry) / inertia * dt;
        let coasting = self.velocity + free / inertia * dt;
        if next * self.velocity < 0.0 && (coasting * self.velocity > 0.0 || free.abs() <= dry) {
            0.0
        } else {
            next
        }
    }

    /// True position, rad or m.
    pub fn position(&self) -> f64 {
        self.position
    }

    /// True velocity, rad/s or m/s.
    pub fn velocity(&self) -> f64 {
        self.velocity
    }

    /// Returns the reading of a sensor without steps: the position behind the filter that the rig
    /// knows, plus its sensor effects.
    pub fn reading(&self) -> f64 {
        self.position - self.lag + self.sensor
    }

    fn filter_s(&self) -> Option<f64> {
        self.rig.encoder.filter_s.filter(|s| *s > 0.0)
    }

    /// Sets the time since the start, s, for a replay that begins within a recording.
    pub fn begin(&mut self, time: f64) {
        self.time = time;
    }

    /// Sets position and velocity, for replay from a measured state: behind a known filter of the
    /// sensor the position is further on.
    pub fn place(&mut self, position: f64, velocity: f64) {
        self.lag = velocity * self.filter_s().unwrap_or(0.0);
        self.position = position + self.lag;
        self.velocity = velocity;
    }

    /// Returns the reading of the encoder, whole counts.
    pub fn counts(&self) -> f64 {
        (self.reading() * self.rig.encoder.counts_per_unit).floor()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_rig_knows_of_delay_filter_and_gravity_is_run() {
        let mut rig = Rig::of_values(0.01, 0.1, 0.0);
        rig.actuator.delay_s = Some(0.05);
        let mut plant = Plant::new(&rig);
        let mut run = |seconds: f64, command: f64| {
            for _ in 0..(seconds / 1e-4) as usize {
                plant.step(command, Surroundings::default(), 1e-4);
            }
            plant.velocity()
        };
        run(0.01, 0.0);
        assert_eq!(run(0.04, 1.0), 0.0, "the command is under way");
        assert!(run(0.1, 1.0) > 0.1);
        let mut rig = Rig::of_values(0.01, 0.1, 0.0);
        rig.encoder.filter_s = Some(0.02);
        let mut plant = Plant::new(&rig);
        for _ in 0..20_000 {
            plant.step(1.0, Surroundings::default(), 1e-4);
        }
        // At a constant speed a first-order filter is late by its time constant.
        let late = (plant.position() - plant.reading()) / plant.velocity();
        assert!((late - 0.02).abs() < 1e-3, "{late} s");
        plant.place(3.0, 0.5);
        assert!((plant.reading() - 3.0).abs() < 1e-12 && plant.position() == 3.01);
        let mut rig = Rig::of_values(0.01, 0.1, 0.0);
        rig.encoder.absolute = true;
        (rig.model.gravity, rig.model.gravity_zero) = (Some(1.0), Some(0.4));
        let mut plant = Plant::new(&rig);
        for _ in 0..50_000 {
            plant.step(0.0, Surroundings::default(), 1e-4);
        }
        assert!((plant.position() - 0.4).abs() < 1e-3, "it hangs at its zero: {}", plant.position());
    }
}
