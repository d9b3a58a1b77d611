//! `host-sim fit-force`.

use clap::Args;
use convert::export::write;
use device_sim::error::Error;
use lab::force_fit::{self, Fit, insertions, page, table::Origin, writer};
use live::{examples, say};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Fit the force table of Paper 000, F(depth, speed, angle), to insertions at several speeds and
/// angles.
///
/// Reads recordings of this program (MCAP), or CSV with the columns time_s, depth_mm (along the
/// needle), force_n and angle_deg. It is judged by the insertions of --holdout; without any, by
/// each insertion in its turn, left out. Writes the table, which a profile's `[force_table]` takes,
/// and beside it a page that shows measured against fitted.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim fit-force phantom/*.csv --out table.toml"))]
pub(crate) struct FitForce {
    /// Recordings to fit to
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
    /// Recordings to judge by, which the fit does not see
    #[arg(long, value_name = "FILE")]
    holdout: Vec<PathBuf>,
    /// The table; the page gets the same name with .html
    #[arg(long, value_name = "F.toml")]
    out: PathBuf,
}

impl FitForce {
    pub(crate) fn run(self) -> Result<(), Error> {
        if let Some(both) = self.files.iter().find(|file| self.holdout.contains(file)) {
            return Err(Error::input(format_args!(
                "{}: is both to fit to and to judge by; give it once",
                both.display()
            )));
        }
        let read = |files: &[PathBuf]| -> Result<Vec<_>, Error> {
            Ok(files.iter().map(|f| insertions::read(f)).collect::<Result<Vec<_>, _>>()?.concat())
        };
        let (seen, unseen) = (read(&self.files)?, read(&self.holdout)?);
        let fit = force_fit::fit(seen, &unseen)
            .ok_or_else(|| Error::input("the recordings hold no insertion to fit to; give others"))?;
        let table = writer::toml(&fit);
        if table.contains("NaN") || table.contains("inf") {
            return Err(Error::input(
                "the fit has no finite table: are depth_mm and force_n in mm and N, positive into the tissue and against insertion?",
            ));
        }
        save(&self.out, &table)?;
        let shown = self.out.with_extension("html");
        save(&shown, &page::html(&fit))?;
        say!("{}", self.out.display());
        say!("{}", shown.display());
        report(&fit);
        Ok(())
    }
}

fn save(path: &Path, text: &str) -> Result<(), Error> {
    write(path, |out| out.write_all(text.as_bytes()))
}

fn report(fit: &Fit) {
    for (speed, angle, origin) in fit.table.not_measured() {
        let how = match origin {
            Origin::Nearest => "taken from the nearest measured cell",
            _ => "taken as separable",
        };
        say!("no data at {speed:.1} mm/s and {angle:.0}°: {how}");
    }
    let mean = |value: fn(&force_fit::Judgement) -> f64| {
        let squares: f64 = fit.judged.iter().map(|j| value(j).powi(2)).sum();
        (squares / fit.judged.len().max(1) as f64).sqrt()
    };
    say!(
        "insertions={} cells={} measured={} judged={} force_rms_n={:.4} unseen_rms_n={:.4} gives_way={} worst_peak_percent={:.1}",
        fit.insertions.len(),
        fit.table.speeds_mm_s.len() * fit.table.angles_deg.len(),
        fit.table.cells.iter().flatten().filter(|c| c.origin == Origin::Measured).count(),
        fit.judged.len(),
        mean(|j| j.size_n),
        mean(|j| j.unseen_n),
        fit.table.gives_way.len(),
        force_fit::worst_peak(&fit.judged).unwrap_or(0.0) * 100.0
    );
}
