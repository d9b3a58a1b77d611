//! Metrics over real machines, judged by what is believed of them.

use serde_json::{Value, json};

use crate::expected_answer::{ExpectedAnswer, Judgement};
use crate::judge::Record;
use crate::metrics::{BELIEVED, Reliability};
use crate::stats::Rate;

/// One machine with the answer to it.
#[derive(Clone, Debug)]
pub(crate) struct Machine {
    pub(crate) record: Record,
    pub(crate) belief: ExpectedAnswer,
}

impl Machine {
    pub(crate) fn outcome(&self) -> Judgement {
        self.belief.judge(&self.record)
    }
}

/// Everything that the report prints of machines.
#[derive(Clone, Debug)]
pub(crate) struct MachineSums {
    /// In the order of [`Judgement::ALL`].
    pub(crate) outcomes: [usize; 7],
    pub(crate) cases: usize,
    /// Right or defensible.
    pub(crate) good: Rate,
    pub(crate) refused: Rate,
    pub(crate) reliability: Reliability,
}

/// Metrics over all machines.
pub(crate) fn sum(machines: &[Machine]) -> MachineSums {
    let mut s = MachineSums {
        outcomes: [0; 7],
        cases: machines.len(),
        good: Rate::default(),
        refused: Rate::default(),
        reliability: Reliability::default(),
    };
    let mut names = Vec::new();
    for machine in machines {
        let outcome = machine.outcome();
        s.outcomes[Judgement::ALL.iter().position(|o| *o == outcome).unwrap_or(0)] += 1;
        s.good.add(matches!(outcome, Judgement::Right | Judgement::Defensible));
        s.refused.add(outcome == Judgement::Refused);
        for e in machine.record.effects() {
            names.push((e.confidence, machine.belief.allows(&e.name, e.judged_class())));
        }
    }
    s.reliability = Reliability::of(&names);
    s
}

impl MachineSums {
    /// (measure, wanted, measured).
    pub(crate) fn rows(&self) -> Vec<[String; 3]> {
        let mut rows = vec![
            ["a right or defensible answer".into(), "≥ 22 of 26".into(), self.good.text()],
            ["refused without a fit".into(), "0".into(), self.refused.text()],
            [
                format!("right or acceptable among the names given with {BELIEVED} or more"),
                "≥ 90 %".into(),
                self.reliability.believed.text(),
            ],
        ];
        for (outcome, count) in Judgement::ALL.iter().zip(self.outcomes) {
            rows.push([format!("… {}", outcome.word()), "–".into(), format!("{count} of {}", self.cases)]);
        }
        rows
    }

    pub(crate) fn json(&self) -> Value {
        let outcomes: serde_json::Map<String, Value> = Judgement::ALL
            .iter()
            .zip(self.outcomes)
            .map(|(outcome, count)| (outcome.word().into(), json!(count)))
            .collect();
        json!({
            "cases": self.cases, "outcomes": outcomes, "right_or_defensible": self.good.json(),
            "refused": self.refused.json(), "reliability": self.reliability.json(),
        })
    }
}
