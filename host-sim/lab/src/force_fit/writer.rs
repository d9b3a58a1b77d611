//! A fitted table as TOML, for the `[force_table]` of a profile.

use super::Fit;
use super::table::{Cell, Origin};
use super::worst_peak;
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
        "# {} insertions; residual of this table on those that it had not seen: {:.4} N rms.",
        fit.insertions.len(),
        judged.sqrt()
    );
    if let Some(worst) = worst_peak(&fit.judged) {
        let _ = writeln!(out, "# The forces at which layers give way are met within {:.1} %.", worst * 100.0);
    }
    for (speed, angle, origin) in table.not_measured() {
        let how = if origin == Origin::Separable { "separable" } else { "the nearest cell" };
        let _ = writeln!(out, "# No data at {speed:.2} mm/s and {angle:.1} degrees: {how}.");
    }
    let numbers = |values: &[f64], decimals: usize| {
        values.iter().map(|v| format!("{v:.decimals$}")).collect::<Vec<_>>().join(", ")
    };
    let _ = writeln!(out, "[force_table]");
    let _ = writeln!(out, "speeds_mm_s = [{}]", numbers(&table.speeds_mm_s, 3));
    let _ = writeln!(out, "angles_deg = [{}]", numbers(&table.angles_deg, 2));
    let cells = table.cells.iter().flatten();
    let measured =
        cells.clone().map(|cell| (cell.origin == Origin::Measured).to_string()).collect::<Vec<_>>();
    let _ = writeln!(out, "measured = [{}]", measured.join(", "));
    let knots: Vec<String> = table.gives_way.iter().map(usize::to_string).collect();
    let _ = writeln!(
        out,
        "gives_way = [{}]            # knots, counted from 0, at which a layer gives way",
        knots.join(", ")
    );
    out.push_str("# A line for every speed and angle, the angles of a speed together.\n");
    let mut rows = |key: &str, decimals: usize, values: &dyn Fn(&Cell) -> &Vec<f64>| {
        let _ = writeln!(out, "{key} = [");
        for cell in cells.clone() {
            let _ = writeln!(out, "  [{}],", numbers(values(cell), decimals));
        }
        out.push_str("]\n");
    };
    rows("depths_mm", 2, &|cell| &cell.force.depths_mm);
    rows("force_n", 3, &|cell| &cell.force.forces_n);
    out
}
