//! Real machines: nobody knows what is in them, so an answer is judged against the effects that
//! their sources report and least squares found. `believed.tsv` has one line a case; the rules are
//! in `docs/design/benchmark.md`.

use crate::judge::Record;

/// The expected answer to a case.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ExpectedAnswer {
    /// The first name has to be one of these.
    right: Vec<String>,
    /// Names that are accepted in addition to a right one, or alone.
    acceptable: Vec<String>,
    /// ExpectedAnswer and source, in words.
    pub(crate) source: String,
}

/// `no_mismatch` or `parameters_only`, in the table.
const NONE: &str = "none";
/// No name at all.
const ABSTAIN: &str = "abstain";

/// The judgement of a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Judgement {
    /// The first name is right and none is false.
    Right,
    /// A name is right or acceptable, another one is false.
    RightBesideFalse,
    /// Nothing false, but not what the belief puts first.
    Defensible,
    /// No name where one was wanted, and no denial.
    Silent,
    /// Says that nothing structural is missing, or that nothing repeats, where something is.
    Denies,
    /// Every name is false.
    Wrong,
    /// No report, or none with a fit.
    Refused,
}

impl Judgement {
    pub(crate) const ALL: [Self; 7] = [
        Self::Right,
        Self::RightBesideFalse,
        Self::Defensible,
        Self::Silent,
        Self::Denies,
        Self::Wrong,
        Self::Refused,
    ];

    /// The word for it in tables.
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Right => "right",
            Self::RightBesideFalse => "right, a false name beside",
            Self::Defensible => "defensible",
            Self::Silent => "silent",
            Self::Denies => "denies it",
            Self::Wrong => "wrong",
            Self::Refused => "refused",
        }
    }
}

/// Reads `believed.tsv`: case, right, acceptable, source; `#` begins a comment line.
///
/// # Errors
/// The line that has too few columns.
pub(crate) fn parse(text: &str) -> Result<Vec<(String, ExpectedAnswer)>, String> {
    let mut list = Vec::new();
    for (index, line) in text.lines().enumerate() {
        if line.trim().is_empty() || line.starts_with('#') {
            continue;
        }
        let fields: Vec<&str> = line.split('\t').collect();
        let [case, right, acceptable, rest @ ..] = fields.as_slice() else {
            return Err(format!(
                "line {}: {} columns, three are needed: case, right, acceptable, separated by tabs",
                index + 1,
                fields.len()
            ));
        };
        let names = |text: &str| -> Vec<String> {
            text.split(',').map(str::trim).filter(|s| !s.is_empty()).map(String::from).collect()
        };
        list.push((
            (*case).to_string(),
            ExpectedAnswer {
                right: names(right),
                acceptable: names(acceptable),
                source: rest.first().unwrap_or(&"").to_string(),
            },
        ));
    }
    Ok(list)
}

impl ExpectedAnswer {
    /// The names that would be right, for tables.
    pub(crate) fn wanted(&self) -> String {
        self.right.join(" or ")
    }

    /// True if a name, or its class, is right or acceptable.
    pub(crate) fn allows(&self, name: &str, class: &[String]) -> bool {
        holds(&self.right, name, class) || holds(&self.acceptable, name, class)
    }

    /// Judges the case.
    pub(crate) fn judge(&self, record: &Record) -> Judgement {
        let Ok(answer) = &record.answer else { return Judgement::Refused };
        if let Some(first) = answer.effects.first() {
            let allowed = answer.effects.iter().filter(|e| self.allows(&e.name, e.judged_class())).count();
            return match allowed {
                0 => Judgement::Wrong,
                n if n < answer.effects.len() => Judgement::RightBesideFalse,
                _ if holds(&self.right, &first.name, first.judged_class()) => Judgement::Right,
                _ => Judgement::Defensible,
            };
        }
        if answer.refused {
            return Judgement::Refused;
        }
        let lists = |list: &[String], word: &str| list.iter().any(|w| w == word);
        let none = matches!(answer.verdict.as_str(), "no_mismatch" | "parameters_only");
        let says = |list: &[String]| lists(list, ABSTAIN) || none && lists(list, NONE);
        let denies = (none || answer.verdict == "random_disturbance") && !lists(&self.right, NONE);
        if says(&self.right) {
            Judgement::Right
        } else if says(&self.acceptable) {
            Judgement::Defensible
        } else if denies {
            Judgement::Denies
        } else {
            Judgement::Silent
        }
    }
}

fn holds(list: &[String], name: &str, class: &[String]) -> bool {
    list.iter().any(|l| l == name || class.contains(l))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::tests::{record, says};
    use crate::key::{Category, Key};

    fn belief(right: &str, acceptable: &str) -> ExpectedAnswer {
        parse(&format!("# case\tright\nx\t{right}\t{acceptable}\tsomebody\n")).unwrap().remove(0).1
    }

    fn judged(belief: &ExpectedAnswer, names: &[(&str, f64)], verdict: &str) -> Judgement {
        let mut answer = says(names);
        if names.is_empty() {
            answer.verdict = verdict.into();
        }
        belief.judge(&record(Key::of(Category::Null), answer))
    }

    #[test]
    fn every_outcome_is_reached() {
        let b = belief("coulomb_friction", "stribeck_friction,cogging");
        let (c, s, x) = (("coulomb_friction", 0.9), ("stribeck_friction", 0.9), ("backlash", 0.9));
        assert_eq!(judged(&b, &[c, s], ""), Judgement::Right);
        assert_eq!(judged(&b, &[c, x], ""), Judgement::RightBesideFalse);
        assert_eq!(judged(&b, &[s], ""), Judgement::Defensible);
        assert_eq!(judged(&b, &[s, c], ""), Judgement::Defensible);
        assert_eq!(judged(&b, &[x, c], ""), Judgement::RightBesideFalse);
        assert_eq!(judged(&b, &[s, x], ""), Judgement::RightBesideFalse);
        assert_eq!(judged(&b, &[x], ""), Judgement::Wrong);
        assert_eq!(judged(&b, &[], "unexplained"), Judgement::Silent);
        assert_eq!(judged(&b, &[], "no_mismatch"), Judgement::Denies);
        assert_eq!(judged(&b, &[], "random_disturbance"), Judgement::Denies);
        let mut refused = record(Key::of(Category::Null), says(&[]));
        refused.answer.as_mut().unwrap().refused = true;
        assert_eq!(b.judge(&refused), Judgement::Refused);
        refused.answer = Err("too short".into());
        assert_eq!(b.judge(&refused), Judgement::Refused);
    }

    #[test]
    fn none_is_a_verdict_and_abstaining_is_any_without_a_name() {
        let none = belief("none", "abstain,cogging");
        assert_eq!(judged(&none, &[], "parameters_only"), Judgement::Right);
        assert_eq!(judged(&none, &[], "unexplained"), Judgement::Defensible);
        assert_eq!(judged(&none, &[("cogging", 0.5)], ""), Judgement::Defensible);
        assert_eq!(judged(&none, &[("backlash", 0.5)], ""), Judgement::Wrong);
        let abstain = belief("abstain", "");
        assert_eq!(judged(&abstain, &[], "no_mismatch"), Judgement::Right);
    }

    #[test]
    fn a_line_of_two_columns_is_named() {
        assert!(parse("a\tb\tc\nx\ty\n").unwrap_err().contains("line 2"));
    }
}
