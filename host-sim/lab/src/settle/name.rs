//! A named effect with its class.

use diagnosis::laws::EffectName;

/// A named effect.
#[derive(Clone, Debug, PartialEq)]
pub struct Name {
    /// Its name.
    pub name: String,
    /// Names that the recordings cannot distinguish from it, itself included.
    pub class: Vec<String>,
    /// Probability that the class holds the truth; in the outcome of a run, with all its looks
    /// counted.
    pub confidence: f64,
}

impl Name {
    /// Returns its class in the words of the report.
    pub fn in_words(&self) -> String {
        let words: Vec<&str> = self.class.iter().map(|name| effect_in_words(name)).collect();
        words.join(" or ")
    }
}

/// Returns the words of the report for an effect's name, or the name itself if it has none.
pub(super) fn effect_in_words(name: &str) -> &str {
    EffectName::find(name).map_or(name, |effect| effect.in_words())
}
