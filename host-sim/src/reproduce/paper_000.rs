//! Seed 000, layered tissue in extended reality: force against depth at its speeds and angles (Fig. 2), and Table 1.

use super::measure::{Trace, is_contact_with};
use super::{Row, Whose, numbers, row};
use crate::failure::Failure;
use crate::force_fit::{self, Judgement, insertions};
use crate::procedure::Procedure;
use crate::profile::Profile;
use crate::rehearsal;
use crate::session::tissue_name;
use crate::sheet::chart::{Chart, Curve};
use crate::sheet::{Cell, Sheet, decimal};
use control_core::config::Tissue;
use std::path::{Path, PathBuf};

/// Speeds, mm/s, and angles, °, of the paper's experiment.
const SPEEDS: [u32; 3] = [1, 3, 5];
const ANGLES: [u32; 3] = [30, 45, 60];

/// One insertion.
struct Cut {
    speed: u32,
    angle: u32,
    trace: Trace,
    file: PathBuf,
}

impl Cut {
    /// Whether the paper measured this cell of its design.
    fn is_the_papers(&self) -> bool {
        self.angle == 60 || self.speed == 5
    }
}

pub(super) fn sheet(dir: &Path) -> Result<Sheet, Failure> {
    let profile = Profile::find("phantom")?;
    let mut cuts = Vec::new();
    for (speed, angle) in SPEEDS.iter().flat_map(|v| ANGLES.iter().map(move |a| (*v, *a))) {
        let procedure = Procedure::find(&format!("insertion-{speed}mms-{angle}deg"), &profile)?;
        let file = dir.join(format!("paper-000-{speed}mms-{angle}deg.mcap"));
        let trace = Trace::of(&rehearsal::record(&profile, procedure, &file)?)?;
        cuts.push(Cut { speed, angle, trace, file });
    }
    let mut sheet = Sheet::new(
        "A Hybrid Virtual Reality-Haptic Simulation Framework for Layer-aware Needle Insertion in Extended Reality (seed 000)",
        "The paper prints its protocol and Table 1, and no force: its force function is a picture of a screen, and its measurements are curves \
         without numbers in the text. Its curves count here as shape only.",
    );
    sheet.paragraph(
        "Run on the patient phantom with the law xr, a table over depth, speed and angle. The table's forces are assumptions of ours, as the \
         patient's file says: the paper prints none. Protocol, layers, vessel test and the fit of a table are those of the paper.",
    );
    sheet.heading("Numbers");
    let mut rows = rows(&profile, &cuts);
    rows.extend(fitted(&cuts)?);
    numbers(&mut sheet, &rows);
    sheet.heading("Fig. 2 and 4: force against depth");
    let of = |wanted: &dyn Fn(&Cut) -> bool, name: &dyn Fn(&Cut) -> String, title: &str| {
        let curves = cuts.iter().filter(|c| wanted(c)).zip(0..);
        Chart {
            title: title.into(),
            x_label: "depth along the needle, mm".into(),
            y_label: "force, N".into(),
            curves: curves
                .map(|(c, colour)| Curve {
                    name: name(c),
                    colour,
                    dashed: false,
                    points: c.trace.force_over_depth(0..c.trace.deepest()),
                })
                .collect(),
            ..Chart::default()
        }
        .svg()
    };
    let speed = |c: &Cut| format!("{} mm/s", c.speed);
    let angle = |c: &Cut| format!("{}°", c.angle);
    let no_data = "The paper did not measure this; the table is taken as separable there.";
    sheet.figures(&[
        (
            of(&|c| c.angle == 60, &speed, "Fig. 2 (a): 60°"),
            "As the paper measured it: three speeds at 60°.".into(),
        ),
        (
            of(&|c| c.speed == 5, &angle, "Fig. 2 (b): 5 mm/s"),
            "As the paper measured it: three angles at 5 mm/s.".into(),
        ),
        (of(&|c| c.angle == 45 && c.speed < 5, &speed, "45°, no data in the paper"), no_data.into()),
        (of(&|c| c.angle == 30 && c.speed < 5, &speed, "30°, no data in the paper"), no_data.into()),
    ]);
    sheet.heading("Table 1");
    sheet.paragraph(
        "Constraints of the tissue's picture, as the paper prints them. It gives no unit to L₀, no compliance, no count of particles and no time \
         step; its bending values are rest angles. They are one of the configurations of the tissue picture (`paper_000` in the folder tissue), where L₀ is \
         taken as metres between particles and V₀ as a share of the volume as built, and no part of the force.",
    );
    let cells = |name: &str, values: [&str; 3]| {
        let mut row = vec![Cell::text(name)];
        row.extend(values.iter().map(|v| Cell::Number((*v).into())));
        row.push(Cell::Tag { text: "the paper's number".into(), kind: 0 });
        row
    };
    sheet.table(
        &["layer", "distance (L₀)", "volume (V₀)", "bending (θ₀)", "whose number"],
        &[
            cells("Skin (top)", ["0.01; here 10 mm", "1.0", "180°"]),
            cells("Vessel", ["0.015; here 15 mm", "0.8", "0°"]),
            cells("Skin (bottom)", ["0.012; here 12 mm", "1.0", "180°"]),
        ],
    );
    sheet.heading("What the paper leaves open");
    for words in [
        "The force function is “described in Figure 3”, which is a picture of a screen. Here the force is a table over depth, speed and angle, which fit-force fits to insertions.",
        "Five of nine cells of speed and angle were measured. The other four are taken as separable; nothing in the paper says that they are.",
        "Whether speed matters is disputed between sources: it is a parameter of the table.",
    ] {
        sheet.paragraph(words);
    }
    Ok(sheet)
}

