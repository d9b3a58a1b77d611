//! Dry friction that grows with the measured external load: `-coefficient·|force|·sgn(q̇)`; with
//! `of_drive` the load is the drive's own force, as a gear loses it, which has no name and speaks
//! only against others.

use super::definition::{
    Allowed, EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, POSITIVE, Reported, Span, Unnamed,
};
use super::law::sign;
use super::shape::{ShapeKey, shape};
use super::{Effect, EffectName, State, Subsystem};

#[derive(Debug, Clone)]
struct LoadDependentFrictionLaw {
    of_drive: bool,
}

impl ForceLaw for LoadDependentFrictionLaw {
    fn names(&self) -> Vec<String> {
        vec!["coefficient".into()]
    }
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        let load = if self.of_drive { state.drive } else { state.external };
        out[0] = -sign(velocity) * load.abs();
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

shape! {
    /// The force that presses.
    struct Shape {
        /// True if the drive's own force presses, as in a gear; the measured load otherwise.
        of_drive: flag,
    }
}

pub(super) struct Defined;

impl EffectLaw for Defined {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(LoadDependentFrictionLaw { of_drive: Shape::of(effect).of_drive }))
    }
    fn reads_command(&self, effect: &Effect) -> bool {
        effect.shape.contains_key("of_drive")
    }
    fn follows_drive(&self, effect: &Effect) -> bool {
        Shape::of(effect).of_drive
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[Shape::KEYS]
    }
    fn is_dry(&self) -> bool {
        true
    }
}

impl EffectSearch for Defined {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        if span.force { vec![Effect::shaped(name, &[])] } else { Vec::new() }
    }
    fn limits(&self, _term: usize, _allowed: &Allowed) -> (f64, f64) {
        POSITIVE
    }
    fn unnamed(&self, name: EffectName, _fitted: Option<&Effect>, _span: &Span) -> Vec<Unnamed> {
        // Whatever bends with speed, force or command may be the loss of a gear.
        vec![Unnamed {
            effect: Effect::shaped(name, &[("of_drive", 1.0)]),
            freedom: 1.0,
            what: "friction in proportion to the force of the drive, as a gear loses it,".into(),
        }]
    }
}

impl EffectReport for Defined {
    fn subsystem(&self) -> Subsystem {
        Subsystem::Transmission
    }
    fn words(&self) -> &'static str {
        "dry friction that grows with the load"
    }
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        fitted.one_force("coefficient", "1".into())
    }
    fn form_sd(&self, _value: &str) -> f64 {
        0.03
    }
}
