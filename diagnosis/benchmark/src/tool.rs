//! The tool under test as the judge sees it: files in, the contract's report out.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::evidence;

/// The paths of a case's files.
#[derive(Clone, Debug)]
pub(crate) struct Paths {
    pub(crate) rig: PathBuf,
    pub(crate) fit: Vec<PathBuf>,
    pub(crate) holdout: Vec<PathBuf>,
}

impl Paths {
    /// The same files in the folder `to`, which is created, where no key is next to them.
    pub(crate) fn copied(&self, to: &Path) -> Result<Self, String> {
        std::fs::create_dir_all(to).map_err(|e| format!("cannot create {}: {e}", to.display()))?;
        let copy = |from: &PathBuf| {
            let target = to.join(from.file_name().unwrap_or_default());
            std::fs::copy(from, &target).map_err(|e| format!("cannot copy {}: {e}", from.display()))?;
            Ok::<_, String>(target)
        };
        let all = |list: &[PathBuf]| list.iter().map(copy).collect::<Result<Vec<_>, _>>();
        Ok(Self { rig: copy(&self.rig)?, fit: all(&self.fit)?, holdout: all(&self.holdout)? })
    }
}

/// Whatever turns a rig and recordings into the files of the contract.
pub(crate) trait Tool: Sync {
    /// Diagnoses and writes `diagnosis.json` and `patched-rig.toml` into `out`; the error is the
    /// tool's own sentence.
    fn diagnose(&self, paths: &Paths, out: &Path) -> Result<(), String>;
}

/// The project's own diagnosis.
pub(crate) struct Diagnosis;

impl Tool for Diagnosis {
    fn diagnose(&self, paths: &Paths, out: &Path) -> Result<(), String> {
        let request = diagnosis::Request {
            rig: paths.rig.clone(),
            fit: paths.fit.clone(),
            effects: None,
            holdout: paths.holdout.clone(),
        };
        let outcome = diagnosis::diagnose(&request, &|_, _| {}).map_err(|e| e.to_string())?;
        outcome.write(out).map_err(|e| e.to_string())?;
        std::fs::write(out.join(evidence::FILE), outcome.hypotheses_csv()).map_err(|e| e.to_string())
    }
}

/// Another program, by a command line with `{rig}`, `{fit}`, `{holdout}` and `{out}` in it. The
/// word that holds `{fit}` or `{holdout}` is repeated for every such file, with the flag before it.
pub(crate) struct Program {
    pub(crate) line: String,
    /// It is stopped after this.
    pub(crate) patience: Duration,
}

impl Program {
    fn words(&self, paths: &Paths, out: &Path) -> Vec<String> {
        let mut words: Vec<String> = Vec::new();
        for word in self.line.split_whitespace() {
            let many = match word {
                "{fit}" => &paths.fit,
                "{holdout}" => &paths.holdout,
                _ => {
                    let word = word.replace("{rig}", &paths.rig.to_string_lossy());
                    words.push(word.replace("{out}", &out.to_string_lossy()));
                    continue;
                }
            };
            let flag = words.pop();
            for path in many {
                words.extend(flag.clone());
                words.push(path.to_string_lossy().into_owned());
            }
        }
        words
    }
}

impl Tool for Program {
    fn diagnose(&self, paths: &Paths, out: &Path) -> Result<(), String> {
        let words = self.words(paths, out);
        let (program, arguments) = words.split_first().ok_or("--tool needs a command line")?;
        let log = std::fs::File::create(out.join("log.txt")).map_err(|e| format!("no log: {e}"))?;
        let mut child = Command::new(program)
            .args(arguments)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(log)
            .spawn()
            .map_err(|e| format!("`{program}` cannot be started: {e}"))?;
        let start = Instant::now();
        loop {
            match child.try_wait().map_err(|e| format!("`{program}` was lost: {e}"))? {
                Some(status) if status.success() => return Ok(()),
                Some(status) => {
                    let said = std::fs::read_to_string(out.join("log.txt")).unwrap_or_default();
                    return Err(format!("{} ({status})", said.trim()));
                }
                None if start.elapsed() > self.patience => {
                    // It may have ended in this very moment.
                    let _ = child.kill();
                    let _ = child.wait();
                    return Err(format!("no answer within {} s", self.patience.as_secs()));
                }
                None => std::thread::sleep(Duration::from_millis(20)),
            }
        }
    }
}

