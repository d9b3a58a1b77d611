//! Shares of the source files in a profile of callgrind, as `callgrind_annotate` prints them: one
//! line for each function and each file of which code was inlined into it. By file, because a whole
//! tick is inlined into one function.

use std::collections::BTreeMap;

/// Files with their shares, in %, from the largest; a function where no file is known.
pub(super) fn of(annotated: &str) -> Vec<(String, f64)> {
    let mut shares: BTreeMap<String, f64> = BTreeMap::new();
    for (file, percent) in annotated.lines().filter_map(line) {
        *shares.entry(file).or_default() += percent;
    }
    let mut shares: Vec<(String, f64)> = shares.into_iter().collect();
    shares.sort_by(|a, b| b.1.total_cmp(&a.1));
    shares
}

/// A line such as `39,750,811
/// (21.05%) /top/control-core/src/controller.rs:control_core::Controller::tick [/program]`.
fn line(line: &str) -> Option<(String, f64)> {
    let (_, rest) = line.split_once('(')?;
    let (percent, rest) = rest.split_once("%)")?;
    let place = rest.trim().split(" [").next()?;
    let (file, function) = place.split_once(':')?;
    let name = if file == "???" { function.to_string() } else { short(file) };
    Some((name, percent.trim().parse().ok()?))
}

/// The end of a path from its crate on.
fn short(file: &str) -> String {
    let folder = file.rfind("/src/").map_or(file, |at| &file[..at]);
    let from = folder.rfind('/').map_or(0, |at| at + 1);
    file.get(from..).unwrap_or(file).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_file_are_added_over_the_functions_it_is_in() {
        let text = "188 (100.0%)  PROGRAM TOTALS\n39 (21.05%)  /a/control-core/src/law/jog.rs:core::Controller::tick [/b]\n\
                    14 ( 7.70%)  /a/control-core/src/law/jog.rs:law::tick [/b/tick]\n\
                    7 ( 3.72%)  /rustc/5/library/core/src/cmp.rs:core::Controller::tick\n9 ( 4.00%)  ???:memcpy [/libc.so.6]\n";
        let shares = of(text);
        assert_eq!(shares.len(), 3);
        assert_eq!(shares[0].0, "control-core/src/law/jog.rs");
        assert!((shares[0].1 - 28.75).abs() < 1e-9, "{shares:?}");
        assert_eq!(shares[1], ("memcpy".into(), 4.0));
        assert_eq!(shares[2].0, "core/src/cmp.rs");
    }
}
