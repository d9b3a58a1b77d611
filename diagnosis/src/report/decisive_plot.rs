//! The decisive plot, on top of the page.

use crate::decide::decisive::{Bin, Decisive, RivalLaw};
use crate::report::outcome::Outcome;
use html_report::drawing::path;
use html_report::plot::{close, frame};
use html_report::safe;
use numerics::digits::short;
use std::fmt::Write as _;

/// Draws what the refitted simulation leaves over the state of the first named law; nothing where
/// nothing is named.
pub(super) fn draw(out: &mut String, outcome: &Outcome) {
    let Some(plot) = &outcome.evidence.decisive else { return };
    let unit = &outcome.report.fit.unit;
    let what = plot.name.in_words();
    let _ = write!(
        out,
        "<section><h2>The force that was left out</h2><p class=note>The force that the simulation leaves after its values were refitted, by {}: \
         <span><i class=\"key a\"></i> fitted</span> <span><i class=\"key c\"></i> held out</span>, mean and standard deviation. \
         <span><i class=\"key law\"></i> what {} takes of it,</span> <span><i class=\"key reach\"></i> with its values anywhere in their 95 % intervals.</span></p>",
        plot.variable,
        safe(what)
    );
    if let Some(rival) = &plot.rival {
        let _ =
            write!(out, "<p class=note><i class=\"key rival\"></i> {}.</p>", safe(&sentence(what, rival)));
    }
    let bins = plot.fitted.iter().chain(&plot.held_out).flatten();
    let band = plot.band.iter().flatten().flatten();
    let ends = bins.map(|bin| bin.mean.abs() + bin.spread).chain(band.map(|end| end.abs()));
    let top = ends.fold(1e-300_f64, f64::max);
    let (low, high) = (plot.at[0], plot.at[plot.at.len() - 1]);
    let label = axis(plot, outcome);
    let way = if plot.along_motion { " in the direction of motion" } else { "" };
    let at = frame(out, (low, high), (-top, top), &label, &format!("residual force{way}, {unit}"));
    reach(out, plot, &at);
    let aside = 0.12 * (high - low) / plot.at.len() as f64;
    for (class, name, bins, aside) in
        [("a", "fitted", &plot.fitted, -aside), ("c", "held out", &plot.held_out, aside)]
    {
        let _ = write!(out, "<path class=\"bins {class}\" data-name=\"{name}\" d=\"");
        for (x, bin) in plot.at.iter().zip(bins) {
            if let Some(bin) = bin {
                mark(out, &at, x + aside, *bin);
            }
        }
        out.push_str("\"/>");
    }
    let _ = write!(out, "<path class=\"line law\" data-name=\"{}\" d=\"", safe(what));
    path(out, plot.law.iter().zip(&plot.at).filter_map(|(law, x)| law.map(|law| Some(at(*x, law)))));
    out.push_str("\"/>");
    if let Some(rival) = &plot.rival {
        let _ = write!(out, "<path class=\"line rival\" data-name=\"{}\" d=\"", safe(rival.name.in_words()));
        path(out, rival.law.iter().zip(&plot.at).map(|(law, x)| law.map(|law| at(*x, law))));
        out.push_str("\"/>");
    }
    close(out, &label);
    out.push_str("</section>");
}

/// The band of the law, a bar as wide as a bin each.
fn reach(out: &mut String, plot: &Decisive, at: &impl Fn(f64, f64) -> (f64, f64)) {
    let wide = at(plot.at[1], 0.0).0 - at(plot.at[0], 0.0).0;
    let _ = write!(out, "<path class=reach stroke-width={wide:.1} data-name=\"95 % band\" d=\"");
    for (x, ends) in plot.at.iter().zip(&plot.band) {
        if let Some([low, high]) = ends.map(|ends| ends.map(|end| at(*x, end))) {
            let _ = write!(out, "M{:.1} {:.1}V{:.1}", low.0, low.1, high.1);
        }
    }
    out.push_str("\"/>");
}

/// The nearest rival in one sentence, without its full stop.
fn sentence(winner: &str, rival: &RivalLaw) -> String {
    let name = rival.name.in_words();
    if rival.behind > 0.0 {
        format!(
            "The nearest rival, {name}, explains the held-out recordings less well than {winner}, by {} nats of log-likelihood",
            short(rival.behind)
        )
    } else {
        format!("The nearest rival, {name}, explains the held-out recordings as well as {winner}")
    }
}

/// A bar from one standard deviation below the mean to one above, with a tick at the mean.
fn mark(out: &mut String, at: &impl Fn(f64, f64) -> (f64, f64), x: f64, bin: Bin) {
    let (x, mean) = at(x, bin.mean);
    let [low, high] = [-bin.spread, bin.spread].map(|by| at(0.0, bin.mean + by).1);
    let _ = write!(out, "M{x:.1} {low:.1}V{high:.1}M{:.1} {mean:.1}H{:.1}", x - 3.0, x + 3.0);
}

fn axis(plot: &Decisive, outcome: &Outcome) -> String {
    let length = outcome.evidence.kind.length();
    if let Some(period) = plot.period {
        return format!("angle within a period of {} {length}, {length}", short(period));
    }
    match plot.variable {
        "speed" => format!("speed, {length}/s"),
        "time" => "time, s".to_owned(),
        "command" => format!("command, {}", outcome.nominal_rig.actuator.command_unit),
        "tilt" => "tilt, rad".to_owned(),
        other => format!("{other}, {length}"),
    }
}
