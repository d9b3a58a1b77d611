//! The floors of a crate: a file that uses no other is on the first one, each other one above what
//! it uses.

use super::Uses;
use std::collections::BTreeMap;

/// The number of floors of a crate without circles.
pub(super) fn floors(uses: &Uses) -> usize {
    let mut known = BTreeMap::new();
    uses.keys().map(|file| floor(file, uses, &mut known)).max().unwrap_or(0)
}

fn floor<'a>(file: &'a str, uses: &'a Uses, known: &mut BTreeMap<&'a str, usize>) -> usize {
    if let Some(floor) = known.get(file) {
        return *floor;
    }
    // A file of a circle, which is reported elsewhere, counts as the first floor on the way back.
    known.insert(file, 1);
    let below = uses.get(file).into_iter().flatten().map(|(other, _)| floor(other, uses, known));
    let floor = 1 + below.max().unwrap_or(0);
    known.insert(file, floor);
    floor
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_one_floor_above_what_it_uses() {
        let of = |others: &[&str]| others.iter().map(|other| ((*other).to_owned(), String::new())).collect();
        let uses: Uses = [
            ("lib", of(&["a", "c"])),
            ("a", of(&["b"])),
            ("b", of(&["c"])),
            ("c", of(&[])),
            ("d", of(&["c"])),
        ]
        .map(|(file, others)| (file.to_owned(), others))
        .into();
        assert_eq!(floors(&uses), 4);
        assert_eq!(floors(&Uses::new()), 0);
    }
}
