//! Corrects confidence for testing the same name in several rounds: a name that chance makes in one
//! diagnosis of twenty comes up in one run of four that may stop at the first of five diagnoses.

use super::name::Name;

/// Confidence below which a diagnosis names nothing.
const LEAST: f64 = 2.0 / 3.0;

/// The part of the error that a run may still make that each of its diagnoses takes: the first half
/// of all, the last the rest.
const SPENT: f64 = 0.5;

/// Names of the last round with a confidence that counts the looks of a run of at most `most`
/// rounds, and those that are then too unsure to be names.
///
/// A run could have stopped for a name in the round since which every round gives it. An error is
/// spent on each round in turn (a union bound): if each name's error is no more than its share, the
/// run's errors together are no more than that.
pub(super) fn corrected(rounds: &[Vec<Name>], most: usize) -> (Vec<Name>, Vec<Name>) {
    let Some(last) = rounds.last() else { return (Vec::new(), Vec::new()) };
    let counted = |name: &Name| {
        let error = (1.0 - name.confidence) / share(since(name, rounds), most);
        Name { confidence: (1.0 - error).max(0.0), ..name.clone() }
    };
    last.iter().map(counted).partition(|name| name.confidence >= LEAST)
}

/// The share of a run's error that its diagnosis of this number, from 1, takes.
fn share(round: usize, most: usize) -> f64 {
    match (round, most) {
        (_, 0 | 1) => 1.0,
        (round, most) if round >= most => (1.0 - SPENT).powi(most as i32 - 1),
        (round, _) => SPENT * (1.0 - SPENT).powi(round as i32 - 1),
    }
}

/// The round, from 1, since which every round gives the name or one of its class.
pub(super) fn since(name: &Name, rounds: &[Vec<Name>]) -> usize {
    let is_same = |other: &Name| other.class.iter().any(|one| name.class.contains(one));
    let without = rounds.iter().rposition(|names| !names.iter().any(is_same));
    without.map_or(1, |round| round + 2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(class: &[&str], confidence: f64) -> Name {
        let class: Vec<String> = class.iter().map(|name| (*name).to_owned()).collect();
        Name { name: class[0].clone(), class, confidence }
    }

    #[test]
    fn a_single_diagnosis_keeps_its_confidence() {
        let twins = name(&["electrical_lag", "command_delay"], 0.72);
        assert_eq!(corrected(&[vec![twins.clone()]], 1), (vec![twins], vec![]));
    }

    #[test]
    fn a_name_that_is_kept_from_the_first_round_counts_twice() {
        let twins = name(&["electrical_lag", "command_delay"], 0.72);
        let (names, unsure) = corrected(&[vec![twins], vec![name(&["command_delay"], 0.98)]], 5);
        assert!((names[0].confidence - 0.96).abs() < 1e-12);
        assert!(unsure.is_empty());
    }

    #[test]
    fn a_name_counts_the_more_the_later_it_comes_up() {
        let rounds = [vec![], vec![name(&["cogging"], 0.9)], vec![], vec![], vec![name(&["cogging"], 0.78)]];
        let (names, unsure) = corrected(&rounds, 5);
        assert!(names.is_empty());
        assert!(unsure[0].confidence < 0.01);
        let (names, _) = corrected(&[vec![], vec![name(&["cogging"], 0.98)]], 5);
        assert!((names[0].confidence - 0.92).abs() < 1e-12, "four times in the second round");
        for most in 1..=5 {
            let all: f64 = (1..=most).map(|round| share(round, most)).sum();
            assert!((all - 1.0).abs() < 1e-12, "{most} rounds");
        }
    }

    /// A run stops at the first of five looks that gives a name; where nothing is there, each look
    /// gives one with the probability that its confidence admits. However sure a name is said to
    /// be, at most that part of the runs gives it.
    #[test]
    fn a_run_without_anything_to_find_names_as_rarely_as_it_says() {
        let runs = 20_000;
        let mut state = 1_u64;
        let mut uniform = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut at_first_sight = 0;
        let mut counted = [0; 3];
        for _ in 0..runs {
            let mut rounds = Vec::new();
            while rounds.len() < 5 {
                let confidence = uniform();
                let is_named = confidence >= LEAST;
                rounds.push(if is_named { vec![name(&["cogging"], confidence)] } else { vec![] });
                if is_named {
                    at_first_sight += i32::from(confidence >= 0.9);
                    break;
                }
            }
            let sure = corrected(&rounds, 5).0.first().map_or(0.0, |name| name.confidence);
            for (count, least) in counted.iter_mut().zip([LEAST, 0.8, 0.9]) {
                *count += i32::from(sure >= least);
            }
        }
        let part = |count: i32| f64::from(count) / f64::from(runs);
        assert!(part(at_first_sight) > 0.2, "without the correction: {}", part(at_first_sight));
        for (count, least) in counted.into_iter().zip([LEAST, 0.8, 0.9]) {
            assert!(part(count) <= 1.0 - least + 0.01, "{} of the runs are {least} sure", part(count));
        }
    }
}
