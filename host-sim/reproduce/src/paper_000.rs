//! Paper 000, layered tissue in extended reality: force against depth at its speeds and angles
//! (Fig. 2), and Table 1.

use super::measure::{Trace, is_contact_with, is_puncture_of};
use super::table_1;
use super::{Row, Whose, numbers, row};
use control_core::config::Tissue;
use device_sim::error::Error;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use device_sim::session::tissue_name;
use html_report::chart::{Chart, Curve};
use html_report::{Cell, Sheet, decimal};
use lab::force_fit::insertions::{self, Insertion};
use lab::force_fit::{self, Judgement};
use server::virtual_run;
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
    /// True if the paper measured this cell of its design.
    fn is_the_papers(&self) -> bool {
        self.angle == 60 || self.speed == 5
    }
}

/// Questions that the paper leaves open, and the answers chosen here.
const OPEN: [&str; 5] = [
    "The force function is “described in Figure 3”, which is a picture of a screen. Here the force is a table over depth, speed and angle, which fit-force fits to insertions.",
    "Five of nine cells of speed and angle were measured. The other four are taken as separable; nothing in the paper says that they are.",
    "No real insertion was compared with: every curve here comes from the phantom's table.",
    "What a needle feels in a track that it has made already, and beside it: here a layer gives way once, and in its track the force is the lower hull of the table.",
    "Whether speed matters is disputed between sources: it is a parameter of the table.",
];

pub(super) fn sheet(dir: &Path) -> Result<Sheet, Error> {
    let profile = Profile::find("phantom")?;
    let cuts = record(&profile, dir)?;
    let mut sheet = Sheet::new(
        "A Hybrid Virtual Reality-Haptic Simulation Framework for Layer-aware Needle Insertion in Extended Reality (paper 000)",
        "The paper prints its protocol and Table 1, and no force: its force function is a picture of a screen, and its measurements are curves \
         without numbers in the text. Its curves count here as shape only.",
    );
    sheet.paragraph(
        "Run on the patient phantom with the law xr, a table over depth, speed and angle. The table's forces are assumptions of ours, as the \
         patient's file says: the paper prints none. Protocol, layers, vessel test and the fit of a table are those of the paper.",
    );
    sheet.heading("Numbers");
    numbers(&mut sheet, &rows(&profile, &cuts));
    sheet.heading("Cells that the paper measured");
    numbers(&mut sheet, &largest(&cuts, true));
    sheet.heading("Cells that the paper did not measure: extrapolated");
    numbers(&mut sheet, &largest(&cuts, false));
    let (compared, fit) = fitted(&cuts)?;
    sheet.heading("The generated profile against the insertions (Fig. 4 against Fig. 2)");
    sheet.paragraph(
        "The paper says that the trend of its generated profile resembles that of its measurements. The same comparison here: the insertions of its five cells, \
         recorded with the phantom's table, and the table that fit-force makes of them. Both come from our phantom; no real insertion is in it.",
    );
    numbers(&mut sheet, &compared);
    sheet.paragraph(&fit);
    sheet.heading("Fig. 2 and 4: force against depth");
    let mut figures = force_figures(&profile, &cuts);
    figures.push(table_1::side_by_side(dir)?);
    sheet.figures(&figures);
    sheet.heading("Table 1");
    put_table_1(&mut sheet);
    table_1::pushes(&mut sheet, dir)?;
    sheet.heading("What the paper leaves open");
    OPEN.iter().for_each(|words| sheet.paragraph(words));
    Ok(sheet)
}

/// Records an insertion at every speed and angle.
fn record(profile: &Profile, dir: &Path) -> Result<Vec<Cut>, Error> {
    let mut cuts = Vec::new();
    for (speed, angle) in SPEEDS.iter().flat_map(|v| ANGLES.iter().map(move |a| (*v, *a))) {
        let procedure = Procedure::find(&format!("insertion-{speed}mms-{angle}deg"), profile)?;
        let file = dir.join(format!("paper-000-{speed}mms-{angle}deg.mcap"));
        let trace = Trace::of(&virtual_run::record(profile, procedure, &file)?)?;
        cuts.push(Cut { speed, angle, trace, file });
    }
    Ok(cuts)
}

/// Force against depth, as (picture, words): the cells that the paper measured, then the others.
fn force_figures(profile: &Profile, cuts: &[Cut]) -> Vec<(String, String)> {
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
            marks: cuts.iter().find(|c| wanted(c)).map_or_else(Vec::new, |c| marks(profile, c)),
            ..Chart::default()
        }
        .svg()
    };
    let speed = |c: &Cut| format!("{} mm/s", c.speed);
    let angle = |c: &Cut| format!("{}°", c.angle);
    let no_data = "The paper did not measure this; the table is taken as separable there.";
    vec![
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
    ]
}

