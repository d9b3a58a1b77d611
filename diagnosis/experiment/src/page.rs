//! Why this input decides, as a page that needs no network.

use crate::choose::{Alternative, Design, odds};
use crate::input::short;
use crate::predict::STEP_S;
use html_report::chart::{Chart, Curve};
use html_report::{Cell, Sheet};

/// Rows of a prediction that are left out between two that are drawn.
const EVERY: usize = 20;

/// The page.
pub(crate) fn html(design: &Design) -> String {
    let kind = design.case.rivals[0].rig.kind;
    let nearest = design.chosen.nearest();
    let lead = format!(
        "Play this: {}. It lasts {} s. {}",
        design.chosen.input.in_words(kind.length(), kind.force()),
        short(design.chosen.input.seconds()),
        nearest.map_or(String::new(), |pair| format!(
            "The pair that is hardest to distinguish, {} and {}, ends with odds of {} ({} nats).",
            pair.truth,
            pair.rival,
            odds(pair.nats),
            short(pair.nats)
        ))
    );
    let mut sheet = Sheet::new("The experiment that decides", &lead);
    if let Some(sentence) = design.limits_in_words() {
        sheet.paragraph(&format!("{sentence}."));
    }
    rivals(&mut sheet, design);
    inputs(&mut sheet, design);
    sheet.heading("Evidence, and what each rival would do");
    sheet.figures(&[
        evidence(design),
        motion(design, &format!("position, {}", kind.length()), |p| &p.position),
        motion(design, &format!("command, {}", design.case.rivals[0].rig.actuator.command_unit), |p| {
            &p.command
        }),
    ]);
    sheet.note(
        "Each rival was simulated with its own values. The nats do not compare these curves: along the motion of each rival, \
         every other one is refitted first, and only what it still does not expect counts.",
    );
    sheet.finish()
}

fn rivals(sheet: &mut Sheet, design: &Design) {
    sheet.heading("The rivals");
    let row = |rival: &crate::case::Rival| {
        let pairs = design.chosen.pairs.iter().filter(|pair| pair.truth == rival.name);
        let nearest = pairs.min_by(|a, b| a.nats.total_cmp(&b.nats));
        vec![
            Cell::text(format!("{} ({})", rival.words, rival.name)),
            Cell::number(Some(100.0 * rival.probability), 0),
            Cell::text(nearest.map_or("–", |pair| &pair.rival)),
            Cell::number(nearest.map(|pair| pair.nats), 1),
            Cell::text(nearest.map_or("–".into(), |pair| odds(pair.nats))),
        ]
    };
    let rows: Vec<Vec<Cell>> = design.case.rivals.iter().map(row).collect();
    sheet.table(
        &["if this is true", "probability now, %", "its nearest rival", "nats", "expected odds"],
        &rows,
    );
}

fn inputs(sheet: &mut Sheet, design: &Design) {
    let kind = design.case.rivals[0].rig.kind;
    sheet.heading("Why this input");
    let all = || std::iter::once(&design.chosen).chain(&design.runners_up);
    let label = |place: usize| match place {
        0 => "chosen".to_owned(),
        place => format!("runner-up {place}"),
    };
    let row = |(place, one): (usize, &Alternative)| {
        let nearest = one.nearest();
        vec![
            Cell::text(label(place)),
            Cell::number(Some(one.input.seconds()), 1),
            Cell::number(Some(one.criterion), 1),
            Cell::number(nearest.map(|pair| pair.nats), 1),
            Cell::text(nearest.map_or("–".into(), |pair| format!("{}, {}", pair.truth, pair.rival))),
        ]
    };
    let rows: Vec<Vec<Cell>> = all().enumerate().map(row).collect();
    sheet.table(&["", "seconds", "expected worth, nats", "nats of the nearest pair", "nearest pair"], &rows);
    for (place, one) in all().enumerate() {
        sheet.note(&format!("{}: {}.", label(place), one.input.in_words(kind.length(), kind.force())));
    }
    let (tried, out) = design.tried;
    sheet.note(&format!(
        "{tried} segments were simulated with every rival; {out} left 80 % of the limits and were not considered. Among inputs within 3 % \
         of the best, the shortest is chosen. Nats beyond 50 count by their logarithm."
    ));
}

/// The nats that the chosen input and the runners-up gather over time.
fn evidence(design: &Design) -> (String, String) {
    let all = std::iter::once(&design.chosen).chain(&design.runners_up);
    let curve = |(place, one): (usize, &Alternative)| Curve {
        name: if place == 0 { "chosen".to_owned() } else { format!("runner-up {place}") },
        colour: place as u8,
        dashed: place > 0,
        points: one.gathered.1.clone(),
    };
    let mut curves: Vec<Curve> = all.enumerate().map(curve).collect();
    curves.reverse();
    let chart = Chart {
        title: "Evidence for the truth, nearest pair of each".into(),
        x_label: "time, s".into(),
        y_label: "nats".into(),
        curves,
        ..Chart::default()
    };
    let caption =
        "Expected log-odds gathered after the rival was refitted; 3 nats are 20 to 1, 14 a million to 1.";
    (chart.svg(), caption.to_owned())
}

fn motion<'a>(
    design: &'a Design,
    label: &str,
    column: impl Fn(&'a crate::predict::Prediction) -> &'a Vec<f64>,
) -> (String, String) {
    let curves = design
        .case
        .rivals
        .iter()
        .zip(&design.predictions)
        .enumerate()
        .map(|(place, (rival, prediction))| Curve {
            name: rival.name.clone(),
            colour: place as u8,
            dashed: place > 0,
            points: column(prediction)
                .iter()
                .enumerate()
                .step_by(EVERY)
                .map(|(row, x)| (row as f64 * STEP_S, *x))
                .collect(),
        })
        .collect();
    let chart = Chart {
        title: label.to_owned(),
        x_label: "time, s".into(),
        y_label: label.to_owned(),
        curves,
        ..Chart::default()
    };
    (chart.svg(), format!("Predicted {label}, each rival under the chosen input."))
}
