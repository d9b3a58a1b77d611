//! The effects that act as a force or in the sensor: their terms, linear in the coefficients, with internal state.

use super::bristles::Bristles;
use super::load::Load;
use super::{Effect, EffectName};
use std::f64::consts::TAU;

/// Where the plant is during one step.
#[derive(Debug, Clone, Copy, Default)]
pub struct State {
    /// Position from the start of the recording or simulation, rad or m.
    pub position: f64,
    /// rad/s or m/s.
    pub velocity: f64,
    /// rad/s² or m/s²; asked only by what no plant has.
    pub acceleration: f64,
    /// Whether the sign of the velocity is unknown: friction is a reaction then and not in the model.
    pub rest: bool,
    /// Force that the command asks for: gain · effective command, N·m or N.
    pub drive: f64,
    /// Effective command, in the rig's unit.
    pub command: f64,
    /// Inclination below the horizontal, rad.
    pub tilt: f64,
    /// External load on the coordinate, N·m or N.
    pub external: f64,
    /// Acceleration by the force that is there all the time, rad/s² or m/s².
    pub bias: f64,
    /// Since the start, s.
    pub time: f64,
    /// Length of the step, s.
    pub dt: f64,
}

/// Names of terms of which the second is not always there.
fn first_or_both(first: &str, second: &str, both: bool) -> Vec<String> {
    [first, second].into_iter().take(if both { 2 } else { 1 }).map(str::to_owned).collect()
}

/// Sign with `sgn(0) = 0`.
fn sign(x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { x.signum() }
}

/// An effect with its internal state. The force is the sum of coefficient times term; sensor effects give travel instead.
#[derive(Debug, Clone)]
pub struct Law {
    name: EffectName,
    a: f64,
    b: f64,
    /// Time in which a spring's force fades while it stays bent, s; never, but where that is asked.
    fades_s: f64,
    /// Time at which a drift comes all at once, s; never, but where that is asked.
    at_once_s: f64,
    /// Whether a profile along the travel is of the inertia.
    of_inertia: bool,
    /// Whether the load that friction grows with is the drive's own force.
    of_drive: bool,
    waves: Vec<f64>,
    times: Vec<f64>,
    /// Names of the terms, in the order of [`Law::terms`].
    names: Vec<String>,
    /// Internal state: what has faded of a spring, resonator.
    state: [f64; 3],
    bristles: Bristles,
    /// What hangs on the motor by a gap or a grip.
    load: Load,
}

