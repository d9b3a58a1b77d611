//! The options of `prove`.

use std::path::PathBuf;

/// The sources of inputs that `--settle` compares, the judged one first.
const INPUTS: [&str; 4] = ["designed", "multisines", "characterise", "passive"];

/// The flags of `prove`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Seed of every draw: the same seed gives the same cases to the last byte.
    pub seed: u64,
    /// Draws of every effect at every strength, with pairs, nulls and the rest in proportion; or
    /// effects to conceal in all.
    pub cases: Option<usize>,
    /// The small fixed run.
    pub quick: bool,
    /// Conceal plants in the virtual device and let `host-sim settle` name them.
    pub settle: bool,
    /// With `settle`: the folder of plants that are settled instead of drawn ones.
    pub plants_from: Option<PathBuf>,
    /// With `settle`: the sources of inputs that are compared, the one that sets the time of motion
    /// first.
    pub inputs: Vec<&'static str>,
    /// Cases that run at the same time.
    pub jobs: usize,
    /// No case begins after this many minutes; the report says how many were left.
    pub minutes: Option<u64>,
    /// Write the files and the keys into this folder and run nothing.
    pub write: Option<PathBuf>,
    /// Only cases whose category or hidden physics contains this text.
    pub only: Option<String>,
    /// A table that gets a row for every hypothesis of every case.
    pub evidence: Option<PathBuf>,
    /// Folders of cases that somebody else made: judge these and draw none.
    pub cases_from: Vec<PathBuf>,
    /// Folders of real machines: conceal effects in their recordings and judge those.
    pub inject: Vec<PathBuf>,
    /// Diagnoses of these machines as they are, which count whatever made them.
    pub untouched: Option<PathBuf>,
    /// Reports stay here, in a folder for every case.
    pub keep: Option<PathBuf>,
    /// Reports that are there already, in a folder for every case: judge these and run no tool.
    pub reports: Option<PathBuf>,
    /// Another tool, by its command line.
    pub tool: Option<String>,
    /// An earlier program, by its command line: compare its answers with those of `tool`, and judge
    /// none.
    pub same_as: Option<String>,
    /// Folder for `proof.json` and `proof.md`.
    pub out: PathBuf,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            cases: None,
            quick: false,
            settle: false,
            plants_from: None,
            inputs: INPUTS.to_vec(),
            jobs: 2,
            minutes: None,
            write: None,
            only: None,
            evidence: None,
            cases_from: Vec::new(),
            inject: Vec::new(),
            untouched: None,
            keep: None,
            reports: None,
            tool: None,
            same_as: None,
            out: PathBuf::from("target"),
        }
    }
}

/// The value of `--only` that measures the time and runs no case.
pub(crate) const SPEED: &str = "speed";

/// The flags that take a value.
const FLAGS: [&str; 17] = [
    "--seed",
    "--cases",
    "--inputs",
    "--plants-from",
    "--jobs",
    "--minutes",
    "--only",
    "--write",
    "--evidence",
    "--cases-from",
    "--inject",
    "--untouched",
    "--keep",
    "--reports",
    "--tool",
    "--same-as",
    "--out",
];

