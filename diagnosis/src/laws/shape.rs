//! The values of an effect that enter non-linearly: speeds, lengths, delays, orders.
//!
//! Each effect declares its own once, with what a missing one is. Its law reads them as a struct;
//! searches, which move them by name, read [`crate::laws::Effect::shape`].

/// The value that holds where a rig gives none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Missing {
    /// Nothing: a rig must give the value, above zero.
    Refused,
    /// This value; zero is "no" of a value that means yes or no.
    Is(f64),
    /// The law does without it.
    Optional,
    /// The key is the start of numbered ones, of which there may be none.
    Numbered,
}

/// A key of a shape.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ShapeKey {
    pub(crate) name: &'static str,
    pub(crate) missing: Missing,
}

impl ShapeKey {
    pub(crate) const fn new(name: &'static str, missing: Missing) -> Self {
        Self { name, missing }
    }

    /// Returns it as a sentence names it.
    pub(crate) fn in_words(&self) -> String {
        let number = if self.missing == Missing::Numbered { "N" } else { "" };
        format!("{}{number}", self.name)
    }

    /// True if it is the key that a rig calls `key`.
    pub(crate) fn is(&self, key: &str) -> bool {
        match self.missing {
            Missing::Numbered => key.strip_prefix(self.name).is_some_and(|number| !number.is_empty()),
            _ => key == self.name,
        }
    }
}

/// Declares the values of an effect as a struct with the constructor `of(&Effect)` and the constant
/// `KEYS`. The type of a value says what holds where it is missing: `needed` (a rig must give it),
/// `flag` (no), `optional` (none), or a number.
macro_rules! shape {
    ($(#[$about:meta])* struct $Name:ident { $($(#[$doc:meta])* $key:ident: $missing:tt,)* }) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy)]
        pub(super) struct $Name {
            $($(#[$doc])* pub(super) $key: $crate::laws::shape::shape!(@type $missing),)*
        }

        impl $Name {
            /// Their keys in a rig.
            pub(super) const KEYS: &[$crate::laws::shape::ShapeKey] = &[$($crate::laws::shape::ShapeKey::new(
                stringify!($key),
                $crate::laws::shape::shape!(@missing $missing),
            ),)*];

            /// The values of an effect; a needed one that is missing is not a number.
            pub(super) fn of(effect: &$crate::laws::Effect) -> Self {
                Self { $($key: $crate::laws::shape::shape!(@read effect, $key, $missing),)* }
            }
        }
    };
    (@type flag) => { bool };
    (@type optional) => { Option<f64> };
    (@type $number:tt) => { f64 };
    (@missing needed) => { $crate::laws::shape::Missing::Refused };
    (@missing flag) => { $crate::laws::shape::Missing::Is(0.0) };
    (@missing optional) => { $crate::laws::shape::Missing::Optional };
    (@missing $number:tt) => { $crate::laws::shape::Missing::Is($number) };
    (@read $effect:ident, $key:ident, flag) => { $effect.value(stringify!($key)) > 0.5 };
    (@read $effect:ident, $key:ident, optional) => { $effect.shape.get(stringify!($key)).copied() };
    (@read $effect:ident, $key:ident, $number:tt) => { $effect.value(stringify!($key)) };
}
pub(super) use shape;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::{Effect, EffectName};

    #[test]
    fn a_missing_value_is_what_its_effect_declares() {
        let spring = Effect::shaped(EffectName::PositionSpring, &[("one_sided", 1.0)]);
        assert_eq!((spring.value("one_sided"), spring.value("preload")), (1.0, 0.0));
        assert!(spring.value("fades_s").is_infinite());
        assert!(Effect::shaped(EffectName::CommandDelay, &[]).value("delay").is_nan(), "no default");
    }

    #[test]
    fn a_numbered_key_has_a_number() {
        let order = ShapeKey::new("order_", Missing::Numbered);
        assert!(order.is("order_7") && !order.is("order_") && !order.is("period_1"));
    }

    #[test]
    fn shapes_are_checked_when_a_rig_is_read() {
        let said =
            |name, shape: &[(&str, f64)]| Effect::shaped(name, shape).check().expect_err("it is wrong");
        assert_eq!(
            said(EffectName::StribeckFriction, &[("sped", 0.5)]),
            "shape.sped is not a value of stribeck_friction, which has speed and exponent"
        );
        assert_eq!(
            said(EffectName::CoulombFriction, &[("speed", 0.5)]),
            "shape.speed is not a value of coulomb_friction, which has none"
        );
        assert_eq!(said(EffectName::CommandDelay, &[]), "shape.delay is required and must be above zero");
        let cogging = Effect::shaped(EffectName::Cogging, &[("turn", 6.0), ("order_7", 7.0)]);
        assert_eq!(cogging.check(), Ok(()));
        let mut drag = Effect::shaped(EffectName::QuadraticDrag, &[]);
        drag.coefficients.insert("coeficient".into(), 1e-7);
        let said = drag.check().expect_err("it would count as zero");
        assert!(
            said.starts_with("coefficients.coeficient is not a value of quadratic_drag, which has "),
            "{said}"
        );
    }
}