impl Law {
    /// The law of an effect on force or sensor; none where it acts on the command.
    pub fn new(effect: &Effect) -> Option<Self> {
        use EffectName as N;
        let get = |key: &str, otherwise: f64| effect.shape_or(key, otherwise);
        let mut waves = Vec::new();
        let mut times = Vec::new();
        let (mut a, mut b) = (0.0, 0.0);
        let fades_s = get("fades_s", f64::INFINITY);
        let at_once_s = get("at_once_s", f64::INFINITY);
        let set = |key: &str| get(key, 0.0) > 0.5;
        let (of_inertia, of_drive) = (set("of_inertia"), set("of_drive"));
        let names: Vec<String> = match effect.name {
            N::ViscousFriction => vec!["viscous".into()],
            N::CoulombFriction => vec!["coulomb".into()],
            N::AsymmetricFriction => {
                first_or_both("viscous_difference", "coulomb_difference", !set("viscous_only"))
            }
            N::StribeckFriction => {
                (a, b) = (get("speed", 1.0), get("exponent", 2.0));
                vec!["peak".into()]
            }
            // Alike, they are LuGre's, which dampen as they bend.
            N::PreslidingFriction => first_or_both("coulomb", "damping", get("spread", 1.0) <= 1.0),
            N::QuadraticDrag | N::LoadDependentFriction => vec!["coefficient".into()],
            N::PositionDependentFriction | N::PositionDependentDamping => {
                (a, b) = (get("low", -1.0), get("high", 1.0));
                (1..=get("degree", 3.0) as usize).map(|k| format!("legendre_{k}")).collect()
            }
            N::FrictionDrift => {
                a = get("time_constant", 1.0);
                // What is not there does not drift.
                first_or_both("coulomb", "viscous", !set("dry_only"))
            }
            N::GainDrift => {
                a = get("time_constant", 1.0);
                vec!["change".into()]
            }
            N::Cogging | N::TorqueRipple | N::MassImbalance | N::EncoderEccentricity => {
                let mut found = effect.waves();
                if found.is_empty() {
                    found.push(("1".into(), TAU / get("turn", TAU)));
                }
                waves = found.iter().map(|wave| wave.1).collect();
                found.iter().flat_map(|(n, _)| [format!("cos_{n}"), format!("sin_{n}")]).collect()
            }
            N::TiltGravity => vec!["weight".into()],
            N::PositionSpring => {
                (a, b) = (get("from", 0.0), get("one_sided", 0.0));
                // Where it is at rest is not known: a force that is there at the start.
                first_or_both("stiffness", "preload", set("preload"))
            }
            N::Backlash | N::RollerSlip => vec!["inertia_ratio".into()],
            N::DriveCompliance => {
                (a, b) = (TAU * get("resonance_hz", 1.0), get("damping", 0.05));
                vec!["inertia_ratio".into()]
            }
            N::MissedCounts => {
                for (key, value) in &effect.shape {
                    if key.starts_with("time_") {
                        times.push(*value);
                    }
                }
                effect
                    .shape
                    .keys()
                    .filter_map(|key| key.strip_prefix("time_").map(|n| format!("step_{n}")))
                    .collect()
            }
            N::CommandDeadband | N::CommandSaturation | N::CommandDelay | N::ElectricalLag => return None,
        };
        let state = [0.0; 3];
        let (bristles, load) = (Bristles::new(effect), Load::new(effect));
        Some(Self {
            name: effect.name,
            a,
            b,
            fades_s,
            at_once_s,
            of_inertia,
            of_drive,
            waves,
            times,
            names,
            state,
            bristles,
            load,
        })
    }

    /// Names of the terms, in order.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Whether the terms are travel added to what the encoder reads, rather than force.
    pub fn in_sensor(&self) -> bool {
        matches!(self.name, EffectName::EncoderEccentricity | EffectName::MissedCounts)
    }

    /// Whether the force is dry friction, which holds an axis at rest rather than moving it.
    pub fn is_dry(&self) -> bool {
        use EffectName as N;
        matches!(
            self.name,
            N::CoulombFriction
                | N::AsymmetricFriction
                | N::StribeckFriction
                | N::PositionDependentFriction
                | N::LoadDependentFriction
                | N::FrictionDrift
        )
    }

