//! Reads the output of the measuring programs: values by the name of their row, peers, and lines of
//! the board's own table.

use crate::rows::ROWS;
use std::collections::BTreeMap;

/// The beginning of a line of the board's own table.
pub(crate) const BOARD_LINE: &str = "| ";

/// The beginning of the names under which programs print the time of an amount of work.
pub(crate) const WORK: &str = "work";

/// The measured values, by name.
pub(crate) type Values = BTreeMap<String, String>;

/// The lines of the board's own table; whatever the test runner wrote before a line is not part of
/// it.
pub(crate) fn board_lines_in(text: &str) -> impl Iterator<Item = String> {
    text.lines().filter_map(|line| Some(line.get(line.find(BOARD_LINE)?..)?.to_string()))
}

/// `name=value` among the words of `text`, and rows in JSON, where the table knows the name; the
/// time of work by the name of that.
pub(crate) fn values_in(text: &str) -> Values {
    let known = |name: &str| {
        let first = name.split('.').next();
        first == Some(WORK) || ROWS.iter().any(|row| Some(row.name) == first)
    };
    let mut values: Values = text
        .split_whitespace()
        .filter_map(|word| word.split_once('='))
        .filter(|(name, _)| known(name))
        .map(|(name, value)| (name.to_string(), value.to_string()))
        .collect();
    let words: Vec<&str> = text.split_whitespace().map(|word| word.trim_end_matches([',', '}'])).collect();
    let mut row = None;
    for pair in words.windows(2) {
        match pair {
            ["\"row\":", name] => row = Some(name.trim_matches('"')).filter(|name| known(name)),
            ["\"value\":", value] => {
                values.extend(row.take().map(|name| (name.to_string(), value.to_string())));
            }
            _ => {}
        }
    }
    values
}

/// The median of each value over some runs; what is no number is as the first run has it.
pub(crate) fn medians(runs: &[Values]) -> Values {
    let mut all = Values::new();
    for (name, first) in runs.iter().flatten() {
        let of_runs = runs.iter().filter_map(|run| run.get(name)?.parse::<f64>().ok());
        let mut numbers: Vec<f64> = of_runs.collect();
        numbers.sort_by(f64::total_cmp);
        let median = numbers.get(numbers.len() / 2).map_or_else(|| first.clone(), ToString::to_string);
        all.entry(name.clone()).or_insert(median);
    }
    all
}

/// Somebody else's number for the same thing.
pub(crate) struct Peer {
    pub(crate) who: String,
    pub(crate) value: f64,
}

pub(crate) fn peer(values: &Values, row: &str) -> Option<Peer> {
    let who = values.get(&format!("{row}.peer"))?.clone();
    let value = values.get(&format!("{row}.peer_value"))?.parse().ok()?;
    Some(Peer { who, value })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_among_words_and_others_are_not() {
        let values =
            values_in("ran: tick_host_ns=81.5 other=3\ntick_host_ns.peer=idsp tick_host_ns.peer_value=90 x");
        assert_eq!(values.len(), 3);
        assert_eq!(values["tick_host_ns"], "81.5");
        let peer = peer(&values, "tick_host_ns").unwrap();
        assert_eq!((peer.who.as_str(), peer.value), ("idsp", 90.0));
    }

    #[test]
    fn runs_by_turns_give_their_medians() {
        let run = |ns: &str, peer: Option<&str>| {
            let peer = peer.map(|ns| format!("tick_host_ns.peer=idsp tick_host_ns.peer_value={ns}"));
            values_in(&format!("tick_host_ns={ns} {}", peer.unwrap_or_default()))
        };
        let all = medians(&[run("80", None), run("300", None), run("81", None)]);
        assert_eq!(all, run("81", None), "one slow run moves nothing");
        let absent = medians(&[run("80", Some("91")), run("82", None), run("84", Some("90"))]);
        let peer = peer(&absent, "tick_host_ns").expect("it ran twice");
        assert_eq!((peer.who.as_str(), absent["tick_host_ns"].as_str()), ("idsp", "82"));
    }

    #[test]
    fn rows_are_found_in_json() {
        let text = "{ \"rows\": [ { \"peer\": null, \"row\": \"page_mb\", \"unit\": \"MB\", \"value\": 0.25 },\n\
                    { \"row\": \"other\", \"value\": 3 }, { \"row\": \"build_s\", \"value\": 61, \"peer\": null } ] }";
        let values = values_in(text);
        assert_eq!(
            values,
            Values::from([("page_mb", "0.25"), ("build_s", "61")].map(|(n, v)| (n.into(), v.into())))
        );
    }

    #[test]
    fn the_lines_of_the_board_are_found_behind_the_runners_dots() {
        let lines: Vec<String> = board_lines_in("..| jump | 0.1 ms |\nnothing\n| stack | 1 of 2 |").collect();
        assert_eq!(lines, ["| jump | 0.1 ms |", "| stack | 1 of 2 |"]);
    }
}
