//! The `[patient]` of a profile: whom it stands for. The control law knows none of it; people, `profiles` and recordings do.

use serde::Deserialize;

/// Each where it is known.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Person {
    /// Age in years, 0–120.
    pub age_years: Option<f64>,
    /// Weight in kg, 0.5–400.
    pub weight_kg: Option<f64>,
    /// Height in cm, 30–250.
    pub height_cm: Option<f64>,
    /// Sex, where the anatomy depends on it.
    pub sex: Option<Sex>,
    /// What the patient suffers from, in words of at most 80 characters.
    pub pathology: Option<String>,
    /// Where the needle goes in.
    pub site: Option<Site>,
    /// How hard it is to do well.
    pub difficulty: Option<Difficulty>,
}

/// Sex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sex {
    /// Female.
    Female,
    /// Male.
    Male,
}

/// Where the needle goes in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Site {
    /// The inside of the elbow.
    Antecubital,
    /// The back of the hand.
    DorsalHand,
    /// The shoulder.
    Shoulder,
    /// No patient: layers of gelatin.
    Phantom,
}

/// How hard it is to do well.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Difficulty {
    /// For a first attempt.
    Easy,
    /// For somebody who has done it.
    Moderate,
    /// For somebody who does it often.
    Hard,
}

impl Person {
    /// Refuses what no person is, by key and range.
    pub(super) fn check(&self) -> Result<(), String> {
        for (key, value, low, high) in [
            ("patient.age_years", self.age_years, 0.0, 120.0),
            ("patient.weight_kg", self.weight_kg, 0.5, 400.0),
            ("patient.height_cm", self.height_cm, 30.0, 250.0),
        ] {
            if let Some(value) = value.filter(|value| !(low..=high).contains(value)) {
                return Err(format!("{key} is {value}; it must lie from {low} to {high}"));
            }
        }
        match &self.pathology {
            Some(words) if words.chars().count() > 80 || words.contains('\n') => {
                Err("patient.pathology is too long; it must be one line of at most 80 characters".into())
            }
            _ => Ok(()),
        }
    }
}
