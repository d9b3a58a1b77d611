//! Insertions as statements of the Experience API 1.0.3 (xAPI), which a learning record store takes
//! as a JSON array. The id of a statement follows from what it says: a store takes an insertion
//! once, however often it is sent.

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
/// `score`, and the verdict. `trainee` is an e-mail address or a pseudonym.
pub fn statements(recording: &Recording, by: Option<&Profile>, trainee: &str) -> Result<Vec<Value>, Error> {
    let actor = actor(trainee)?;
    let mut statements = Vec::new();
    each(recording, by, |span, judge, profile| {
        let mut statement = statement(&actor, profile, &judge.insertion(span));
        let since_s = recording.begun_ns / 1_000_000_000 + span.end / u64::from(TICK_HZ);
        if let Some(stamp) = utc(since_s).filter(|_| recording.begun_ns > 0) {
            statement["timestamp"] = json!(stamp);
        }
        statement["id"] = json!(id(&format!("{statement} {} {}", recording.begun_ns, span.begin)));
        statements.push(statement);
    })?;
    Ok(statements)
}

/// Returns a time in seconds since 1970 as ISO 8601 in UTC; none beyond the year 9999. Written here
/// because a library of calendars and time zones is a large build for one time stamp.
fn utc(since_1970_s: u64) -> Option<String> {
    let (days, second) = (since_1970_s / 86_400, since_1970_s % 86_400);
    // Days from 0000-03-01, in eras of 400 years; years begin in March, so that a leap day is the
    // last of its year.
    let days = days + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year_of_era = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let march = (5 * day + 2) / 153;
    let day = day - (153 * march + 2) / 5 + 1;
    let (month, later) = if march < 10 { (march + 3, 0) } else { (march - 9, 1) };
    let year = 400 * era + year_of_era + later;
    let (hour, minute) = (second / 3_600, second / 60 % 60);
    (year <= 9_999)
        .then(|| format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{:02}Z", second % 60))
}

/// Returns a UUID that follows from a text: FNV-1a of 128 bits, marked as version 8 of RFC 9562.
fn id(text: &str) -> String {
    let step = |hash: u128, byte: u8| (hash ^ u128::from(byte)).wrapping_mul(0x0100_0000_0000_0000_0000_013B);
    let hash = text.bytes().fold(0x6C62_272E_07BB_0142_62B8_2175_6295_C58D, step);
    let marked = hash & !(0xF << 76 | 0b11 << 62) | 0x8 << 76 | 0b10 << 62;
    let digits = format!("{marked:032x}");
    [&digits[..8], &digits[8..12], &digits[12..16], &digits[16..20], &digits[20..]].join("-")
}

/// The trainee: an e-mail address, or a pseudonym that says nothing outside this project.
fn actor(trainee: &str) -> Result<Value, Error> {
    let is_plain = |part: &str| {
        !part.is_empty()
            && !part.contains(|c: char| c.is_whitespace() || c.is_control() || "@<>\"".contains(c))
    };
    match trainee.split_once('@') {
        Some((name, domain)) if is_plain(name) && is_plain(domain) => {
            Ok(json!({ "objectType": "Agent", "mbox": format!("mailto:{trainee}") }))
        }
        None if !trainee.trim().is_empty() && !trainee.contains(char::is_control) => {
            let account = json!({ "homePage": format!("{OURS}pseudonyms"), "name": trainee });
            Ok(json!({ "objectType": "Agent", "account": account }))
        }
        _ => Err(Error::input(format_args!(
            "--actor is \"{trainee}\"; it must be an e-mail address such as trainee@example.org, or a pseudonym"
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

    /// RFC 9562: the digits of version and variant, and the published offset of FNV-1a.
    #[test]
    fn an_id_is_a_uuid_that_follows_from_the_text() {
        assert_eq!(id(""), "6c62272e-07bb-8142-a2b8-21756295c58d");
        assert_eq!(id("a"), id("a"));
        assert_ne!(id("a"), id("b"));
    }

    #[test]
    fn seconds_become_a_date() {
        // Written by `date -u -d @N +%FT%TZ`.
        for (since_1970_s, date) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_798_761_599, "2026-12-31T23:59:59Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
            (253_402_300_799, "9999-12-31T23:59:59Z"),
        ] {
            assert_eq!(utc(since_1970_s).as_deref(), Some(date));
        }
        assert_eq!([253_402_300_800, u64::MAX].map(utc), [None, None]);
    }

    #[test]
    fn names_and_addresses_are_checked() {
        assert_eq!(in_urn("Mrs. Müller 2"), "Mrs.%20M%C3%BCller%202");
        assert_eq!(actor("blue 7").expect("a pseudonym")["account"]["name"], "blue 7");
        for wrong in ["", " ", "a\n", "@", "a@b@c", "a b@c.org", "a@"] {
            let said = actor(wrong).expect_err(wrong).to_string();
            assert!(said.contains("--actor") && said.contains("trainee@example.org"), "{said}");
        }
    }
}
