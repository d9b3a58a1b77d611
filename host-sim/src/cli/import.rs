//! `host-sim import`: recordings as people have them, made into what `diagnose` reads.

use clap::Args;
use convert::import::{self, Decimal, Keep, Known, Request, RigValues};
use convert::shell::quoted;
use device_sim::error::Error;
use live::{examples, note, say};
use std::path::PathBuf;

/// Make rig.toml and CSV files, which `diagnose` reads, from recordings of any other program.
///
/// Reads tables as text (any separator, decimal commas, comments, a row of units, no header,
/// channels in rows), NumPy's .npz, MATLAB's .mat, JSON, MCAP with messages in JSON; with
/// `--features hdf5` HDF5 and MATLAB's -v7.3, with `--features ros` ROS 2 bags in MCAP, and with
/// `--features parquet` Parquet and LeRobot datasets. Says what it took for what, what it changed
/// and what it left out. Values that recordings do not contain are written as nan in rig.toml, to
/// be filled in.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim import run1.csv run2.csv --out imported
  host-sim import --page --out imported
  host-sim import log.csv --column position=theta:deg --column command=-tau:mNm --out imported
  host-sim import angle.csv torque.csv --column position=angle.csv/value:deg --column command=torque.csv/value:Nm --out imported
  host-sim import robot.csv --axes --split 0.6 --out robot
  host-sim import log.npz --rate 1000 --split 0.6 --inertia 0.17 --gain 1 --out imported"))]
pub(crate) struct Import {
    /// Recordings; several files of one run in chronological order, or with different columns
    #[arg(required_unless_present = "page", value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Ask on a page instead, on this computer only: drop a log on it, say what its columns are
    /// while you see them, fill in the rig, and have the report
    #[arg(long, conflicts_with_all = ["axes", "column", "clock", "rig"])]
    page: bool,
    /// With --page: the port of 127.0.0.1 (0: any free one)
    #[arg(long, default_value_t = 8712, requires = "page", value_name = "PORT")]
    port: u16,
    /// Folder to write to; created if missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// The column of the time, command, position, velocity, reference, tilt, force or enabled (1
    /// where the drive was on), and its unit; a minus before the name changes the sign, FILE/NAME
    /// is a column of one file, and none leaves the role empty
    #[arg(long, value_name = "ROLE=NAME[:UNIT]")]
    column: Vec<String>,
    /// The column with the time stamps of one role, where channels have clocks of their own
    #[arg(long, value_name = "ROLE=NAME[:UNIT]")]
    clock: Vec<String>,
    /// The sign of whole numbers of a role: int16 (two's complement), sign10 (in bit 10) or
    /// plain
    #[arg(long, value_name = "ROLE=ENCODING")]
    encoding: Vec<String>,
    /// The sign before the decimals of numbers as text; the other one separates thousands
    #[arg(long, value_name = "SIGN")]
    decimal: Option<Sign>,
    /// Row K of every N, where the rows of N axes alternate
    #[arg(long, value_name = "K/N")]
    rows: Option<String>,
    /// Split the log of a machine into its axes by the names of their columns, a folder each in
    /// --out, for `diagnose --all`; or give each axis with --column position=NAME
    #[arg(long)]
    axes: bool,
    /// Rows per second, if no column has the time
    #[arg(long, value_name = "HZ")]
    rate: Option<f64>,
    /// Treat every file as a separate run, even if neither clocks nor names say so
    #[arg(long)]
    runs: bool,
    /// Nothing drives the axis: the command is zero
    #[arg(long)]
    undriven: bool,
    /// A position loop drives the axis and its command was not logged: the command is reference −
    /// position, and the gain the loop's stiffness
    #[arg(long, conflicts_with = "undriven")]
    error_as_command: bool,
    /// Encoder counts per turn of the coordinate
    #[arg(long, value_name = "N")]
    counts_per_turn: Option<f64>,
    /// Encoder counts per rad or m
    #[arg(long, value_name = "N", conflicts_with = "counts_per_turn")]
    counts_per_unit: Option<f64>,
    /// An existing rig file: its resolution is used, and no new one is written
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// Inertia for rig.toml, kg·m² or kg
    #[arg(long, value_name = "J")]
    inertia: Option<f64>,
    /// Force for one unit of command, for rig.toml, N·m or N
    #[arg(long, value_name = "K")]
    gain: Option<f64>,
    /// Cut every run at this fraction of its length, into fit.csv and holdout.csv
    #[arg(long, value_name = "PART")]
    split: Option<f64>,
    /// Keep the rows at rest
    #[arg(long)]
    keep_idle: bool,
    /// Keep positions that jump by a turn
    #[arg(long)]
    keep_wraps: bool,
    /// Keep rows whose position jumps away and back, and positions that begin again
    #[arg(long)]
    keep_outliers: bool,
}