    /// The terms for this step; `out` has one place per name.
    pub fn terms(&mut self, s: &State, out: &mut [f64]) {
        use EffectName as N;
        let velocity = if s.rest { 0.0 } else { s.velocity };
        let way = sign(velocity);
        match self.name {
            N::ViscousFriction => out[0] = -velocity,
            N::CoulombFriction => out[0] = -way,
            N::AsymmetricFriction => {
                out[0] = -velocity.abs();
                if let Some(dry) = out.get_mut(1) {
                    *dry = -way.abs();
                }
            }
            N::StribeckFriction => out[0] = -way * (-(velocity.abs() / self.a).powf(self.b)).exp(),
            // Bristles bend on where the sign is too unsure for dry friction, and hold alone there.
            N::PreslidingFriction => {
                let (bent, more) = self.bristles.bend(s.velocity * s.dt);
                out[0] = way - bent;
                if let Some(damping) = out.get_mut(1) {
                    *damping = if s.dt > 0.0 { -more / s.dt } else { 0.0 };
                }
            }
            N::QuadraticDrag => out[0] = -velocity * velocity.abs(),
            N::LoadDependentFriction => {
                let load = if self.of_drive { s.drive } else { s.external };
                out[0] = -way * load.abs();
            }
            N::PositionDependentFriction => legendre(self.along(s.position), -way, out),
            N::PositionDependentDamping if self.of_inertia => self.inertia(s, out),
            N::PositionDependentDamping => legendre(self.along(s.position), -velocity, out),
            N::FrictionDrift => {
                let settled = 1.0 - (-s.time / self.a).exp();
                out[0] = -way * settled;
                if let Some(viscous) = out.get_mut(1) {
                    *viscous = -velocity * settled;
                }
            }
            N::GainDrift if self.at_once_s.is_finite() => {
                out[0] = if s.time >= self.at_once_s { s.drive } else { 0.0 };
            }
            N::GainDrift => out[0] = s.drive * (1.0 - (-s.time / self.a).exp()),
            N::Cogging | N::MassImbalance | N::EncoderEccentricity => {
                self.harmonics(s.position, velocity * s.dt, 1.0, out)
            }
            N::TorqueRipple => self.harmonics(s.position, velocity * s.dt, s.drive, out),
            N::TiltGravity => out[0] = s.tilt.sin(),
            N::PositionSpring => {
                let x = s.position - self.a;
                // Maxwell's spring and dashpot in series: what has faded is no longer bent.
                self.state[0] += (x - self.state[0]) * (1.0 - (-s.dt / self.fades_s).exp());
                let bent = x - self.state[0];
                out[0] = if self.b > 0.5 { -bent.max(0.0) } else { -bent };
                if let Some(preload) = out.get_mut(1) {
                    *preload = 1.0;
                }
            }
            N::Backlash => out[0] = self.load.through_gap(s),
            N::RollerSlip => out[0] = self.load.by_grip(s),
            N::DriveCompliance => out[0] = self.resonate(s.drive, s.dt),
            N::MissedCounts => {
                for (term, time) in out.iter_mut().zip(&self.times) {
                    *term = if s.time >= *time { 1.0 } else { 0.0 };
                }
            }
            _ => out.fill(0.0),
        }
    }

    fn along(&self, position: f64) -> f64 {
        let (low, high) = (self.a, self.b);
        let half = 0.5 * (high - low);
        if half > 0.0 { ((position - low) / half - 1.0).clamp(-1.0, 1.0) } else { 0.0 }
    }

    /// What an inertia J(q) takes beside a constant one, J′v²/2 and its part of the acceleration, by Lagrange's equation.
    fn inertia(&self, s: &State, out: &mut [f64]) {
        let half = 0.5 * (self.b - self.a);
        let step = 1e-3 * half;
        let mut beyond = vec![0.0; out.len()];
        legendre(self.along(s.position + step), 1.0, &mut beyond);
        legendre(self.along(s.position - step), 1.0, out);
        for (term, beyond) in out.iter_mut().zip(beyond) {
            let slope = (beyond - *term) / (2.0 * step);
            *term = -0.5 * (beyond + *term) * s.acceleration - 0.5 * slope * s.velocity * s.velocity;
        }
    }

    /// Means over the step: a wave that is passed within it averages out.
    fn harmonics(&self, position: f64, passed: f64, times: f64, out: &mut [f64]) {
        for (pair, wave) in out.chunks_exact_mut(2).zip(&self.waves) {
            let (cos, sin) = wave_mean(*wave, position, passed);
            pair[0] = times * cos;
            pair[1] = times * sin;
        }
    }

