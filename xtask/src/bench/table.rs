//! The table as text and as `target/bench.json`.

use super::values::Peer;
use crate::rows::{Better, Row};
use std::fmt::Write as _;

/// A row with its value and its peer.
pub(crate) type Measured = (Row, f64, Option<Peer>);

/// Prints the table.
pub(crate) fn print(rows: &[Measured]) {
    println!("{:<28}{:>14}  {:<20}{:>12}  peer", "row", "value", "unit", "wanted");
    for (row, value, peer) in rows {
        let wanted = match (row.wanted, row.better) {
            (Some(wanted), Better::Lower) => format!("<= {wanted}"),
            (Some(wanted), Better::Higher) => format!(">= {wanted}"),
            (None, _) => String::new(),
        };
        let peer = match (peer, row.peer) {
            (Some(peer), _) => format!("{} {}", peer.who, peer.value),
            (None, Some(who)) => format!("{who} (absent)"),
            (None, None) => String::new(),
        };
        println!("{:<28}{value:>14}  {:<20}{wanted:>12}  {peer}", row.name, row.unit);
    }
}

/// Returns the contents of `target/bench.json`.
pub(crate) fn json(commit: &str, rows: &[Measured]) -> String {
    let number =
        |value: Option<f64>| value.filter(|v| v.is_finite()).map_or("null".into(), |v| v.to_string());
    let mut text = format!("{{ \"commit\": {}, \"rows\": [", quoted(commit));
    for (index, (row, value, peer)) in rows.iter().enumerate() {
        let better = if row.better == Better::Lower { "lower" } else { "higher" };
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "{}\n  {{ \"row\": {}, \"value\": {}, \"unit\": {}, \"wanted\": {}, \"better\": \"{better}\", \"peer\": {}, \
             \"peer_value\": {} }}",
            if index == 0 { "" } else { "," },
            quoted(row.name),
            number(Some(*value)),
            quoted(row.unit),
            number(row.wanted),
            peer.as_ref().map_or("null".into(), |peer| quoted(&peer.who)),
            number(peer.as_ref().map(|peer| peer.value)),
        );
    }
    text.push_str("\n] }\n");
    text
}

fn quoted(text: &str) -> String {
    let escaped: String = text
        .chars()
        .flat_map(|c| match c {
            '"' | '\\' => vec!['\\', c],
            c if c.is_control() => vec![' '],
            c => vec![c],
        })
        .collect();
    format!("\"{escaped}\"")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rows::ROWS;

    #[test]
    fn the_file_is_what_the_contract_says() {
        let peer = Some(Peer { who: "a \"b\"".into(), value: 2.0 });
        let text = json("c", &[(ROWS[0], 612.0, None), (ROWS[2], 1.5, peer)]);
        let expected = "{ \"commit\": \"c\", \"rows\": [\n  { \"row\": \"tick_instructions_longest\", \"value\": 612, \
                        \"unit\": \"instructions\", \"wanted\": 840, \"better\": \"lower\", \"peer\": null, \"peer_value\": \
                        null },\n  { \"row\": \"tick_host_ns\", \"value\": 1.5, \"unit\": \"ns\", \"wanted\": 60, \
                        \"better\": \"lower\", \"peer\": \"a \\\"b\\\"\", \"peer_value\": 2 }\n] }\n";
        assert_eq!(text, expected);
    }
}
