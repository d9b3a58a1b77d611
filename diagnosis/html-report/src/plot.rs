//! A plot that shows its values under the pointer: its frame with round ticks and units, and the
//! mapping of values to places. Plain SVG; without [`SCRIPT`] it shows the same curves.

use crate::drawing::{decimals, round_step, ticks};
use crate::safe;
use std::fmt::Write as _;

/// Shows the values of the paths that have a `data-name` under the pointer, and a stretch alone
/// once it is dragged over. For the end of a page's body; the page's style gives colours to
/// `.cursor` and `.chosen`.
pub const SCRIPT: &str = include_str!("plot.js");

/// Size of a plot and its margins, in its own units.
const WIDE: f64 = 640.0;
/// The height of a frame, in drawing units: places run from 0 at the top to this.
pub const HIGH: f64 = 190.0;
/// Room for a tick's label of eight characters, minus sign included, in the large type of small
/// plots.
const LEFT: f64 = 96.0;
const TOP: f64 = 16.0;
const BOTTOM: f64 = 32.0;
/// Room between the curves and the frame.
const EDGE: f64 = 6.0;

/// Ticks of a range.
const TICKS: f64 = 6.0;

/// Returns a tick's label, with as many decimals as distinguish it from its neighbours.
fn label(value: f64, step: f64) -> String {
    let size = value.abs().max(step);
    if size >= 1e5 || step < 1e-4 {
        let digits = (size.log10().floor() - step.log10().floor()).clamp(0.0, 6.0) as usize;
        return if value == 0.0 { "0".into() } else { format!("{value:.digits$e}") };
    }
    format!("{:.*}", decimals(step), value + 0.0)
}

/// A range that has a size: a curve of zeros is drawn between -1 and 1.
fn with_size((low, high): (f64, f64)) -> (f64, f64) {
    let middle = 0.5 * (low + high);
    if high - low > f64::EPSILON * middle.abs() && high - low > SMALLEST {
        (low, high)
    } else {
        (middle - 1.0, middle + 1.0)
    }
}

/// Nothing that is measured is smaller.
const SMALLEST: f64 = 1e-100;

/// A frame with its ticks, under the title of its upright axis; returns the mapping of values to
/// places. [`close`] ends it. `plot.js` reads the ranges and shows the values of the paths that
/// have a `data-name`.
pub fn frame(
    out: &mut String,
    x: (f64, f64),
    y: (f64, f64),
    x_label: &str,
    y_label: &str,
) -> impl Fn(f64, f64) -> (f64, f64) + use<> {
    let x = with_size(x);
    let along = round_step((x.1 - x.0) / TICKS);
    let ticks = ticks(x.0, x.1, along).into_iter().map(|value| (value, label(value, along))).collect();
    framed(out, x, y, (x_label, y_label), (ticks, ""))
}

/// The same over the logarithm of a range above zero.
pub fn log_frame(
    out: &mut String,
    x: (f64, f64),
    y: (f64, f64),
    x_label: &str,
    y_label: &str,
) -> impl Fn(f64, f64) -> (f64, f64) + use<> {
    let logs = with_size((x.0.log10(), x.1.log10()));
    let parts: &[f64] =
        if logs.1 - logs.0 > 1.0 { &[1.0, 2.0, 5.0] } else { &[1.0, 2.0, 3.0, 4.0, 5.0, 7.0] };
    let round =
        |power: i32| parts.iter().map(move |part| (part * 10_f64.powi(power), (-power).max(0) as usize));
    let powers = logs.0.floor() as i32..=logs.1.floor() as i32;
    let inside = powers.flat_map(round).filter(|(value, _)| (logs.0..=logs.1).contains(&value.log10()));
    let ticks = inside.map(|(value, decimals)| (value.log10(), format!("{value:.decimals$}"))).collect();
    let at = framed(out, logs, y, (x_label, y_label), (ticks, " data-log=10"));
    move |a: f64, b: f64| at(a.log10(), b)
}