/// The flags, for `--help`.
pub const HELP: &str = "prove: the blinded benchmark of the diagnosis

  --seed N      seed of every draw (1)
  --cases K     draws of every effect at every strength (2); pairs, nulls and the rest in proportion
  --quick       the small fixed run: one draw of every second effect at the strongest, a sample of the rest
  --settle      conceal --cases K plants (20) in the virtual device and let `host-sim settle` name them, beside random multisines,
                the set of characterise and strokes as in practice in the same time of motion; settle.json and settle.md in the folder of --out.
                --keep DIR leaves the recordings. A run of the same seed, inputs and programs that was stopped goes on; with --only,
                plants are settled anew and their report takes its place
  --plants-from DIR  with --settle: the plants of a folder with key.json (tests/independent/settle_plants.py writes one), not drawn ones
  --inputs A,B  with --settle: only these of designed, multisines, characterise and passive; the first sets the time of motion
  --jobs N      cases that run at the same time (2)
  --minutes N   no case begins after N minutes; the report says how many were left
  --only TEXT   only cases whose kind or hidden physics contains TEXT; `speed` for the time of a minute at 10 kHz; with --settle
                also the folder of one plant, such as plant-5
  --cases-from DIR  judge the cases of a folder with its key.json or believed.tsv and draw none; again for more folders.
                    docs/design/benchmark.md tells the format
  --inject DIR  conceal known effects in the recordings of real machines of a folder (a folder a machine, with rig.toml,
                fit*.csv and holdout*.csv; of other names the last judges) and judge these; again for more folders.
                --cases K: K effects in all (44)
  --untouched DIR  with --inject: the diagnoses of the machines as they are, in a folder for every machine, whatever version
                made them, so that two versions meet the same cases. Without it they are made anew for each version and
                kept in inject-untouched of the folder of --out
  --keep DIR    leave the reports in DIR, in a folder for every case
  --reports DIR judge the reports that --keep, or another program, left in DIR, and run no tool; with --cases-from
  --tool 'PROGRAM --rig {rig} --fit {fit} --holdout {holdout} --out {out}'  judge another program; a file that there are
                several of is repeated with the flag before it
  --same-as 'PROGRAM …'  with --tool: diagnose --cases N drawn recordings (100) with both programs, compare diagnosis.json and
                patched-rig.toml to the digit, print the keys that differ, and fail if there is one
  --write DIR   write the recordings to DIR/cases and the key to DIR/key.json, and run nothing
  --evidence FILE  add a row for every hypothesis of every case to a CSV table: what the filter and the regression say of it, in
                the same numbers on every machine, and whether it is right
  --out DIR     folder for proof.json and proof.md, of a folder of cases proof-NAME.json and proof-NAME.md (target); those of
                --settle and --inject are written anew after every case
";

impl Options {
    /// Draws of every effect at every strength.
    pub(crate) fn draws(&self) -> usize {
        self.cases.unwrap_or(2)
    }

    /// The time in which cases may begin.
    pub(crate) fn budget(&self) -> Option<std::time::Duration> {
        self.minutes.map(|m| std::time::Duration::from_secs(60 * m))
    }

    /// Reads the flags after the program's name. `Ok(None)` where help was asked for.
    ///
    /// # Errors
    /// One sentence that says which flag is wrong and what it takes.
    pub fn parse(arguments: impl IntoIterator<Item = String>) -> Result<Option<Self>, String> {
        let mut options = Self::default();
        let mut list = arguments.into_iter();
        while let Some(flag) = list.next() {
            if flag == "--help" || flag == "-h" {
                return Ok(None);
            }
            if flag == "--quick" {
                options.quick = true;
                continue;
            }
            if flag == "--settle" {
                options.settle = true;
                continue;
            }
            if !FLAGS.contains(&flag.as_str()) {
                return Err(format!("`{flag}` is not a flag of prove; `prove --help` lists them"));
            }
            let value = list.next().ok_or_else(|| format!("{flag} needs a value after it"))?;
            let whole =
                |what: &str| value.parse::<u64>().map_err(|_| format!("{flag} takes {what}, not `{value}`"));
            match flag.as_str() {
                "--seed" => options.seed = whole("a whole number from 0")?,
                "--cases" => {
                    options.cases = Some(whole("a whole number from 1")?.clamp(1, 10_000) as usize);
                }
                "--plants-from" => options.plants_from = Some(PathBuf::from(value)),
                "--inputs" => options.inputs = inputs(&value)?,
                "--jobs" => options.jobs = whole("a whole number from 1")?.clamp(1, 256) as usize,
                "--minutes" => options.minutes = Some(whole("a whole number of minutes")?),
                "--only" => options.only = Some(value),
                "--evidence" => options.evidence = Some(PathBuf::from(value)),
                "--write" => options.write = Some(PathBuf::from(value)),
                "--cases-from" => options.cases_from.push(PathBuf::from(value)),
                "--inject" => options.inject.push(PathBuf::from(value)),
                "--untouched" => options.untouched = Some(PathBuf::from(value)),
                "--keep" => options.keep = Some(PathBuf::from(value)),
                "--reports" => options.reports = Some(PathBuf::from(value)),
                "--tool" => options.tool = Some(value),
                "--same-as" => options.same_as = Some(value),
                _ => options.out = PathBuf::from(value),
            }
        }
        options.check()?;
        Ok(Some(options))
    }

