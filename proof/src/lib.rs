//! The blinded benchmark of the diagnosis.
//!
//! A generator with a plant of its own writes recordings; the tool sees these and the rig file and nothing else; a judge
//! opens the key. Of the tool this crate may use the one entry point and the files it writes, never its models.

mod bench;
mod calibrate;
mod cases;
mod generator;
mod judge;
mod options;
mod pool;
mod report;
mod rivals;
mod rng;
mod signal;
mod stats;
mod tool;

use std::path::Path;

pub use options::{HELP, Options};

use cases::Amounts;
use generator::case::{Spec, build};
use generator::files;

/// Does what the options ask for.
///
/// # Errors
/// One sentence: what could not be read, written or run, and where.
pub fn run(options: &Options) -> Result<(), String> {
    if !options.calibrate.is_empty() {
        print!("{}", calibrate::calibrate(&options.calibrate)?);
        return Ok(());
    }
    let specs = wanted(options);
    if let Some(dir) = &options.write {
        return write_all(options, &specs, dir);
    }
    prove(options, &specs, &tool::Diagnosis)
}

fn prove(options: &Options, specs: &[Spec], tool: &dyn tool::Tool) -> Result<(), String> {
    let start = std::time::Instant::now();
    let (records, unbuilt) = bench::run_cases(options, specs, tool)?;
    let speed = if options.quick || options.only.as_deref().is_some_and(|only| only != options::SPEED) {
        None
    } else {
        bench::measure_speed(options.seed, tool).ok()
    };
    let run = report::Run {
        options: options.clone(),
        tool: "host-sim diagnose".into(),
        seconds: start.elapsed().as_secs_f64(),
        speed,
        planned: specs.len(),
        unbuilt,
    };
    let sums = judge::sum(&records);
    print!("{}", report::terminal(&records, &sums, &run));
    std::fs::create_dir_all(&options.out)
        .map_err(|e| format!("cannot create {}: {e}", options.out.display()))?;
    let write = |name: &str, text: String| {
        let path = options.out.join(name);
        std::fs::write(&path, text).map_err(|e| format!("cannot write {}: {e}", path.display()))
    };
    let value = report::json(&records, &sums, &run);
    write("proof.json", serde_json::to_string_pretty(&value).map_err(|e| e.to_string())? + "\n")?;
    write("proof.md", report::markdown(&records, &sums, &run))?;
    write("proof-aggregate.md", report::aggregate(&records, &sums, &run))?;
    if options.quick && options.only.is_none() { gate(&sums) } else { Ok(()) }
}

/// What the small run holds the tool to, so that it can fail in CI: far below what is wanted, above what luck gives.
fn gate(sums: &judge::Sums) -> Result<(), String> {
    let right = sums.right[0];
    if sums.failures > 0 {
        return Err(format!(
            "the tool gave no report in {} cases; the table above lists them",
            sums.failures
        ));
    }
    if sums.null_alarms.hits > 0 {
        return Err(format!(
            "the tool named physics in {} nulls; the misses above list them",
            sums.null_alarms.hits
        ));
    }
    if right.hits * 10 < right.trials * 7 {
        return Err(format!(
            "the tool found {} of {} strong effects, fewer than seven in ten; the misses above list them",
            right.hits, right.trials
        ));
    }
    Ok(())
}

fn wanted(options: &Options) -> Vec<Spec> {
    let amounts = if options.quick { Amounts::quick() } else { Amounts::full(options.cases) };
    let mut specs = cases::list(amounts, options.seed);
    if let Some(text) = &options.only {
        specs.retain(|s| {
            s.category.word().contains(text) || s.hidden.iter().any(|h| h.contains(text.as_str()))
        });
    }
    specs
}

fn write_all(options: &Options, specs: &[Spec], dir: &Path) -> Result<(), String> {
    let keys = dir.join("keys");
    let failed = |what: &Path, e: std::io::Error| {
        format!("cannot write {}: {e}; choose another --write folder", what.display())
    };
    std::fs::create_dir_all(&keys).map_err(|e| failed(&keys, e))?;
    let written = pool::map(options.jobs, None, "writing cases", specs, |spec| {
        let Some(case) = build(spec, options.seed, options.quick) else { return Ok(0) };
        let name = format!("case-{:04}", spec.id);
        let folder = dir.join("cases").join(&name);
        files::write_case(&case, &folder).map_err(|e| failed(&folder, e))?;
        let key = keys.join(format!("{name}.json"));
        let text = serde_json::to_string_pretty(&files::key(&case)).map_err(|e| e.to_string())?;
        std::fs::write(&key, text + "\n").map_err(|e| failed(&key, e)).map(|()| 1)
    });
    let written: usize = written.into_iter().flatten().sum::<Result<usize, String>>()?;
    println!("{} cases in {}, their keys in {}", written, dir.join("cases").display(), keys.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use judge::Sums;
    use stats::Rate;

    #[test]
    fn the_small_run_can_fail() {
        let good = Sums { right: [Rate { hits: 20, trials: 25 }; 3], ..Sums::default() };
        assert_eq!(gate(&good), Ok(()));
        let poor = Sums { right: [Rate { hits: 17, trials: 25 }; 3], ..Sums::default() };
        assert!(gate(&poor).unwrap_err().contains("17 of 25"));
        let alarm = Sums { null_alarms: Rate { hits: 1, trials: 4 }, ..good.clone() };
        assert!(gate(&alarm).unwrap_err().contains("1 nulls"));
        let silent = Sums { failures: 2, ..good };
        assert!(gate(&silent).unwrap_err().contains("no report in 2"));
    }
}
