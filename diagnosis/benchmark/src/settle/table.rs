//! The figures of `--settle` as a table.

use super::{Figures, Judged};
use crate::stats::{Rate, quantile};
use std::fmt::Write as _;

/// The table in Markdown, with every plant below it.
pub(super) fn markdown(judged: &[&Judged], inputs: &[&str], seed: u64, drawn: usize) -> String {
    let rule = format!("| --- |{}\n", " --- |".repeat(inputs.len()));
    let figures: Vec<Figures> = (0..inputs.len())
        .map(|source| {
            let mut figures = Figures::default();
            judged.iter().for_each(|plant| figures.add(plant, &plant.answers[source]));
            figures
        })
        .collect();
    let mut out = format!(
        "Seed {seed}: {} of {drawn} concealed plants. Wilson's 95 % interval; the others moved as long as the first.\n\n\
         | | {} |\n{rule}",
        judged.len(),
        inputs.join(" | ")
    );
    let mut row = |what: &str, value: &dyn Fn(&Figures) -> String| {
        let cells: Vec<String> = figures.iter().map(value).collect();
        let _ = writeln!(out, "| {what} | {} |", cells.join(" | "));
    };
    let median = |values: &[f64]| quantile(values, 0.5).map_or("–".into(), |x| format!("{x:.0}"));
    let both =
        |f: &Figures| Rate { hits: f.twins.hits + f.singles.hits, trials: f.twins.trials + f.singles.trials };
    row("right single name, twins and singles", &|f| both(f).text());
    row("right single name, twins", &|f| f.twins.text());
    row("right single name, singles", &|f| f.singles.text());
    row("right names of a pair", &|f| f.pairs.text());
    row("true names in named classes", &|f| f.in_class.text());
    row("wrong name ≥ 0.9, all plants", &|f| f.wrong.text());
    row("nulls named", &|f| f.nulls_named.text());
    row("outside named", &|f| f.outside_named.text());
    row("rounds, median", &|f| median(&f.rounds));
    row("motion, median, s", &|f| median(&f.motion_s));
    row("no answer", &|f| f.errors.to_string());
    out.push_str("\n| truth | ");
    out.push_str(&inputs.join(" | "));
    let _ = write!(out, " |\n{rule}");
    for plant in judged {
        let named = plant.names.join(" + ");
        let truth = if named.is_empty() { plant.kind.words() } else { &named };
        let cells: Vec<String> = plant.answers.iter().map(answered).collect();
        let _ = writeln!(out, "| {truth} | {} |", cells.join(" | "));
    }
    out
}

/// An answer in a cell.
fn answered(answer: &super::Answer) -> String {
    if let Some(error) = &answer.error {
        return format!("error: {error}");
    }
    let name = |(class, sure): &(Vec<String>, f64)| format!("{} {sure:.2}", class.join("/"));
    let names: Vec<String> = answer.names.iter().map(name).collect();
    let named = if names.is_empty() { "–".to_owned() } else { names.join(", ") };
    format!("{named} ({} rounds, {:.0} s)", answer.rounds, answer.motion_s)
}
