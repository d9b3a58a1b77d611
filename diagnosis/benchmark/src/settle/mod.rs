//! `--settle`: plants concealed in the virtual device, which `host-sim settle` is to name; for
//! comparison, in the same time of motion, random multisines, the set of `characterise`, and
//! strokes as in practice.

mod earlier;
mod given;
mod plants;
mod table;

use crate::options::Options;
use crate::pool;
use crate::stats::Rate;
use crate::tool::mark;
use plants::{Base, Kind, Plant};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Plants that are drawn where nobody says how many.
const PLANTS: usize = 20;
/// A confidence from which a name is sure.
const SURE: f64 = 0.9;
/// The least motion that the others get, s: `host-sim settle` takes no less.
const LEAST_MOTION_S: f64 = 20.0;

/// The answer of one run of `host-sim settle`.
#[derive(Clone, Debug, Default, PartialEq)]
struct Answer {
    /// Names with their class and confidence.
    names: Vec<(Vec<String>, f64)>,
    rounds: usize,
    motion_s: f64,
    /// Why there is no answer.
    error: Option<String>,
}

/// A plant with the answer by each source of inputs.
struct Judged {
    /// Its place among those of the seed.
    index: usize,
    kind: Kind,
    names: Vec<String>,
    answers: Vec<Answer>,
}

impl Answer {
    /// Reads `settle.json`.
    fn parse(text: &str) -> Option<Self> {
        let value: Value = serde_json::from_str(text).ok()?;
        Some(Self {
            names: names(&value)?,
            rounds: value["rounds"].as_array()?.len(),
            motion_s: value["motion_s"].as_f64()?,
            error: None,
        })
    }

    /// True if the names that are given are the true ones, each alone in its class, and no others.
    fn is_right(&self, truth: &[String]) -> bool {
        let is_given =
            |name: &String| self.names.iter().any(|(class, _)| class.len() == 1 && class[0] == *name);
        self.error.is_none() && self.names.len() == truth.len() && truth.iter().all(is_given)
    }

    /// True if a class without a true name is given as sure.
    fn is_surely_wrong(&self, truth: &[String]) -> bool {
        let is_true = |name: &String| truth.contains(name);
        self.names.iter().any(|(class, sure)| *sure >= SURE && !class.iter().any(is_true))
    }
}

/// Names with their class and confidence in the JSON of an answer.
fn names(answer: &Value) -> Option<Vec<(Vec<String>, f64)>> {
    let one = |name: &Value| {
        let class = name["class"].as_array()?.iter().filter_map(|n| Some(n.as_str()?.to_owned()));
        Some((class.collect(), name["confidence"].as_f64()?))
    };
    answer["names"].as_array()?.iter().map(one).collect()
}

/// Figures of one source of inputs.
#[derive(Clone, Debug, Default)]
struct Figures {
    twins: Rate,
    singles: Rate,
    pairs: Rate,
    /// Every true name is in the class of a name.
    in_class: Rate,
    wrong: Rate,
    nulls_named: Rate,
    outside_named: Rate,
    rounds: Vec<f64>,
    motion_s: Vec<f64>,
    errors: usize,
}

impl Figures {
    fn add(&mut self, plant: &Judged, answer: &Answer) {
        match plant.kind {
            Kind::Twin => self.twins.add(answer.is_right(&plant.names)),
            Kind::Single => self.singles.add(answer.is_right(&plant.names)),
            Kind::Pair => self.pairs.add(answer.is_right(&plant.names)),
            Kind::Null => self.nulls_named.add(!answer.names.is_empty()),
            Kind::Outside => self.outside_named.add(!answer.names.is_empty()),
        }
        if !plant.names.is_empty() {
            let is_held =
                |truth: &String| answer.names.iter().any(|(class, _)| class.iter().any(|name| name == truth));
            self.in_class.add(plant.names.iter().all(is_held));
        }
        self.wrong.add(answer.is_surely_wrong(&plant.names));
        self.errors += usize::from(answer.error.is_some());
        if answer.error.is_none() {
            self.rounds.push(answer.rounds as f64);
            self.motion_s.push(answer.motion_s);
        }
    }
}