/// The constraints of the tissue's picture as the paper prints them.
fn put_table_1(sheet: &mut Sheet) {
    sheet.paragraph(
        "Constraints of the tissue's picture, as the paper prints them. It gives no unit to L₀, no compliance, no count of particles and no time \
         step; its bending values are rest angles. They are one of the configurations of the tissue picture (`paper_000` in the folder tissue), where L₀ is \
         taken as metres between particles and V₀ as a share of the volume as built, and no part of the force unless one asks for it.",
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
}

/// Returns the depths at which the layers are met and give way on one of the curves, mm along the
/// needle.
fn marks(profile: &Profile, cut: &Cut) -> Vec<(f64, String)> {
    let of = |number: u8, tissue: Tissue| {
        let named = |index: Option<usize>, what: &str| {
            index.map(|at| (cut.trace.depth_mm(at), format!("{} {what}", tissue_name(tissue))))
        };
        let met = named(cut.trace.event(0, is_contact_with(number)), "met");
        let gives_way = named(cut.trace.event(0, is_puncture_of(number)), "gives way");
        met.into_iter().chain(gives_way)
    };
    (0..).zip(&profile.config.patient.layers).flat_map(|(number, layer)| of(number, layer.tissue)).collect()
}

/// The largest force of each cell that the paper measured, or of each of the others.
fn largest(cuts: &[Cut], measured: bool) -> Vec<Row> {
    let of = |cut: &Cut| {
        row(
            &format!("largest force, {} mm/s, {}°", cut.speed, cut.angle),
            if measured { "a curve without numbers" } else { "not measured" },
            format!("{} N", decimal(cut.trace.largest_n(0..cut.trace.deepest()), 2)),
            Whose::NoneGiven,
        )
    };
    cuts.iter().filter(|cut| cut.is_the_papers() == measured).map(of).collect()
}

/// Compares fit-force's table of the paper's five cells with the insertions that it was made from,
/// and says in a sentence how well it predicts the other four.
fn fitted(cuts: &[Cut]) -> Result<(Vec<Row>, String), Error> {
    let read = |wanted: bool| -> Result<Vec<_>, Error> {
        let files = cuts.iter().filter(|c| c.is_the_papers() == wanted).map(|c| insertions::read(&c.file));
        Ok(files.collect::<Result<Vec<_>, _>>()?.concat())
    };
    let Some(fit) = force_fit::fit(read(true)?, &read(false)?) else {
        return Ok((Vec::new(), String::new()));
    };
    let compared = |one: &Insertion| {
        let curve = fit.table.curve(one.speed_mm_s, one.angle_deg);
        let pairs: Vec<(f64, f64)> = one.points.iter().map(|(mm, n)| (*n, curve.at(*mm))).collect();
        let said = format!(
            "correlation {}, {} N rms apart",
            decimal(correlation(&pairs), 3),
            decimal((pairs.iter().map(|(a, b)| (a - b).powi(2)).sum::<f64>() / pairs.len() as f64).sqrt(), 3)
        );
        let what = format!("{} mm/s, {}°", decimal(one.speed_mm_s, 0), decimal(one.angle_deg, 0));
        row(&what, "“the trend resembles”", said, Whose::NoneGiven)
    };
    let rms = |value: fn(&Judgement) -> f64| {
        let squares: f64 = fit.judged.iter().map(|j| value(j).powi(2)).sum();
        (squares / fit.judged.len().max(1) as f64).sqrt()
    };
    let said = format!(
        "The four other cells, which the table has not seen: {} N rms apart, of {} N.",
        decimal(rms(|j| j.unseen_n), 3),
        decimal(rms(|j| j.size_n), 2)
    );
    Ok((fit.insertions.iter().map(compared).collect(), said))
}

/// Pearson's coefficient.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (a, b) = pairs.iter().fold((0.0, 0.0), |(a, b), pair| (a + pair.0 / n, b + pair.1 / n));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (x, y) in pairs {
        ab += (x - a) * (y - b);
        aa += (x - a).powi(2);
        bb += (y - b).powi(2);
    }
    ab / (aa * bb).sqrt()
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
            let gives_way = cut.trace.event(0, is_puncture_of(vessel as u8));
            let ours = gives_way.map_or("–".into(), |at| {
                format!("{} mm along the needle", decimal(cut.trace.depth_mm(at), 1))
            });
            let what = format!("vessel gives way at {}°", cut.angle);
            rows.push(row(&what, "“tissue rupture”, no number", ours, Whose::NoneGiven));
        }
    }
    rows
}
