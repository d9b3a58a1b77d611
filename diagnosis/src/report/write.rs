//! The files that a diagnosis becomes.

use crate::report::html;
use crate::report::outcome::Outcome;
use std::fmt::Write as _;
use std::io;
use std::path::Path;

impl Outcome {
    /// Writes `diagnosis.json`, `report.html`, `patched-rig.toml`, the rigs that lead to it and
    /// `residuals.csv`, each whole or not at all, and the rigs of the contenders in a folder
    /// `contenders`.
    pub fn write(&self, dir: &Path) -> io::Result<()> {
        std::fs::create_dir_all(dir)?;
        let json = serde_json::to_string_pretty(&self.report).map_err(io::Error::other)?;
        let files = [
            ("residuals.csv", self.residuals_csv()),
            ("nominal-rig.toml", self.nominal_rig.to_toml()),
            ("refit-rig.toml", self.refit_rig.to_toml()),
            ("patched-rig.toml", self.patched_rig.to_toml()),
            ("report.html", self.html()),
            ("diagnosis.json", json + "\n"),
        ];
        let contenders = dir.join("contenders");
        if contenders.exists() {
            // Those of an earlier report in the same folder do not contend any more.
            std::fs::remove_dir_all(&contenders)?;
        }
        if !self.contending_rigs.is_empty() {
            std::fs::create_dir_all(&contenders)?;
        }
        for (contender, rig) in self.report.contenders.iter().zip(&self.contending_rigs) {
            std::fs::write(dir.join(&contender.rig), rig.to_toml())?;
        }
        for (name, text) in files {
            let half = dir.join(format!(".{name}.part"));
            std::fs::write(&half, text)?;
            std::fs::rename(&half, dir.join(name))?;
        }
        Ok(())
    }

    /// Returns the report as a page, `report.html`.
    pub fn html(&self) -> String {
        html::page(self)
    }

    fn residuals_csv(&self) -> String {
        let mut out = String::from("recording,time_s,velocity,nominal,refit,patched\n");
        for series in &self.evidence.series {
            let file = series.file.replace([',', '"', '\n', '\r'], "_");
            for j in 0..series.time_s.len() {
                let _ = write!(out, "{file},{:.6},{:e}", series.time_s[j], series.velocity[j]);
                for column in [&series.nominal, &series.refit, &series.patched] {
                    match column[j] {
                        Some(x) => {
                            let _ = write!(out, ",{x:e}");
                        }
                        None => out.push(','),
                    }
                }
                out.push('\n');
            }
        }
        out
    }
}
