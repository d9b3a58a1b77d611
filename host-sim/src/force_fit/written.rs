//! A fitted table as TOML, for the `[force_table]` of a profile.

use super::Fit;
use super::table::{Cell, Origin};
use control_core::config::MAX_DEPTHS;
use std::fmt::Write as _;

/// The table, and above it what it rests on.
pub fn toml(fit: &Fit) -> String {
    let table = &fit.table;
    let mut out = String::from(
        "# F(depth, speed, angle) in N, fitted by `host-sim fit-force`; depth is perpendicular to the skin.\n",
    );
    let judged = fit.judged.iter().map(|j| j.unseen_n.powi(2)).sum::<f64>() / fit.judged.len().max(1) as f64;
    let _ = writeln!(
        out,
        "# {} insertions; what it leaves of those that it had not seen: {:.4} N rms.",
        fit.insertions.len(),
        judged.sqrt()
    );
    for (speed, angle, origin) in table.not_measured() {
        let how = if origin == Origin::Separable { "separable" } else { "the nearest cell" };
        let _ = writeln!(out, "# No data at {speed:.2} mm/s and {angle:.1} degrees: {how}.");
    }
    let deepest = table.cells.iter().flatten().map(|cell| cell.force.end()).fold(0.0, f64::max);
    // The control law has room for so many depths and takes no pull for a push.
    let step = deepest / (MAX_DEPTHS - 1) as f64;
    let row =
        |cell: &Cell| (0..MAX_DEPTHS).map(|k| cell.force.at(k as f64 * step).max(0.0)).collect::<Vec<_>>();
    let numbers = |values: &[f64], decimals: usize| {
        values.iter().map(|v| format!("{v:.decimals$}")).collect::<Vec<_>>().join(", ")
    };
    let _ = writeln!(out, "[force_table]");
    let _ = writeln!(out, "depth_step_mm = {:.5}", step);
    let _ = writeln!(out, "speeds_mm_s = [{}]", numbers(&table.speeds_mm_s, 3));
    let _ = writeln!(out, "angles_deg = [{}]", numbers(&table.angles_deg, 2));
    let cells = table.cells.iter().flatten();
    let measured =
        cells.clone().map(|cell| (cell.origin == Origin::Measured).to_string()).collect::<Vec<_>>();
    let _ = writeln!(out, "measured = [{}]", measured.join(", "));
    out.push_str("# A line for every speed and angle, the angles of a speed together; the values are at 0, 1, 2 … steps of depth.\nforce_n = [\n");
    for cell in cells {
        let _ = writeln!(out, "  [{}],", numbers(&row(cell), 4));
    }
    out.push_str("]\n");
    out
}
