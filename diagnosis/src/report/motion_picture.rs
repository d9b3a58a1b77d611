//! The picture of "simulation and recording differ": the motions side by side, drawn, tabulated and
//! as a file.

use crate::simulation::comparison::{AFRESH_S, Comparison, Figures, Off, Simulated};
use html_report::drawing::{path, thinned};
use html_report::plot::{HIGH, close, frame};
use html_report::safe;
use numerics::digits::short;
use std::fmt::Write as _;

/// Columns of a line: with fewer than four rows in each, a reader who zooms in sees every row.
pub(super) const COLUMNS: usize = 5_000;
/// Rows a second in the CSV, at most.
const RATE_HZ: f64 = 1000.0;

/// The class of a model in pictures: its colour.
pub(super) fn class(model: &str) -> &'static str {
    match model {
        "nominal" => "a",
        "refit" => "b",
        "patched" => "c",
        _ => "d",
    }
}

/// Returns the name of a model in words.
pub(crate) fn words(model: &str) -> &str {
    match model {
        "nominal" => "the simulation as it is",
        "refit" => "with its values refitted",
        "patched" => "with what was found",
        "motion-fitted" => "with values fitted by motion",
        other => other,
    }
}

/// A line through points; it is interrupted where it leaves the picture and wherever the simulation
/// is started `afresh`, s.
fn line(
    out: &mut String,
    (class, name): (&str, &str),
    time: &[f64],
    values: &[f64],
    afresh: Option<f64>,
    at: &impl Fn(f64, f64) -> (f64, f64),
) {
    let part = |t: f64| afresh.map_or(0, |seconds| (t / seconds) as u64);
    let _ = write!(out, "<path class=\"motion {class}\" data-name=\"{}\" d=\"", safe(name));
    let mut last = None;
    let rows: Vec<(f64, f64)> = time.iter().copied().zip(values.iter().copied()).collect();
    let shown = thinned(&rows, COLUMNS).into_iter().flat_map(|(t, x)| {
        let place = Some(at(t, x)).filter(|(_, y)| *y > 0.0 && *y < HIGH);
        let is_new = last.replace(part(t)) != Some(part(t));
        is_new.then_some(None).into_iter().chain([place])
    });
    path(out, shown);
    out.push_str("\"/>");
}

/// Returns the range of all but one in a hundred of the values.
fn bulk(values: &[f64]) -> (f64, f64) {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|x| x.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return (0.0, 0.0) };
    let few = sorted.len() / 200;
    (sorted[few], sorted[last - few])
}

/// The range of a picture: what was recorded with some room, and up to half as much again for the
/// simulations: one that runs away leaves the picture.
fn range(recorded: &[f64], models: &[(&str, &[f64])]) -> (f64, f64) {
    let (low, high) = bulk(recorded);
    let span = (high - low).max(1e-12);
    let (mut least, mut most) = (low, high);
    for (_, values) in models {
        let (a, b) = bulk(values);
        least = least.min(a.max(low - 0.5 * span));
        most = most.max(b.min(high + 0.5 * span));
    }
    (least - 0.15 * span, most + 0.15 * span)
}

struct Picture<'a> {
    title: String,
    label: String,
    recorded: &'a [f64],
    models: Vec<(&'a str, &'a [f64])>,
    /// Time between two starts from the measured state, s.
    afresh: Option<f64>,
    /// The upright range, where it does not follow from what was recorded.
    range: Option<(f64, f64)>,
}

fn picture(out: &mut String, time: &[f64], picture: &Picture) {
    let last = time.last().copied().unwrap_or(1.0);
    let _ = write!(out, "<h3>{}</h3>", picture.title);
    let range = picture.range.unwrap_or_else(|| range(picture.recorded, &picture.models));
    let at = frame(out, (0.0, last), range, "time, s", &picture.label);
    for (model, values) in &picture.models {
        line(out, (class(model), words(model)), time, values, picture.afresh, &at);
    }
    if !picture.recorded.is_empty() {
        line(out, ("r", "recorded"), time, picture.recorded, None, &at);
    }
    close(out, "time, s");
}

pub(super) fn legend(out: &mut String, models: &[&str]) {
    out.push_str("<p class=note><span><i class=\"key rec\"></i> recorded</span>");
    for model in models {
        let _ = write!(out, " <span><i class=\"key {}\"></i> {}</span>", class(model), safe(words(model)));
    }
    out.push_str("</p>");
}

/// A column of each of the models that are `wanted` and have it.
fn columns<'a>(
    compared: &'a Comparison,
    wanted: &[&str],
    pick: impl Fn(&'a Simulated) -> Option<&'a [f64]>,
) -> Vec<(&'a str, &'a [f64])> {
    let models = compared.models.iter().filter(|m| wanted.contains(&m.model.as_str()));
    models.filter_map(|m| Some((m.model.as_str(), pick(m)?))).collect()
}

