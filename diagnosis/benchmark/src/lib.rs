//! The blinded benchmark of the diagnosis.
//!
//! A generator with a plant of its own writes recordings; the tool sees these and the rig file and
//! nothing else; a judge opens the key. Of the tool this crate may use the one entry point and the
//! files it writes, never its models.

mod answers;
mod baselines;
mod bench;
mod cases;
mod dynamics;
mod evidence;
mod expected_answer;
mod external_cases;
mod folder;
mod generator;
mod inject;
mod judge;
mod key;
mod machines;
mod metrics;
mod options;
mod pool;
mod report;
mod report_json;
mod report_machines;
mod report_residuals;
mod rng;
mod scratch;
mod settle;
mod share;
mod signal;
mod stats;
mod tool;

use std::path::Path;
use std::time::{Duration, Instant};

pub use options::{HELP, Options};

use cases::Amounts;
use generator::case::build;
use generator::files;
use generator::spec::Spec;
use tool::Tool;

/// The longest that another program may take over a case.
const PATIENCE: Duration = Duration::from_secs(600);

/// Does what the options ask for.
///
/// # Errors
/// One sentence: what could not be read, written or run, and where.
pub fn run(options: &Options) -> Result<(), String> {
    if options.settle {
        return settle::run(options);
    }
    let tool: Box<dyn Tool> = match &options.tool {
        Some(line) => Box::new(tool::Program { line: line.clone(), patience: PATIENCE }),
        None if options.reports.is_some() => Box::new(tool::Finished),
        None => Box::new(tool::Diagnosis),
    };
    if !options.inject.is_empty() {
        return inject::run(options, &*tool);
    }
    if !options.cases_from.is_empty() {
        return options.cases_from.iter().try_for_each(|top| judge_folder(options, top, &*tool));
    }
    let specs = wanted(options);
    if let Some(before) = &options.same_as {
        let before = tool::Program { line: before.clone(), patience: PATIENCE };
        return answers::run(options, &specs, options.cases.unwrap_or(answers::CASES), [&before, &*tool]);
    }
    if let Some(dir) = &options.write {
        return write_all(options, &specs, dir);
    }
    prove(options, &specs, &*tool)
}

/// Returns the tool's name in the reports.
fn tool_name(options: &Options) -> String {
    match (&options.tool, &options.reports) {
        (Some(line), _) => line.clone(),
        (None, Some(reports)) => format!("the reports in {}", reports.display()),
        (None, None) => "host-sim diagnose".into(),
    }
}

fn judge_folder(options: &Options, top: &Path, tool: &dyn Tool) -> Result<(), String> {
    let start = Instant::now();
    let judged = external_cases::run(options, top, tool)?;
    let run = report::Run {
        options: options.clone(),
        tool: tool_name(options),
        source: top.display().to_string(),
        seconds: start.elapsed().as_secs_f64(),
        speed: None,
        planned: judged.planned,
        unbuilt: 0,
    };
    let name = top.canonicalize().ok().and_then(|p| Some(p.file_name()?.to_string_lossy().into_owned()));
    let name = format!("proof-{}", name.unwrap_or_else(|| "cases".into()));
    let (text, markdown, value) = if judged.machines.is_empty() {
        let metrics = metrics::sum(&judged.records);
        (
            report::terminal(&judged.records, &metrics, &run),
            report::markdown(&judged.records, &metrics, &run),
            report_json::as_json(&judged.records, &metrics, &run),
        )
    } else {
        let metrics = machines::sum(&judged.machines);
        (
            report_machines::terminal(&judged.machines, &metrics, &run),
            report_machines::markdown(&judged.machines, &metrics, &run),
            report_machines::as_json(&judged.machines, &metrics, &run),
        )
    };
    print!("{text}");
    write_out(options, &format!("{name}.json"), &pretty(&value)?)?;
    write_out(options, &format!("{name}.md"), &markdown)
}

fn pretty(value: &serde_json::Value) -> Result<String, String> {
    Ok(serde_json::to_string_pretty(value).map_err(|e| e.to_string())? + "\n")
}

fn write_out(options: &Options, name: &str, text: &str) -> Result<(), String> {
    std::fs::create_dir_all(&options.out)
        .map_err(|e| format!("cannot create {}: {e}", options.out.display()))?;
    let path = options.out.join(name);
    std::fs::write(&path, text).map_err(|e| format!("cannot write {}: {e}", path.display()))
}