/// Draws the plants, lets each be settled, and writes `settle.json` and `settle.md`.
pub(crate) fn run(options: &Options) -> Result<(), String> {
    let program = program()?;
    let out = options.out.join("settle");
    std::fs::create_dir_all(&out).map_err(|e| format!("cannot create {}: {e}", out.display()))?;
    let all = all_plants(options, &program, &out)?;
    let count = all.len();
    let plants: Vec<(usize, Plant)> = all
        .into_iter()
        .enumerate()
        .filter(|(index, plant)| is_wanted(options.only.as_deref(), *index, plant))
        .collect();
    let mark = marks(&program, options);
    let mut answers = earlier::answers(options, &mark);
    let judged = |(index, plant): &(usize, Plant), answers| Judged {
        index: *index,
        kind: plant.kind,
        names: plant.names.clone(),
        answers,
    };
    let known: Vec<Judged> =
        plants.iter().filter_map(|one| Some(judged(one, answers.remove(&one.0)?))).collect();
    let is_known = |index: usize| known.iter().any(|plant| plant.index == index);
    let left: Vec<(usize, Plant)> = plants.iter().filter(|(index, _)| !is_known(*index)).cloned().collect();
    let work = |one: &(usize, Plant)| {
        let (index, plant) = one;
        let folder = out.join(format!("plant-{index}"));
        let answers = settle(&program, plant, &options.inputs, options.seed + *index as u64, &folder);
        if options.keep.is_none() {
            // Recordings of a plant take 100 MB.
            let _ = std::fs::remove_dir_all(&folder);
        }
        judged(one, answers)
    };
    let write_all = |new: &[Option<Judged>]| {
        let mut all: Vec<&Judged> = known.iter().chain(new.iter().flatten()).collect();
        all.sort_by_key(|plant| plant.index);
        write(options, &all, count, &mark)
    };
    // A report that cannot be written now is tried again after the next plant; the last failure is
    // reported.
    let save = |new: &[Option<Judged>]| drop(write_all(new));
    let new = pool::map_and_save(options.jobs, options.budget(), "settled", &left, work, save);
    print!("{}", write_all(&new)?);
    Ok(())
}

/// The plants of a folder, or those of the seed.
fn all_plants(options: &Options, program: &Path, out: &Path) -> Result<Vec<Plant>, String> {
    if let Some(folder) = &options.plants_from {
        let all = given::plants(folder)?;
        return Ok(all.into_iter().take(options.cases.unwrap_or(usize::MAX)).collect());
    }
    let base = base(program, out)?;
    let count = options.cases.unwrap_or(PLANTS);
    Ok((0..count).map(|index| plants::draw(&base, options.seed, index)).collect())
}

/// Marks of the program that is judged, and of what draws or lists the plants.
fn marks(program: &Path, options: &Options) -> String {
    let own = std::env::current_exe().map(|own| mark(&own)).unwrap_or_default();
    let key = options.plants_from.as_ref().map(|folder| mark(&folder.join(given::KEY)));
    format!("{} {own} {}", mark(program), key.unwrap_or_default()).trim_end().to_owned()
}

/// Writes `settle.json` and `settle.md` about the plants that are judged; returns the latter.
fn write(options: &Options, judged: &[&Judged], count: usize, mark: &str) -> Result<String, String> {
    let text = table::markdown(judged, &options.inputs, options.seed, count);
    let all: Vec<Value> = judged.iter().map(|plant| json_of(plant, &options.inputs)).collect();
    let json = json!({ "seed": options.seed, "drawn": count, "program": mark, "plants": all });
    crate::write_out(options, "settle.md", &text)?;
    crate::write_out(options, "settle.json", &crate::pretty(&json)?)?;
    Ok(text)
}

/// True if `only` is the folder of plant `index`, or a part of its kind or of its effects; all are
/// wanted if it is absent.
fn is_wanted(only: Option<&str>, index: usize, plant: &Plant) -> bool {
    only.is_none_or(|text| {
        let number = text.strip_prefix("plant-").and_then(|number| number.parse().ok());
        let is_within = || plant.kind.words().contains(text) || plant.names.join(" + ").contains(text);
        number.map_or_else(is_within, |number: usize| number == index)
    })
}

fn json_of(plant: &Judged, inputs: &[&str]) -> Value {
    let answer = |(inputs, answer): (&&str, &Answer)| {
        let names: Vec<Value> =
            answer.names.iter().map(|(class, sure)| json!({ "class": class, "confidence": sure })).collect();
        json!({
            "inputs": inputs,
            "names": names,
            "rounds": answer.rounds,
            "motion_s": answer.motion_s,
            "error": answer.error,
        })
    };
    let answers: Vec<Value> = inputs.iter().zip(&plant.answers).map(answer).collect();
    json!({ "plant": plant.index, "kind": plant.kind.words(), "truth": plant.names, "answers": answers })
}

/// `host-sim`, next to this program.
fn program() -> Result<PathBuf, String> {
    let own = std::env::current_exe().map_err(|e| format!("the program's own folder is unknown: {e}"))?;
    let path = own.with_file_name(format!("host-sim{}", std::env::consts::EXE_SUFFIX));
    if path.exists() {
        return Ok(path);
    }
    Err(format!("{} is missing: build it first, with `cargo build --release --workspace`", path.display()))
}

/// The rig of the device without anything concealed.
fn base(program: &Path, out: &Path) -> Result<Base, String> {
    let folder = out.join("base");
    let run = Command::new(program).args(["--quiet", "characterise", "--out"]).arg(&folder).output();
    let run = run.map_err(|e| format!("{} cannot be started: {e}", program.display()))?;
    if !run.status.success() {
        return Err(format!("characterise: {}", String::from_utf8_lossy(&run.stderr).trim()));
    }
    let path = folder.join("rig.toml");
    let text = std::fs::read_to_string(&path).map_err(|e| format!("cannot read {}: {e}", path.display()))?;
    Base::parse(&text)
}

