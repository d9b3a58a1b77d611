//! The `[patient]` of a profile: the person. The control law knows none of it: thicknesses follow
//! from it here, forces in `condition`.

use super::Layer;
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
    /// The patient's illness, one of those of `condition`.
    pub pathology: Option<String>,
    /// The site of the insertion.
    pub site: Option<Site>,
    /// The difficulty of doing it well.
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

/// The site of the insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Site {
    /// The inside of the elbow.
    Antecubital,
    /// The back of the hand.
    DorsalHand,
    /// The shoulder.
    Shoulder,
    /// The knee.
    Knee,
    /// The hip.
    Hip,
    /// No patient: layers of gelatin.
    Phantom,
}

/// The difficulty of doing it well.
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

/// The rule for a layer's thickness.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Thickness {
    /// The fat over the deltoid by ultrasound, for each sex, in proportion to body mass index.
    ByBodyMass,
}

/// From skin to muscle over the deltoid on average, mm: Poland et al. 1997, JAMA 277(21):1709.
const MEAN_MALE_MM: f64 = 8.3;
const MEAN_FEMALE_MM: f64 = 11.7;
/// The skin's part of it, mm: Laurent 2007.
const SKIN_MM: f64 = 2.5;
/// Body mass index at which they hold, kg/m². It was the same in both sexes; its value, and that
/// the fat is in proportion to it, are assumptions.
const MEAN_INDEX: f64 = 26.5;

impl Thickness {
    /// Returns the thickness for this patient, mm; an error if the patient's file does not say
    /// enough.
    pub(super) fn of_mm(self, person: &Person) -> Result<f64, String> {
        let Self::ByBodyMass = self;
        let missing = || "thickness by-body-mass needs patient.sex, weight_kg and height_cm".to_owned();
        let (sex, index) = (person.sex.ok_or_else(missing)?, person.body_mass_index().ok_or_else(missing)?);
        let mean_mm = match sex {
            Sex::Male => MEAN_MALE_MM,
            Sex::Female => MEAN_FEMALE_MM,
        };
        Ok((mean_mm - SKIN_MM) * index / MEAN_INDEX)
    }
}

/// Returns the depth of each layer, mm: as its key says, unless the patient sets the thickness of
/// one above it.
pub(super) fn depths_mm(layers: &[Layer], person: &Person) -> Result<Vec<f64>, String> {
    let (mut depths_mm, mut moved_mm) = (Vec::new(), 0.0);
    for (number, layer) in layers.iter().enumerate() {
        let depth_mm = own_depth_mm(layer, number)?;
        depths_mm.push(depth_mm + moved_mm);
        if let Some(thickness) = layer.thickness {
            let below = layers.get(number + 1);
            let below = below.ok_or_else(|| format!("layer {number} has a thickness and none below it"))?;
            moved_mm += thickness.of_mm(person)? - (own_depth_mm(below, number + 1)? - depth_mm);
        }
    }
    Ok(depths_mm)
}

/// The depth that a layer's key gives, mm.
fn own_depth_mm(layer: &Layer, number: usize) -> Result<f64, String> {
    let depth_mm = layer.depth_mm.ok_or_else(|| format!("depth_mm of layer {number} is missing; add it"))?;
    if depth_mm < 0.0 {
        return Err(format!("depth_mm of layer {number} is {depth_mm}; it must be 0 or more"));
    }
    Ok(depth_mm)
}

impl Person {
    /// In kg/m², where weight and height are known.
    fn body_mass_index(&self) -> Option<f64> {
        Some(self.weight_kg? / (self.height_cm? * 1e-2).powi(2))
    }

    /// Refuses what no person is, by key and range.
    pub(super) fn check(&self) -> Result<(), String> {
        for (key, value, low, high) in [
            ("patient.age_years", self.age_years, 0.0, 120.0),
            ("patient.weight_kg", self.weight_kg, 0.5, 400.0),
            ("patient.height_cm", self.height_cm, 30.0, 250.0),
        ] {
            if let Some(value) = value.filter(|value| !(low..=high).contains(value)) {
                return Err(format!("{key} is {value}; it must be from {low} to {high}"));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fat_follows_from_weight_height_and_sex() {
        let person = |sex, weight_kg| Person {
            sex: Some(sex),
            weight_kg: Some(weight_kg),
            height_cm: Some(200.0),
            ..Person::default()
        };
        let fat_mm =
            |sex, weight_kg| Thickness::ByBodyMass.of_mm(&person(sex, weight_kg)).expect("all is known");
        // Poland's means from skin to muscle at 26.5 kg/m², which is 106 kg here.
        assert!((fat_mm(Sex::Male, 106.0) + 2.5 - 8.3).abs() < 1e-9);
        assert!((fat_mm(Sex::Female, 106.0) + 2.5 - 11.7).abs() < 1e-9);
        let unknown = Person { height_cm: None, ..person(Sex::Male, 80.0) };
        assert!(Thickness::ByBodyMass.of_mm(&unknown).expect_err("no height").contains("height_cm"));
    }
}
