//! The three papers on the virtual device: their procedures are run and recorded, and every figure
//! and number that a paper's text gives is on a page next to ours. A module for each paper says
//! what it gives and what we measure; none computes a force of its own.

mod measure;
mod paper_000;
mod paper_001;
mod paper_002;
mod table_1;

use device_sim::error::Error;
use html_report::{Cell, Sheet};
use std::path::{Path, PathBuf};

/// A paper, by its number among the seeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paper {
    /// Layered tissue in extended reality.
    Xr000,
    /// The roller device for venepuncture.
    Jog001,
    /// The joint injection simulator.
    Sparte002,
}

/// All of them.
pub const PAPERS: [Paper; 3] = [Paper::Xr000, Paper::Jog001, Paper::Sparte002];

impl Paper {
    /// Its number among the seeds.
    pub fn number(self) -> &'static str {
        match self {
            Paper::Xr000 => "000",
            Paper::Jog001 => "001",
            Paper::Sparte002 => "002",
        }
    }
}

/// Whose a number is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Whose {
    /// The paper prints it, and ours is to be it.
    Papers,
    /// The paper needs it and does not print it: we chose it.
    Ours,
    /// The paper shows or says something of the kind without a number: ours was measured.
    NoneGiven,
}

/// A number of the paper and ours.
#[derive(Clone, Debug)]
struct Row {
    what: String,
    paper: String,
    ours: String,
    whose: Whose,
}

fn row(what: &str, paper: &str, ours: impl Into<String>, whose: Whose) -> Row {
    Row { what: what.into(), paper: paper.into(), ours: ours.into(), whose }
}

/// Runs the procedures of `paper` and writes its page and the recordings that it shows to `dir`;
/// the page.
pub fn reproduce(paper: Paper, dir: &Path) -> Result<PathBuf, Error> {
    std::fs::create_dir_all(dir).map_err(|cause| {
        Error::input(format_args!(
            "{}: the folder cannot be made ({cause}); choose another --out",
            dir.display()
        ))
    })?;
    let sheet = match paper {
        Paper::Xr000 => paper_000::sheet(dir)?,
        Paper::Jog001 => paper_001::sheet(dir)?,
        Paper::Sparte002 => paper_002::sheet(dir)?,
    };
    let page = dir.join(format!("paper-{}.html", paper.number()));
    std::fs::write(&page, sheet.finish()).map_err(|cause| {
        Error::failed(format_args!("{}: cannot be written ({cause}); choose another --out", page.display()))
    })?;
    Ok(page)
}

/// Numbers in a table, with a column that says whose each is.
fn numbers(sheet: &mut Sheet, rows: &[Row]) {
    let rows: Vec<Vec<Cell>> = rows
        .iter()
        .map(|row| {
            let (text, kind) = match row.whose {
                Whose::Papers => ("the paper's number", 0),
                Whose::Ours => ("ours", 1),
                Whose::NoneGiven => ("the paper gives none", 3),
            };
            vec![
                Cell::text(row.what.clone()),
                Cell::text(row.paper.clone()),
                Cell::text(row.ours.clone()),
                Cell::Tag { text: text.into(), kind },
            ]
        })
        .collect();
    sheet.table(&["", "paper", "here", "whose number"], &rows);
}