/// The answer by each source of inputs on one plant; the others move as long as the first did.
fn settle(program: &Path, plant: &Plant, inputs: &[&str], seed: u64, folder: &Path) -> Vec<Answer> {
    let mut motion_s = f64::INFINITY;
    let mut answers = Vec::new();
    for source in inputs {
        let answer = answer(program, plant, seed, &folder.join(source), source, motion_s)
            .unwrap_or_else(|error| Answer { error: Some(error), ..Answer::default() });
        if answers.is_empty() && answer.error.is_none() {
            motion_s = answer.motion_s;
        }
        answers.push(answer);
    }
    answers
}

fn answer(
    program: &Path,
    plant: &Plant,
    seed: u64,
    folder: &Path,
    source: &str,
    motion_s: f64,
) -> Result<Answer, String> {
    std::fs::create_dir_all(folder).map_err(|e| format!("cannot create {}: {e}", folder.display()))?;
    let concealed = folder.with_file_name("concealed.toml");
    std::fs::write(&concealed, &plant.toml)
        .map_err(|e| format!("cannot write {}: {e}", concealed.display()))?;
    let mut command = Command::new(program);
    command
        .args(["--quiet", "settle", "--no-compensate", "--inputs", source, "--seed"])
        .arg(seed.to_string());
    command.arg("--plant").arg(&concealed).arg("--out").arg(folder);
    if motion_s.is_finite() {
        command.arg("--motion").arg(motion_s.max(LEAST_MOTION_S).to_string());
    }
    let run = command.output().map_err(|e| format!("{} cannot be started: {e}", program.display()))?;
    if !run.status.success() {
        return Err(String::from_utf8_lossy(&run.stderr).trim().to_owned());
    }
    let text =
        std::fs::read_to_string(folder.join("settle.json")).map_err(|e| format!("no settle.json: {e}"))?;
    Answer::parse(&text).ok_or_else(|| "settle.json is not of the form expected".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn answer(classes: &[&[&str]], confidence: f64) -> Answer {
        let class = |class: &&[&str]| (class.iter().map(|name| (*name).to_owned()).collect(), confidence);
        Answer { names: classes.iter().map(class).collect(), rounds: 2, motion_s: 48.0, error: None }
    }

    fn texts(names: &[&str]) -> Vec<String> {
        names.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn only_the_true_name_alone_is_right() {
        assert!(answer(&[&["cogging"]], 0.95).is_right(&texts(&["cogging"])));
        assert!(!answer(&[&["cogging", "torque_ripple"]], 0.95).is_right(&texts(&["cogging"])));
        assert!(!answer(&[&["cogging"], &["command_delay"]], 0.95).is_right(&texts(&["cogging"])));
        assert!(!answer(&[], 0.0).is_right(&texts(&["cogging"])));
        let both = answer(&[&["cogging"], &["command_delay"]], 0.95);
        assert!(both.is_right(&texts(&["command_delay", "cogging"])));
        assert!(!both.is_right(&texts(&["command_delay", "torque_ripple"])));
    }

    #[test]
    fn only_the_plants_that_are_asked_for_are_settled() {
        let names = texts(&["cogging", "command_delay"]);
        let plant = Plant { kind: Kind::Pair, names, toml: String::new() };
        for wanted in [None, Some("plant-12"), Some("cogging"), Some("pairs")] {
            assert!(is_wanted(wanted, 12, &plant), "{wanted:?}");
        }
        for other in ["plant-1", "plant-123", "backlash", "nulls"] {
            assert!(!is_wanted(Some(other), 12, &plant), "{other}");
        }
    }

    #[test]
    fn a_name_is_surely_wrong_if_its_class_lacks_the_truth() {
        assert!(answer(&[&["cogging"]], 0.95).is_surely_wrong(&texts(&["torque_ripple"])));
        assert!(!answer(&[&["cogging", "torque_ripple"]], 0.95).is_surely_wrong(&texts(&["torque_ripple"])));
        assert!(!answer(&[&["cogging"]], 0.85).is_surely_wrong(&texts(&["torque_ripple"])));
        assert!(
            answer(&[&["cogging"]], 0.95).is_surely_wrong(&texts(&[])),
            "any sure name is wrong where nothing is concealed"
        );
    }

    #[test]
    fn an_answer_is_read_as_settle_writes_it() {
        let text = r#"{ "names": [{ "name": "cogging", "class": ["cogging"], "confidence": 0.97 }],
                        "rounds": [{}, {}], "motion_s": 48.0, "conclusion": "" }"#;
        let read = Answer::parse(text).expect("it is whole");
        assert_eq!(read, answer(&[&["cogging"]], 0.97));
        assert_eq!(Answer::parse("{}"), None);
    }
}
