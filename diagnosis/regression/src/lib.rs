//! One regression that proposes missing physics, with evidence and without an opinion.
//!
//! [`propose`] is a pure function: a [`Rig`] (the nominal simulation and how far its values may be
//! off) and [`Recording`]s in, [`Proposals`] out. Chosen on left-out frames of the fit recordings
//! alone; the holdout is read once, after everything is chosen, for the final laws and their
//! printed rivals.
//!
//! Signals on an even grid (`grid`, `signals`) and columns of laws (`laws`) pass one mask, one
//! low-pass and one orthonormal lapped transform (`tiles`); weighted least squares with the rig's
//! values as prior (`problem`, `fit`) scores each law by the share of the force error that it takes
//! (`evidence`), and the best goes in, up to three times (`selection`).

mod constants;
pub mod data;
pub mod evidence;
mod filters;
mod fit;
mod grid;
pub mod laws;
mod problem;
mod selection;
mod signals;
mod tiles;

pub use data::{Part, Recording, Rig, Value};
pub use evidence::{Evidence, HeldOut};

use problem::Problem;
use selection::Search;

/// A law that may be missing, beside those of the rounds before.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypothesis {
    /// Its record.
    pub law: &'static laws::Law,
    /// Its shape; several if several waves act together.
    pub shapes: Vec<laws::Shape>,
    /// Coefficients of its columns, recording by recording where phases are of their own.
    pub coefficients: Vec<f64>,
    /// True if the first coefficient has the sign and unit of the law, and two halves agree.
    pub valid: bool,
    /// The figures for and against it.
    pub evidence: Evidence,
}

/// Force error in the band, N·m or N rms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ForceError {
    /// On left-out frames of the fit.
    pub fit: f64,
    /// On the holdout.
    pub holdout: f64,
}

/// The rounds of the search, each with the best of every law, the chosen one first.
#[derive(Debug, Clone, PartialEq)]
pub struct Proposals {
    /// At most four; each is beside the first laws of those before.
    pub rounds: Vec<Vec<Hypothesis>>,
    /// Force error of the nominal structure, and after the first law of each round.
    pub errors: Vec<ForceError>,
    /// Band in which forces are compared, Hz.
    pub band_hz: f64,
}

/// Says why recordings cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal(pub String);

/// Fewest rows of a recording, and of the transformed fit and holdout.
const FEWEST: (usize, usize, usize) = (60, 60, 40);

/// Proposes laws that the rig leaves out. Recordings of fewer than 60 rows are left aside.
///
/// # Errors
/// A sentence if too little remains to fit or to hold out, or if a column is not as long as the
/// times.
pub fn propose(rig: &Rig, recordings: &[Recording]) -> Result<Proposals, Refusal> {
    let mut used: Vec<&Recording> = recordings.iter().filter(|r| r.time_s.len() >= FEWEST.0).collect();
    used.sort_by_key(|r| r.part == Part::Holdout);
    used.iter().try_for_each(|r| check(r))?;
    let fit = used.iter().filter(|r| r.part == Part::Fit).count();
    if fit == 0 || fit == used.len() {
        return Err(Refusal("a fit and a held-out recording of at least 60 rows each are needed".into()));
    }
    let problem = Problem::new(rig, &used);
    let rows = problem.tiling.rows.len();
    let fit_rows = problem.tiling.fit_rows;
    if fit_rows < FEWEST.1 || rows - fit_rows < FEWEST.2 {
        return Err(Refusal("the recordings are too short to cut into frames; record longer".into()));
    }
    let band_hz = problem.tiling.band_hz;
    let (search, rounds) = Search::run(problem);
    let evidence = search.evidence(&rounds);
    let error = |n: usize| {
        let [fit, holdout] = search.force_error(&rounds[..n]);
        ForceError { fit, holdout }
    };
    let errors = (0..=rounds.len()).map(error).collect();
    let hypotheses = rounds.iter().zip(evidence).map(|(round, evidence)| {
        let hypothesis = |(scored, evidence): (&selection::Scored, Evidence)| {
            let candidate = &search.candidates[scored.candidate];
            Hypothesis {
                law: candidate.law,
                shapes: candidate.shapes.clone(),
                coefficients: search.coefficients(scored).to_vec(),
                valid: scored.is_valid(),
                evidence,
            }
        };
        round.ranked.iter().zip(evidence).map(hypothesis).collect()
    });
    Ok(Proposals { rounds: hypotheses.collect(), errors, band_hz })
}

fn check(r: &Recording) -> Result<(), Refusal> {
    let n = r.time_s.len();
    let as_long = |x: &Option<Vec<f64>>| x.as_ref().is_none_or(|x| x.len() == n);
    let finite = r.time_s.iter().chain(&r.command).chain(&r.position_counts).all(|x| x.is_finite());
    let rising = r.time_s.windows(2).all(|w| w[0] < w[1]);
    let whole =
        r.command.len() == n && r.position_counts.len() == n && as_long(&r.tilt_rad) && as_long(&r.load);
    if finite && rising && whole {
        return Ok(());
    }
    Err(Refusal("a recording's columns must be finite and as long as its increasing times".into()))
}
