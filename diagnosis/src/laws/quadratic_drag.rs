//! Drag with the square of speed: `-coefficient·q̇·|q̇|`.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span,
};
use super::{Effect, EffectName, State, Variable};

#[derive(Debug, Clone)]
struct QuadraticDragLaw;

impl ForceLaw for QuadraticDragLaw {
    fn names(&self) -> Vec<String> {
        vec!["coefficient".into()]
    }
    fn terms(&mut self, _state: &State, velocity: f64, out: &mut [f64]) {
        out[0] = -velocity * velocity.abs();
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

pub(super) struct QuadraticDrag;

impl EffectLaw for QuadraticDrag {
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(QuadraticDragLaw))
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Speed)
    }
}

impl EffectSearch for QuadraticDrag {
    fn grid(&self, name: EffectName, _span: &Span) -> Vec<Effect> {
        vec![Effect::shaped(name, &[])]
    }
}

impl EffectReport for QuadraticDrag {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        fitted.one_force("coefficient", format!("{}·s²/{}²", fitted.force, fitted.length))
    }
    fn experiment(&self, _other: EffectName) -> Option<&'static str> {
        Some(super::experiments::SPEEDS)
    }
}
