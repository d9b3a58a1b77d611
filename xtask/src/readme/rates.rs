//! The README's table from the cases of `cargo xtask prove --inject`.

use super::json::Json;
use std::collections::{BTreeMap, BTreeSet};

/// A name given with at least this confidence counts as sure.
const SURE: f64 = 0.9;
/// The plain regression names a law that takes at least this share of the force error.
const PLAIN_SHARES: [f64; 2] = [0.15, 0.05];

/// The names that are believed of a machine as it is, by carrier.
pub(super) type Believed = BTreeMap<String, BTreeSet<String>>;

/// Adds what a file `believed.tsv` says: carrier, right names, acceptable names, source.
pub(super) fn add_believed(text: &str, believed: &mut Believed) {
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let mut columns = line.split('\t');
        let Some(carrier) = columns.next() else { continue };
        let names = columns.take(2).flat_map(|column| column.split(',')).map(str::trim);
        let names = names.filter(|name| !name.is_empty()).map(String::from);
        believed.entry(carrier.to_string()).or_default().extend(names);
    }
}

/// Hits among trials.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Rate {
    hits: usize,
    trials: usize,
}

impl Rate {
    fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.trials += 1;
    }

    /// "92 % (23 of 25, 75–98)", with Wilson's 95 % interval (Wilson 1927).
    fn words(self) -> String {
        if self.trials == 0 {
            return "–".into();
        }
        let (n, z) = (self.trials as f64, 1.959_963_985_f64);
        let p = self.hits as f64 / n;
        let centre = p + z * z / (2.0 * n);
        let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
        let percent = |part: f64| format!("{:.0}", 100.0 * part.clamp(0.0, 1.0));
        let end = |sign: f64| percent((centre + sign * half) / (1.0 + z * z / n));
        format!("{} % ({} of {}, {}–{})", percent(p), self.hits, self.trials, end(-1.0), end(1.0))
    }
}

/// The rates of one method.
#[derive(Default)]
struct Row {
    /// Found of the solvable, at three times and at once the residual.
    found: [Rate; 2],
    /// Names that are neither concealed nor believed of the machine.
    wrong: Rate,
    /// Sure names that are concealed or believed.
    sure: Rate,
}

impl Row {
    fn add(&mut self, case: &Json, is_found: bool) -> Option<()> {
        let strength = case.get("strength").number()?;
        let solvable = case.get("solvable").bool()?;
        if let Some(place) = [3.0, 1.0].iter().position(|s| *s == strength).filter(|_| solvable) {
            self.found[place].add(is_found);
        }
        Some(())
    }

    fn add_tool(&mut self, case: &Json) -> Option<()> {
        self.add(case, case.get("said").text()? == "found")?;
        for name in case.get("names").list()? {
            let is_right = name.get("right").bool()? | name.get("believed").bool()?;
            self.wrong.add(!is_right);
            if name.get("confidence").number()? >= SURE {
                self.sure.add(is_right);
            }
        }
        Some(())
    }

    fn add_plain(&mut self, case: &Json, least: f64, believed: &Believed) -> Option<()> {
        let hidden = case.get("hidden").text()?;
        let own = plain_names(case.get("plain_untouched"), least)?;
        let mut names = plain_names(case.get("plain"), least)?;
        names.retain(|name| *name == hidden || !own.contains(name));
        let expected = believed.get(case.get("carrier").text()?);
        for name in &names {
            self.wrong.add(*name != hidden && expected.is_none_or(|list| !list.contains(*name)));
        }
        self.add(case, names.contains(&hidden))
    }

    fn line(&self, method: &str) -> String {
        let [triple, single] = self.found.map(Rate::words);
        format!("| {method} | {triple} | {single} | {} | {} |\n", self.wrong.words(), self.sure.words())
    }
}

/// The laws that the plain regression names, in its order, while each takes at least `least`.
fn plain_names(laws: &Json, least: f64) -> Option<Vec<&str>> {
    let mut names = Vec::new();
    // Files of before b1280ce5 hold the laws chosen by their share beside those by evidence.
    for law in laws.list().or_else(|| laws.get("by_share").list())? {
        if law.get("share").number()? < least {
            break;
        }
        names.push(law.get("name").text()?);
    }
    Some(names)
}