/// What fit-force makes of the paper's five cells, and how it tells the four that the paper did not measure.
fn fitted(cuts: &[Cut]) -> Result<Option<Row>, Failure> {
    let read = |wanted: bool| -> Result<Vec<_>, Failure> {
        let files = cuts.iter().filter(|c| c.is_the_papers() == wanted).map(|c| insertions::read(&c.file));
        Ok(files.collect::<Result<Vec<_>, _>>()?.concat())
    };
    let fit = force_fit::fit(read(true)?, &read(false)?);
    Ok(fit.map(|fit| {
        let rms = |value: fn(&Judgement) -> f64| {
            let squares: f64 = fit.judged.iter().map(|j| value(j).powi(2)).sum();
            (squares / fit.judged.len().max(1) as f64).sqrt()
        };
        let said =
            format!("{} N rms of {} N", decimal(rms(|j| j.unseen_n), 3), decimal(rms(|j| j.size_n), 2));
        row(
            "what a table fitted to the paper's five cells leaves of the other four",
            "“the trend resembles”",
            said,
            Whose::NoneGiven,
        )
    }))
}

fn names(profile: &Profile) -> String {
    let layers = profile.config.patient.layers.iter().map(|l| tissue_name(l.tissue));
    layers.collect::<Vec<_>>().join(", ")
}

fn rows(profile: &Profile, cuts: &[Cut]) -> Vec<Row> {
    let layers = &profile.config.patient.layers;
    let vessel = layers.iter().position(|l| l.tissue == Tissue::Vessel);
    let mut rows = vec![
        row("insertion speeds", "1, 3 and 5 mm/s", "1, 3 and 5 mm/s", Whose::Papers),
        row("angles", "30, 45 and 60°", "30, 45 and 60°", Whose::Papers),
        row("layers", "3: skin, vessel, skin", names(profile), Whose::Ours),
    ];
    for cut in cuts {
        let largest = cut.trace.largest_n(0..cut.trace.deepest());
        rows.push(row(
            &format!("largest force, {} mm/s, {}°", cut.speed, cut.angle),
            if cut.is_the_papers() { "a curve without numbers" } else { "not measured" },
            format!("{} N", decimal(largest, 2)),
            Whose::NoneGiven,
        ));
    }
    if let Some(vessel) = vessel {
        for cut in cuts.iter().filter(|c| c.speed == 5) {
            let contact = cut.trace.event(0, is_contact_with(vessel as u8));
            let ours = contact.map_or("–".into(), |at| {
                format!("{} mm along the needle", decimal(cut.trace.depth_mm(at), 1))
            });
            rows.push(row(
                &format!("vessel met at {}°", cut.angle),
                "detected and shown",
                ours,
                Whose::NoneGiven,
            ));
        }
    }
    rows
}