/// The sign before decimals.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Sign {
    /// 1.5, and 1,000
    Point,
    /// 1,5, and 1.000
    Comma,
    /// 1.5 and 1,5
    Both,
}

/// Reads `--rows K/N`.
fn every(text: &str) -> Result<(usize, usize), Error> {
    let read = || {
        let (first, step) = text.split_once('/')?;
        let (first, step) = (first.parse().ok()?, step.parse().ok()?);
        (1..=step).contains(&first).then_some((first, step))
    };
    read().ok_or_else(|| {
        Error::input(format_args!("--rows {text}: give it as --rows 1/2, the first of every two rows"))
    })
}

impl Import {
    /// Refuses numbers that no recording has.
    fn check(&self) -> Result<(), Error> {
        let positive = [
            ("--rate", self.rate),
            ("--counts-per-turn", self.counts_per_turn),
            ("--counts-per-unit", self.counts_per_unit),
            ("--inertia", self.inertia),
        ];
        for (option, value) in positive {
            if let Some(x) = value.filter(|x| !(x.is_finite() && *x > 0.0)) {
                return Err(Error::input(format_args!("{option} is {x}; it must be a number above zero")));
            }
        }
        if let Some(gain) = self.gain.filter(|x| !x.is_finite() || *x == 0.0) {
            return Err(Error::input(format_args!("--gain is {gain}; it must be a number other than zero")));
        }
        if let Some(split) = self.split.filter(|x| !(0.1..=0.9).contains(x)) {
            return Err(Error::input(format_args!(
                "--split is {split}; it must be from 0.1 to 0.9; 0.6 is usual"
            )));
        }
        Ok(())
    }

    pub(crate) fn run(self) -> Result<(), Error> {
        self.check()?;
        if self.page {
            return super::import_page::serve(self.files, self.out, self.port);
        }
        let columns = self.column.iter().map(|text| import::choice(text)).collect::<Result<_, _>>()?;
        let clocks = self.clock.iter().map(|text| import::clock_choice(text)).collect::<Result<_, _>>()?;
        let encodings = self.encoding.iter().map(|text| import::encoding(text)).collect::<Result<_, _>>()?;
        let decimal = self.decimal.map(|sign| match sign {
            Sign::Point => Decimal::Point,
            Sign::Comma => Decimal::Comma,
            Sign::Both => Decimal::Both,
        });
        let known =
            Known { rate_hz: self.rate, undriven: self.undriven, error_as_command: self.error_as_command };
        let request = Request {
            files: self.files,
            columns,
            clocks,
            encodings,
            decimal,
            every: self.rows.as_deref().map(every).transpose()?,
            known,
            counts_per_turn: self.counts_per_turn,
            counts_per_unit: self.counts_per_unit,
            values: RigValues { inertia: self.inertia, gain: self.gain },
            rig: self.rig,
            runs: self.runs,
            keep: Keep { idle: self.keep_idle, wraps: self.keep_wraps, outliers: self.keep_outliers },
            split: self.split,
            out: self.out.clone(),
        };
        if !self.axes {
            let done = import::import(&request)?;
            report(&done);
            next(&done, &self.out);
            return Ok(());
        }
        for (name, done) in import::import_axes(&request)? {
            say!("axis {name}:");
            report(&done);
        }
        let out = self.out.display().to_string();
        note!("next: host-sim diagnose --all {} --out {}", quoted(&out), quoted(&format!("{out}-report")));
        Ok(())
    }
}

/// Says what was done.
fn report(done: &import::Imported) {
    for note in &done.notes {
        say!("{note}");
    }
    for file in &done.recordings {
        let rate = (file.rows - 1) as f64 / file.seconds;
        say!("{} rows={} seconds={:.3} rate_hz={rate:.1}", file.path.display(), file.rows, file.seconds);
    }
    if done.to_fill_in {
        say!("{}: fill in the values that stand as nan", done.rig.display());
    }
}

/// The command that comes next.
fn next(done: &import::Imported, out: &std::path::Path) {
    let paths = done.recordings.iter().map(|recording| recording.path.clone()).collect();
    let Some((fit, held)) = super::diagnose_all::parted(paths) else {
        note!("next: another recording, to hold out, or import this one again with --split 0.6");
        return;
    };
    let list = |option: &str, files: &[PathBuf]| {
        files.iter().map(|f| format!(" {option} {}", quoted(&f.display().to_string()))).collect::<String>()
    };
    note!(
        "next: host-sim diagnose --rig {}{}{} --out {}",
        quoted(&done.rig.display().to_string()),
        list("--fit", &fit),
        list("--holdout", &held),
        quoted(&out.join("report").display().to_string())
    );
}
