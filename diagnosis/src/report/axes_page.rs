//! One page for the axes of a machine, a row each.

use crate::report::outcome::{Outcome, percent_of_force};
use html_report::{Cell, Sheet};

/// One axis.
#[derive(Debug, Clone)]
pub struct Row {
    name: String,
    sentence: String,
    /// True if it has a report.
    has_report: bool,
    /// Held-out force error as it is and with what was found, in per cent of the force.
    errors: Option<[f64; 2]>,
}

impl Row {
    /// The axis of a diagnosis whose report is in a folder of the axis' name.
    pub fn of(name: &str, outcome: &Outcome) -> Self {
        let report = &outcome.report;
        let errors = [report.fit.nominal.holdout, report.fit.patched.holdout];
        let errors = errors.map(|force| percent_of_force(report, force));
        let is_known = report.fit.force_rms.holdout > 0.0 && errors.iter().all(|x| x.is_finite());
        Self {
            name: name.into(),
            sentence: report.sentence.clone(),
            has_report: true,
            errors: is_known.then_some(errors),
        }
    }

    /// An axis that could not be diagnosed; `why` is a sentence without its full stop.
    pub fn failed(name: &str, why: &str) -> Self {
        let sentence = format!("Cannot be diagnosed: {why}");
        Self { name: name.into(), sentence, has_report: false, errors: None }
    }
}

/// The page, for the folder with the axes' folders.
pub fn page(rows: &[Row]) -> String {
    let mut sheet = Sheet::new(
        "Diagnosis of all axes",
        "What the simulation of each axis leaves out. The errors are of the force on recordings that were not used for fitting.",
    );
    let cells = |row: &Row| {
        let part = |i: usize| Cell::number(row.errors.map(|errors| errors[i]), 1);
        let name = if row.has_report {
            Cell::Link { text: row.name.clone(), to: format!("{}/report.html", row.name) }
        } else {
            Cell::text(row.name.clone())
        };
        vec![name, Cell::text(format!("{}.", row.sentence)), part(0), part(1)]
    };
    let rows: Vec<Vec<Cell>> = rows.iter().map(cells).collect();
    sheet.table(&["axis", "what was found", "before, %", "after, %"], &rows);
    sheet.finish()
}
