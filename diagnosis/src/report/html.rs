//! `report.html`: one page without network, for a desktop and a phone. Plain SVG drawn here; the
//! script of [`html_report::plot`] shows the values under the pointer.

use crate::data::recording::shown_at;
use crate::data::rig::Kind;
use crate::data::schema::{Hypothesis, Named, Verdict};
use crate::report::decisive_plot;
use crate::report::faults;
use crate::report::free_form;
use crate::report::frequency_plot;
use crate::report::motion_picture;
use crate::report::outcome::{Outcome, unit};
use crate::report::residual_plots::{over_states, over_time};
use crate::report::simulation_page;
use html_report::safe;
use numerics::digits::short;
use std::fmt::Write as _;

/// The page.
pub(crate) fn page(outcome: &Outcome) -> String {
    let r = &outcome.report;
    let mut out = String::with_capacity(200_000);
    let _ = write!(
        out,
        "<p class=rig>{}</p><h1>{}.</h1>\
         <dl class=short><dt>What remains</dt><dd>{}.</dd><dt>Record next</dt><dd>{}.</dd>{}</dl>",
        safe(&outcome.evidence.rig),
        safe(&r.sentence),
        safe(&r.remains),
        safe(&r.record_next),
        short_notes(outcome)
    );
    decisive_plot::draw(&mut out, outcome);
    if let Some(first) = outcome.evidence.simulated.first() {
        frequency_plot::draw(&mut out, first, shown(outcome), &outcome.nominal_rig.actuator.command_unit);
    }
    motion(&mut out, outcome);
    if r.verdict != Verdict::InsufficientExcitation {
        numbers(&mut out, outcome);
        what(&mut out, outcome);
        if let (Some(form), Some(told)) = (&outcome.evidence.form, &r.free_form) {
            free_form::draw(&mut out, form, told, &r.fit.unit, outcome.evidence.kind);
        }
        over_time(&mut out, outcome);
        over_states(&mut out, outcome);
        hypotheses(&mut out, outcome);
        remains(&mut out, outcome);
    }
    check(&mut out, outcome);
    next(&mut out, outcome);
    footer(&mut out, outcome);
    simulation_page::whole(&format!("Diagnosis: {}", outcome.evidence.rig), &out)
}

/// Faults of the recordings, and notes.
fn short_notes(outcome: &Outcome) -> String {
    let faults =
        faults::clauses(&outcome.report.data_faults).into_iter().map(|text| ("Fault of the data", text));
    let notes = outcome.report.notes.iter().map(|text| ("Note", text.clone()));
    faults.chain(notes).map(|(what, text)| format!("<dt>{what}</dt><dd>{}.</dd>", safe(&text))).collect()
}

/// Lists the limits of what the recordings can show, folded.
fn check(out: &mut String, outcome: &Outcome) {
    if outcome.evidence.check.is_empty() {
        return;
    }
    out.push_str("<details><summary>What these recordings can and cannot show</summary><ul>");
    for sentence in &outcome.evidence.check {
        let _ = write!(out, "<li>{}.</li>", safe(sentence));
    }
    out.push_str("</ul></details>");
}

/// The models that plots show.
fn shown(outcome: &Outcome) -> &'static [&'static str] {
    let found = outcome.evidence.simulated.first().is_some_and(|one| one.figures("patched").is_some());
    if found { &["nominal", "patched"] } else { &["nominal", "refit"] }
}

/// The motion that the simulation gives, next to the one that was recorded.
fn motion(out: &mut String, outcome: &Outcome) {
    let Some(first) = outcome.evidence.simulated.first() else { return };
    let _ = write!(out, "<section><h2>Simulated and recorded: {}, held out</h2>", safe(&first.file));
    let wanted = shown(outcome);
    motion_picture::in_windows(out, first, wanted);
    motion_picture::table(out, first);
    motion_picture::free_run(out, first, wanted);
    if let Some(worse) = outcome.report.simulation.as_ref().and_then(|s| s.worse.as_ref()) {
        let _ = write!(
            out,
            "<p class=next><b>Warning:</b> {}, although the force residual is smaller; <code>host-sim simulate --fit</code> fits its values to motion.</p>",
            safe(worse)
        );
    }
    out.push_str("</section>");
}

/// Writes what the page was made of.
fn footer(out: &mut String, outcome: &Outcome) {
    let Some(made) = &outcome.made else { return };
    let _ = write!(
        out,
        "<footer><h2>Made from</h2><div class=scroll><table><tr><th>file</th><th>SHA-256</th></tr>"
    );
    for (file, hash) in &made.files {
        let _ = write!(out, "<tr><td>{}</td><td><code>{}</code></td></tr>", safe(file), safe(hash));
    }
    let _ = write!(out, "</table></div><p>{}, {}</p></footer>", safe(&made.program), safe(&made.date));
}

