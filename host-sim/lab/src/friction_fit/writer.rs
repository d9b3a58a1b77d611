//! Fitted friction as TOML, for the `[law.friction]` of a profile whose law is `sparte`.

use super::FrictionFit;
use std::fmt::Write as _;

/// Standard errors on either side of a value in its 95 % interval.
const INTERVAL: f64 = 1.96;

/// The keys, with the 95 % interval of each behind it; what the recording does not tell says so.
pub fn toml(fit: &FrictionFit) -> String {
    let (slowest, fastest) =
        fit.speeds_mm_s.iter().fold((f64::MAX, 0.0_f64), |(l, h), v| (l.min(*v), h.max(*v)));
    let mut out = format!(
        "# LuGre friction, fitted by `host-sim fit-friction` to {} reversals at {slowest:.2} to {fastest:.1} mm/s.\n\
         # It leaves {:.4} N of {:.4} N rms; the sensor reads {:.4} N without a force.\n[law.friction]\n",
        fit.turns, fit.left_n, fit.force_n, fit.friction.zero_n
    );
    let (fit, error) = (&fit.friction, &fit.errors);
    for (key, value, error) in [
        ("stiffness_n_per_mm", fit.stiffness_n_per_mm, error.stiffness_n_per_mm),
        ("damping_n_s_per_mm", fit.damping_n_s_per_mm, error.damping_n_s_per_mm),
        ("viscous_n_s_per_mm", fit.viscous_n_s_per_mm, error.viscous_n_s_per_mm),
        ("sliding_n", fit.sliding_n, error.sliding_n),
        ("sticking_n", fit.sticking_n, error.sticking_n),
        ("stribeck_mm_s", fit.stribeck_mm_s, error.stribeck_mm_s),
    ] {
        let either_side = INTERVAL * error;
        let remark = if either_side < value {
            format!("{:.6} to {:.6}", value - either_side, value + either_side)
        } else {
            format!("at most {:.6}: the recording does not tell it from none", value + either_side)
        };
        let _ = writeln!(out, "{key} = {value:.6} # {remark}");
    }
    out
}
