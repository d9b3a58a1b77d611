//! The report of a benchmark as JSON: sums, and every case.

use serde_json::{Value, json};

use crate::judge::Record;
use crate::metrics::Metrics;
use crate::report::Run;
use crate::stats::{Rate, quantile};

pub(crate) fn case_json(r: &Record) -> Value {
    let effects: Vec<Value> = r
        .effects()
        .iter()
        .map(|e| json!({ "name": e.name, "class": e.class, "confidence": e.confidence, "right": r.is_true(e) }))
        .collect();
    let (gain, left) = (r.gain(), r.left.as_ref().ok());
    json!({
        "id": r.id, "kind": r.key.category.word(), "hidden": r.key.hidden(), "strength": r.key.strength,
        "snr": r.key.snr, "rig": r.key.rig, "right": r.right(), "verdict": r.verdict(), "effects": effects,
        "answer": r.answer_text(), "refit": left.map(|l| l.refit), "patched": left.map(|l| l.patched), "unjudged": r.left.as_ref().err(),
        "reported_gain_over_oracle": r.reported_gain().map(|g| g.of_oracle),
        "gain": gain,
        "seconds": r.seconds,
    })
}

/// The whole result as JSON: sums, and one entry for every case.
pub(crate) fn as_json(records: &[Record], s: &Metrics, run: &Run) -> Value {
    let lines: serde_json::Map<String, Value> =
        s.lines.iter().map(|l| (l.key.clone(), l.figure.json())).collect();
    let by = |rates: &[Rate]| json!(rates.iter().map(Rate::json).collect::<Vec<_>>());
    let by_effect: serde_json::Map<String, Value> =
        s.by_effect.iter().map(|(n, r)| (n.clone(), by(r))).collect();
    let by_unknown: Vec<Value> = s
        .by_unknown
        .iter()
        .map(|((detector, name), r)| {
            json!({ "kind": name, "detector": detector, "abstained": r[0].json(), "confidently_wrong": r[1].json() })
        })
        .collect();
    let rivals: Vec<Value> = s
        .rivals
        .iter()
        .map(|r| {
            json!({
                "name": r.name,
                "right": by(&r.right),
                "null_alarms": r.null_alarms.json(),
                "parameters_called_physics": r.parameters_called_physics.json(),
                "false_names": r.false_names.json(),
                "outside_abstains": r.outside_abstains.json(),
                "gain": { "median": quantile(&r.shares, 0.5), "p10": quantile(&r.shares, 0.1), "cases": r.shares.len() },
            })
        })
        .collect();
    let times: Option<serde_json::Map<String, Value>> =
        run.speed.as_ref().map(|times| times.iter().map(|t| (t.hidden.into(), json!(t.seconds))).collect());
    json!({
        "format": 2,
        "tool": run.tool,
        "source": run.source,
        "seed": run.options.seed,
        "quick": run.options.quick,
        "draws": run.options.draws(),
        "only": run.options.only,
        "planned": run.planned,
        "unbuilt": run.unbuilt,
        "figures": lines,
        "by_effect": by_effect,
        "by_unknown": by_unknown,
        "reliability": s.reliability.json(),
        "seconds_60s_10khz": times,
        "rivals": rivals,
        "cases": records.iter().map(case_json).collect::<Vec<_>>(),
    })
}
