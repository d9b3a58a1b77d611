//! Answers of an earlier run of the same seed into the same folder: a run that was stopped goes on
//! where it was.

use super::{Answer, names};
use crate::options::Options;
use serde_json::Value;
use std::collections::BTreeMap;

/// Answers per plant in the `settle.json` of the folder of `--out`; none if there is no such file,
/// if it is of another seed, of other inputs or of another program, or if only some plants are
/// asked for: these are settled anew.
pub(super) fn answers(options: &Options, program: &str) -> BTreeMap<usize, Vec<Answer>> {
    if options.only.is_some() {
        return BTreeMap::new();
    }
    let text = std::fs::read_to_string(options.out.join("settle.json")).unwrap_or_default();
    let Ok(value) = serde_json::from_str::<Value>(&text) else { return BTreeMap::new() };
    if value["seed"] != options.seed || value["program"] != program {
        return BTreeMap::new();
    }
    let plants = value["plants"].as_array().into_iter().flatten();
    plants
        .filter_map(|plant| Some((plant["plant"].as_u64()? as usize, of(plant, &options.inputs)?)))
        .collect()
}

/// The answers to a plant by each of `inputs`; none if it has others, or one that failed.
fn of(plant: &Value, inputs: &[&str]) -> Option<Vec<Answer>> {
    let answers = plant["answers"].as_array()?;
    let is_of = |(answer, source): (&Value, &&str)| answer["inputs"] == **source && answer["error"].is_null();
    if answers.len() != inputs.len() || !answers.iter().zip(inputs).all(is_of) {
        return None;
    }
    answers.iter().map(one).collect()
}

fn one(answer: &Value) -> Option<Answer> {
    Some(Answer {
        names: names(answer)?,
        rounds: answer["rounds"].as_u64()? as usize,
        motion_s: answer["motion_s"].as_f64()?,
        error: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::Scratch;

    #[test]
    fn only_answers_of_the_same_run_are_kept() {
        let folder = Scratch::new().expect("a folder");
        let text = r#"{ "seed": 7, "program": "a", "plants": [
            { "plant": 3, "answers": [{ "inputs": "designed", "names": [{ "class": ["cogging"], "confidence": 0.9 }],
                                        "rounds": 2, "motion_s": 56.0, "error": null }] },
            { "plant": 4, "answers": [{ "inputs": "multisines", "names": [], "rounds": 1, "motion_s": 24.0, "error": null }] },
            { "plant": 5, "answers": [{ "inputs": "designed", "names": [], "rounds": 0, "motion_s": 0.0, "error": "killed" }] }] }"#;
        std::fs::write(folder.0.join("settle.json"), text).expect("it is written");
        let of = |seed, program| {
            let options =
                Options { seed, inputs: vec!["designed"], out: folder.0.clone(), ..Options::default() };
            answers(&options, program)
        };
        let known = of(7, "a");
        assert_eq!(known.keys().collect::<Vec<_>>(), [&3], "plant 4 met other inputs, and plant 5 failed");
        assert_eq!((known[&3][0].rounds, known[&3][0].names[0].1), (2, 0.9));
        assert!(of(8, "a").is_empty() && of(7, "b").is_empty());
    }
}
