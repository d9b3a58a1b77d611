//! Force errors on the held-out recording, worked out from the files alone: a refit of the nominal
//! structure by least squares, and the patched rig as it is.
//!
//! Both sides of the equation of motion go through the filters of the key's oracle. What is a
//! nuisance of each recording is found on it: its bias, where the rig allows one, and the encoder's
//! zero against what is periodic.

use std::path::{Path, PathBuf};

use super::band::{Band, NOMINAL, prior, spread};
use super::known;
use super::laws::effective_command;
use super::patched;
use super::recording::Recording;
use super::rig::Rig;
use crate::key::Key;
use crate::signal::Normal;
use crate::tool::Paths;

/// The files of a case in the oracle's band.
pub(crate) struct JudgeDynamics {
    rig: Rig,
    fits: Vec<Band>,
    held: Band,
    floor: f64,
    /// True inertia, the scale of the oracle's forces.
    truth: f64,
}

impl JudgeDynamics {
    /// Reads rig and recordings.
    ///
    /// # Errors
    /// Fails if a file cannot be read, or if the key lacks a value.
    pub(crate) fn new(paths: &Paths, key: &Key) -> Result<Self, String> {
        let oracle = key.oracle.as_ref().ok_or("the key has no oracle")?;
        let truth = key.true_inertia.ok_or("the key does not tell the true inertia")?;
        let rig = read(&paths.rig)?;
        let recording = Recording::read(paths.holdout.first().ok_or("there is no held-out recording")?)?;
        let still: Vec<[f64; 2]> = oracle.still_s.iter().map(|s| s.map(|t| t - recording.time[0])).collect();
        let held = Band::of(&recording, &rig, oracle, &still);
        let fit = |path: &PathBuf| Ok(Band::of(&Recording::read(path)?, &rig, oracle, &[]));
        let fits = paths.fit.iter().map(fit).collect::<Result<_, String>>()?;
        Ok(Self { rig, fits, held, floor: oracle.floor, truth })
    }

    /// Rms that the refitted nominal structure leaves on the held-out recording, N·m or N in the
    /// scale of the true inertia.
    pub(crate) fn refit(&self) -> f64 {
        let values = refit(&self.rig, &self.fits, self.floor);
        values.left(&self.rig, &self.held) * self.truth / values.means[0]
    }

    /// The same of a patched rig.
    ///
    /// # Errors
    /// What cannot be read, or which of its effects the judge cannot run.
    pub(crate) fn patched(&self, file: &Path) -> Result<f64, String> {
        let patched = read(file)?;
        Ok(patched::left(&self.rig, &patched, &self.held)? * self.truth / patched.inertia)
    }

    /// The same of a fit that is given the whole structure.
    ///
    /// # Errors
    /// Fails if nothing is fitted to one of the hidden effects, and names it.
    pub(crate) fn known_structure(&self, key: &Key) -> Result<f64, String> {
        let (left, inertia) = known::left(&self.rig, key, &self.fits, &self.held, self.floor)?;
        Ok(left * self.truth / inertia)
    }
}

fn read(path: &Path) -> Result<Rig, String> {
    let text = std::fs::read_to_string(path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    Rig::parse(&text).map_err(|e| format!("{}: {e}", path.display()))
}

/// Nominal values after the refit.
#[derive(Debug)]
struct Values {
    means: [f64; NOMINAL],
}

/// The force of the drive as the nominal rig has it.
fn drive(rig: &Rig, band: &Band) -> Vec<f64> {
    let nominal = Rig { effects: Vec::new(), ..rig.clone() };
    let command = effective_command(&nominal, &band.motion);
    band.see(|i| rig.gain * command[i])
}

/// Least squares on the fit recordings, held by the declared uncertainty; `floor` is the noise.
fn refit(rig: &Rig, fits: &[Band], floor: f64) -> Values {
    let (means, sds) = prior(rig);
    let width = NOMINAL + fits.len();
    let mut normal = Normal::new(width);
    let mut seconds = 0.0;
    for (r, band) in fits.iter().enumerate() {
        let columns = band.nominal_columns();
        for (j, drive) in drive(rig, band).iter().enumerate() {
            let mut row = vec![0.0; width];
            let mut left = *drive;
            for (k, column) in columns.iter().enumerate() {
                row[k] = column[j];
                left -= means[k] * row[k];
            }
            row[NOMINAL + r] = -1.0;
            normal.add(&row, left);
        }
        seconds += band.seconds();
    }
    // Rows that follow each other closely are not independent: the prior weighs accordingly.
    let weight = Band::dependence(fits, normal.rows, seconds);
    let mut penalty: Vec<f64> = sds.iter().map(|sd| weight * floor * floor / (sd * sd).max(1e-300)).collect();
    penalty.resize(width, 0.0);
    let mut active: Vec<usize> = (0..NOMINAL).filter(|&k| sds[k] > 0.0).collect();
    if rig.offset.is_some() {
        active.extend(NOMINAL..width);
    }
    let moved = normal.solve(&active, &penalty);
    Values { means: std::array::from_fn(|k| means[k] + moved[k]) }
}

impl Values {
    /// Rms of what they leave.
    fn left(&self, rig: &Rig, band: &Band) -> f64 {
        let mut left = drive(rig, band);
        for (value, column) in self.means.iter().zip(band.nominal_columns()) {
            left.iter_mut().zip(column).for_each(|(x, c)| *x -= value * c);
        }
        spread(&left, rig.offset.is_some())
    }
}
