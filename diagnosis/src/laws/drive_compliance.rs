//! A spring between motor and load, seen as a resonance: what a rigid model misses of two masses.

use super::definition::{
    Coupling, EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Movable, Reported,
    Span,
};
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State};
use numerics::golden_section::logarithmic;
use std::f64::consts::TAU;

/// Resonance above which a spring holds like a solid shaft, Hz.
const STIFFEST_HZ: f64 = 400.0;

#[derive(Debug, Clone)]
struct DriveComplianceLaw {
    omega: f64,
    damping: f64,
    /// Position and speed of the resonator; none before the first force.
    state: Option<(f64, f64)>,
}

impl ForceLaw for DriveComplianceLaw {
    fn names(&self) -> Vec<String> {
        vec!["inertia_ratio".into()]
    }
    /// Mean over the step of s²/(s² + 2ζωs + ω²) applied to a held force, per unit of the ratio of
    /// load to motor inertia.
    fn terms(&mut self, state: &State, _velocity: f64, out: &mut [f64]) {
        if state.dt <= 0.0 {
            out[0] = 0.0;
            return;
        }
        let m = transition(self.omega, self.damping, state.dt);
        // At the start the spring carries the standing force.
        let (x, v) = self.state.unwrap_or((state.drive / (self.omega * self.omega), 0.0));
        let next = m[2] * x + m[3] * v + m[5] * state.drive;
        self.state = Some((m[0] * x + m[1] * v + m[4] * state.drive, next));
        out[0] = (next - v) / state.dt;
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
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

/// Highest resonance of a load on a spring that still shows in how fast the motor answers, Hz.
fn highest(span: &Span) -> f64 {
    (0.5 / span.block).max((0.25 / span.row).min(STIFFEST_HZ))
}

shape! {
    /// The resonance of the load against the motor.
    struct Shape {
        /// Its frequency, Hz.
        resonance_hz: needed,
        /// Its damping over the critical one.
        damping: needed,
    }
}

pub(super) struct DriveCompliance;

impl EffectLaw for DriveCompliance {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        let Shape { resonance_hz, damping } = Shape::of(effect);
        Some(Box::new(DriveComplianceLaw { omega: TAU * resonance_hz, damping, state: None }))
    }
    fn coupling(&self) -> Option<Coupling> {
        Some(Coupling::Stiff)
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn is_relative_to_gain(&self) -> bool {
        true
    }
}

impl EffectSearch for DriveCompliance {
    fn has_optima_apart(&self) -> bool {
        true
    }
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        let mut out = Vec::new();
        for damping in [0.02, 0.12] {
            for hz in logarithmic(5.0, 0.7 * highest(span), 12) {
                out.push(Effect::shaped(name, &[("resonance_hz", hz), ("damping", damping)]));
            }
        }
        out
    }
    fn movable(&self, _effect: &Effect, span: &Span) -> Vec<Movable> {
        vec![("resonance_hz", 4.0, highest(span)), ("damping", 0.003, 0.7)]
    }
}

impl EffectReport for DriveCompliance {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        let (f, s) = fitted.shape("resonance_hz");
        let (x, sd) = fitted.term(0);
        let load = (x / fitted.ratio).max(0.0);
        let part = (1.0 + load).sqrt();
        let sd = ((s / part).powi(2) + (0.5 * f / part.powi(3) * sd / fitted.ratio).powi(2)).sqrt();
        vec![Reported::new("antiresonance_hz", (f / part, sd), "Hz")]
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.035
    }
}