/// Position of some of the models in short windows started from the measured state, and how far off
/// it is there.
pub(crate) fn in_windows(out: &mut String, compared: &Comparison, wanted: &[&str]) {
    let length = compared.kind.length();
    let motion = &compared.motion;
    let afresh = columns(compared, wanted, |m| m.afresh.as_deref());
    if afresh.is_empty() {
        return;
    }
    let _ = write!(
        out,
        "<p class=note>Every {AFRESH_S} s the simulation is put back to the measured state, and then the command alone drives it: what grows \
         within a window is the simulation's own error of force.</p>"
    );
    legend(out, wanted);
    let off: Vec<(&str, Vec<f64>)> = afresh
        .iter()
        .map(|(model, x)| (*model, x.iter().zip(&motion.position).map(|(a, b)| a - b).collect()))
        .collect();
    let position = Picture {
        title: format!("Position in windows of {AFRESH_S} s"),
        label: format!("position, {length}"),
        recorded: &motion.position,
        models: afresh,
        afresh: Some(AFRESH_S),
        range: None,
    };
    picture(out, &motion.time, &position);
    let most = off
        .iter()
        .map(|(_, values)| bulk(values))
        .fold(1e-300_f64, |most, (low, high)| most.max(low.abs()).max(high.abs()));
    let error = Picture {
        title: "How far off it is".into(),
        label: format!("simulated − recorded position, {length}"),
        recorded: &[],
        models: off.iter().map(|(model, values)| (*model, values.as_slice())).collect(),
        afresh: Some(AFRESH_S),
        range: Some((-1.15 * most, 1.15 * most)),
    };
    picture(out, &motion.time, &error);
}

/// Position and speed of some of the models in one free run, folded away: it is a bad judge.
pub(crate) fn free_run(out: &mut String, compared: &Comparison, wanted: &[&str]) {
    let length = compared.kind.length();
    let motion = &compared.motion;
    let _ = write!(
        out,
        "<details><summary>The free run of {:.1} s from the first row</summary><p class=note>It is a poor measure of a simulation: nothing \
         corrects it, so that an error of force adds up twice to one of position, and a tiny offset, or a start that is a little off, \
         counts for more than physics that is missing. A line that leaves the picture has diverged.</p>",
        motion.seconds()
    );
    legend(out, wanted);
    let shown = |title: &str, label, recorded, models| {
        let title = title.to_owned();
        Picture { title, label, recorded, models, afresh: None, range: None }
    };
    let position = columns(compared, wanted, |m| Some(&m.free.position));
    let label = format!("position, {length}");
    picture(out, &motion.time, &shown("Position", label, &motion.position, position));
    let speed = columns(compared, wanted, |m| Some(&m.free.velocity));
    let label = format!("speed, {length}/s");
    picture(out, &motion.time, &shown("Speed", label, &motion.velocity, speed));
    out.push_str("</details>");
}

/// Position under the recorded reference with the loop that ran, where it was recognised.
pub(crate) fn under_reference(out: &mut String, compared: &Comparison, wanted: &[&str]) {
    let Some(feedback) = compared.feedback else { return };
    let _ = write!(
        out,
        "<h2>Under the recorded reference</h2><p class=note>The loop that ran was recognised from its reference; it explains {:.0} % of the \
         command. What else the command held stays as recorded.</p>",
        100.0 * feedback.explained
    );
    picture(
        out,
        &compared.motion.time,
        &Picture {
            title: "Position".into(),
            label: format!("position, {}", compared.kind.length()),
            recorded: &compared.motion.position,
            models: columns(compared, wanted, |m| m.under.as_ref().map(|u| u.position.as_slice())),
            afresh: None,
            range: None,
        },
    );
}

/// Inertia times acceleration along the recorded motion.
pub(crate) fn force(out: &mut String, compared: &Comparison, wanted: &[&str]) {
    picture(
        out,
        &compared.motion.time,
        &Picture {
            title: "Force along the recorded motion".into(),
            label: format!("inertia · acceleration, {}", compared.kind.force()),
            recorded: &compared.force,
            models: columns(compared, wanted, |m| Some(&m.force)),
            afresh: None,
            range: None,
        },
    );
}

fn position(off: Off, unit: &str) -> String {
    format!("{} {unit}", short(off.position_rms))
}

