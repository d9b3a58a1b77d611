//! Numbers as people read them.

/// Returns a number with four significant digits.
pub fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let magnitude = x.abs().log10().floor();
    if (-3.0..5.0).contains(&magnitude) {
        format!("{x:.*}", (3.0 - magnitude).clamp(0.0, 6.0) as usize)
    } else {
        format!("{x:.3e}")
    }
}

/// Returns the same; zero where it is less than a thousandth of a range.
pub fn short_within(x: f64, range: f64) -> String {
    short(if x.abs() < 1e-3 * range { 0.0 } else { x })
}

/// Returns a number with at most three significant digits, for a sentence.
pub fn in_sentence(x: f64) -> String {
    let magnitude = if x == 0.0 { 0.0 } else { x.abs().log10().floor() };
    if !(-4.0..6.0).contains(&magnitude) {
        return format!("{x:.2e}");
    }
    let text = format!("{x:.*}", (2.0 - magnitude).clamp(0.0, 6.0) as usize);
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_in_a_sentence_has_at_most_three_digits() {
        let all = [0.02, 1.5, 31.98, 2.101, 0.0, -4321.0, 1e-7].map(in_sentence);
        assert_eq!(all, ["0.02", "1.5", "32", "2.1", "0", "-4321", "1.00e-7"]);
    }
}
