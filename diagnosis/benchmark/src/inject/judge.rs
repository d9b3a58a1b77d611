//! The judgement of a concealed effect: whether it was found, which names are false, and where it
//! was lost.

use serde_json::Value;

use super::plain::Found;
use super::regress::Oracle;
use crate::expected_answer::ExpectedAnswer;
use crate::tool::{Answer, Named};

/// A case with the answers to it.
#[derive(Clone, Debug)]
pub(crate) struct Case {
    pub(crate) id: String,
    pub(crate) carrier: String,
    pub(crate) machine: String,
    pub(crate) hidden: &'static str,
    /// The ratio of the effect's residual to that of the tool's own model on the untouched machine.
    pub(crate) factor: f64,
    pub(crate) size: f64,
    pub(crate) oracle: Oracle,
    pub(crate) answer: Result<Answer, String>,
    /// The stage at which the tool lost the effect, and its reason.
    pub(crate) lost: Lost,
    /// Names that the tool gives on the untouched machine.
    pub(crate) own: Vec<Named>,
    /// The names that are believed of the untouched machine, where somebody wrote them down.
    pub(crate) believed: Option<ExpectedAnswer>,
    /// The findings of the plain rival here, and on the untouched machine.
    pub(crate) plain: Vec<Found>,
    pub(crate) plain_own: Vec<Found>,
    pub(crate) seconds: f64,
}

/// The rank of an effect among the hypotheses of the report.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Lost {
    /// It gains most on the held-out recordings, and is refused.
    Leads(String),
    /// It gains at least 70 % of what the best one gains.
    Near(String),
    /// Another one gains more: its name, and why the effect itself was refused.
    Behind(String, String),
    GainsNothing(String),
    NeverFitted(String),
    NotListed,
    NoReport,
}

impl Lost {
    /// The place in a few words.
    pub(crate) fn word(&self) -> &'static str {
        match self {
            Lost::Leads(_) => "leads, refused",
            Lost::Near(_) => "within 30 % of the lead",
            Lost::Behind(..) => "behind",
            Lost::GainsNothing(_) => "gains nothing held out",
            Lost::NeverFitted(_) => "never fitted in full",
            Lost::NotListed => "not among the hypotheses",
            Lost::NoReport => "no report",
        }
    }

    pub(crate) fn reason(&self) -> &str {
        match self {
            Lost::Leads(why)
            | Lost::Near(why)
            | Lost::Behind(_, why)
            | Lost::GainsNothing(why)
            | Lost::NeverFitted(why) => why,
            _ => "",
        }
    }
}

/// Looks the effect up in the report.
pub(crate) fn lost(report: &Value, hidden: &str) -> Lost {
    let Some(list) = report["hypotheses"].as_array() else { return Lost::NoReport };
    let gain = |h: &Value| h["holdout_gain"].as_f64();
    let mut best: (f64, &str) = (f64::NEG_INFINITY, "");
    let mut own: Option<(Option<f64>, String)> = None;
    for h in list {
        let name = h["name"].as_str().unwrap_or("");
        if name == hidden {
            let better =
                own.as_ref().is_none_or(|(g, _)| gain(h).unwrap_or(f64::MIN) > g.unwrap_or(f64::MIN));
            if better {
                own = Some((gain(h), h["rejected_because"].as_str().unwrap_or("").to_string()));
            }
        } else if gain(h).is_some_and(|g| g > best.0) {
            best = (gain(h).unwrap_or(0.0), name);
        }
    }
    match own {
        None => Lost::NotListed,
        Some((None, why)) => Lost::NeverFitted(why),
        Some((Some(g), why)) if g <= 0.0 => Lost::GainsNothing(why),
        Some((Some(g), why)) if g >= best.0 => Lost::Leads(why),
        Some((Some(g), why)) if g >= 0.7 * best.0 => Lost::Near(why),
        Some((_, why)) => Lost::Behind(best.1.into(), why),
    }
}

/// A method's answer to a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Said {
    Found,
    /// Only names that are neither hidden nor given on the untouched machine.
    False,
    Silent,
    NoReport,
}

impl Case {
    /// A name counts as the machine's own if it, or its class, was named on the untouched machine.
    fn is_own(&self, named: &Named) -> bool {
        self.own.iter().any(|own| own.holds(&named.name) || named.holds(&own.name))
    }

    /// The tool's names that are not the machine's own: confidence, and whether the name or its
    /// class is right.
    pub(crate) fn new_names(&self) -> Vec<(&Named, bool)> {
        let all = self.answer.as_ref().map_or(&[][..], |a| &a.effects);
        let right = |n: &&Named| n.holds(self.hidden);
        all.iter().filter(|n| right(n) || !self.is_own(n)).map(|n| (n, right(&n))).collect()
    }

