//! `cargo xtask bench`: runs the measuring programs there are and puts what they print into one
//! table. A program gives a row by printing `name=value`, with a name of [`crate::rows`], or as
//! JSON, `"row": "name", … "value": …`; a peer in the same row by `name.peer=who
//! name.peer_value=…`; the time of an amount of work by `work.subject.unit.amount=seconds`. A row
//! that nothing measures is an error at the end, and a missing peer is named: no number here was
//! written by hand. Lines that a test of the emulated board begins with a bar are printed unchanged
//! below the table.

mod end_to_end;
mod fit;
mod programs;
mod table;
mod values;
mod work;

use crate::rows::ROWS;
use crate::shell::{self, Error};
use crate::{boards, firmware};
use programs::{EXAMPLES, PEERS};
use std::fs;
use std::process::{Command, Stdio};
use table::Measured;
pub(crate) use values::board_lines_in;
use values::{Values, peer};

/// Measures, prints the tables, writes `target/bench.json`. Where `names` has any, only what gives
/// these rows is run.
pub(crate) fn run(names: &[String]) -> Result<(), Error> {
    if let Some(unknown) = names.iter().find(|name| ROWS.iter().all(|row| row.name != **name)) {
        let all: Vec<&str> = ROWS.iter().map(|row| row.name).collect();
        return Err(Error::usage(format!(
            "`{unknown}` is not a row of the bench; the rows are: {}",
            all.join(" ")
        )));
    }
    let mut bench = BenchRun { names, values: Values::new(), board_lines: vec![], errors: vec![] };
    bench.measure_programs();
    bench.measure_whole();
    bench.measure_tests()?;
    let works = work::works(&bench.values);
    bench.values.extend(work::growths(&works));
    bench.name_unmeasured();
    let BenchRun { values, board_lines, errors, .. } = bench;
    let rows: Vec<Measured> = ROWS
        .into_iter()
        .filter_map(|row| Some((row, values.get(row.name)?.parse().ok()?, peer(&values, row.name))))
        .collect();
    table::print(&rows);
    work::print(&works);
    println!("\nThe flash image on the emulated board:");
    board_lines.iter().for_each(|line| println!("{line}"));
    let path = shell::target().join("bench.json");
    fs::write(&path, table::json(&commit(), &rows))
        .map_err(|error| Error::new(format!("{} cannot be written: {error}", path.display())))?;
    println!("written to {}", path.display());
    if errors.is_empty() { Ok(()) } else { Err(Error::new(errors.join("; "))) }
}

/// Runs of a program and of its peer, by turns.
const TURNS: usize = 3;

/// A run of the bench: the rows that are wanted, and what has been measured.
struct BenchRun<'a> {
    /// All rows where it has none.
    names: &'a [String],
    values: Values,
    board_lines: Vec<String>,
    errors: Vec<String>,
}

impl BenchRun<'_> {
    /// True if a row is wanted whose name begins so.
    fn wants(&self, rows: &str) -> bool {
        self.names.is_empty() || self.names.iter().any(|name| name.starts_with(rows))
    }

    /// Measures where one of these rows is wanted; an error is reported at the end.
    fn measure(&mut self, rows: &[&str], what: &str, measured: impl FnOnce() -> Result<Values, Error>) {
        if !rows.iter().any(|rows| self.wants(rows)) {
            return;
        }
        match measured() {
            Ok(new) => self.values.extend(new),
            Err(error) => self.errors.push(format!("{what}: {error}")),
        }
    }

    fn measure_programs(&mut self) {
        for (name, rows) in EXAMPLES {
            self.measure(&[rows], name, || programs::example(name));
        }
        for (name, script, rows) in PEERS {
            if self.wants(rows) {
                self.measure_by_turns(name, script);
            }
        }
        self.measure(&["parameter_fit_"], "parameter fit", fit::ours);
        self.measure(&["parameter_fit_"], "parameter fit with its peer", fit::with_peer);
        self.measure(&["class_"], "class", programs::class);
    }

    /// Runs a program of ours and somebody else's by turns, so that a machine that slows down slows
    /// both, and takes the median of each value. Ours is measured where the other is absent.
    fn measure_by_turns(&mut self, name: &str, script: &str) {
        let (mut runs, mut is_there) = (vec![], true);
        for _ in 0..TURNS {
            if !self.keeps(name, programs::example(name), &mut runs) {
                break;
            }
            is_there = is_there && self.keeps(script, programs::peer(script), &mut runs);
        }
        self.values.extend(values::medians(&runs));
    }

    /// Keeps a run, or its error, which is reported at the end; true if it is a run.
    fn keeps(&mut self, what: &str, run: Result<Values, Error>, runs: &mut Vec<Values>) -> bool {
        match run {
            Ok(values) => runs.push(values),
            Err(error) => {
                self.errors.push(format!("{what}: {error}"));
                return false;
            }
        }
        true
    }

    fn measure_whole(&mut self) {
        self.measure(&["build_"], "build", end_to_end::build_time);
        self.measure(&["packages"], "packages", end_to_end::packages);
        self.measure(&["firmware_"], "firmware", end_to_end::image);
        self.measure(&["stream_"], "stream", end_to_end::stream);
        self.measure(&["diagnose_60s_", "diagnose_peak_"], "diagnosis", end_to_end::diagnosis);
    }

    /// Makes errors of the rows that are wanted and have no value: what printed them may have
    /// moved.
    fn name_unmeasured(&mut self) {
        let missing = ROWS.iter().filter(|row| self.wants(row.name) && !self.values.contains_key(row.name));
        let missing: Vec<String> = missing.map(|row| format!("nothing measured `{}`", row.name)).collect();
        self.errors.extend(missing);
    }

    fn measure_tests(&mut self) -> Result<(), Error> {
        let mut modules = programs::test_modules()?;
        modules.retain(|module| module.measures(|rows| self.wants(rows)));
        if modules.iter().any(programs::TestModule::is_of_a_board) {
            let images = boards::ALL.iter().try_for_each(|board| firmware::build(board).map(drop));
            self.errors.extend(images.err().map(|error| format!("firmware: {error}")));
        }
        for module in modules {
            match module.run(&mut self.board_lines) {
                Ok(new) => self.values.extend(new),
                Err(error) => self.errors.push(format!("{}: {error}", module.name)),
            }
        }
        Ok(())
    }
}

fn commit() -> String {
    let mut git = Command::new("git");
    git.current_dir(shell::top()).args(["rev-parse", "HEAD"]).stderr(Stdio::null());
    shell::output(&mut git).map_or_else(|_| "unknown".into(), |text| text.trim().to_string())
}
