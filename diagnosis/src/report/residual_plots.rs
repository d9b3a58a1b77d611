//! Plots of the place of the residual: over time and over states.

use crate::decide::diagnosis::Series;
use crate::evidence::residual_maps::Map;
use crate::report::motion_picture::COLUMNS;
use crate::report::outcome::Outcome;
use html_report::drawing::{path, thinned};
use html_report::plot::{HIGH, close, frame};
use html_report::safe;
use std::fmt::Write as _;

/// Residuals along each recording.
pub(super) fn over_time(out: &mut String, outcome: &Outcome) {
    let unit = &outcome.report.fit.unit;
    let marked = "<span><i class=\"key m\"></i> where</span>";
    let (after_name, marks_say) = match &outcome.report {
        report if !report.effects.is_empty() || outcome.evidence.form.is_some() => {
            ("with what was found", format!(" {marked} the effects found are strongest"))
        }
        report if report.place.is_some() => {
            ("with its values refitted", format!(" {marked} its residual is largest"))
        }
        _ => ("with its values refitted", String::new()),
    };
    let _ = write!(
        out,
        "<section><h2>Where: residual over time</h2><p class=note><span><i class=\"key a\"></i> as it is</span> <span><i class=\"key c\"></i> \
         {after_name}</span>{marks_say}. Gaps: at rest, where friction is a reaction.</p>",
    );
    for series in &outcome.evidence.series {
        let kind = if series.held_out { "held out" } else { "fitted" };
        let _ = write!(out, "<h3>{} <small>{kind}</small></h3>", safe(&series.file));
        let last = series.time_s.last().copied().unwrap_or(1.0);
        let columns = [("a", "as it is", &series.nominal), ("c", after_name, &series.patched)];
        let mut sizes: Vec<f64> =
            columns.iter().flat_map(|(.., x)| x.iter().flatten().map(|x| x.abs())).collect();
        sizes.sort_by(f64::total_cmp);
        let top = sizes.get(sizes.len() * 997 / 1000).copied().unwrap_or(1.0).max(1e-300);
        let at = frame(out, (0.0, last), (-top, top), "time, s", &format!("residual force, {unit}"));
        marks(out, outcome, series, &at);
        for (class, name, column) in columns {
            let _ = write!(out, "<path class=\"band {class}\" data-name=\"{name}\" d=\"");
            let blocks: Vec<(f64, f64)> =
                series.time_s.iter().zip(column).map(|(t, x)| (*t, x.unwrap_or(f64::NAN))).collect();
            path(out, thinned(&blocks, COLUMNS).into_iter().map(|(t, x)| x.is_finite().then(|| at(t, x))));
            out.push_str("\"/>");
        }
        close(out, "time, s");
    }
    out.push_str("</section>");
}

fn marks(out: &mut String, outcome: &Outcome, series: &Series, at: &impl Fn(f64, f64) -> (f64, f64)) {
    let places = outcome.report.effects.iter().map(|e| &e.place).chain(&outcome.report.place);
    for place in places {
        for stretch in place.recordings.iter().filter(|s| s.file == series.file) {
            for [from, to] in &stretch.intervals_s {
                let (x0, x1) = (at(*from, 0.0).0, at(*to, 0.0).0);
                let _ = write!(
                    out,
                    "<rect class=mark x={x0:.1} y=0 width={:.1} height={HIGH} />",
                    (x1 - x0).max(1.0)
                );
            }
        }
    }
}

/// Residuals over states that carry to the held-out recordings.
pub(super) fn over_states(out: &mut String, outcome: &Outcome) {
    if outcome.evidence.maps.is_empty() {
        return;
    }
    let model = if outcome.report.effects.is_empty() { "refitted" } else { "patched" };
    let _ = write!(
        out,
        "<section><h2>Where: residual over states</h2><p class=note><span><i class=\"key f\"></i> moving forward</span> <span><i class=\"key r\"></i> moving \
         backward.</span> Mean residual of the {model} model on the fitted recordings.</p><div class=maps>",
    );
    for map in &outcome.evidence.maps {
        draw(out, map, &outcome.report.fit.unit, outcome.evidence.kind.length());
    }
    out.push_str("</div></section>");
}

fn draw(out: &mut String, map: &Map, unit: &str, length: &str) {
    let x_unit = match map.variable {
        "speed" => format!("{length}/s"),
        "time" => "s".to_owned(),
        "command" => "command units".to_owned(),
        _ => length.to_owned(),
    };
    let top = map.forward.iter().chain(&map.backward).flatten().fold(1e-300_f64, |m, x| m.max(x.abs()));
    let low = map.edges.first().copied().unwrap_or(0.0);
    let high = map.edges.last().copied().unwrap_or(1.0);
    out.push_str("<figure>");
    let x_label = format!("{}, {x_unit}", map.variable);
    let at = frame(out, (low, high), (-top, top), &x_label, &format!("residual force, {unit}"));
    for (class, name, column) in [("f", "forward", &map.forward), ("r", "backward", &map.backward)] {
        let _ = write!(out, "<path class=\"line {class}\" data-name={name} d=\"");
        let places = map.edges.windows(2).map(|edges| 0.5 * (edges[0] + edges[1]));
        path(out, column.iter().zip(places).map(|(value, x)| value.map(|value| at(x, value))));
        out.push_str("\"/>");
    }
    let carries = if map.significant {
        format!("predicts {:.0} % of the held-out residual", 100.0 * map.carries.max(0.0))
    } else {
        "does not generalise to the held-out recordings".to_owned()
    };
    close(out, &x_label);
    let _ = write!(out, "<figcaption>over {}: {carries}</figcaption></figure>", map.variable);
}
