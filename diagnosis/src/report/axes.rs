//! The frame of a picture: round ticks, units, and the mapping of values to places. Plain SVG.

use std::fmt::Write as _;

/// Text that may stand in a page.
pub(crate) fn safe(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Size of a picture and its margins, in its own units.
pub(crate) const WIDE: f64 = 640.0;
pub(crate) const HIGH: f64 = 190.0;
const LEFT: f64 = 72.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 32.0;
/// Room between the curves and the frame.
const EDGE: f64 = 6.0;

/// Round values within a range, about `count` of them: 1, 2 or 5 times a power of ten apart.
pub(crate) fn ticks(low: f64, high: f64, count: f64) -> Vec<f64> {
    let span = high - low;
    if !(span > 0.0 && span.is_finite()) {
        return vec![low];
    }
    let rough = span / count;
    let power = 10_f64.powf(rough.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|s| *s >= 0.999 * rough).unwrap_or(rough);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|k| k as f64 * step).collect()
}

/// A tick's label: as many decimals as tell it from its neighbours.
pub(crate) fn label(value: f64, step: f64) -> String {
    let size = value.abs().max(step);
    if size >= 1e5 || step < 1e-4 {
        let digits = (size.log10().floor() - step.log10().floor()).clamp(0.0, 6.0) as usize;
        return if value == 0.0 { "0".into() } else { format!("{value:.digits$e}") };
    }
    let decimals = (-(step * 1.0001).log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{:.decimals$}", value + 0.0)
}

/// A frame with its ticks, under the title of its upright axis; returns the mapping of values to places. [`close`] ends it.
/// `plot.js` reads the ranges and shows the values of the paths that have a `data-name`.
pub(crate) fn frame(
    out: &mut String,
    x: (f64, f64),
    y: (f64, f64),
    x_label: &str,
    y_label: &str,
) -> impl Fn(f64, f64) -> (f64, f64) + use<> {
    let (x_label, y_label) = (safe(x_label), safe(y_label));
    let _ = write!(
        out,
        "<div class=plot><p class=axis>{y_label}</p><svg viewBox=\"0 -{TOP} {WIDE} {}\" role=img data-of=\"{x_label}\" \
         data-x=\"{:e} {:e}\" data-y=\"{:e} {:e}\" data-box=\"{LEFT} {} {EDGE} {}\"><title>{y_label} over {x_label}</title>",
        TOP + HIGH + BOTTOM,
        x.0,
        x.1,
        y.0,
        y.1,
        WIDE - EDGE,
        HIGH - EDGE
    );
    let at = move |a: f64, b: f64| {
        let px = LEFT + (a - x.0) / (x.1 - x.0).max(1e-300) * (WIDE - LEFT - EDGE);
        let py = EDGE + (y.1 - b) / (y.1 - y.0).max(1e-300) * (HIGH - 2.0 * EDGE);
        (px, py.clamp(0.0, HIGH))
    };
    let step = |ticks: &[f64]| if let [a, b, ..] = ticks { b - a } else { 1.0 };
    let up = ticks(y.0, y.1, 6.0);
    for value in &up {
        let (_, py) = at(x.0, *value);
        let _ = write!(
            out,
            "<line class=grid x1={LEFT} x2={WIDE} y1={py:.1} y2={py:.1} /><text x={} y={:.1} text-anchor=end>{}</text>",
            LEFT - 5.0,
            py + 3.0,
            label(*value, step(&up))
        );
    }
    let along = ticks(x.0, x.1, 6.0);
    for value in &along {
        let (px, _) = at(*value, y.0);
        let anchor = if px > WIDE - 24.0 { "end" } else { "middle" };
        let _ = write!(
            out,
            "<line class=grid x1={px:.1} x2={px:.1} y1={} y2={HIGH} /><text x={px:.1} y={} text-anchor={anchor}>{}</text>",
            HIGH - 5.0,
            HIGH + 24.0,
            label(*value, step(&along))
        );
    }
    at
}

/// Ends a frame, with the title of its level axis.
pub(crate) fn close(out: &mut String, x_label: &str) {
    let _ = write!(out, "</svg><p class=\"axis level\">{}</p></div>", safe(x_label));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_their_range() {
        for (low, high) in [(-0.0137, 0.0141), (0.0, 24.813), (-371.0, 9.0), (1e-9, 4.4e-9), (0.2, 0.21)] {
            let found = ticks(low, high, 5.0);
            assert!((3..=8).contains(&found.len()), "{found:?}");
            let step = found[1] - found[0];
            let mantissa = step / 10_f64.powf((step * 1.000_001).log10().floor());
            assert!([1.0, 2.0, 5.0].iter().any(|m| (mantissa - m).abs() < 1e-6), "{step}");
            assert!(found.iter().all(|t| *t >= low - 1e-6 * step && *t <= high + 1e-6 * step));
            let labels: Vec<String> = found.iter().map(|t| label(*t, step)).collect();
            let distinct: std::collections::BTreeSet<&String> = labels.iter().collect();
            assert_eq!(distinct.len(), labels.len(), "{labels:?}");
        }
        assert_eq!(
            (label(0.5, 0.5), label(20.0, 5.0), label(-0.0, 0.1)),
            ("0.5".into(), "20".into(), "0.0".into())
        );
    }
}
