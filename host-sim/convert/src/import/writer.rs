//! The contract's files: a rig of which the values are still to be filled in, and a CSV for every
//! run.

use super::encoder_resolution::Scale;
use super::role::Role;
use super::rows::Rows;
use super::units::Quantity;
use crate::export::write;
use crate::shell::quoted;
use device_sim::error::Error;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The known values of the rig.
#[derive(Clone, Debug, Default)]
pub struct RigValues {
    /// kg·m² or kg.
    pub inertia: Option<f64>,
    /// N·m or N per unit of command.
    pub gain: Option<f64>,
}

fn value(x: Option<f64>, unit: &str, what: &str) -> String {
    match x {
        Some(x) => format!("{x:?}              # {unit}"),
        None => format!("nan                # {unit}: fill in {what}"),
    }
}

/// Returns the text of `rig.toml`. Values that no recording gives are `nan`, which `diagnose`
/// refuses until they are filled in.
pub(super) fn rig(name: &str, rows: &Rows, scale: Scale, known: &RigValues) -> String {
    let linear = rows.position == Quantity::Length;
    let (kind, force, mass, length) =
        if linear { ("linear", "N", "kg", "m") } else { ("rotary", "N·m", "kg·m²", "rad") };
    let already_force = matches!((rows.command, linear), (Quantity::Torque, false) | (Quantity::Force, true));
    let gain = known.gain.or(already_force.then_some(1.0));
    let unit = match rows.command {
        Quantity::Plain => "1",
        other => other.unit(),
    };
    let mut out = String::new();
    let _ = write!(
        out,
        "# Written by host-sim import. Fill in what your simulation believes; a term whose key is missing is not in it.\n\
         format = 1\nname = {:?}\nkind = \"{kind}\"{}\n\n[model]\ninertia = {}\n\
         # viscous = 0.0    # {force}·s/{length}\n# coulomb = 0.0    # {force}\n# offset = 0.0     # {force}\n",
        name,
        if rows.position == Quantity::Counts {
            "                # or \"linear\": the recording has counts only"
        } else {
            ""
        },
        value(known.inertia, mass, "what the command moves, at the coordinate")
    );
    if rows.columns.contains_key(&Role::Tilt) {
        let _ = writeln!(out, "# weight = 0.0     # {force}, the load at a tilt of 90°");
    }
    let _ = write!(
        out,
        "\n[uncertainty]      # relative standard deviations of the values above\n\
         inertia = 0.15\nviscous = 0.5\ncoulomb = 0.5\ngain = 0.1\n\n[actuator]\ngain = {}\ncommand_unit = \"{unit}\"\n\
         # limit = 1.0      # the largest |command| that the drive accepts\n\n[encoder]\ncounts_per_unit = {}\n",
        value(gain, &format!("{force} per {unit}"), "the force for one unit of command"),
        value(scale.counts_per_unit, &format!("counts per {length}"), "the encoder's resolution")
    );
    out
}

/// Counts to a thousandth, without zeros that say nothing.
fn count(out: &mut String, x: f64, whole: bool) {
    if whole || x.fract() == 0.0 {
        let _ = write!(out, "{:.0}", x + 0.0);
    } else {
        let _ = write!(out, "{x:.3}");
    }
}

fn csv(run: &Rows, scale: Scale, out: &mut impl std::io::Write) -> std::io::Result<()> {
    let optional: Vec<(Role, &str)> =
        [(Role::Tilt, "tilt_rad"), (Role::Reference, "reference_counts"), (Role::Force, "force")]
            .into_iter()
            .filter(|(role, _)| run.columns.contains_key(role))
            .collect();
    let mut line = String::from("time_s,command,position_counts");
    for (_, name) in &optional {
        line.push(',');
        line.push_str(name);
    }
    line.push('\n');
    out.write_all(line.as_bytes())?;
    let per = |quantity: Quantity| {
        if quantity == Quantity::Counts { 1.0 } else { scale.counts_per_unit.unwrap_or(1.0) }
    };
    let (of_position, of_reference) = (per(run.position), per(run.reference));
    let (command, position) = (&run.columns[&Role::Command], &run.columns[&Role::Position]);
    for i in 0..run.time.len() {
        line.clear();
        // Tenths of a microsecond; writing to a string does not fail.
        let _ = write!(line, "{:.7},{},", run.time[i], command[i]);
        count(&mut line, position[i] * of_position, scale.whole);
        for (role, _) in &optional {
            line.push(',');
            let x = run.columns[role][i];
            if *role == Role::Reference {
                count(&mut line, x * of_reference, false);
            } else {
                let _ = write!(line, "{x}");
            }
        }
        line.push('\n');
        out.write_all(line.as_bytes())?;
    }
    Ok(())
}

