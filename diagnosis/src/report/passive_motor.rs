//! MuJoCo's `dcmotor` without a winding: LuGre friction and cogging that act on a joint.

use super::xml::number;
use crate::laws::joint_terms::{Bristles, Drop, JointTerms, Wave};
use std::fmt::Write as _;

/// Phase by which rigid bristles swing in a step, rad.
const RIGID: f64 = 0.2;

/// LuGre's friction of a joint: stiffness, damping, sliding and static friction, and the speed
/// between them, in N·m and rad or N and m; none where dry friction says all. Friction that falls
/// with speed and has no bristles gets such as a step just resolves.
pub(super) fn lugre(joint: &JointTerms, step_s: f64) -> Option<[f64; 5]> {
    let drop = joint.drop.unwrap_or(Drop { peak: 0.0, speed: 1.0 });
    if let Some(Bristles { dry, deflection, damping }) = joint.bristles {
        return Some([dry / deflection, damping, dry, dry + drop.peak, drop.speed]);
    }
    let per_s = RIGID / step_s;
    let (stiffness, damping) = (joint.inertia * per_s * per_s, 2.0 * joint.inertia * per_s);
    joint.drop.map(|_| [stiffness, damping, joint.dry, joint.dry + drop.peak, drop.speed])
}

/// The actuators, with no control each.
pub(super) fn tags(joint: &str, lugre: Option<[f64; 5]>, waves: &[Wave]) -> String {
    let mut out = String::new();
    if let Some(lugre) = lugre {
        tag(&mut out, joint, "friction", "lugre", &lugre);
    }
    for (k, one) in waves.iter().enumerate() {
        let values = [one.amplitude, one.wave, one.phase];
        tag(&mut out, joint, &format!("cogging_{}", k + 1), "cogging", &values);
    }
    out
}

/// Gear and limit are given, because those of a class of motors would be inherited.
fn tag(out: &mut String, joint: &str, name: &str, key: &str, values: &[f64]) {
    let values: Vec<String> = values.iter().map(|x| number(*x)).collect();
    let _ = write!(
        out,
        "<dcmotor name=\"{joint}_{name}\" joint=\"{joint}\" input=\"none\" motorconst=\"0 0\" resistance=\"1\" gear=\"1 0 0 0 0 0\" \
         saturation=\"0 0 0\" {key}=\"{}\"/>",
        values.join(" ")
    );
}
