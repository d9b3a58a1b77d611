//! The files of a design.

use crate::choose::{Alternative, Design};
use crate::page;
use crate::predict::STEP_S;
use serde_json::{Value, json};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Rows of the predictions that are left out between two that are written.
const EVERY: usize = 10;

impl Design {
    /// Writes `command.csv`, `reference.csv`, `predicted.csv`, `experiment.json` and
    /// `experiment.html` to a folder; returns their paths.
    ///
    /// # Errors
    /// One sentence: the file, the cause, what to do.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, String> {
        let refuse = |path: &Path, cause: std::io::Error| {
            format!(
                "{}: it cannot be written ({cause}); free some space or choose another --out",
                path.display()
            )
        };
        std::fs::create_dir_all(folder).map_err(|cause| refuse(folder, cause))?;
        let files = [
            ("command.csv", self.command_csv()),
            ("reference.csv", self.reference_csv()),
            ("predicted.csv", self.predicted_csv()),
            ("experiment.json", format!("{:#}\n", self.json())),
            ("experiment.html", page::html(self)),
        ];
        let mut out = Vec::new();
        for (name, text) in files {
            let path = folder.join(name);
            std::fs::write(&path, text).map_err(|cause| refuse(&path, cause))?;
            out.push(path);
        }
        Ok(out)
    }

    /// The command at 10 kHz that the servo would send if the most probable rival were true.
    fn command_csv(&self) -> String {
        let mut out = String::from("time_s,command\n");
        for (row, command) in self.predictions[0].command.iter().enumerate() {
            let _ = writeln!(out, "{:.4},{command:.6e}", row as f64 * STEP_S);
        }
        out
    }

    /// The reference at 10 kHz, in rad or m from the start, and the force in addition to the
    /// loop's.
    fn reference_csv(&self) -> String {
        let mut out = String::from("time_s,reference,force\n");
        let segments = self.chosen.input.segments.iter();
        let forces = segments.flat_map(|segment| {
            let rows = (segment.seconds / STEP_S).round() as usize;
            (0..rows).map(|row| segment.signal.at(row as f64 * STEP_S).force)
        });
        for (row, (reference, force)) in self.predictions[0].reference.iter().zip(forces).enumerate() {
            let _ = writeln!(out, "{:.4},{reference:.6e},{force:.6e}", row as f64 * STEP_S);
        }
        out
    }

    /// Position, speed and command of every rival at 1 kHz.
    fn predicted_csv(&self) -> String {
        let mut out = String::from("time_s");
        for rival in &self.case.rivals {
            let name = &rival.name;
            let _ = write!(out, ",{name}_position,{name}_velocity,{name}_command");
        }
        out.push('\n');
        for row in (0..self.predictions[0].position.len()).step_by(EVERY) {
            let _ = write!(out, "{:.3}", row as f64 * STEP_S);
            for p in &self.predictions {
                let _ =
                    write!(out, ",{:.6e},{:.6e},{:.6e}", p.position[row], p.velocity[row], p.command[row]);
            }
            out.push('\n');
        }
        out
    }

    /// The design as data.
    pub fn json(&self) -> Value {
        let kind = self.case.rivals[0].rig.kind;
        let of = |one: &Alternative| {
            let pairs: Vec<Value> = one
                .pairs
                .iter()
                .map(|p| json!({ "truth": p.truth, "rival": p.rival, "nats": p.nats }))
                .collect();
            json!({
                "input": one.input.in_words(kind.length(), kind.force()),
                "seconds": one.input.seconds(),
                "criterion_nats": one.criterion,
                "pairs": pairs,
            })
        };
        let rivals: Vec<Value> = self
            .case
            .rivals
            .iter()
            .map(|rival| json!({ "name": rival.name, "probability": rival.probability }))
            .collect();
        json!({
            "format": 1,
            "rivals": rivals,
            "chosen": of(&self.chosen),
            "runners_up": self.runners_up.iter().map(of).collect::<Vec<_>>(),
            "not_told_apart": self.inseparable,
            "servo": { "stiffness": self.servo.stiffness, "damping": self.servo.damping },
            "limits": self.case.limits,
            "tried": self.tried.0,
            "beyond_limits": self.tried.1,
        })
    }

    /// The outcome in sentences for the terminal.
    pub fn summary(&self) -> String {
        let kind = self.case.rivals[0].rig.kind;
        let mut out = format!(
            "{}: {:.1} s.\n",
            self.chosen.input.in_words(kind.length(), kind.force()),
            self.chosen.input.seconds()
        );
        for rival in &self.case.rivals {
            let pairs = self.chosen.pairs.iter().filter(|pair| pair.truth == rival.name);
            let Some(nearest) = pairs.min_by(|a, b| a.nats.total_cmp(&b.nats)) else { continue };
            let _ = writeln!(
                out,
                "  if {} ({:.0} %) is true: {} against {}, the nearest rival ({:.1} nats)",
                rival.name,
                100.0 * rival.probability,
                crate::choose::odds(nearest.nats),
                nearest.rival,
                nearest.nats
            );
        }
        if let Some(sentence) = self.limits_in_words() {
            let _ = writeln!(out, "  {sentence}.");
        }
        out
    }
}