/// Writes the next steps.
fn next(out: &mut String, outcome: &Outcome) {
    let r = &outcome.report;
    let holdout = outcome.evidence.simulated.first().map_or("FILE.csv", |one| one.file.as_str());
    let wanted = r.effects.iter().filter_map(|e| e.separating_experiment.as_ref());
    let mut items: Vec<String> = wanted
        .chain(&r.separating_experiment)
        .map(|experiment| {
            format!(
                "Record what would decide: {experiment}. On a device of this project `host-sim characterise --device /dev/ttyACM0 --out bench` \
                 plays it; then run `host-sim diagnose` again with the new files."
            )
        })
        .collect();
    match r.verdict {
        Verdict::NoMismatch => items.push("Nothing: keep the simulation as it is.".into()),
        Verdict::ParametersOnly => {
            items.push("Put the refitted values of `patched-rig.toml` into your simulation.".into());
        }
        Verdict::RandomDisturbance => items.push(
            "Look for what moves the axis and was not recorded (a hand, a load, the inclination, a supply that dips); record it as \
             `force` or `tilt_rad`, and run `host-sim diagnose` again."
                .into(),
        ),
        Verdict::Unexplained => items.push(
            "Compare the shape above with what you know of the machine. A formula of your own is searched with \
             `host-sim diagnose … --effects own.toml`."
                .into(),
        ),
        Verdict::MissingPhysics | Verdict::InsufficientExcitation => {}
    }
    if !r.effects.is_empty() || outcome.evidence.form.is_some() {
        items.push(format!(
            "Simulate with what was found: `patched-rig.toml` next to this page is the rig with it; \
             `host-sim simulate --rig patched-rig.toml --recording {holdout} --out simulated` runs it."
        ));
        items.push(
            "Take it where you simulate: add `--export mjcf` for MuJoCo, `--export urdf` or `--export json` for others, to either command."
                .into(),
        );
    }
    simulation_page::what_next(out, &items);
}

fn numbers(out: &mut String, outcome: &Outcome) {
    let f = &outcome.report.fit;
    let unit = safe(&f.unit);
    let percent = |x: f64| if f.force_rms.holdout > 0.0 { 100.0 * x / f.force_rms.holdout } else { 0.0 };
    let most = f.nominal.holdout.max(f.refit.holdout).max(f.patched.holdout).max(1e-300);
    out.push_str(
        "<section><h2>Before and after, on recordings that were not used for fitting</h2><div class=bars>",
    );
    let models = [
        ("the simulation as it is", "a", f.nominal),
        ("with its values refitted", "b", f.refit),
        ("with what was found", "c", f.patched),
    ];
    let found = !outcome.report.effects.is_empty() || outcome.evidence.form.is_some();
    for (label, class, both) in &models[..if found { 3 } else { 2 }] {
        let _ = write!(
            out,
            "<div class=bar><span>{label}</span><i class={class} style=\"width:{:.1}%\"></i><b>{:.1} % <small>{} {unit}</small></b></div>",
            (100.0 * both.holdout / most).max(0.5),
            percent(both.holdout),
            short(both.holdout)
        );
    }
    let _ = write!(
        out,
        "</div><p class=note>Root mean square force residual of each model, in per cent of the force itself ({} {unit}), below {:.0} Hz.",
        short(f.force_rms.holdout),
        outcome.report.residual_bandwidth_hz
    );
    if found {
        // Adding zero takes the sign from what rounds to nothing.
        let [low, high] = f.holdout_gain_ci95.map(|part| (100.0 * part).round() + 0.0);
        let _ = if low > 0.0 {
            write!(out, " From refit to patched the mean square falls by {low:.0} to {high:.0} % (95 %).")
        } else if high < 0.0 {
            write!(
                out,
                " From refit to patched the mean square rises by {:.0} to {:.0} % (95 %).",
                -high, -low
            )
        } else {
            write!(
                out,
                " That it falls from refit to patched is not proven: the 95 % interval of its fall, {low:.0} to {high:.0} %, holds zero."
            )
        };
    }
    out.push_str("</p></section>");
}

fn what(out: &mut String, outcome: &Outcome) {
    let r = &outcome.report;
    if r.effects.is_empty() {
        return;
    }
    out.push_str("<section><h2>What was left out</h2>");
    for effect in &r.effects {
        one(out, effect, outcome.evidence.kind);
    }
    out.push_str("</section>");
}

