//! Curves in a frame with scales, as SVG that takes its colours from the page.

use crate::drawing::{decimals, path, round_step, thinned, ticks};
use crate::{decimal, safe};
use std::fmt::Write as _;

/// Drawing units: on a phone two thirds of them are a pixel, so that 14 stay readable.
const WIDE: f64 = 520.0;
const HIGH: f64 = 300.0;
const LEFT: f64 = 52.0;
const RIGHT: f64 = 10.0;
const BOTTOM: f64 = 44.0;
/// A legend's line.
const LINE: f64 = 20.0;
/// A row of names of marks.
const NAME: f64 = 18.0;
/// Columns of a curve: more are not seen.
const COLUMNS: usize = 600;

/// One curve.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Its name in the legend; empty if it needs none.
    pub name: String,
    /// Its colour: 0 to 5.
    pub colour: u8,
    /// Drawn in dashes.
    pub dashed: bool,
    /// In their order; a gap where a number is not finite.
    pub points: Vec<(f64, f64)>,
}

/// A frame with curves.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// Over the frame.
    pub title: String,
    /// Under it, with the unit.
    pub x_label: String,
    /// Beside it, with the unit.
    pub y_label: String,
    /// The curves, the last on top.
    pub curves: Vec<Curve>,
    /// Places along x that have a name.
    pub marks: Vec<(f64, String)>,
    /// From where to where along x the frame is shaded.
    pub zone: Option<(f64, f64)>,
    /// Values of y that are always shown; 0 is.
    pub y_includes: Vec<f64>,
}

impl Chart {
    /// The drawing.
    pub fn svg(&self) -> String {
        let (x, y) = (self.x_range(), self.y_range());
        let named: Vec<&Curve> = self.curves.iter().filter(|c| !c.name.is_empty()).collect();
        let legend = legend_rows(&named);
        let to_x = |v: f64| LEFT + (v - x.low) / (x.high - x.low) * (WIDE - LEFT - RIGHT);
        let names = self.place_names(&to_x);
        let rows = names.iter().map(|(_, row)| row + 1).max().unwrap_or(0);
        let top = 26.0 + LINE * legend.len() as f64 + NAME * rows as f64;
        let total = top + HIGH + BOTTOM;
        let mut out = format!("<svg viewBox=\"0 0 {WIDE} {total}\" role=img>");
        let _ = write!(out, "<title>{}</title>", safe(&self.title));
        let _ = write!(out, "<text class=title x={LEFT} y=16>{}</text>", safe(&self.title));
        draw_legend(&mut out, &legend);
        let to_y = |v: f64| top + (y.high - v) / (y.high - y.low) * HIGH;
        if let Some((from, to)) = self.zone {
            let (from, wide) = (to_x(from), to_x(to) - to_x(from));
            let _ = write!(out, "<rect class=zone x={from:.1} y={top:.1} width={wide:.1} height={HIGH} />");
        }
        for value in y.ticks() {
            let at = to_y(value);
            let _ = write!(
                out,
                "<line class=grid x1={LEFT} x2={:.1} y1={at:.1} y2={at:.1} /><text x={:.1} y={:.1} text-anchor=end>{}</text>",
                WIDE - RIGHT,
                LEFT - 6.0,
                at + 5.0,
                decimal(value, y.decimals)
            );
        }
        for value in x.ticks() {
            let at = to_x(value);
            let _ = write!(
                out,
                "<line class=grid x1={at:.1} x2={at:.1} y1={top:.1} y2={:.1} /><text x={at:.1} y={:.1} text-anchor=middle>{}</text>",
                top + HIGH,
                top + HIGH + 18.0,
                decimal(value, x.decimals)
            );
        }
        let zero = to_y(0.0_f64.clamp(y.low, y.high));
        let _ = write!(out, "<line class=axis x1={LEFT} x2={:.1} y1={zero:.1} y2={zero:.1} />", WIDE - RIGHT);
        self.draw_marks(&mut out, &to_x, &names, top);
        for curve in &self.curves {
            draw_curve(&mut out, curve, &to_x, &to_y);
        }
        let _ = write!(
            out,
            "<text x={:.1} y={:.1} text-anchor=end>{}</text><text x=12 y={:.1} text-anchor=middle transform=\"rotate(-90 12 {:.1})\">{}</text></svg>",
            WIDE - RIGHT,
            total - 6.0,
            safe(&self.x_label),
            top + HIGH / 2.0,
            top + HIGH / 2.0,
            safe(&self.y_label)
        );
        out
    }