    /// Mean over the step of s²/(s² + 2ζωs + ω²) applied to a held force: what a rigid model misses of two masses on a
    /// spring seen from the motor, per unit of the ratio of load to motor inertia.
    fn resonate(&mut self, force: f64, dt: f64) -> f64 {
        if dt <= 0.0 {
            return 0.0;
        }
        let (omega, zeta) = (self.a, self.b);
        let m = transition(omega, zeta, dt);
        if self.state[2] == 0.0 {
            // At the start the spring carries the standing force.
            self.state = [force / (self.a * self.a), 0.0, 1.0];
        }
        let [x, v, _] = self.state;
        let next = m[2] * x + m[3] * v + m[5] * force;
        self.state[0] = m[0] * x + m[1] * v + m[4] * force;
        self.state[1] = next;
        (next - v) / dt
    }
}

/// Mean cosine and sine of a wave, rad per unit of travel, over `passed` travel about `position`.
pub(crate) fn wave_mean(wave: f64, position: f64, passed: f64) -> (f64, f64) {
    let (sin, cos) = (wave * position).sin_cos();
    let half = 0.5 * wave * passed;
    let part = sinc(half);
    (part * cos, part * sin)
}

/// sin x / x, to the last digits: by its series where that is faster.
fn sinc(x: f64) -> f64 {
    let y = x * x;
    if y > 0.09 {
        return x.sin() / x;
    }
    1.0 - y / 6.0 * (1.0 - y / 20.0 * (1.0 - y / 42.0 * (1.0 - y / 72.0 * (1.0 - y / 110.0))))
}

/// Exact transition of x″ + 2ζωx′ + ω²x = f over `dt` with `f` held: [a11 a12 a21 a22 b1 b2].
fn transition(omega: f64, zeta: f64, dt: f64) -> [f64; 6] {
    let zeta = zeta.clamp(1e-4, 0.99);
    let decay = zeta * omega;
    let damped = omega * (1.0 - zeta * zeta).sqrt();
    let e = (-decay * dt).exp();
    let (sin, cos) = (damped * dt).sin_cos();
    let k = decay / damped;
    let a11 = e * (cos + k * sin);
    let a12 = e * sin / damped;
    let a21 = -omega * omega * a12;
    let a22 = e * (cos - k * sin);
    [a11, a12, a21, a22, (1.0 - a11) / (omega * omega), -a21 / (omega * omega)]
}