/// Writes every run and, where `rig` has a text, `rig.toml`, into `dir`; the paths of the runs.
/// What an earlier import wrote there is replaced, or removed, but never a file that somebody
/// changed.
pub(super) fn files(
    dir: &Path,
    rig: Option<&str>,
    runs: &[(String, Rows)],
    scale: Scale,
) -> Result<Vec<PathBuf>, Error> {
    let paths: Vec<PathBuf> = runs.iter().map(|(name, _)| dir.join(format!("{name}.csv"))).collect();
    let rig = rig.map(|text| (dir.join("rig.toml"), text));
    let earlier = Written::read(dir);
    for path in rig.iter().map(|(path, _)| path).chain(&paths) {
        earlier.check(path)?;
    }
    std::fs::create_dir_all(dir).map_err(|cause| {
        Error::input(format_args!(
            "{}: the folder cannot be made ({cause}); choose another --out",
            dir.display()
        ))
    })?;
    let mut done = earlier;
    if let Some((path, text)) = &rig {
        write(path, |out| out.write_all(text.as_bytes()))?;
        done.add(path)?;
    }
    for (path, (_, run)) in paths.iter().zip(runs) {
        write(path, |out| csv(run, scale, out))?;
        done.add(path)?;
    }
    done.remove_all_but(&paths)?;
    Ok(paths)
}

/// The files that imports wrote into a folder, by name, with the sums of their contents.
struct Written {
    dir: PathBuf,
    sums: BTreeMap<String, u64>,
}

impl Written {
    const NAME: &str = ".import";

    fn read(dir: &Path) -> Self {
        let text = std::fs::read_to_string(dir.join(Self::NAME)).unwrap_or_default();
        let line = |line: &str| {
            let (sum, name) = line.split_once(' ')?;
            Some((name.to_owned(), u64::from_str_radix(sum, 16).ok()?))
        };
        Self { dir: dir.to_owned(), sums: text.lines().filter_map(line).collect() }
    }

    fn write(&self) -> Result<(), Error> {
        let text: String = self.sums.iter().map(|(name, sum)| format!("{sum:016x} {name}\n")).collect();
        write(&self.dir.join(Self::NAME), |out| out.write_all(text.as_bytes()))
    }

    /// Notes a file that was written now.
    fn add(&mut self, path: &Path) -> Result<(), Error> {
        self.sums.extend(sum(path).map(|sum| (name(path), sum)));
        self.write()
    }

    /// True if the file is as an import wrote it.
    fn is_ours(&self, path: &Path) -> bool {
        self.sums.get(&name(path)).is_some_and(|wrote| sum(path) == Some(*wrote))
    }

    /// Refuses to replace a file that somebody else wrote or changed.
    fn check(&self, path: &Path) -> Result<(), Error> {
        if !path.exists() || self.is_ours(path) {
            return Ok(());
        }
        let keep = if path.ends_with("rig.toml") {
            format!("keep it with --rig {}, remove it, ", quoted(&path.display().to_string()))
        } else {
            "remove it ".into()
        };
        Err(Error::input(format_args!(
            "{}: is there already and not as import wrote it; {keep}or choose another --out",
            path.display()
        )))
    }

    /// Removes recordings that an earlier import wrote and this one did not.
    fn remove_all_but(&mut self, new: &[PathBuf]) -> Result<(), Error> {
        let old: Vec<PathBuf> = self.sums.keys().map(|name| self.dir.join(name)).collect();
        for path in old.iter().filter(|path| !new.contains(path) && !path.ends_with("rig.toml")) {
            if self.is_ours(path) && std::fs::remove_file(path).is_ok() {
                self.sums.remove(&name(path));
            }
        }
        self.write()
    }
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// A sum of a file's content (FNV-1a, which no accident meets); none where it cannot be read.
fn sum(path: &Path) -> Option<u64> {
    let add = |sum: u64, byte: u8| (sum ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    let mut reader = std::io::BufReader::with_capacity(1 << 16, std::fs::File::open(path).ok()?);
    let mut total = 0xcbf2_9ce4_8422_2325;
    loop {
        let bytes = std::io::BufRead::fill_buf(&mut reader).ok()?;
        if bytes.is_empty() {
            return Some(total);
        }
        total = bytes.iter().fold(total, |sum, byte| add(sum, *byte));
        let length = bytes.len();
        std::io::BufRead::consume(&mut reader, length);
    }
}
