//! Another point of entry and direction into the body of a patient.

use super::Profile;
use super::body::{check_along, check_direction};
use crate::error::Error;
use crate::named_files::{self, Text};
use anatomy::Site;
use serde::Deserialize;

/// The options of a command that change where and how a needle enters a body; without one, the
/// patient's file says it.
#[derive(Clone, Copy, Debug, Default)]
pub struct Entry {
    /// `--along`: the point of entry along the limb, mm.
    pub along_mm: Option<f64>,
    /// `--around`: the point of entry around the limb from its top, degrees.
    pub around_deg: Option<f64>,
    /// `--azimuth`: the needle's direction seen from above, degrees.
    pub azimuth_deg: Option<f64>,
    /// `--turn`: the turn of the limb about its axis, degrees.
    pub turn_deg: Option<f64>,
    /// `--angle`: the needle's inclination below the horizontal, 5 to 90 degrees.
    pub angle_deg: Option<f64>,
}

impl Entry {
    /// Refuses values out of range at a site, by the names of the options.
    fn check(&self, site: Site, slope: Option<Slope>) -> Result<(), String> {
        self.along_mm.map_or(Ok(()), |mm| check_along("--along", mm, site))?;
        for (option, degrees) in
            [("--around", self.around_deg), ("--azimuth", self.azimuth_deg), ("--turn", self.turn_deg)]
        {
            degrees.map_or(Ok(()), |degrees| check_direction(option, degrees))?;
        }
        self.angle_deg.map_or(Ok(()), |degrees| check_entry("--angle", degrees, slope))
    }
}

impl Profile {
    /// The same patient entered as `entry` says: what the line through its body meets follows from
    /// it.
    ///
    /// # Errors
    ///
    /// If the patient has no body, a value is out of range, or the needle would not enter.
    pub fn entered(&self, entry: &Entry) -> Result<Self, Error> {
        let refuse = |what: &str| Error::input(format_args!("{}: {what}", self.source.origin));
        let body = self.body.as_ref().ok_or_else(|| {
            refuse("this patient is layers without a body; choose one with [body], such as forearm")
        })?;
        entry.check(body.site, self.slope).map_err(Error::input)?;
        let mut table: toml::Table = named_files::parse(&self.source)?;
        let set = |table: &mut toml::Table, key: &str, value: Option<f64>| {
            if let Some(value) = value {
                table.insert(key.to_owned(), toml::Value::Float(value));
            }
        };
        set(&mut table, "entry_deg", entry.angle_deg);
        if let Some(body) = table.get_mut("body").and_then(toml::Value::as_table_mut) {
            set(body, "along_mm", entry.along_mm);
            set(body, "around_deg", entry.around_deg);
            set(body, "azimuth_deg", entry.azimuth_deg);
            set(body, "turn_deg", entry.turn_deg);
        }
        let text = toml::to_string(&table).map_err(|cause| refuse(&cause.to_string()))?;
        Self::parse_for(Text { origin: self.source.origin.clone(), text }, &self.config.device)
    }
}

/// `slope_deg` of a patient: the angles to the skin between which the device's barrier holds the
/// needle, condition 5 of Paper 001. In a body the angle is that below the horizontal.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slope {
    /// The flattest, degrees.
    pub smallest: f64,
    /// The steepest, degrees.
    pub largest: f64,
}

impl Slope {
    /// Refuses a range that is upside down or that no needle has.
    pub(super) fn check(self) -> Result<(), String> {
        check_angle("slope_deg.smallest", self.smallest)?;
        check_angle("slope_deg.largest", self.largest)?;
        if self.smallest < self.largest {
            return Ok(());
        }
        let Self { smallest, largest } = self;
        Err(format!("slope_deg is from {smallest} to {largest} degrees; give the smaller one as smallest"))
    }
}

/// Refuses an angle to the skin that no needle has; `key` as the user wrote it.
pub(super) fn check_angle(key: &str, degrees: f64) -> Result<(), String> {
    if (5.0..=90.0).contains(&degrees) {
        Ok(())
    } else {
        Err(format!("{key} is {degrees} degrees; it must be from 5 to 90 degrees, the angle to the skin"))
    }
}

/// Refuses an angle at entry that no needle has, or that is outside the patient's `slope_deg`.
pub(crate) fn check_entry(key: &str, degrees: f64, slope: Option<Slope>) -> Result<(), String> {
    check_angle(key, degrees)?;
    match slope {
        Some(Slope { smallest, largest }) if !(smallest..=largest).contains(&degrees) => Err(format!(
            "{key} is {degrees} degrees; it must be from {smallest} to {largest} degrees, the slope_deg of the patient"
        )),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(name: &str) -> Profile {
        Profile::find(name).expect("it is built in")
    }

    #[test]
    fn a_refused_entry_names_the_option_and_its_unit() {
        let none = Entry::default();
        for (entry, wanted) in [
            (
                Entry { along_mm: Some(300.0), ..none },
                "--along is 300 mm; it must be from -60 to 80 mm at the forearm",
            ),
            (
                Entry { around_deg: Some(-181.0), ..none },
                "--around is -181 degrees; it must be from -180 to 180 degrees",
            ),
            (
                Entry { azimuth_deg: Some(f64::NAN), ..none },
                "--azimuth is NaN degrees; it must be from -180 to 180 degrees",
            ),
            (
                Entry { turn_deg: Some(300.0), ..none },
                "--turn is 300 degrees; it must be from -180 to 180 degrees",
            ),
            (
                Entry { angle_deg: Some(3.0), ..none },
                "--angle is 3 degrees; it must be from 5 to 90 degrees, the angle to the skin",
            ),
        ] {
            assert_eq!(find("forearm").entered(&entry).expect_err(wanted).to_string(), wanted);
        }
        let no_body = find("adult").entered(&none).expect_err("it has no body").to_string();
        assert!(no_body.contains("adult") && no_body.contains("choose one with [body]"), "{no_body}");
    }
}