/// Returns the factor and the name of the unit for position errors: thousandths of the unit where
/// some errors are below a thousandth.
pub(crate) fn scale(compared: &Comparison) -> (f64, String) {
    let unit = compared.kind.length();
    let figures = compared.models.iter().map(|m| &m.figures);
    let largest = figures.clone().map(|f| f.free_run.position_rms).fold(0.0, f64::max);
    let smallest = figures.flat_map(|f| &f.windows).map(|w| w.off.position_rms).fold(largest, f64::min);
    if largest < 1.0 || (smallest < 1e-3 && largest < 10.0) {
        (1e3, format!("m{unit}"))
    } else {
        (1.0, unit.to_owned())
    }
}

/// Writes the errors of each model as a table.
pub(crate) fn table(out: &mut String, compared: &Comparison) {
    let (factor, unit) = scale(compared);
    let _ = write!(out, "<div class=scroll><table><tr><th>position error, rms, {unit}</th>");
    for model in &compared.models {
        let _ = write!(out, "<th class=n>{}</th>", safe(&model.model));
    }
    out.push_str("</tr>");
    let mut row = |name: String, of: &dyn Fn(&Figures) -> Option<Off>| {
        let _ = write!(out, "<tr><td>{name}</td>");
        for model in &compared.models {
            let shown = of(&model.figures).map_or("–".to_owned(), |off| short(factor * off.position_rms));
            let _ = write!(out, "<td class=n>{shown}</td>");
        }
        out.push_str("</tr>");
    };
    let windows = compared.models.first().map_or(0, |m| m.figures.windows.len());
    for k in 0..windows {
        let seconds = compared.models[0].figures.windows[k].seconds;
        row(format!("windows of {seconds} s"), &|f| f.windows.get(k).map(|w| w.off));
    }
    row(format!("free run, {:.1} s", compared.motion.seconds()), &|f| Some(f.free_run));
    if compared.feedback.is_some() {
        row("under the recorded reference".into(), &|f| f.under_reference);
    }
    out.push_str("</table></div>");
}

/// The motions as a table, at most a thousand rows a second.
pub fn csv(compared: &Comparison) -> String {
    let mut out = String::from("time_s,position,velocity,force");
    for model in &compared.models {
        let name = model.model.replace(|c: char| !c.is_alphanumeric(), "_");
        let _ = write!(out, ",position_{name},velocity_{name},force_{name}");
        if model.under.is_some() {
            let _ = write!(out, ",position_{name}_under_reference");
        }
    }
    out.push('\n');
    let motion = &compared.motion;
    let rate = motion.time.len() as f64 / motion.seconds().max(1e-9);
    let every = (rate / RATE_HZ).round().max(1.0) as usize;
    for i in (0..motion.time.len()).step_by(every) {
        let _ = write!(
            out,
            "{:.6},{:e},{:e},{:e}",
            motion.time[i], motion.position[i], motion.velocity[i], compared.force[i]
        );
        for model in &compared.models {
            let _ = write!(
                out,
                ",{:e},{:e},{:e}",
                model.free.position[i], model.free.velocity[i], model.force[i]
            );
            if let Some(under) = &model.under {
                let _ = write!(out, ",{:e}", under.position[i]);
            }
        }
        out.push('\n');
    }
    out
}

/// The figures as JSON.
pub fn summary(compared: &[Comparison], notes: &[String]) -> serde_json::Value {
    let recordings: Vec<serde_json::Value> = compared
        .iter()
        .map(|one| {
            let models: Vec<serde_json::Value> = one
                .models
                .iter()
                .map(|m| serde_json::json!({ "model": m.model, "figures": m.figures }))
                .collect();
            let feedback = one.feedback.map(|f| {
                serde_json::json!({ "proportional": f.proportional, "derivative": f.derivative, "explained": f.explained })
            });
            serde_json::json!({
                "file": one.file, "unit": one.kind.length(), "seconds": one.motion.seconds(), "loop": feedback, "models": models
            })
        })
        .collect();
    serde_json::json!({ "format": 1, "notes": notes, "recordings": recordings })
}

/// Lines for the terminal.
pub fn lines(compared: &Comparison) -> Vec<String> {
    let unit = compared.kind.length();
    let mut out = Vec::new();
    for model in &compared.models {
        let f = &model.figures;
        let window = |seconds: f64| f.windows.iter().find(|w| w.seconds == seconds).map(|w| w.off);
        let mut text = format!(
            "{} {}: free run of {:.1} s {}",
            compared.file,
            model.model,
            compared.motion.seconds(),
            position(f.free_run, unit)
        );
        for seconds in [0.1, 1.0, 5.0] {
            if let Some(off) = window(seconds) {
                let _ = write!(text, ", windows of {seconds} s {}", position(off, unit));
            }
        }
        if let Some(off) = f.under_reference {
            let _ = write!(text, ", under the reference {}", position(off, unit));
        }
        out.push(text);
    }
    out
}
