//! Insertions as statements of the Experience API 1.0.3 (xAPI), which a learning record store takes
//! as a JSON array. A statement has no `id`: the store adds one.

use crate::score::{Insertion, each};
use control_core::TICK_HZ;
use device_sim::error::Error;
use device_sim::profile::Profile;
use recording::read::Recording;
use serde_json::{Map, Value, json};

/// Version of the specification.
const VERSION: &str = "1.0.3";
/// The verbs and the type of activity of the vocabulary that ADL publishes.
const VERBS: &str = "http://adlnet.gov/expapi/verbs/";
const SIMULATION: &str = "http://adlnet.gov/expapi/activities/simulation";
/// Names of our own are URNs: nothing is served for them.
const OURS: &str = "urn:needle-insertion:";

/// Returns a statement for each insertion: passed or failed, how long it took, the figures of
/// `score`, and the verdict. `e_mail` is the trainee's.
pub fn statements(recording: &Recording, by: Option<&Profile>, e_mail: &str) -> Result<Vec<Value>, Error> {
    let actor = actor(e_mail)?;
    let mut statements = Vec::new();
    each(recording, by, |span, judge, profile| {
        let mut statement = statement(&actor, profile, &judge.insertion(span));
        let since_s = recording.begun_ns / 1_000_000_000 + span.end / u64::from(TICK_HZ);
        if let Some(stamp) = utc(since_s).filter(|_| recording.begun_ns > 0) {
            statement["timestamp"] = json!(stamp);
        }
        statements.push(statement);
    })?;
    Ok(statements)
}

/// Returns a time in seconds since 1970 as ISO 8601 in UTC; none beyond the year 9999.
fn utc(since_1970_s: u64) -> Option<String> {
    let stamp = jiff::Timestamp::from_second(i64::try_from(since_1970_s).ok()?).ok()?;
    Some(stamp.to_string())
}

/// The trainee, identified by an e-mail address.
fn actor(e_mail: &str) -> Result<Value, Error> {
    let is_plain = |part: &str| {
        !part.is_empty()
            && !part.contains(|c: char| c.is_whitespace() || c.is_control() || "@<>\"".contains(c))
    };
    match e_mail.split_once('@') {
        Some((name, domain)) if is_plain(name) && is_plain(domain) => {
            Ok(json!({ "objectType": "Agent", "mbox": format!("mailto:{e_mail}") }))
        }
        _ => Err(Error::input(format_args!(
            "--actor is \"{e_mail}\"; it must be an e-mail address such as trainee@example.org"
        ))),
    }
}

fn statement(actor: &Value, profile: &Profile, figures: &Insertion) -> Value {
    let verdict = &figures.verdict;
    let verb = if verdict.passed { "passed" } else { "failed" };
    json!({
        "version": VERSION,
        "actor": actor,
        "verb": { "id": format!("{VERBS}{verb}"), "display": { "en": verb } },
        "object": {
            "objectType": "Activity",
            "id": format!("{OURS}patient:{}", in_urn(&profile.name)),
            "definition": {
                "type": SIMULATION,
                "name": { "en": format!("Needle insertion, patient {}", profile.name) },
                "description": { "en": format!("{}.", verdict.goal) },
            },
        },
        "result": {
            "success": verdict.passed,
            "completion": true,
            "duration": format!("PT{:.2}S", figures.time_s),
            "extensions": extensions(figures),
        },
        "context": { "platform": recording::version::program() },
    })
}

/// The figures that are known, by the names of `score --json`, the verdict among them.
fn extensions(figures: &Insertion) -> Map<String, Value> {
    let figures = serde_json::to_value(figures).unwrap_or_default();
    let known = figures.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null());
    known.map(|(name, value)| (format!("{OURS}figure:{name}"), value.clone())).collect()
}

/// A name as a part of a URN: other characters than letters, digits, `-`, `.` and `_` are
/// percent-encoded.
fn in_urn(name: &str) -> String {
    let encode = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'.' | b'_' => char::from(byte).to_string(),
        other => format!("%{other:02X}"),
    };
    name.bytes().map(encode).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::Verdict;

    #[test]
    fn a_statement_says_what_the_figures_say() {
        let adult = Profile::find("adult").expect("it is built in");
        let actor = actor("trainee@example.org").expect("an address");
        let verdict = Verdict { goal: "Reach the vein".into(), passed: true, ..Verdict::default() };
        let good = Insertion { time_s: 3.604, punctures: 2, verdict, ..Insertion::default() };
        let passed = statement(&actor, &adult, &good);
        assert_eq!(passed["verb"]["id"], "http://adlnet.gov/expapi/verbs/passed");
        assert_eq!(passed["object"]["id"], "urn:needle-insertion:patient:adult");
        assert_eq!(passed["object"]["definition"]["description"]["en"], "Reach the vein.");
        assert_eq!(passed["result"]["duration"], "PT3.60S");
        assert_eq!(passed["result"]["success"], true);
        let failed = statement(&actor, &adult, &Insertion::default());
        assert_eq!(failed["verb"]["id"], "http://adlnet.gov/expapi/verbs/failed");
        assert_eq!(failed["result"]["success"], false);
    }

    #[test]
    fn seconds_become_a_date() {
        // Written by `date -u -d @N +%FT%TZ`.
        for (since_1970_s, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_798_761_599, "2026-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(utc(since_1970_s).as_deref(), Some(date));
        }
    }

    #[test]
    fn names_and_addresses_are_checked() {
        assert_eq!(in_urn("Mrs. Müller 2"), "Mrs.%20M%C3%BCller%202");
        for wrong in ["", "trainee", "@", "a@b@c", "a b@c.org", "a@"] {
            let said = actor(wrong).expect_err(wrong).to_string();
            assert!(said.contains("--actor") && said.contains("trainee@example.org"), "{said}");
        }
    }
}