    /// Flags that do not go together.
    fn check(&self) -> Result<(), String> {
        if self.reports.is_some() && self.cases_from.len() != 1 {
            return Err("--reports goes with one --cases-from: the reports are of its cases".into());
        }
        if self.reports.is_some() && (self.tool.is_some() || self.keep.is_some()) {
            return Err("--reports runs no tool, so it goes neither with --tool nor with --keep".into());
        }
        if self.plants_from.is_some() && !self.settle {
            return Err("--plants-from goes with --settle: the plants are for its virtual device".into());
        }
        if self.untouched.is_some() && self.inject.is_empty() {
            return Err("--untouched goes with --inject: the diagnoses are of its machines".into());
        }
        let others = !self.cases_from.is_empty() || self.write.is_some() || self.reports.is_some();
        if !self.inject.is_empty() && others {
            return Err(
                "--inject draws cases of its own, so it does not go with --cases-from, --write or --reports"
                    .into(),
            );
        }
        if self.same_as.is_some() && self.tool.is_none() {
            return Err("--same-as goes with --tool: it compares two programs".into());
        }
        let others = others || self.quick || !self.inject.is_empty() || self.settle;
        if self.same_as.is_some() && others {
            return Err(
                "--same-as draws recordings of its own; give it --tool, --cases, --seed, --only and --jobs"
                    .into(),
            );
        }
        if self.write.is_some() && !self.cases_from.is_empty() {
            return Err("--write draws cases, so it does not go with --cases-from".into());
        }
        Ok(())
    }
}

/// The sources of inputs in a list with commas.
fn inputs(list: &str) -> Result<Vec<&'static str>, String> {
    let one = |name: &str| {
        let found = INPUTS.into_iter().find(|known| *known == name);
        found.ok_or_else(|| format!("--inputs takes some of {}, not `{name}`", INPUTS.join(", ")))
    };
    list.split(',').map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(line: &str) -> Result<Option<Options>, String> {
        Options::parse(line.split_whitespace().map(String::from))
    }

    #[test]
    fn flags_are_read_and_wrong_ones_named() {
        let o = parse("--seed 7 --cases 3 --quick --jobs 1").unwrap().unwrap();
        assert_eq!((o.seed, o.cases, o.quick, o.jobs), (7, Some(3), true, 1));
        assert_eq!(o.inputs, INPUTS, "all where nobody says which");
        let o = parse("--settle --inputs multisines,designed").unwrap().unwrap();
        assert_eq!(o.inputs, ["multisines", "designed"]);
        assert!(parse("--settle --inputs sines").unwrap_err().contains("`sines`"));
        assert_eq!(parse("--help"), Ok(None));
        assert!(parse("--sed 7").unwrap_err().contains("--sed"));
        assert!(parse("--seed x").unwrap_err().contains("`x`"));
        let two = parse("--cases-from a --cases-from b").unwrap().unwrap();
        assert_eq!(two.cases_from.len(), 2);
        assert!(parse("--cases-from a --cases-from b --reports r").unwrap_err().contains("one --cases-from"));
        assert!(parse("--reports r").unwrap_err().contains("one --cases-from"));
        assert!(parse("--write w --cases-from a").unwrap_err().contains("--write"));
        assert!(parse("--untouched a").unwrap_err().contains("--inject"));
        assert!(parse("--same-as a").unwrap_err().contains("--tool"));
        assert!(parse("--same-as a --tool b --quick").unwrap_err().contains("of its own"));
        assert_eq!(parse("--same-as a --tool b").unwrap().unwrap().same_as, Some("a".into()));
        assert!(parse("--inject a --write b").unwrap_err().contains("--write"));
        assert!(parse("--seed").unwrap_err().contains("needs a value"));
    }
}