/// Legendre polynomials of degree 1 and up, times a factor.
pub(crate) fn legendre(x: f64, times: f64, out: &mut [f64]) {
    let (mut before, mut now) = (1.0, x);
    for (k, term) in out.iter_mut().enumerate() {
        *term = times * now;
        let n = (k + 1) as f64;
        let next = ((2.0 * n + 1.0) * x * now - n * before) / (n + 1.0);
        (before, now) = (now, next);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bristles() -> Law {
        Law::new(&Effect::shaped(EffectName::PreslidingFriction, &[("deflection", 1.0)])).unwrap()
    }

    /// The bristles' force and their damping after a long slide forward and one step.
    fn after_a_slide(velocity: f64, rest: bool) -> [f64; 2] {
        let (mut law, mut out) = (bristles(), [0.0; 2]);
        law.terms(&State { velocity: 100.0, dt: 1.0, ..State::default() }, &mut out);
        law.terms(&State { velocity, rest, dt: 1e-3, ..State::default() }, &mut out);
        out
    }

    #[test]
    fn bristles_take_the_place_of_dry_friction_where_its_sign_is_unknown() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-3;
        assert!(near(after_a_slide(0.1, false)[0], 0.0), "sliding on, dry friction is whole");
        assert!(near(after_a_slide(-0.1, false)[0], -2.0), "turned round, the bristles still push back");
        for velocity in [0.1, 0.0, -0.1] {
            assert!(near(after_a_slide(velocity, true)[0], -1.0), "at rest they hold alone");
        }
    }

    #[test]
    fn bristles_dampen_only_while_they_bend() {
        assert!(after_a_slide(0.1, false)[1].abs() < 1e-9, "sliding on, nothing bends");
        // Turned round at −0.1 they unbend by 2·0.1 of their length a second.
        assert!((after_a_slide(-0.1, false)[1] - 0.2).abs() < 1e-3);
    }

    #[test]
    fn what_is_not_there_does_not_drift() {
        let names = |shape: &[(&str, f64)]| {
            let drift = Effect::shaped(EffectName::FrictionDrift, shape);
            Law::new(&drift).unwrap().names().to_vec()
        };
        assert_eq!(names(&[]), ["coulomb", "viscous"]);
        assert_eq!(names(&[("dry_only", 1.0)]), ["coulomb"]);
    }

    #[test]
    fn a_spring_that_fades_holds_what_is_bent_at_once_and_lets_go() {
        let spring = |fades: &[(&str, f64)], seconds: usize| {
            let mut law = Law::new(&Effect::shaped(EffectName::PositionSpring, fades)).unwrap();
            let mut out = [0.0];
            for _ in 0..1000 * seconds {
                law.terms(&State { position: 2.0, dt: 1e-3, ..State::default() }, &mut out);
            }
            out[0]
        };
        assert_eq!(spring(&[], 5), -2.0);
        assert!((spring(&[("fades_s", 1.0)], 1) + 2.0 * (-1.0_f64).exp()).abs() < 0.01);
        assert!(spring(&[("fades_s", 1.0)], 10).abs() < 1e-3);
    }

    #[test]
    fn an_inertia_along_the_travel_takes_its_part_of_the_acceleration_and_half_its_slope_of_the_square_of_speed()
     {
        let shape = [("low", 0.0), ("high", 4.0), ("degree", 2.0), ("of_inertia", 1.0)];
        let mut law = Law::new(&Effect::shaped(EffectName::PositionDependentDamping, &shape)).unwrap();
        let mut out = [0.0; 2];
        law.terms(&State { position: 3.0, velocity: 2.0, acceleration: 5.0, ..State::default() }, &mut out);
        // x = (q − 2)/2 = ½: P₁ = x with slope ½, P₂ = (3x² − 1)/2 with slope 3x/2.
        for (term, expected) in out.iter().zip([-0.5 * 5.0 - 0.25 * 4.0, 0.125 * 5.0 - 0.375 * 4.0]) {
            assert!((term - expected).abs() < 1e-4, "{term} instead of {expected}");
        }
    }

    #[test]
    fn a_wave_passed_within_a_step_averages_out_alike_by_series_and_by_sine() {
        for x in [1e-9_f64, 1e-3, 0.1, 0.299_999, 0.300_001, 2.0, -0.2] {
            assert!((sinc(x) - x.sin() / x).abs() < 4e-16, "{x}");
        }
        assert_eq!(sinc(0.0), 1.0);
    }

    #[test]
    fn friction_grows_with_the_load_or_with_what_the_drive_carries() {
        let friction = |of_drive: f64, velocity: f64| {
            let effect = Effect::shaped(EffectName::LoadDependentFriction, &[("of_drive", of_drive)]);
            let (mut law, mut out) = (Law::new(&effect).unwrap(), [0.0]);
            law.terms(&State { velocity, external: 2.0, drive: -3.0, ..State::default() }, &mut out);
            out[0]
        };
        assert_eq!([friction(0.0, 1.0), friction(0.0, -1.0)], [-2.0, 2.0]);
        assert_eq!([friction(1.0, 1.0), friction(1.0, -1.0)], [-3.0, 3.0]);
    }

    #[test]
    fn at_rest_nothing_that_depends_on_speed_acts() {
        for name in [EffectName::ViscousFriction, EffectName::QuadraticDrag, EffectName::StribeckFriction] {
            let (mut law, mut out) = (Law::new(&Effect::shaped(name, &[])).unwrap(), [1.0]);
            law.terms(&State { velocity: 3.0, rest: true, dt: 1e-3, ..State::default() }, &mut out);
            assert_eq!(out[0], 0.0, "{name}");
        }
    }
}
