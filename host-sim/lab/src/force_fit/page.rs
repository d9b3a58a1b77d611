//! Measured against fitted, as a page that needs no other file.

use super::table::{Cell, Origin};
use super::{Fit, Judgement};
use html_report::chart::{Chart, Curve};
use html_report::{Cell as Field, Sheet, decimal};

/// The page.
pub fn html(fit: &Fit) -> String {
    let judged = &fit.judged;
    let mean = |value: fn(&Judgement) -> f64| {
        (judged.iter().map(|j| value(j).powi(2)).sum::<f64>() / judged.len().max(1) as f64).sqrt()
    };
    let lead = format!(
        "{} insertions at {} speeds and {} angles. Over the insertions that the table had not seen, what it leaves is {} N of {} N \
         (root mean square).",
        fit.insertions.len(),
        fit.table.speeds_mm_s.len(),
        fit.table.angles_deg.len(),
        decimal(mean(|j| j.unseen_n), 3),
        decimal(mean(|j| j.size_n), 3),
    );
    let mut sheet = Sheet::new("Force over depth, speed and angle", &lead);
    sheet.heading("What was measured");
    sheet.table(&design_head(fit), &design(fit));
    if fit.table.not_measured().next().is_some() {
        sheet.note(
            "Separable: taken as the measured curve of this angle times what this speed is to its speed elsewhere. It cannot be \
             checked without an insertion there. Nearest: nothing ties this speed or angle to the others; the nearest cell stands for it.",
        );
    }
    sheet.heading("Measured and fitted");
    sheet.figures(&charts(fit));
    sheet.heading("Judged by insertions that it has not seen");
    sheet.table(
        &[
            "insertion",
            "mm/s",
            "°",
            "force, N rms",
            "left unseen, N rms",
            "left seen, N rms",
            "another there",
            "worst peak, %",
        ],
        &judged.iter().map(row).collect::<Vec<_>>(),
    );
    sheet.finish()
}

fn design_head(fit: &Fit) -> Vec<&'static str> {
    let mut head = vec!["angle"];
    // One empty header per speed; the speeds themselves are in the first row.
    head.extend(fit.table.speeds_mm_s.iter().map(|_| ""));
    head
}

fn design(fit: &Fit) -> Vec<Vec<Field>> {
    let table = &fit.table;
    let mut rows = vec![vec![Field::text("")]];
    rows[0].extend(table.speeds_mm_s.iter().map(|v| Field::text(format!("{} mm/s", decimal(*v, 1)))));
    for (index, angle) in table.angles_deg.iter().enumerate() {
        let mut row = vec![Field::text(format!("{}°", decimal(*angle, 0)))];
        row.extend(table.cells.iter().map(|speed| tag(&speed[index])));
        rows.push(row);
    }
    rows
}

fn tag(cell: &Cell) -> Field {
    let (text, kind) = match cell.origin {
        Origin::Measured => ("measured", 2),
        Origin::Separable => ("no data: separable", 1),
        Origin::Nearest => ("no data: nearest", 1),
    };
    Field::Tag { text: text.into(), kind }
}

/// A chart for every angle: each speed's insertions and the table's curve over them.
fn charts(fit: &Fit) -> Vec<(String, String)> {
    let table = &fit.table;
    let near = |grid: &[f64], value: f64| super::nearest(grid, value);
    table
        .angles_deg
        .iter()
        .enumerate()
        .map(|(a, angle)| {
            let mut curves = Vec::new();
            for (s, speed) in table.speeds_mm_s.iter().enumerate() {
                let colour = (s % 6) as u8;
                let there = fit.insertions.iter().filter(|i| {
                    near(&table.speeds_mm_s, i.speed_mm_s) == s && near(&table.angles_deg, i.angle_deg) == a
                });
                curves.extend(there.map(|i| Curve {
                    colour: 5,
                    points: i.points.clone(),
                    ..Curve::default()
                }));
                let cell = &table.cells[s][a];
                let knots = cell.force.depths_mm.iter().zip(&cell.force.forces_n);
                let points = knots.map(|(mm, n)| (*mm, *n)).collect();
                let filled = cell.origin != Origin::Measured;
                let name = format!("{} mm/s{}", decimal(*speed, 1), if filled { ", no data" } else { "" });
                curves.push(Curve { name, colour, dashed: filled, points });
            }
            let chart = Chart {
                title: format!("{}°", decimal(*angle, 0)),
                x_label: "depth under the skin, mm".into(),
                y_label: "force, N".into(),
                curves,
                ..Chart::default()
            };
            (chart.svg(), "Grey: measured. Coloured: the table; in dashes where nobody measured.".to_owned())
        })
        .collect()
}

fn row(one: &Judgement) -> Vec<Field> {
    vec![
        Field::text(one.name.clone()),
        Field::number(Some(one.speed_mm_s), 2),
        Field::number(Some(one.angle_deg), 1),
        Field::number(Some(one.size_n), 3),
        Field::number(Some(one.unseen_n), 3),
        Field::number(one.seen_n, 3),
        Field::text(if one.has_neighbours { "yes" } else { "no" }),
        Field::number(one.worst_peak().map(|share| share * 100.0), 1),
    ]
}