/// Reports that are there already, in folders named as the cases' own.
pub(crate) struct Finished;

impl Tool for Finished {
    fn diagnose(&self, _: &Paths, _: &Path) -> Result<(), String> {
        Ok(())
    }
}

/// A class of more names than this is no answer.
const WIDEST_CLASS: usize = 3;

/// An effect that the report names.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Named {
    pub(crate) name: String,
    pub(crate) class: Vec<String>,
    pub(crate) confidence: f64,
    /// (name, value, 95 % interval).
    pub(crate) parameters: Vec<(String, f64, Option<[f64; 2]>)>,
}

impl Named {
    /// The class as it is judged: of too many names, none counts but the effect's own.
    pub(crate) fn judged_class(&self) -> &[String] {
        if self.class.len() <= WIDEST_CLASS { &self.class } else { &[] }
    }

    /// True if the name or the class holds `effect`.
    pub(crate) fn holds(&self, effect: &str) -> bool {
        self.name == effect || self.judged_class().iter().any(|c| c == effect)
    }
}

/// The parts of `diagnosis.json` and `patched-rig.toml` that the judge reads.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Answer {
    pub(crate) verdict: String,
    /// There was no fit: the recordings were turned away before.
    pub(crate) refused: bool,
    pub(crate) effects: Vec<Named>,
    /// Held-out force rmse under the refit and under the patched model.
    pub(crate) refit_holdout: f64,
    pub(crate) patched_holdout: f64,
    pub(crate) bandwidth_hz: f64,
    /// Gain of the patched rig, where it says one.
    pub(crate) gain: Option<f64>,
}

/// Runs the tool and reads what it wrote.
pub(crate) fn ask(tool: &dyn Tool, paths: &Paths, out: &Path) -> Result<Answer, String> {
    std::fs::create_dir_all(out).map_err(|e| format!("cannot create {}: {e}", out.display()))?;
    // A panic of the tool is a failure of this case, not of the benchmark.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| tool.diagnose(paths, out)))
        .unwrap_or_else(|_| Err("the tool panicked".into()))?;
    let file = out.join("diagnosis.json");
    let text = std::fs::read_to_string(&file).map_err(|e| format!("no report at {}: {e}", file.display()))?;
    let value: Value = serde_json::from_str(&text).map_err(|e| format!("{}: {e}", file.display()))?;
    let mut answer = read(&value)?;
    if let Ok(rig) = std::fs::read_to_string(out.join("patched-rig.toml")) {
        answer.gain = actuator_gain(&rig);
    }
    Ok(answer)
}

/// Reads the report to the letter of the contract; what it must have and has not is an error.
pub(crate) fn read(report: &Value) -> Result<Answer, String> {
    let missing = |what: &str| format!("diagnosis.json has no usable `{what}`");
    let verdict = report["verdict"].as_str().ok_or_else(|| missing("verdict"))?.to_string();
    let list = report["effects"].as_array().ok_or_else(|| missing("effects"))?;
    let mut effects = Vec::new();
    for effect in list {
        let name = effect["name"].as_str().ok_or_else(|| missing("effects[].name"))?.to_string();
        let class = strings(&effect["class"]).ok_or_else(|| missing("effects[].class"))?;
        let confidence = effect["confidence"].as_f64().ok_or_else(|| missing("effects[].confidence"))?;
        let mut parameters = Vec::new();
        for (key, p) in effect["parameters"].as_object().into_iter().flatten() {
            let Some(value) = p["value"].as_f64() else { continue };
            let interval = match (p["ci95"][0].as_f64(), p["ci95"][1].as_f64()) {
                (Some(low), Some(high)) => Some([low, high]),
                _ => None,
            };
            parameters.push((key.clone(), value, interval));
        }
        effects.push(Named { name, class, confidence, parameters });
    }
    let number = |v: &Value| v.as_f64().unwrap_or(f64::NAN);
    let refit_holdout = number(&report["fit"]["refit"]["holdout"]);
    Ok(Answer {
        // The contract says null; a force error of exactly nothing is no fit either.
        refused: verdict == "insufficient_excitation" && (refit_holdout.is_nan() || refit_holdout == 0.0),
        verdict,
        effects,
        refit_holdout,
        patched_holdout: number(&report["fit"]["patched"]["holdout"]),
        bandwidth_hz: number(&report["residual_bandwidth_hz"]),
        gain: None,
    })
}