fn one(out: &mut String, effect: &Named, kind: Kind) {
    let _ = write!(
        out,
        "<article><h3>{} <em>{:.0} % sure</em></h3><p><code>{}</code>, in the {}</p>",
        safe(effect.name.in_words()),
        100.0 * effect.confidence,
        effect.name,
        format!("{:?}", effect.subsystem).to_lowercase()
    );
    if !effect.parameters.is_empty() {
        out.push_str(
            "<div class=scroll><table><tr><th></th><th class=n>value</th><th class=n>95 % interval</th><th>unit</th></tr>",
        );
        for (name, p) in &effect.parameters {
            let _ = write!(
                out,
                "<tr><td>{}</td><td class=n>{}</td><td class=n>{} to {}</td><td>{}</td></tr>",
                safe(name),
                short(p.value),
                short(p.ci95[0]),
                short(p.ci95[1]),
                safe(p.unit_in_words())
            );
        }
        out.push_str("</table></div>");
    }
    for region in &effect.place.states {
        let _ = write!(
            out,
            "<p>Strongest for {} from {} to {}{}.</p>",
            safe(&region.variable),
            short(region.low),
            short(region.high),
            safe(&unit(&region.variable, kind))
        );
    }
    if effect.class.len() > 1 {
        let others: Vec<&str> = effect.class[1..].iter().map(|n| n.in_words()).collect();
        let _ =
            write!(out, "<p>These recordings cannot distinguish it from: {}.</p>", safe(&others.join("; ")));
    }
    if let Some(next) = &effect.separating_experiment {
        let _ = write!(out, "<p class=next><b>Record next:</b> {}.</p>", safe(next));
    }
    out.push_str("</article>");
}

fn hypotheses(out: &mut String, outcome: &Outcome) {
    let r = &outcome.report;
    if r.hypotheses.is_empty() {
        return;
    }
    let _ = write!(
        out,
        "<details><summary>What was tested: {} hypotheses, of which {} named; {} could not show in these recordings</summary>\
         <div class=scroll><table><tr><th>hypothesis</th><th class=n>held-out gain</th><th>outcome</th></tr>",
        r.hypotheses.len(),
        match r.effects.len() {
            0 => "none is".to_owned(),
            1 => "one is".to_owned(),
            n => format!("{n} are"),
        },
        r.untested.len()
    );
    let gain = |h: &Hypothesis| h.holdout_gain.unwrap_or(f64::NEG_INFINITY);
    let mut sorted: Vec<_> = r.hypotheses.iter().collect();
    sorted.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
    for h in sorted {
        let outcome = h.rejected_because.as_deref().unwrap_or("named");
        let _ = write!(
            out,
            "<tr><td>{} <small>{}</small></td><td class=n>{}</td><td>{}</td></tr>",
            safe(h.name.in_words()),
            h.name,
            h.holdout_gain.map_or_else(String::new, short),
            safe(outcome)
        );
    }
    out.push_str("</table></div><p class=note>Gain of log-likelihood on the held-out recordings over the model without it.</p>");
    if !r.untested.is_empty() {
        out.push_str("<h3>Not tested</h3><p class=note>These recordings could not show them, so they are not ruled out.</p><ul>");
        for one in &r.untested {
            let _ = write!(
                out,
                "<li>{} <small>{}</small>: {}</li>",
                safe(one.name.in_words()),
                one.name,
                safe(&one.because)
            );
        }
        out.push_str("</ul>");
    }
    out.push_str("</details>");
}

fn remains(out: &mut String, outcome: &Outcome) {
    let r = &outcome.report;
    let _ = write!(
        out,
        "<section><h2>What remains</h2><p>{:.0} % of the mean square that the simulation left on the held-out recordings is still \
         unexplained. The sensor's noise alone would leave {} {}.</p>",
        100.0 * r.unexplained_fraction,
        short(r.noise_floor),
        safe(&r.fit.unit)
    );
    if !r.refitted.is_empty() {
        out.push_str("<p>Refitted values: ");
        let values: Vec<String> =
            r.refitted.iter().map(|(key, value)| format!("{key} {}", short(*value))).collect();
        out.push_str(&safe(&values.join(", ")));
        out.push_str(".</p>");
    }
    if let Some(rate) = outcome.evidence.rate_hz {
        let _ = write!(out, "<p>{}.</p>", safe(&shown_at(rate)));
    }
    out.push_str("</section>");
}