    /// True if a name, or its class, is believed of the untouched machine: a rig without friction
    /// lacks it whether or not the tool says so before something is concealed.
    pub(crate) fn is_believed(&self, name: &str, class: &[String]) -> bool {
        self.believed.as_ref().is_some_and(|belief| belief.allows(name, class))
    }

    pub(crate) fn said(&self) -> Said {
        if self.answer.is_err() {
            return Said::NoReport;
        }
        let names = self.new_names();
        if names.iter().any(|(_, right)| *right) {
            Said::Found
        } else if names.is_empty() {
            Said::Silent
        } else {
            Said::False
        }
    }

    /// The plain rival's names from a share of the force error on, in the same way.
    pub(crate) fn plain_names(&self, least: f64) -> Vec<(&'static str, bool)> {
        let taken = |list: &[Found]| -> Vec<&'static str> {
            list.iter().take_while(|found| found.share >= least).map(|found| found.name).collect()
        };
        let own = taken(&self.plain_own);
        let names = taken(&self.plain).into_iter();
        names.filter(|n| *n == self.hidden || !own.contains(n)).map(|n| (n, n == self.hidden)).collect()
    }

    pub(crate) fn plain_said(&self, least: f64) -> Said {
        let names = self.plain_names(least);
        match names.iter().any(|(_, right)| *right) {
            true => Said::Found,
            false if names.is_empty() => Said::Silent,
            false => Said::False,
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::expected_answer;
    use crate::judge::tests::says;
    use serde_json::json;

    fn found(name: &'static str, share: f64) -> Found {
        Found { name, share }
    }

    pub(crate) fn case(hidden: &'static str, names: &[(&str, f64)], own: &[(&str, f64)]) -> Case {
        Case {
            id: "1".into(),
            carrier: "axis-A".into(),
            machine: "axis".into(),
            hidden,
            factor: 3.0,
            size: 1.0,
            oracle: Oracle { coefficient: 1.0, share: 0.5 },
            answer: Ok(says(names)),
            lost: Lost::NotListed,
            own: says(own).effects,
            believed: None,
            plain: vec![found(hidden, 0.3), found("cogging", 0.06)],
            plain_own: Vec::new(),
            seconds: 1.0,
        }
    }

    #[test]
    fn what_the_untouched_machine_has_is_not_false() {
        let said = |names: &[(&str, f64)], own: &[(&str, f64)]| case("quadratic_drag", names, own).said();
        assert_eq!(said(&[("quadratic_drag", 0.9), ("cogging", 0.9)], &[]), Said::Found);
        assert_eq!(said(&[("cogging", 0.9)], &[]), Said::False);
        assert_eq!(said(&[("cogging", 0.9)], &[("cogging", 0.7)]), Said::Silent);
        assert_eq!(said(&[], &[]), Said::Silent);
        let mut failed = case("quadratic_drag", &[], &[]);
        failed.answer = Err("it broke".into());
        assert_eq!(failed.said(), Said::NoReport);
        let plain = case("quadratic_drag", &[], &[]);
        assert_eq!(plain.plain_names(0.05).len(), 2);
        assert_eq!((plain.plain_said(0.15), plain.plain_said(0.4)), (Said::Found, Said::Silent));
    }

    #[test]
    fn a_name_that_is_believed_of_the_machine_is_known_as_such() {
        let mut case = case("quadratic_drag", &[("cogging", 0.9)], &[]);
        assert!(!case.is_believed("cogging", &[]));
        let line = "axis-A\tnone\tcogging\tsomebody\n";
        let belief = expected_answer::parse(line).unwrap().remove(0).1;
        case.believed = Some(belief);
        assert!(case.is_believed("cogging", &[]) && !case.is_believed("torque_ripple", &[]));
        assert!(case.is_believed("torque_ripple", &["torque_ripple".into(), "cogging".into()]));
        assert_eq!(case.said(), Said::False, "what was said stays what it was");
    }

    #[test]
    fn where_an_effect_is_lost_is_read_from_the_report() {
        let of = |drag: Value, cogging: f64| {
            let report = json!({ "hypotheses": [
                { "name": "quadratic_drag", "holdout_gain": drag, "rejected_because": "too small" },
                { "name": "cogging", "holdout_gain": cogging } ] });
            lost(&report, "quadratic_drag").word()
        };
        assert_eq!(of(json!(5.0), 3.0), "leads, refused");
        assert_eq!(of(json!(4.0), 5.0), "within 30 % of the lead");
        assert_eq!(of(json!(1.0), 5.0), "behind");
        assert_eq!(of(json!(-1.0), 5.0), "gains nothing held out");
        assert_eq!(of(Value::Null, 5.0), "never fitted in full");
        assert_eq!(lost(&json!({ "hypotheses": [] }), "x"), Lost::NotListed);
    }
}
