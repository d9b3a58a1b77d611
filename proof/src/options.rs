//! What `prove` is asked to do.

use std::path::PathBuf;

/// The flags of `prove`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Seed of every draw: the same seed gives the same cases to the last byte.
    pub seed: u64,
    /// Draws of every effect at every strength; pairs, nulls and the rest in proportion.
    pub cases: usize,
    /// The small fixed run.
    pub quick: bool,
    /// Cases that run at the same time.
    pub jobs: usize,
    /// No case begins after this many minutes; the report says how many were left.
    pub minutes: Option<u64>,
    /// Write the files and the keys into this folder and run nothing.
    pub write: Option<PathBuf>,
    /// Only cases whose category or hidden physics contains this text.
    pub only: Option<String>,
    /// Results of earlier runs: find the weights of the tool's confidence from them, and run nothing.
    pub calibrate: Vec<PathBuf>,
    /// Folder for `proof.json` and `proof.md`.
    pub out: PathBuf,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            seed: 1,
            cases: 2,
            quick: false,
            jobs: 2,
            minutes: None,
            write: None,
            only: None,
            calibrate: Vec::new(),
            out: PathBuf::from("target"),
        }
    }
}

/// What `--only` takes for the measurement of the time and no case.
pub(crate) const SPEED: &str = "speed";

/// The flags, for `--help`.
pub const HELP: &str = "prove: the blinded benchmark of the diagnosis

  --seed N      seed of every draw (1)
  --cases K     draws of every effect at every strength (2); pairs, nulls and the rest in proportion
  --quick       the small fixed run: one draw of every effect at the strongest, a sample of the rest
  --jobs N      cases that run at the same time (2)
  --minutes N   no case begins after N minutes; the report says how many were left
  --only TEXT   only cases whose category or hidden physics contains TEXT; `speed` for the time of a minute at 10 kHz
  --write DIR   write the recordings to DIR/cases and the keys to DIR/keys, and run nothing
  --calibrate A,B  print the weights of the tool's confidence from proof.json of earlier runs, and run nothing
  --out DIR     folder for proof.json and proof.md (target)
";

impl Options {
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
            let known =
                ["--seed", "--cases", "--jobs", "--minutes", "--only", "--write", "--calibrate", "--out"];
            if !known.contains(&flag.as_str()) {
                return Err(format!("`{flag}` is not a flag of prove; `prove --help` lists them"));
            }
            let value = list.next().ok_or_else(|| format!("{flag} needs a value after it"))?;
            let whole =
                |what: &str| value.parse::<u64>().map_err(|_| format!("{flag} takes {what}, not `{value}`"));
            match flag.as_str() {
                "--seed" => options.seed = whole("a whole number from 0")?,
                "--cases" => options.cases = whole("a whole number from 1")?.clamp(1, 1000) as usize,
                "--jobs" => options.jobs = whole("a whole number from 1")?.clamp(1, 256) as usize,
                "--minutes" => options.minutes = Some(whole("a whole number of minutes")?),
                "--only" => options.only = Some(value),
                "--calibrate" => options.calibrate = value.split(',').map(PathBuf::from).collect(),
                "--write" => options.write = Some(PathBuf::from(value)),
                _ => options.out = PathBuf::from(value),
            }
        }
        Ok(Some(options))
    }
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
        assert_eq!((o.seed, o.cases, o.quick, o.jobs), (7, 3, true, 1));
        assert_eq!(parse("--help"), Ok(None));
        assert!(parse("--sed 7").unwrap_err().contains("--sed"));
        assert!(parse("--seed x").unwrap_err().contains("`x`"));
        assert!(parse("--seed").unwrap_err().contains("needs a value"));
    }
}
