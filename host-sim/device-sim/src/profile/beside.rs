//! `[[beside]]` of a patient: structures next to the usual way of the needle that it is to spare,
//! such as a vein. They are drawn and scored. The force does not change in them, because the
//! device's layers have no end along the skin.

use crate::session::SceneBeside;
use serde::Deserialize;

/// A structure in the needle's plane, an ellipse within these bounds.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Beside {
    /// Its name.
    pub name: String,
    /// The near end along the skin from the point of entry, mm.
    pub from_mm: f64,
    /// The far end, mm.
    pub to_mm: f64,
    /// Its top below the skin, mm.
    pub top_mm: f64,
    /// Its bottom, mm.
    pub bottom_mm: f64,
}

/// Longest name in characters.
const LONGEST_NAME: usize = 40;
/// Farthest bound, mm.
const FARTHEST_MM: f64 = 200.0;

impl Beside {
    /// Refuses a structure without a name, inside out or above the skin.
    pub(super) fn check(&self) -> Result<(), String> {
        let Self { name, from_mm, to_mm, top_mm, bottom_mm } = self;
        if name.is_empty() || name.chars().count() > LONGEST_NAME || name.contains(char::is_control) {
            return Err(format!("beside.name must have 1 to {LONGEST_NAME} letters"));
        }
        let is_within = [from_mm, to_mm, top_mm, bottom_mm].iter().all(|mm| mm.abs() <= FARTHEST_MM);
        if is_within && from_mm < to_mm && 0.0 < *top_mm && top_mm < bottom_mm {
            return Ok(());
        }
        Err(format!(
            "beside \"{name}\" reaches from {from_mm} to {to_mm} mm and from {top_mm} to {bottom_mm} mm under the skin; each first number \
             must be the smaller, below the skin, and none beyond {FARTHEST_MM} mm"
        ))
    }

    /// True if a place, in mm along the skin and below it, is inside.
    pub fn contains(&self, (along_mm, below_mm): (f64, f64)) -> bool {
        let share = |at: f64, from: f64, to: f64| (2.0 * at - from - to) / (to - from);
        let (x, y) =
            (share(along_mm, self.from_mm, self.to_mm), share(below_mm, self.top_mm, self.bottom_mm));
        x * x + y * y <= 1.0
    }
}

impl From<&Beside> for SceneBeside {
    fn from(beside: &Beside) -> Self {
        Self {
            name: beside.name.clone(),
            along_mm: (beside.from_mm + beside.to_mm) / 2.0,
            depth_mm: (beside.top_mm + beside.bottom_mm) / 2.0,
            width_mm: beside.to_mm - beside.from_mm,
            height_mm: beside.bottom_mm - beside.top_mm,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::named_files::Text;
    use crate::profile::{BUILT_IN, Profile};

    #[test]
    fn an_ellipse_contains_its_middle_and_not_its_corners() {
        let vein = Beside { name: "vein".into(), from_mm: 9.0, to_mm: 13.0, top_mm: 3.5, bottom_mm: 6.5 };
        assert!(vein.contains((11.0, 5.0)) && vein.contains((9.1, 5.0)) && vein.contains((11.0, 6.4)));
        assert!(!vein.contains((9.1, 3.6)) && !vein.contains((8.9, 5.0)) && !vein.contains((11.0, 6.6)));
    }

    #[test]
    fn an_unsound_structure_is_refused() {
        let shoulder = BUILT_IN.iter().find(|(name, _)| *name == "shoulder").expect("it is built in").1;
        for (right, wrong, hint) in [
            ("from_mm = 9.0", "from_mm = 19.0", "reaches from 19 to 13 mm"),
            ("top_mm = 3.5", "top_mm = -3.5", "from -3.5 to 6.5 mm"),
            ("top_mm = 3.5", "top_mm = nan", "from NaN"),
            ("bottom_mm = 6.5", "bottom_mm = 1e9", "none beyond 200 mm"),
            ("name = \"vein\"", "name = \"\"", "beside.name"),
        ] {
            let text = shoulder.replace(right, wrong);
            assert_ne!(text, shoulder, "{right} is in the file");
            let said =
                Profile::parse(Text { origin: "test.toml".into(), text }).expect_err(wrong).to_string();
            assert!(said.contains(hint) && said.contains("test.toml"), "{said}");
        }
    }
}