/// Returns the table.
///
/// # Errors
/// The id of the case that lacks a value.
pub(super) fn table(cases: &[Json], believed: &Believed) -> Result<String, String> {
    let mut tool = Row::default();
    let mut plain = PLAIN_SHARES.map(|least| (least, Row::default()));
    let mut machines = BTreeSet::new();
    for case in cases {
        let mut add = || -> Option<()> {
            machines.insert(case.get("machine").text()?);
            tool.add_tool(case)?;
            plain.iter_mut().try_for_each(|(least, row)| row.add_plain(case, *least, believed))
        };
        add().ok_or_else(|| case.get("id").text().unwrap_or("without an id").to_string())?;
    }
    let mut table = format!(
        "| {} effects concealed in recordings of {} real machines | found at 3 × | found at 1 × | false names | right among names \
         ≥ {SURE} |\n|{}\n",
        cases.len(),
        machines.len(),
        " --- |".repeat(5)
    );
    table.push_str(&tool.line("`host-sim diagnose`"));
    for (least, row) in plain {
        table.push_str(&row.line(&format!("a plain regression, from {:.0} % of the force", 100.0 * least)));
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::super::json::parse;
    use super::*;

    const CASE: &str = r#"{ "id": "7", "carrier": "axis-A", "machine": "axis", "hidden": "drag", "strength": 3, "solvable": true,
        "said": "found", "names": [
            { "name": "drag", "confidence": 0.95, "right": true, "believed": false },
            { "name": "friction", "confidence": 0.92, "right": false, "believed": true },
            { "name": "clip", "confidence": 0.91, "right": false, "believed": false },
            { "name": "lag", "confidence": 0.6, "right": false, "believed": false } ],
        "plain": [ { "name": "friction", "share": 0.4 }, { "name": "cogging", "share": 0.3 }, { "name": "lag", "share": 0.2 },
            { "name": "drag", "share": 0.06 } ],
        "plain_untouched": [ { "name": "lag", "share": 0.2 }, { "name": "cogging", "share": 0.1 } ] }"#;

    fn rows(case: &str) -> Vec<String> {
        let mut believed = Believed::new();
        add_believed(
            "# carrier\tright\taxis\nother\tcogging\t\taxis\naxis-A\tnone, friction\t\tsomebody",
            &mut believed,
        );
        let table = table(&[parse(case).unwrap()], &believed).unwrap();
        table.lines().skip(2).map(String::from).collect()
    }

    #[test]
    fn each_rate_counts_its_own_cases() {
        assert_eq!(
            rows(CASE),
            [
                "| `host-sim diagnose` | 100 % (1 of 1, 21–100) | – | 50 % (2 of 4, 15–85) | 67 % (2 of 3, 21–94) |",
                // From 15 %, only the lag is the machine's own; the friction is believed.
                "| a plain regression, from 15 % of the force | 0 % (0 of 1, 0–79) | – | 50 % (1 of 2, 9–91) | – |",
                "| a plain regression, from 5 % of the force | 100 % (1 of 1, 21–100) | – | 0 % (0 of 2, 0–66) | – |",
            ]
        );
        let single = rows(&CASE.replace("\"strength\": 3", "\"strength\": 1"));
        assert!(single[0].contains("diagnose` | – | 100 %"), "{single:?}");
        let unsolvable = rows(&CASE.replace("\"solvable\": true", "\"solvable\": false"));
        assert!(unsolvable[0].contains("diagnose` | – | – | 50 %"), "{unsolvable:?}");
        let silent = rows(&CASE.replace("\"said\": \"found\"", "\"said\": \"false\""));
        assert!(silent[0].contains("diagnose` | 0 % (0 of 1"), "{silent:?}");
    }

    #[test]
    fn files_of_before_give_the_same_table() {
        let before = CASE
            .replace("\"plain\": [", "\"plain\": { \"by_evidence\": [], \"by_share\": [")
            .replace("0.06 } ],", "0.06 } ] },");
        assert_eq!(rows(&before), rows(CASE));
    }

    #[test]
    fn a_case_that_lacks_a_value_is_named() {
        let table = |text: &str| table(&[parse(text).unwrap()], &Believed::new());
        for key in
            ["machine", "said", "solvable", "strength", "confidence", "plain_untouched", "share", "believed"]
        {
            let damaged = CASE.replacen(&format!("\"{key}\":"), "\"other\":", 1);
            assert_eq!(table(&damaged), Err("7".into()), "{key}");
        }
    }

    #[test]
    fn intervals_are_those_of_wilson() {
        // Newcombe 1998, table I.
        assert_eq!(Rate { hits: 81, trials: 263 }.words(), "31 % (81 of 263, 26–37)");
        assert_eq!(Rate { hits: 0, trials: 20 }.words(), "0 % (0 of 20, 0–16)");
    }
}
