//! The report in ten lines, for the terminal.

use crate::data::recording::shown_at;
use crate::data::schema::ByModel;
use crate::laws::EffectName;
use crate::report::faults;
use crate::report::outcome::Outcome;
use numerics::digits::short;
use std::fmt::Write as _;

impl Outcome {
    /// Ten lines for the terminal.
    pub fn summary(&self) -> String {
        let r = &self.report;
        let mut out =
            format!("{}.\n  what remains: {}\n  record next: {}\n", r.sentence, r.remains, r.record_next);
        for fault in faults::clauses(&r.data_faults) {
            out.push_str(&format!("  fault of the data: {fault}\n"));
        }
        for note in &r.notes {
            out.push_str(&format!("  note: {note}\n"));
        }
        for effect in &r.effects {
            let values: Vec<String> = effect
                .parameters
                .iter()
                .take(4)
                .map(|(name, p)| {
                    let [low, high] = p.ci95;
                    let text = format!("{name} {} [{}, {}]", short(p.value), short(low), short(high));
                    format!("{text} {}", p.unit_in_words()).trim_end().to_owned()
                })
                .collect();
            let _ = writeln!(out, "  {} ({:.2}): {}", effect.name, effect.confidence, values.join("; "));
        }
        if r.fit.nominal.fit.is_finite() {
            self.figures(&mut out);
        }
        let losers: Vec<&str> = r
            .hypotheses
            .iter()
            .filter(|h| h.rejected_because.is_some())
            .map(|h| EffectName::as_str(h.name))
            .take(6)
            .collect();
        if !losers.is_empty() {
            let _ = writeln!(out, "  tested and rejected: {}", losers.join(", "));
        }
        if let [first, more @ ..] = &r.untested[..] {
            let more =
                if more.is_empty() { String::new() } else { format!("; {} more in the report", more.len()) };
            let _ = writeln!(out, "  not tested: {} ({}{more})", first.name, first.because);
        }
        out
    }

    /// Writes the errors of the models in force and in motion.
    fn figures(&self, out: &mut String) {
        let r = &self.report;
        let f = &r.fit;
        for (name, both) in [("nominal", f.nominal), ("refit", f.refit), ("patched", f.patched)] {
            let percent = |x: f64, whole: f64| if whole > 0.0 { 100.0 * x / whole } else { 0.0 };
            let _ = writeln!(
                out,
                "  force error, {name:7}: fitted {} {} ({:.2} %), held out {} ({:.2} %)",
                short(both.fit),
                f.unit,
                percent(both.fit, f.force_rms.fit),
                short(both.holdout),
                percent(both.holdout, f.force_rms.holdout)
            );
        }
        let _ = writeln!(
            out,
            "  residuals below {:.0} Hz; sensor noise {} {}; unexplained {:.0} %",
            r.residual_bandwidth_hz,
            short(r.noise_floor),
            f.unit,
            100.0 * r.unexplained_fraction
        );
        if let Some(rate) = self.evidence.rate_hz {
            let _ = writeln!(out, "  {}", shown_at(rate));
        }
        if let Some(simulation) = &r.simulation {
            let named = |name: &str, x: Option<f64>| x.map(|x| format!("{name} {}", short(x)));
            let of_each = |m: &ByModel| {
                let all = [named("nominal", m.nominal), named("refit", m.refit), named("patched", m.patched)];
                all.into_iter().flatten().collect::<Vec<_>>().join(", ")
            };
            if let Some(window) = simulation.windows.iter().find(|w| w.seconds >= 0.5) {
                let _ = writeln!(
                    out,
                    "  held-out position RMSE, windows of {} s: {} {}",
                    window.seconds,
                    of_each(&window.position),
                    simulation.unit
                );
            }
            let _ = writeln!(
                out,
                "  held-out position RMSE, free run: {} {}",
                of_each(&simulation.free_run),
                simulation.unit
            );
            if let Some(worse) = &simulation.worse {
                let _ = writeln!(out, "  {worse}");
            }
        }
    }
}