    /// Returns the middle of each mark's name, and its row above the frame: a name that would run
    /// into another goes a row higher.
    fn place_names(&self, to_x: &impl Fn(f64) -> f64) -> Vec<(f64, usize)> {
        let mut free: Vec<f64> = Vec::new();
        let place = |(value, name): &(f64, String)| {
            let half = 3.7 * name.chars().count() as f64;
            let middle = to_x(*value).clamp(LEFT + half, (WIDE - RIGHT - half).max(LEFT + half));
            let row = free.iter().position(|free| middle - half >= *free).unwrap_or(free.len());
            if row == free.len() {
                free.push(LEFT);
            }
            free[row] = middle + half + 6.0;
            (middle, row)
        };
        self.marks.iter().map(place).collect()
    }

    fn draw_marks(&self, out: &mut String, to_x: &impl Fn(f64) -> f64, names: &[(f64, usize)], top: f64) {
        for ((value, name), (middle, row)) in self.marks.iter().zip(names) {
            let (at, y) = (to_x(*value), top - 5.0 - NAME * *row as f64);
            let _ = write!(
                out,
                "<line class=mark x1={at:.1} x2={at:.1} y1={:.1} y2={:.1} /><text x={middle:.1} y={y:.1} text-anchor=middle>{}</text>",
                y + 3.0,
                top + HIGH,
                safe(name)
            );
        }
    }

    fn x_range(&self) -> Scale {
        let xs = self.curves.iter().flat_map(|c| c.points.iter().map(|p| p.0));
        let (low, high) = extremes(xs.chain(self.marks.iter().map(|m| m.0)));
        Scale::exact(low, high)
    }

    fn y_range(&self) -> Scale {
        let ys = self.curves.iter().flat_map(|c| c.points.iter().map(|p| p.1));
        let (low, high) = extremes(ys.chain(self.y_includes.iter().copied()).chain([0.0]));
        Scale::rounded(low, high)
    }
}

fn draw_curve(out: &mut String, curve: &Curve, to_x: &impl Fn(f64) -> f64, to_y: &impl Fn(f64) -> f64) {
    let dash = if curve.dashed { " dash" } else { "" };
    let _ = write!(out, "<path class=\"s s{}{dash}\" d=\"", curve.colour);
    let place = |(x, y): (f64, f64)| (x.is_finite() && y.is_finite()).then(|| (to_x(x), to_y(y)));
    path(out, thinned(&curve.points, COLUMNS).into_iter().map(place));
    out.push_str("\"/>");
}

fn extremes(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
    if low < high {
        (low, high)
    } else if low.is_finite() {
        (low - 0.5, low + 0.5)
    } else {
        (0.0, 1.0)
    }
}

/// From where to where, and the ticks between.
#[derive(Clone, Copy, Debug)]
struct Scale {
    low: f64,
    high: f64,
    step: f64,
    decimals: usize,
}

impl Scale {
    fn exact(low: f64, high: f64) -> Self {
        let step = round_step(((high - low) / 6.0).max(1e-12));
        Self { low, high, step, decimals: decimals(step) }
    }

    fn rounded(low: f64, high: f64) -> Self {
        let scale = Self::exact(low, high);
        let step = scale.step;
        Self { low: (low / step + 1e-9).floor() * step, high: (high / step - 1e-9).ceil() * step, ..scale }
    }

    fn ticks(&self) -> Vec<f64> {
        ticks(self.low, self.high, self.step)
    }
}

/// Names in rows that fit, each with its place.
fn legend_rows<'a>(named: &[&'a Curve]) -> Vec<Vec<(f64, &'a Curve)>> {
    let mut rows: Vec<Vec<(f64, &Curve)>> = Vec::new();
    let mut at = f64::INFINITY;
    for curve in named {
        let width = 38.0 + 7.3 * curve.name.chars().count() as f64;
        if at + width > WIDE {
            rows.push(Vec::new());
            at = LEFT;
        }
        rows.last_mut().into_iter().for_each(|row| row.push((at, curve)));
        at += width + 10.0;
    }
    rows
}