fn prove(options: &Options, specs: &[Spec], tool: &dyn Tool) -> Result<(), String> {
    let start = Instant::now();
    let (records, unbuilt) = bench::run_cases(options, specs, tool)?;
    let speed = if options.quick || options.only.as_deref().is_some_and(|only| only != options::SPEED) {
        None
    } else {
        bench::measure_speed(options.seed, tool).ok()
    };
    let size = if options.quick { "quick run".into() } else { format!("{} draws a cell", options.draws()) };
    let run = report::Run {
        options: options.clone(),
        tool: tool_name(options),
        source: format!("the project's own generator, seed {}, {size}", options.seed),
        seconds: start.elapsed().as_secs_f64(),
        speed,
        planned: specs.len(),
        unbuilt,
    };
    let metrics = metrics::sum(&records);
    print!("{}", report::terminal(&records, &metrics, &run));
    write_out(options, "proof.json", &pretty(&report_json::as_json(&records, &metrics, &run))?)?;
    write_out(options, "proof.md", &report::markdown(&records, &metrics, &run))?;
    write_out(options, "proof-aggregate.md", &report::aggregate(&records, &metrics, &run))?;
    if options.quick && options.only.is_none() { gate(&metrics) } else { Ok(()) }
}

/// The requirements of the small run, so that it can fail in CI: far below the goals, above chance.
fn gate(metrics: &metrics::Metrics) -> Result<(), String> {
    let right = metrics.strong;
    if metrics.failures > 0 {
        return Err(format!(
            "the tool gave no report in {} cases; the table above lists them",
            metrics.failures
        ));
    }
    // Wanted is one in a hundred: two of four is no luck.
    if metrics.null_alarms.hits > 1 {
        return Err(format!(
            "the tool named physics in {} of {} nulls; the misses above list them",
            metrics.null_alarms.hits, metrics.null_alarms.trials
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
    let amounts = match options.same_as {
        // With `--cases`, the number of recordings.
        Some(_) => Amounts::full(options.cases.unwrap_or(answers::CASES).div_ceil(answers::CASES)),
        None if options.quick => Amounts::quick(),
        None => Amounts::full(options.draws()),
    };
    let mut specs = cases::list(amounts, options.seed);
    if let Some(text) = &options.only {
        specs.retain(|s| s.category.matches(text) || s.hidden.iter().any(|h| h.contains(text.as_str())));
    }
    specs
}

fn write_all(options: &Options, specs: &[Spec], dir: &Path) -> Result<(), String> {
    let failed = |what: &Path, e: std::io::Error| {
        format!("cannot write {}: {e}; choose another --write folder", what.display())
    };
    let cases = dir.join("cases");
    std::fs::create_dir_all(&cases).map_err(|e| failed(&cases, e))?;
    let written = pool::map(options.jobs, None, "writing cases", specs, |spec| {
        let Some(case) = build(spec, options.seed, options.quick) else { return Ok(None) };
        let folder = cases.join(spec.name());
        files::write_case(&case, &folder).map_err(|e| failed(&folder, e))?;
        Ok(Some((spec.name(), files::key(&case).to_json())))
    });
    let written: Vec<_> = written.into_iter().flatten().collect::<Result<_, String>>()?;
    let keys: serde_json::Map<String, serde_json::Value> = written.into_iter().flatten().collect();
    let count = keys.len();
    let key = dir.join("key.json");
    std::fs::write(&key, pretty(&serde_json::json!({ "format": 1, "seed": options.seed, "cases": keys }))?)
        .map_err(|e| failed(&key, e))?;
    println!("{count} cases in {}, their key in {}", cases.display(), key.display());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrics::Metrics;
    use stats::Rate;

    #[test]
    fn the_small_run_can_fail() {
        let good = Metrics { strong: Rate { hits: 20, trials: 25 }, ..Metrics::default() };
        assert_eq!(gate(&good), Ok(()));
        let poor = Metrics { strong: Rate { hits: 17, trials: 25 }, ..Metrics::default() };
        assert!(gate(&poor).unwrap_err().contains("17 of 25"));
        let alarm = Metrics { null_alarms: Rate { hits: 2, trials: 4 }, ..good.clone() };
        assert!(gate(&alarm).unwrap_err().contains("2 of 4 nulls"));
        let silent = Metrics { failures: 2, ..good };
        assert!(gate(&silent).unwrap_err().contains("no report in 2"));
    }
}