fn strings(list: &Value) -> Option<Vec<String>> {
    Some(list.as_array()?.iter().filter_map(|v| v.as_str().map(String::from)).collect())
}

/// `gain` of `[actuator]`, read line by line: all that the judge needs of a rig file.
pub(crate) fn actuator_gain(rig: &str) -> Option<f64> {
    let mut inside = false;
    for line in rig.lines().map(str::trim) {
        if line.starts_with('[') {
            inside = line == "[actuator]";
        } else if inside
            && let Some((key, value)) = line.split_once('=')
            && key.trim() == "gain"
        {
            return value.split('#').next()?.trim().parse().ok();
        }
    }
    None
}

/// A mark of a program's file: the same bytes have the same.
pub(crate) fn mark(program: &Path) -> String {
    let bytes = std::fs::read(program).unwrap_or_default();
    let sum = bytes.iter().fold(7_u64, |h, b| h.wrapping_mul(31).wrapping_add(u64::from(*b)));
    format!("{sum:016x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contracts_example_is_read() {
        let text = r#"{"format":1,"verdict":"missing_physics","effects":[{"name":"stribeck_friction",
            "class":["stribeck_friction","quadratic_drag"],"confidence":0.98,
            "parameters":{"peak":{"value":3.1e-4,"ci95":[2.8e-4,3.4e-4],"unit":"N·m"}}}],
            "fit":{"refit":{"fit":1.0,"holdout":2.0},"patched":{"fit":1.0,"holdout":0.5}},
            "residual_bandwidth_hz":100.0}"#;
        let answer = read(&serde_json::from_str(text).unwrap()).unwrap();
        assert_eq!(answer.effects[0].class.len(), 2);
        assert_eq!(answer.effects[0].parameters[0].2, Some([2.8e-4, 3.4e-4]));
        assert_eq!((answer.refit_holdout, answer.patched_holdout, answer.bandwidth_hz), (2.0, 0.5, 100.0));
        assert!(read(&serde_json::json!({"verdict": "x"})).unwrap_err().contains("effects"));
    }

    #[test]
    fn a_panic_of_the_tool_is_its_failure() {
        struct Broken;
        impl Tool for Broken {
            fn diagnose(&self, _: &Paths, _: &Path) -> Result<(), String> {
                panic!("on purpose")
            }
        }
        let paths = Paths { rig: "r".into(), fit: vec![], holdout: vec![] };
        assert_eq!(ask(&Broken, &paths, &std::env::temp_dir()), Err("the tool panicked".into()));
    }

    #[test]
    fn a_program_is_shown_every_file_and_its_failure_reported() {
        let paths = Paths { rig: "r".into(), fit: vec!["a".into(), "b".into()], holdout: vec!["h".into()] };
        let program = |line: &str| Program { line: line.into(), patience: Duration::from_secs(5) };
        let words = program("t --fit {fit} --holdout {holdout} --rig {rig}").words(&paths, Path::new("o"));
        assert_eq!(words.join(" "), "t --fit a --fit b --holdout h --rig r");
        let out = std::env::temp_dir().join(format!("proof-program-{}", std::process::id()));
        assert!(ask(&program("false"), &paths, &out).unwrap_err().contains("exit status"));
        assert!(ask(&program("no-such-tool"), &paths, &out).unwrap_err().contains("cannot be started"));
        let slow = Program { line: "sleep 20".into(), patience: Duration::from_millis(50) };
        assert!(ask(&slow, &paths, &out).unwrap_err().contains("no answer"));
        std::fs::remove_dir_all(&out).unwrap();
    }

    #[test]
    fn the_gain_is_the_actuators() {
        let rig = "[model]\ngain = 7\n[actuator]\nlimit = 2\ngain = 2.5e-2 # N·m/A\n[encoder]\ngain = 1\n";
        assert_eq!(actuator_gain(rig), Some(0.025));
        assert_eq!(actuator_gain("[actuator]\n"), None);
    }
}