/// A frame with the ticks along its level axis, and an attribute for the script.
fn framed(
    out: &mut String,
    x: (f64, f64),
    y: (f64, f64),
    (x_label, y_label): (&str, &str),
    (along, attribute): (Vec<(f64, String)>, &str),
) -> impl Fn(f64, f64) -> (f64, f64) + use<> {
    let (x_label, y_label) = (safe(x_label), safe(y_label));
    let y = with_size(y);
    let _ = write!(
        out,
        "<div class=plot><p class=axis>{y_label}</p><svg viewBox=\"0 -{TOP} {WIDE} {}\" role=img{attribute} data-of=\"{x_label}\" \
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
    let up = round_step((y.1 - y.0) / TICKS);
    for value in ticks(y.0, y.1, up) {
        let (_, py) = at(x.0, value);
        let _ = write!(
            out,
            "<line class=grid x1={LEFT} x2={WIDE} y1={py:.1} y2={py:.1} /><text x={} y={:.1} text-anchor=end>{}</text>",
            LEFT - 5.0,
            py + 3.0,
            label(value, up)
        );
    }
    for (value, label) in along {
        let (px, _) = at(value, y.0);
        let anchor = if px > WIDE - 24.0 { "end" } else { "middle" };
        let _ = write!(
            out,
            "<line class=grid x1={px:.1} x2={px:.1} y1={} y2={HIGH} /><text x={px:.1} y={} text-anchor={anchor}>{}</text>",
            HIGH - 5.0,
            HIGH + 24.0,
            label
        );
    }
    at
}

/// Ends a frame, with the title of its level axis.
pub fn close(out: &mut String, x_label: &str) {
    let _ = write!(out, "</svg><p class=\"axis level\">{}</p></div>", safe(x_label));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_of_ticks_differ_from_each_other() {
        for (low, high) in [(-0.0137, 0.0141), (0.0, 24.813), (-371.0, 9.0), (1e-9, 4.4e-9), (0.2, 0.21)] {
            let step = round_step((high - low) / 5.0);
            let labels: Vec<String> = ticks(low, high, step).into_iter().map(|t| label(t, step)).collect();
            let distinct: std::collections::BTreeSet<&String> = labels.iter().collect();
            assert_eq!(distinct.len(), labels.len(), "{labels:?}");
        }
        assert_eq!([label(0.5, 0.5), label(20.0, 5.0), label(-0.0, 0.1)], ["0.5", "20", "0.0"]);
    }

    #[test]
    fn a_label_has_room_for_its_minus_sign() {
        // A digit is 0.56 as wide as the type is high: 19 units in the small plots of a report.
        let wide = |text: &str| text.chars().count() as f64 * 0.56 * 19.0;
        for top in [3.7, 0.81, 0.0141, 7.3e-4, 9.2e-9, 41_000.0, 6.1e7] {
            let step = round_step(2.0 * top / TICKS);
            for tick in ticks(-top, top, step) {
                assert!(wide(&label(tick, step)) < LEFT - 5.0, "{}", label(tick, step));
            }
        }
    }

    #[test]
    fn a_curve_of_zeros_has_an_axis_that_people_read() {
        let mut out = String::new();
        let _ = frame(&mut out, (0.0, 10.0), (-1e-300, 1e-300), "time, s", "force, N");
        assert!(out.contains("data-y=\"-1e0 1e0\"") && !out.contains("e-30"), "{out}");
    }

    #[test]
    fn a_logarithmic_frame_has_round_ticks_at_their_places() {
        let mut out = String::new();
        let at = log_frame(&mut out, (0.2, 20.0), (0.0, 1.0), "frequency, Hz", "x");
        assert!(
            (at(2.0, 0.0).0 - 0.5 * (LEFT + WIDE - EDGE)).abs() < 1e-9,
            "the middle is the mean of logarithms"
        );
        let labels = |out: &str| -> Vec<String> {
            let texts = out.split("text-anchor=").skip(1);
            texts.filter_map(|part| Some(part.split('>').nth(1)?.split('<').next()?.to_owned())).collect()
        };
        for wanted in ["0.2", "0.5", "1", "2", "5", "10", "20"] {
            assert!(labels(&out).contains(&wanted.to_owned()), "{wanted}: {out}");
        }
        let mut short = String::new();
        let _ = log_frame(&mut short, (0.25, 0.8), (0.0, 1.0), "frequency, Hz", "x");
        assert!(
            labels(&short).contains(&"0.3".to_owned()) && labels(&short).contains(&"0.7".to_owned()),
            "{short}"
        );
    }

    #[test]
    fn a_frame_maps_its_range_and_passes_it_to_the_script() {
        let mut out = String::new();
        let at = frame(&mut out, (0.0, 10.0), (-1.0, 1.0), "time, s", "force <N>");
        close(&mut out, "time, s");
        assert_eq!((at(0.0, 1.0), at(10.0, -1.0)), ((LEFT, EDGE), (WIDE - EDGE, HIGH - EDGE)));
        assert_eq!((at(5.0, 1e9).1, at(5.0, -1e9).1), (0.0, HIGH), "a place is in the frame");
        assert!(out.contains("data-x=\"0e0 1e1\" data-y=\"-1e0 1e0\"") && out.contains("force &lt;N&gt;"));
    }
}
