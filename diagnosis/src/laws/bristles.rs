//! Bristles that bend before they slide: the hysteresis of friction just after a reversal, as a
//! part of the sliding force.
//!
//! One length is Dahl's law (Dahl 1968, exponent 1), which LuGre (Canudas de Wit et al. 1995)
//! dampens. Several, from short to long, are Maxwell-slip elements, each a share of the force that
//! bends and then slides (Iwan 1966; Lampaert, Al-Bender and Swevers 2003): asperities of many
//! sizes.

use super::Effect;
use super::shape::shape;

shape! {
    /// The travel over which bristles bend.
    struct Shape {
        /// Travel over which the middle one bends, rad or m.
        deflection: needed,
        /// Ratio of the longest such travel to the shortest.
        spread: 1.0,
    }
}

/// Elements of a spread: enough to look smooth over a decade.
const ELEMENTS: u32 = 6;

/// Elements with the travel over which each bends and how far it is bent, −1 to 1.
#[derive(Debug, Clone)]
pub(crate) struct Bristles {
    elements: Vec<(f64, f64)>,
}

/// Travel over which each element bends, from short to long; one where they are not spread.
pub(crate) fn lengths(effect: &Effect) -> Vec<f64> {
    let Shape { deflection: middle, spread } = Shape::of(effect);
    if spread <= 1.0 {
        return vec![middle];
    }
    let part = |i: u32| f64::from(i) / f64::from(ELEMENTS - 1) - 0.5;
    (0..ELEMENTS).map(|i| middle * spread.powf(part(i))).collect()
}

impl Bristles {
    pub(crate) fn new(effect: &Effect) -> Self {
        Self { elements: lengths(effect).into_iter().map(|length| (length, 0.0)).collect() }
    }

    /// Returns their mean bend while `travel` passes, −1 to 1, and the difference of the bend
    /// between its end and its start; 1 where all slide forward.
    pub(crate) fn bend(&mut self, travel: f64) -> (f64, f64) {
        let slides = self.elements.len() > 1;
        let (mut sum, mut more) = (0.0, 0.0);
        for (length, bent) in &mut self.elements {
            let after = if slides {
                (*bent + travel / *length).clamp(-1.0, 1.0)
            } else {
                // dz/dq = (1 − z·sgn v)/deflection: z relaxes towards the sign of motion.
                let way = travel.signum();
                way + (*bent - way) * (-travel.abs() / *length).exp()
            };
            sum += 0.5 * (after + *bent);
            more += after - *bent;
            *bent = after;
        }
        let count = self.elements.len() as f64;
        (sum / count, more / count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::EffectName;

    fn bristles(shape: &[(&str, f64)]) -> Bristles {
        Bristles::new(&Effect::shaped(EffectName::PreslidingFriction, shape))
    }

    /// Bends from straight in many steps.
    fn bent_after(bristles: &mut Bristles, travel: f64) -> f64 {
        (0..10_000).map(|_| bristles.bend(travel / 10_000.0).0).last().unwrap()
    }

    #[test]
    fn dahls_bristles_near_the_sliding_force_as_an_exponential() {
        let bent = bent_after(&mut bristles(&[("deflection", 2.0)]), 2.0);
        assert!((bent - (1.0 - (-1.0_f64).exp())).abs() < 1e-3, "{bent}");
    }

    #[test]
    fn spread_bristles_slide_one_after_another_until_all_do() {
        let spread = [("deflection", 1.0), ("spread", 100.0)];
        let bend = |travel: f64| bent_after(&mut bristles(&spread), travel);
        // Lengths of 0.1 to 10: at 0.1 the shortest slides, the others are bent by 0.1 of their
        // lengths' inverse.
        let lengths = lengths(&Effect::shaped(EffectName::PreslidingFriction, &spread));
        let expected = lengths.iter().map(|length| (0.1 / length).min(1.0)).sum::<f64>() / 6.0;
        assert!((bend(0.1) - expected).abs() < 1e-3, "{} instead of {expected}", bend(0.1));
        assert!(bend(5.0) < 0.95 && bend(10.5) == 1.0);
    }

    #[test]
    fn a_reversal_takes_twice_the_length() {
        let mut one = bristles(&[("deflection", 1.0), ("spread", 1.0001)]);
        bent_after(&mut one, 3.0);
        assert!(bent_after(&mut one, -1.0).abs() < 1e-3, "straight after one length");
        assert!((bent_after(&mut one, -1.01) + 1.0).abs() < 1e-2, "the other way after two");
    }
}
