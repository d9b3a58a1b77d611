//! What a person means by "simulation and recording differ": the motions beside each other, drawn, tabulated and as a file.

use crate::numerics::digits::short;
use crate::report::axes::{HIGH, frame, safe};
use crate::simulation::comparison::{Comparison, Figures, Off};
use std::fmt::Write as _;

const STYLE: &str = include_str!("report.css");
/// Points that a line is drawn with.
const POINTS: usize = 900;
/// Rows a second in the CSV, at the most.
const RATE_HZ: f64 = 1000.0;

/// The class of a model in pictures: its colour.
fn class(model: &str) -> &'static str {
    match model {
        "nominal" => "a",
        "refit" => "b",
        "patched" => "c",
        _ => "d",
    }
}

/// What a model is, in words.
fn words(model: &str) -> &str {
    match model {
        "nominal" => "the simulation as it stands",
        "refit" => "with its values refitted",
        "patched" => "with what was found",
        other => other,
    }
}

fn line(out: &mut String, class: &str, time: &[f64], values: &[f64], at: &impl Fn(f64, f64) -> (f64, f64)) {
    let every = time.len().div_ceil(POINTS).max(1);
    let _ = write!(out, "<path class=\"motion {class}\" d=\"");
    let mut pen = 'M';
    for (t, x) in time.iter().zip(values).step_by(every) {
        let (px, py) = at(*t, *x);
        // It has left the picture.
        if py <= 0.0 || py >= HIGH {
            pen = 'M';
            continue;
        }
        let _ = write!(out, "{pen}{px:.1} {py:.1}");
        pen = 'L';
    }
    out.push_str("\"/>");
}

/// The range of what was recorded with some room: a simulation that runs away leaves the picture.
fn range(recorded: &[f64]) -> (f64, f64) {
    let low = recorded.iter().copied().fold(f64::INFINITY, f64::min);
    let high = recorded.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let room = 0.3 * (high - low).max(1e-12);
    (low - room, high + room)
}

struct Picture<'a> {
    title: &'a str,
    label: String,
    recorded: &'a [f64],
    models: Vec<(&'a str, &'a [f64])>,
}

fn picture(out: &mut String, time: &[f64], picture: &Picture) {
    let last = time.last().copied().unwrap_or(1.0);
    let _ = write!(out, "<h3>{}</h3>", picture.title);
    let at = frame(out, (0.0, last), range(picture.recorded), "time, s", &picture.label);
    for (model, values) in &picture.models {
        line(out, class(model), time, values, &at);
    }
    line(out, "r", time, picture.recorded, &at);
    let _ = write!(out, "</svg><p class=axis>{} · time, s</p>", safe(&picture.label));
}

fn legend(out: &mut String, models: &[&str]) {
    out.push_str("<p class=note><span><i class=\"key rec\"></i> recorded</span>");
    for model in models {
        let _ = write!(out, " <span><i class=\"key {}\"></i> {}</span>", class(model), safe(words(model)));
    }
    out.push_str("</p>");
}

/// Position and speed of some of the models in a free run beside the recording.
pub(crate) fn free_run(out: &mut String, compared: &Comparison, models: &[&str]) {
    let length = compared.kind.length();
    legend(out, models);
    let of = |pick: fn(&crate::simulation::replay::Trajectory) -> &[f64]| -> Vec<(&str, &[f64])> {
        let wanted = compared.models.iter().filter(|m| models.contains(&m.model.as_str()));
        wanted.map(|m| (m.model.as_str(), pick(&m.free))).collect()
    };
    let time = &compared.motion.time;
    picture(
        out,
        time,
        &Picture {
            title: "Position",
            label: format!("position, {length}"),
            recorded: &compared.motion.position,
            models: of(|t| &t.position),
        },
    );
    picture(
        out,
        time,
        &Picture {
            title: "Speed",
            label: format!("speed, {length}/s"),
            recorded: &compared.motion.velocity,
            models: of(|t| &t.velocity),
        },
    );
}

fn position(off: Off, unit: &str) -> String {
    format!("{} {unit}", short(off.position_rms))
}

/// How far each model is off, in a table.
pub(crate) fn table(out: &mut String, compared: &Comparison) {
    let unit = compared.kind.length();
    let _ = write!(out, "<div class=scroll><table><tr><th>position off, rms, {unit}</th>");
    for model in &compared.models {
        let _ = write!(out, "<th class=n>{}</th>", safe(&model.model));
    }
    out.push_str("</tr>");
    let mut row = |name: String, of: &dyn Fn(&Figures) -> Option<Off>| {
        let _ = write!(out, "<tr><td>{name}</td>");
        for model in &compared.models {
            let shown = of(&model.figures).map_or("–".to_owned(), |off| short(off.position_rms));
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

/// The page of `simulate`.
pub fn page(title: &str, notes: &[String], compared: &[Comparison]) -> String {
    let mut out = String::with_capacity(400_000);
    let _ = write!(
        out,
        "<!doctype html><html lang=en><head><meta charset=utf-8><meta name=viewport content=\"width=device-width,initial-scale=1\">\
         <title>Simulated: {0}</title><style>{STYLE}</style></head><body><main><p class=rig>{0}</p><h1>Simulated beside recorded</h1>",
        safe(title)
    );
    for note in notes {
        let _ = write!(out, "<p>{}.</p>", safe(note));
    }
    for one in compared {
        let names: Vec<&str> = one.models.iter().map(|m| m.model.as_str()).collect();
        let _ = write!(out, "<section><h2>{}: free run from the first row</h2>", safe(&one.file));
        free_run(&mut out, one, &names);
        table(&mut out, one);
        if let Some(feedback) = one.feedback {
            let _ = write!(
                out,
                "<h2>Under the recorded reference</h2><p class=note>The loop that ran was told from its reference; it explains {:.0} % of the \
                 command. What else the command held stays as recorded.</p>",
                100.0 * feedback.explained
            );
            let length = one.kind.length();
            let models: Vec<(&str, &[f64])> = one
                .models
                .iter()
                .filter_map(|m| Some((m.model.as_str(), m.under.as_ref()?.position.as_slice())))
                .collect();
            picture(
                &mut out,
                &one.motion.time,
                &Picture {
                    title: "Position",
                    label: format!("position, {length}"),
                    recorded: &one.motion.position,
                    models,
                },
            );
        }
        let label = format!("inertia · acceleration, {}", one.kind.force());
        let models = one.models.iter().map(|m| (m.model.as_str(), m.force.as_slice())).collect();
        picture(
            &mut out,
            &one.motion.time,
            &Picture { title: "Force along the recorded motion", label, recorded: &one.force, models },
        );
        out.push_str("</section>");
    }
    out.push_str("</main></body></html>\n");
    out
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
