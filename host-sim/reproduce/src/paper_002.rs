//! Paper 002, the joint injection simulator: the plateaus of both injections and of the withdrawal
//! (its Fig. 5 and 6).

use super::measure::{Trace, is_contact_with, is_exit_from};
use super::{Row, Whose, numbers, row};
use control_core::TICK_HZ;
use control_core::config::{Law, Tissue};
use device_sim::error::Error;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use device_sim::session::{Source, tissue_name};
use html_report::chart::{Chart, Curve};
use html_report::section::{Section, Way};
use html_report::{Sheet, decimal};
use server::virtual_run;
use std::path::Path;
use training::debrief::anatomy;
use training::score::target::TargetOutcome;

/// Cutting forces that the paper prints, N.
const CUTTING: [(Tissue, f64); 6] = [
    (Tissue::Skin, 0.8),
    (Tissue::Fat, 1.5),
    (Tissue::Muscle, 2.0),
    (Tissue::Bursa, 2.5),
    (Tissue::Tendon, 3.0),
    (Tissue::Cartilage, 4.0),
];

/// The two injections, in the paper's order.
const INJECTIONS: [(&str, &str); 2] = [
    ("shoulder-redirected", "first injection: redirected"),
    ("shoulder-straight", "second injection: straight"),
];

pub(super) fn sheet(dir: &Path) -> Result<Sheet, Error> {
    let profile = Profile::find("shoulder")?;
    let traces = INJECTIONS
        .iter()
        .map(|(name, _)| {
            let procedure = Procedure::find(name, &profile)?;
            Trace::of(&virtual_run::record(&profile, procedure, &dir.join(format!("paper-002-{name}.mcap")))?)
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut sheet = Sheet::new(
        "Development of haptic simulator for practicing the intraarticular needle injection under echography (paper 002)",
        "The paper prints one force for each layer and the largest force of its device. Its figures of the two injections have no numbers in \
         the text; here both are run, on the same layers.",
    );
    sheet.paragraph(&format!(
        "The motor is weaker than the paper's device: all forces are given to the hand at {} of the law's, as the patient's file declares. The numbers \
         below are the law's: what the hand felt over that share, and for cutting less the {} N of friction along the shaft.",
        decimal(scale(&profile), 2),
        decimal(friction_n(&profile), 2),
    ));
    sheet.heading("Numbers");
    numbers(&mut sheet, &rows(&profile, &traces));
    sheet.heading("Fig. 5 and 6: both injections");
    let mut figures =
        vec![(section(&profile, &traces), "Fig. 5: ways of the tip, in section, to scale.".to_owned())];
    for (trace, (_, title)) in traces.iter().zip(INJECTIONS) {
        figures.push((
            over_time(&profile, trace, title),
            "Fig. 6: positive resists insertion, negative holds the needle back on its way out. Marks: the layer that the tip comes to, and where it is drawn back; the withdrawal is shaded.".into(),
        ));
    }
    figures.push((
        clamping(&profile, &traces),
        "Fig. 5: the clamping force along the way. It is computed and reported: this device turns freely."
            .into(),
    ));
    figures.push((
        over_depth(&traces),
        "The same over depth: a plateau a layer, and the opposite sign on the way out.".into(),
    ));
    sheet.figures(&figures);
    sheet.heading("What the paper leaves open");
    for words in [
        "The forces of the withdrawal are “of the same kind, in the opposite direction”: no number. Ours have their own magnitudes in the patient's file.",
        "The coefficients of the polynomial before the puncture and of the friction are other papers'. Depths of the layers are not given: ours stand in the patient's file with their sources.",
        "The place of the bursa along the skin: the patient's file says from where to where. In the first injection the needle goes in at 37° and passes beside it, is drawn back by 20 mm, turned to 45°, and reaches it. The device is told where the line of the needle meets the layers: beside the bursa the hand feels none.",
        "Need 1 asks for a free entry point, and the conclusion says that it is fixed: here the procedure chooses it.",
    ] {
        sheet.paragraph(words);
    }
    Ok(sheet)
}

/// The share of the law's forces that the hand is given.
fn scale(profile: &Profile) -> f64 {
    profile.config.patient.scale.to_num()
}

/// Friction along the shaft at the injections' 6 mm/s, N: past the Stribeck speed no more than
/// sliding.
fn friction_n(profile: &Profile) -> f64 {
    match &profile.config.patient.law {
        Law::Sparte(law) => {
            law.friction.sliding.0.to_num::<f64>() + 6.0 * law.friction.viscous.0.to_num::<f64>()
        }
        Law::Jog(_) | Law::Xr(_) => 0.0,
    }
}

fn number(profile: &Profile, tissue: Tissue) -> Option<u8> {
    profile.config.patient.layers.iter().position(|l| l.tissue == tissue).map(|at| at as u8)
}

fn rows(profile: &Profile, traces: &[Trace]) -> Vec<Row> {
    let newtons = |n: Option<f64>| n.map_or("–".into(), |n| format!("{} N", decimal(n, 2)));
    let each = |value: &dyn Fn(&Trace) -> Option<f64>| -> String {
        traces.iter().map(|t| newtons(value(t))).collect::<Vec<_>>().join(" and ")
    };
    let mut rows = Vec::new();
    for (tissue, paper_n) in CUTTING {
        let Some(layer) = number(profile, tissue) else { continue };
        let name = tissue_name(tissue);
        let said = format!("{} N", decimal(paper_n, 1));
        rows.push(row(
            &format!("cutting force, {name} (way in of both injections)"),
            &said,
            each(&|t| plateau_in(t, layer).map(|n| n / scale(profile) - friction_n(profile))),
            Whose::Papers,
        ));
    }
    for (tissue, _) in CUTTING {
        let Some(layer) = number(profile, tissue) else { continue };
        // The innermost is left before its cutting force has turned round.
        let turning = if tissue == Tissue::Cartilage { ", turning round" } else { "" };
        let what = format!("force on the way out, {}{turning} (both injections)", tissue_name(tissue));
        rows.push(row(
            &what,
            "opposite direction",
            each(&|t| plateau_out(t, layer).map(|n| n / scale(profile))),
            Whose::NoneGiven,
        ));
    }
    rows.push(row(
        "largest clamping force, across the needle (both injections)",
        "drawn in Fig. 5",
        each(&|t| t.largest_lateral_n(profile)),
        Whose::NoneGiven,
    ));
    for (trace, (_, title)) in traces.iter().zip(INJECTIONS) {
        let Some(target) = trace.target(profile) else { continue };
        let beside = if target.passed_beside > 0 { "passed beside, then " } else { "" };
        let outcome = match target.outcome {
            TargetOutcome::Missed => "missed",
            TargetOutcome::Reached => "reached",
            TargetOutcome::Beyond => "reached, then on to the cartilage",
        };
        let paper = if beside.is_empty() {
            "all layers until the cartilage"
        } else {
            "missed on purpose, then reached"
        };
        let said = format!("{beside}{outcome}; {} s in it", decimal(target.time_s, 2));
        rows.push(row(&format!("{}, {title}", target.name), paper, said, Whose::NoneGiven));
    }
    let largest = profile.plan.largest_force().0.to_num::<f64>();
    rows.push(row(
        "largest force of the device",
        "10 N",
        format!("{} N: one motor on a roller", decimal(largest, 2)),
        Whose::Papers,
    ));
    rows
}

/// Mean force in the last third of the time between the contact with a layer on the last way in and
/// with the next one, N. In the innermost it ends before the needle rests, where cutting gives way
/// to sliding.
fn plateau_in(trace: &Trace, layer: u8) -> Option<f64> {
    let deepest = trace.deepest();
    let begin = trace.last_event(deepest, is_contact_with(layer))?;
    // The next layer may be met only on another way in.
    let turning = trace.nearly_turning(begin);
    let end = trace.event(begin, is_contact_with(layer + 1)).map_or(turning, |next| next.min(turning));
    trace.mean_n(begin + (end - begin) * 2 / 3..end)
}

/// Mean force between the exits from the layer below and from this one on the last way out, its
/// first third left out; N.
fn plateau_out(trace: &Trace, layer: u8) -> Option<f64> {
    let deepest = trace.deepest();
    let end = trace.event(deepest, is_exit_from(layer))?;
    let begin =
        trace.event(deepest, is_exit_from(layer + 1)).unwrap_or_else(|| trace.drawn_back(deepest)).min(end);
    trace.mean_n(begin + (end - begin) / 3..end)
}

fn section(profile: &Profile, traces: &[Trace]) -> String {
    let (bands, vessel) = anatomy(&profile.scene(Source::Virtual, None));
    let ways = traces.iter().zip(INJECTIONS).zip(0..);
    let way = |((trace, (_, name)), colour): ((&Trace, (&str, &str)), u8)| Way {
        name: name.into(),
        colour,
        points: trace.way(0..trace.len()),
        marks: Vec::new(),
    };
    let ways = ways.map(way).collect();
    Section { title: "Trajectories".into(), bands, vessel, ways, ..Section::default() }.svg()
}

fn over_time(profile: &Profile, trace: &Trace, title: &str) -> String {
    let deepest = trace.deepest();
    let seconds = |index: usize| index as f64 / f64::from(TICK_HZ);
    let met = CUTTING.iter().filter_map(|(tissue, _)| {
        let at = trace.last_event(deepest, is_contact_with(number(profile, *tissue)?))?;
        Some((seconds(at), tissue_name(*tissue).to_owned()))
    });
    let drawn_back = seconds(trace.drawn_back(deepest));
    let back = (drawn_back, "withdrawal".to_owned());
    Chart {
        title: title.into(),
        x_label: "time, s".into(),
        y_label: "force, N".into(),
        curves: vec![Curve { points: trace.force_over_time(0..trace.len()), ..Curve::default() }],
        marks: met.chain([back]).collect(),
        zone: Some((drawn_back, seconds(trace.len()))),
        ..Chart::default()
    }
    .svg()
}

fn clamping(profile: &Profile, traces: &[Trace]) -> String {
    let Law::Sparte(law) = &profile.config.patient.law else { return String::new() };
    let per_rad = law.fixture.per_mrad.0.to_num::<f64>() * 1e3;
    let most_rad = f64::from(law.fixture.largest.0) * 1e-3;
    let curve = |(trace, ((_, name), colour)): (&Trace, ((&str, &str), u8))| Curve {
        name: name.into(),
        colour,
        dashed: false,
        points: trace.lateral_over_way(per_rad, most_rad),
    };
    Chart {
        title: "Clamping force".into(),
        x_label: "way of the tip, mm".into(),
        y_label: "force across the needle, N".into(),
        curves: traces.iter().zip(INJECTIONS.into_iter().zip(0..)).map(curve).collect(),
        ..Chart::default()
    }
    .svg()
}

fn over_depth(traces: &[Trace]) -> String {
    let curve = |(trace, ((_, name), colour)): (&Trace, ((&str, &str), u8))| Curve {
        name: name.into(),
        colour,
        dashed: false,
        points: trace.force_over_depth(0..trace.len()),
    };
    Chart {
        title: "Force over depth".into(),
        x_label: "depth along the needle, mm".into(),
        y_label: "force, N".into(),
        curves: traces.iter().zip(INJECTIONS.into_iter().zip(0..)).map(curve).collect(),
        ..Chart::default()
    }
    .svg()
}
