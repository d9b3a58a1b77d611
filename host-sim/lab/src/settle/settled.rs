//! The rounds of a run and the names that it ends with.

use super::feed_forward::Feel;
use super::name::Name;
use super::repeat_testing;

/// One round.
#[derive(Clone, Debug)]
pub struct Round {
    /// The input in words.
    pub asked: String,
    /// Why it was asked.
    pub why: String,
    /// Names that its input was designed to distinguish; none for another input.
    pub designed_against: Vec<String>,
    /// Motion of this round, s.
    pub seconds: f64,
    /// The sentence of the diagnosis of all recordings so far.
    pub sentence: String,
    /// Names that contend afterwards, with their probabilities; `none` for none of them.
    pub contenders: Vec<(String, f64)>,
    /// Names after the diagnosis of all recordings so far, with the confidence of that diagnosis
    /// alone.
    pub names: Vec<Name>,
}

/// The outcome.
#[derive(Clone, Debug, Default)]
pub struct Settled {
    /// The rounds, in order.
    pub rounds: Vec<Round>,
    /// The names of the last diagnosis that are sure enough with every look counted.
    pub names: Vec<Name>,
    /// The others: a run that looks as often finds them by chance.
    pub unsure: Vec<Name>,
    /// Why no further round follows, a sentence without its full stop.
    pub conclusion: String,
    /// Motion of a round that could not be diagnosed, s.
    pub discarded_s: f64,
    /// The force on a hand before and after, or why nothing is fed forward; none where nothing is
    /// named or it was not asked for.
    pub feel: Option<Result<Feel, String>>,
}

impl Settled {
    /// Takes the names from the rounds so far.
    pub(super) fn count_looks(&mut self, most: usize) {
        let rounds: Vec<Vec<Name>> = self.rounds.iter().map(|round| round.names.clone()).collect();
        (self.names, self.unsure) = repeat_testing::corrected(&rounds, most);
    }

    /// Sentences, without their full stops, on the names that are not sure enough.
    pub fn unsure_in_words(&self) -> impl Iterator<Item = String> {
        let rounds: Vec<Vec<Name>> = self.rounds.iter().map(|round| round.names.clone()).collect();
        self.unsure.iter().map(move |name| {
            format!(
                "not named: {}; {}, and with every look counted it is {:.0} % sure",
                name.in_words(),
                match repeat_testing::since(name, &rounds) {
                    1 => "no round was sure of it".to_owned(),
                    round => format!("it came up only in round {round}"),
                },
                100.0 * name.confidence
            )
        })
    }

    /// Motion of all rounds, s, the last one included if it could not be diagnosed.
    pub fn motion_s(&self) -> f64 {
        self.rounds.iter().map(|round| round.seconds).sum::<f64>() + self.discarded_s
    }
}
