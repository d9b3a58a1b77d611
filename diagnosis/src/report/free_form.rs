//! A force without a name in the report: its entry and its picture.

use crate::data::rig::Kind;
use crate::data::schema::FreeForm;
use crate::decide::diagnosis::FreeForce;
use crate::laws::Variable;
use crate::propose::free_form::Shape;
use crate::report::form_in_words;
use html_report::drawing::path;
use html_report::plot::{close, frame};
use html_report::safe;
use numerics::digits::short;
use std::fmt::Write as _;

/// The form in a sentence without a stop.
pub(crate) fn sentence(shape: &Shape, length: &str) -> String {
    form_in_words::sentence(&shape.table, &shape.visits, length)
}

/// The entry of the report.
pub(crate) fn entry(force: &FreeForce, in_words: Option<String>) -> FreeForm {
    FreeForm {
        inputs: force.inputs.variables().to_vec(),
        in_words,
        holdout_gain: force.holdout_gain,
        left_out_gain: force.left_out_gain,
        left_out_error: force.left_out_error,
        share_of_ceiling: force.share_of_ceiling,
    }
}

/// Lines of a picture over two variables.
const LINES: usize = 5;
/// Standard deviations of the band.
const BAND: f64 = 1.96;

fn unit(variable: Variable, kind: Kind) -> String {
    match variable {
        Variable::Speed => format!("{}/s", kind.length()),
        Variable::Travel | Variable::Angle => kind.length().into(),
        Variable::Command => "command units".into(),
        Variable::SinceReversal | Variable::Time => "s".into(),
    }
}

/// One line of a picture: places, forces, bands, and at what value of the other variable.
struct Line {
    places: Vec<(f64, f64, f64)>,
    at: Option<f64>,
}

/// The lines over one variable, and that variable with the other one.
fn lines(shape: &Shape) -> (Vec<Line>, Variable, Option<Variable>) {
    let table = &shape.table;
    let point = |x: f64, i: usize| (x, table.force[i], BAND * shape.deviation[i]);
    let [first, second] = match table.grid.as_slice() {
        [one] => {
            let places = one.iter().enumerate().map(|(i, x)| point(*x, i)).collect();
            return (vec![Line { places, at: None }], table.over[0], None);
        }
        [first, second] => [first, second],
        _ => return (Vec::new(), Variable::Time, None),
    };
    let n = second.len();
    if table.over[1] == Variable::Command {
        // In proportion to the command: the largest shows all.
        let places = first.iter().enumerate().map(|(i, x)| point(*x, i * n + n - 1)).collect();
        return (vec![Line { places, at: Some(second[n - 1]) }], table.over[0], Some(table.over[1]));
    }
    let row = |k: usize| {
        let i = (2 * k + 1) * (first.len() - 1) / (2 * LINES);
        let places = second.iter().enumerate().map(|(j, x)| point(*x, i * n + j)).collect();
        Line { places, at: Some(first[i]) }
    };
    ((0..LINES).map(row).collect(), table.over[1], Some(table.over[0]))
}

/// The picture with its band, and the sentence.
pub(crate) fn draw(out: &mut String, shape: &Shape, told: &FreeForm, force: &str, kind: Kind) {
    let (lines, variable, other) = lines(shape);
    let words = told.in_words.as_deref().unwrap_or("a force without a name");
    let _ = write!(out, "<section><h2>A force without a name</h2><p>It is {}.", safe(words));
    if let Some(gain) = told.holdout_gain {
        let _ = write!(
            out,
            " On the held-out recordings it gains {} in log-likelihood over the refitted values; on left-out blocks of the fitted ones {} ± {}.",
            short(gain),
            short(told.left_out_gain),
            short(told.left_out_error)
        );
    }
    out.push_str("</p><figure>");
    let places = || lines.iter().flat_map(|line| line.places.iter().copied());
    let (low, high) = places().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p.0), b.max(p.0)));
    let top = places().map(|p| p.1.abs() + p.2).fold(1e-300, f64::max);
    let x_label = format!("{}, {}", variable.in_words(), unit(variable, kind));
    let at = frame(out, (low, high), (-top, top), &x_label, &format!("force, {force}"));
    for (k, line) in lines.iter().enumerate() {
        let turn = 200 + 130 * k / lines.len();
        let _ = write!(out, "<path style=\"fill:hsl({turn} 60% 50%/.18)\" d=\"");
        let at = &at;
        let edge = |sign: f64| move |p: &(f64, f64, f64)| Some(at(p.0, p.1 + sign * p.2));
        path(out, line.places.iter().map(edge(1.0)).chain(line.places.iter().rev().map(edge(-1.0))));
        let name = match (line.at, other) {
            (Some(value), Some(other)) => format!("at a {} of {}", other.in_words(), short(value)),
            _ => "force".to_owned(),
        };
        let _ = write!(
            out,
            "Z\"/><path class=line data-name=\"{}\" style=\"stroke:hsl({turn} 60% 50%)\" d=\"",
            safe(&name)
        );
        path(out, line.places.iter().map(edge(0.0)));
        out.push_str("\"/>");
    }
    close(out, &x_label);
    caption(out, &lines, variable, other, kind);
    out.push_str("</figure></section>");
}

/// The picture's caption, with the key to its lines where there are several.
fn caption(out: &mut String, lines: &[Line], variable: Variable, other: Option<Variable>, kind: Kind) {
    let _ = write!(out, "<figcaption>force over {}, with its 95 % band", variable.in_words());
    if let Some(other) = other {
        out.push_str("; ");
        for (k, line) in lines.iter().enumerate() {
            let turn = 200 + 130 * k / lines.len();
            let _ = write!(
                out,
                "<span><i class=key style=\"background:hsl({turn} 60% 50%)\"></i> at a {} of {} {}</span> ",
                other.in_words(),
                short(line.at.unwrap_or(0.0)),
                safe(&unit(other, kind))
            );
        }
    }
    out.push_str("</figcaption>");
}
