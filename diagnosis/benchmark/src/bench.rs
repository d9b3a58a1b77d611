//! One run of the benchmark: build a case, show its files to the tool, ask the baselines, keep the
//! record, forget the rest.

use std::path::Path;
use std::time::Instant;

use crate::baselines;
use crate::dynamics::JudgeDynamics;
use crate::evidence;
use crate::generator::case::build;
use crate::generator::files;
use crate::generator::spec::Spec;
use crate::judge::Record;
use crate::options::Options;
use crate::pool;
use crate::report::Timed;
use crate::report_residuals;
use crate::scratch::Scratch;
use crate::tool::{Tool, ask};

/// Runs every case that the time allows; records in the order of `specs`, and how many cases no
/// machine drawn could show.
pub(crate) fn run_cases(
    options: &Options,
    specs: &[Spec],
    tool: &dyn Tool,
) -> Result<(Vec<Record>, usize), String> {
    let scratch = Scratch::new()?;
    let records = pool::map(options.jobs, options.budget(), "proving", specs, |spec| {
        run_case(spec, options, tool, &scratch.0)
    });
    let begun: Vec<Option<Record>> = records.into_iter().flatten().collect::<Result<_, String>>()?;
    let unbuilt = begun.iter().filter(|r| r.is_none()).count();
    Ok((begun.into_iter().flatten().collect(), unbuilt))
}

fn run_case(
    spec: &Spec,
    options: &Options,
    tool: &dyn Tool,
    scratch: &Path,
) -> Result<Option<Record>, String> {
    let Some(case) = build(spec, options.seed, options.quick) else { return Ok(None) };
    let dir = scratch.join(spec.name());
    let paths = files::write_case(&case, &dir).map_err(|e| format!("cannot write {}: {e}", dir.display()))?;
    let start = Instant::now();
    let out = match &options.keep {
        Some(keep) => keep.join(spec.name()),
        None => dir.join("out"),
    };
    let answer = ask(tool, &paths, &out);
    let seconds = start.elapsed().as_secs_f64();
    let key = files::key(&case);
    evidence::collect(options, [&spec.name(), "generator"], &key.effects, &out)?;
    let bench = JudgeDynamics::new(&paths, &key);
    let left = report_residuals::judged(&bench, &out);
    let reported = report_residuals::reported(&paths, &out, &key);
    let record = Record {
        id: spec.name(),
        opinions: baselines::known_structure(&bench, &key)
            .into_iter()
            .chain(baselines::judge(&case))
            .collect(),
        key,
        answer,
        left,
        reported,
        seconds,
        nominal_gain: case.nominal.gain,
    };
    std::fs::remove_dir_all(&dir).map_err(|e| format!("cannot remove {}: {e}", dir.display()))?;
    Ok(Some(record))
}

/// Hidden physics of the recordings that the time is measured on: a plain one and the two joints,
/// whose laws take the longest.
const TIMED: [&str; 3] = ["cogging", "backlash", "roller_slip"];

/// Seconds that the tool takes for 60 s at 10 kHz (three recordings of 20 s) of each of [`TIMED`],
/// with the machine to itself.
pub(crate) fn measure_speed(seed: u64, tool: &dyn Tool) -> Result<Vec<Timed>, String> {
    let scratch = Scratch::new()?;
    TIMED.iter().map(|hidden| timed(seed, tool, hidden, &scratch.0.join(hidden))).collect()
}

fn timed(seed: u64, tool: &dyn Tool, hidden: &'static str, dir: &Path) -> Result<Timed, String> {
    let spec = Spec {
        id: 0,
        category: crate::key::Category::Single,
        hidden: vec![hidden],
        strength: 10.0,
        repeat: 0,
        poor: None,
        recorder: Some((10_000.0, 20.0)),
    };
    let case = build(&spec, seed, false).ok_or("no machine for the speed measurement; try another --seed")?;
    let paths = files::write_case(&case, dir).map_err(|e| format!("cannot write {}: {e}", dir.display()))?;
    let start = Instant::now();
    ask(tool, &paths, &dir.join("out"))?;
    Ok(Timed { hidden, seconds: start.elapsed().as_secs_f64() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cases::{Amounts, list};
    use crate::key::Category;
    use crate::metrics::sum;
    use crate::report;
    use crate::tool::Paths;

    /// Names cogging whatever it is shown, and checks that it is shown nothing else.
    struct AlwaysCogging;

    impl Tool for AlwaysCogging {
        fn diagnose(&self, paths: &Paths, out: &Path) -> Result<(), String> {
            let dir = paths.rig.parent().unwrap();
            let mut names: Vec<String> = std::fs::read_dir(dir)
                .unwrap()
                .map(|e| e.unwrap().file_name().into_string().unwrap())
                .collect();
            names.sort();
            assert_eq!(names, ["fit-a.csv", "fit-b.csv", "holdout.csv", "out", "rig.toml"]);
            let report = r#"{"verdict":"missing_physics","effects":[{"name":"cogging","class":["cogging"],
                "confidence":0.9,"parameters":{}}],"fit":{"refit":{"holdout":1},"patched":{"holdout":1}},
                "residual_bandwidth_hz":50}"#;
            std::fs::copy(&paths.rig, out.join("patched-rig.toml")).map_err(|e| e.to_string())?;
            std::fs::write(out.join("diagnosis.json"), report).map_err(|e| e.to_string())
        }
    }

    #[test]
    fn a_tool_that_always_says_cogging_is_seen_through() {
        let options = Options { quick: true, seed: 3, ..Options::default() };
        let mut specs = list(Amounts::quick(), 3);
        specs.retain(|s| {
            s.category == Category::Null || s.hidden == ["cogging"] || s.hidden == ["tilt_gravity"]
        });
        specs.truncate(5);
        let (records, unbuilt) = run_cases(&options, &specs, &AlwaysCogging).unwrap();
        let metrics = sum(&records);
        assert_eq!(metrics.null_alarms.hits, metrics.null_alarms.trials);
        let false_names = records.iter().filter(|r| !r.none_false()).count();
        assert!(false_names >= 3, "{false_names}");
        // It improves nothing: its patched rig is the nominal one, which a refit betters.
        assert!(records.iter().any(|r| r.gain().is_some()));
        assert!(records.iter().filter_map(|r| r.gain()).all(|g| g < 0.3));
        let run = report::Run {
            options,
            tool: "a joke".into(),
            source: "own".into(),
            seconds: 1.0,
            speed: None,
            planned: 5,
            unbuilt,
        };
        let text = report::markdown(&records, &metrics, &run);
        assert!(text.contains("| nulls named | ≤ 1 % | 100.0 %"), "{text}");
        // What goes to the tool's author holds no single case.
        assert!(!report::aggregate(&records, &metrics, &run).contains("Every miss"));
    }

    #[test]
    fn the_same_seed_gives_the_same_report() {
        let options = Options { quick: true, seed: 11, ..Options::default() };
        let mut specs = list(Amounts::quick(), 11);
        specs.truncate(2);
        let text = || {
            let (records, unbuilt) = run_cases(&options, &specs, &AlwaysCogging).unwrap();
            let run = report::Run {
                options: options.clone(),
                tool: "t".into(),
                source: "own".into(),
                seconds: 0.0,
                speed: None,
                planned: 2,
                unbuilt,
            };
            report::markdown(&records, &sum(&records), &run)
        };
        assert_eq!(text(), text());
    }
}