fn draw_legend(out: &mut String, rows: &[Vec<(f64, &Curve)>]) {
    for (index, row) in rows.iter().enumerate() {
        let y = 36.0 + LINE * index as f64;
        for (x, curve) in row {
            let dash = if curve.dashed { " dash" } else { "" };
            let _ = write!(
                out,
                "<path class=\"s s{}{dash}\" d=\"M{x:.1} {:.1}h24\"/><text x={:.1} y={y:.1}>{}</text>",
                curve.colour,
                y - 5.0,
                x + 30.0,
                safe(&curve.name)
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_range() {
        let scale = Scale::rounded(-0.13, 2.9);
        assert_eq!((scale.low, scale.decimals), (-1.0, 0));
        assert_eq!(scale.ticks(), [-1.0, 0.0, 1.0, 2.0, 3.0]);
        let scale = Scale::rounded(0.0, 60.0);
        assert_eq!((scale.low, scale.high), (0.0, 60.0), "a round range stays what it is");
        let scale = Scale::exact(0.0, 0.7);
        assert!(scale.ticks().iter().zip([0.0, 0.2, 0.4, 0.6]).all(|(a, b)| (a - b).abs() < 1e-12));
        assert_eq!(scale.decimals, 1);
    }

    #[test]
    fn a_spike_survives_thinning_and_a_gap_stays_one() {
        let mut points: Vec<(f64, f64)> = (0..50_000).map(|i| (f64::from(i), 0.0)).collect();
        points[31_234].1 = 7.0;
        let kept = thinned(&points, COLUMNS);
        assert!(kept.len() < 4 * COLUMNS && kept.contains(&(31_234.0, 7.0)));
        let curve =
            Curve { points: vec![(0.0, 0.0), (1.0, f64::NAN), (2.0, 1.0), (3.0, 1.0)], ..Curve::default() };
        let svg = Chart { curves: vec![curve], ..Chart::default() }.svg();
        let path = svg.rsplit_once("class=\"s s0\" d=\"").expect("a curve").1;
        assert_eq!(path.split('"').next().expect("its path").matches('M').count(), 2);
    }

    /// The marks of Paper 002's Fig. 6, whose layers are met within a second.
    #[test]
    fn every_mark_has_its_name_and_none_runs_into_another() {
        let names = ["skin", "fat", "muscle", "bursa", "tendon", "cartilage", "withdrawal"];
        let marks = names.iter().zip(0..).map(|(name, at)| (0.2 * f64::from(at), (*name).to_owned()));
        let curve = Curve { points: vec![(0.0, 0.0), (10.0, 1.0)], ..Curve::default() };
        let chart = Chart {
            curves: vec![curve],
            marks: marks.collect(),
            zone: Some((5.0, 10.0)),
            ..Chart::default()
        };
        let svg = chart.svg();
        let mut placed: Vec<(f64, f64, f64)> = Vec::new();
        for name in names {
            let before = svg.split_once(&format!(" text-anchor=middle>{name}<")).expect(name).0;
            let (x, y) = before.rsplit_once("<text x=").expect(name).1.split_once(" y=").expect(name);
            let (x, y): (f64, f64) = (x.parse().expect("x"), y.parse().expect("y"));
            let half = 3.7 * name.len() as f64;
            assert!(y > 16.0 && x - half >= 0.0 && x + half <= WIDE, "{name} at {x}, {y}");
            for (other_x, other_y, other_half) in &placed {
                assert!((y - other_y).abs() > 10.0 || (x - other_x).abs() >= half + other_half, "{name}");
            }
            placed.push((x, y, half));
        }
        // Half of the frame.
        let zone = format!("<rect class=zone x={:.1} ", LEFT + (WIDE - LEFT - RIGHT) / 2.0);
        assert!(svg.contains(&zone), "{svg}");
    }

    #[test]
    fn an_empty_chart_is_a_frame() {
        for curves in [vec![], vec![Curve { points: vec![(1.0, f64::NAN)], ..Curve::default() }]] {
            let svg = Chart { curves, ..Chart::default() }.svg();
            assert!(svg.ends_with("</svg>") && !svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }
}
