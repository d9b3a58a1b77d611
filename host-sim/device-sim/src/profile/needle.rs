//! `[needle]` of a patient: its tip, gauge and lubrication as factors of the forces. None of the
//! three papers gives a force for any needle. The forces of a file are those of a bevelled,
//! lubricated needle of 22 G, an assumption; without `[needle]` they stay as they are.

use super::law::LawTable;
use super::{Layer, Wall};
use serde::Deserialize;

/// Outer diameter by gauge, mm: ISO 9626.
const DIAMETERS_MM: [(u8, f64); 13] = [
    (14, 2.11),
    (16, 1.65),
    (17, 1.47),
    (18, 1.27),
    (19, 1.07),
    (20, 0.91),
    (21, 0.82),
    (22, 0.72),
    (23, 0.64),
    (24, 0.57),
    (25, 0.51),
    (27, 0.41),
    (30, 0.31),
];
/// The gauge of the file's own forces, and its diameter, mm.
const OWN: (u8, f64) = (22, 0.72);
/// Force of a dry needle over that of a lubricated one: Schneider 1978 found 1.5 to 3. That it is
/// 1.6 is an assumption: in the adult the motor gives no more.
const DRY: f64 = 1.6;

/// `[needle]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Needle {
    #[serde(default)]
    tip: Tip,
    /// The gauge of its outer diameter.
    #[serde(default = "own_gauge")]
    gauge: u8,
    #[serde(default = "lubricated")]
    lubricated: bool,
}

fn own_gauge() -> u8 {
    OWN.0
}

fn lubricated() -> bool {
    true
}

/// The shape of a tip. That it changes the force was measured (Okamura 2004, IEEE TBME 51:1707;
/// Jiang 2014, J Biomech 47:3344); how much it does here is an assumption.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Tip {
    #[default]
    Bevel,
    Conical,
    Triangular,
}

impl Tip {
    /// Returns its share of the bevelled tip's force.
    fn factor(self) -> f64 {
        match self {
            Self::Bevel => 1.0,
            // It has no edge and parts the tissue by its cone: an assumption.
            Self::Conical => 1.3,
            // Three edges: an assumption.
            Self::Triangular => 0.8,
        }
    }
}

impl Needle {
    /// Returns the factors of what gives way and is cut at the tip, and of the friction along the
    /// shaft.
    ///
    /// Both go with the diameter: of 61 % tearing, 18 % spreading and 21 % friction in porcine skin
    /// (Barnett 2015, doi:10.1115/1.4030374) the crack is as long as the diameter and the shaft's
    /// surface in proportion to it. That spreading is so too is an assumption.
    fn factors(self) -> Result<[f64; 2], String> {
        let known = DIAMETERS_MM.iter().find(|(gauge, _)| *gauge == self.gauge);
        let (_, diameter_mm) = known.ok_or_else(|| {
            let known: Vec<String> = DIAMETERS_MM.iter().map(|(gauge, _)| gauge.to_string()).collect();
            format!("needle.gauge is {}; use one of {}", self.gauge, known.join(", "))
        })?;
        let shaft = diameter_mm / OWN.1 * if self.lubricated { 1.0 } else { DRY };
        Ok([shaft * self.tip.factor(), shaft])
    }

    /// Scales the forces of `layers` and of the law's friction.
    pub(super) fn apply(self, layers: &mut [Layer], law: Option<&mut LawTable>) -> Result<(), String> {
        let [tip, shaft] = self.factors()?;
        match law {
            Some(LawTable::Xr { .. }) => {
                return Err("[needle] changes nothing here: the forces of law.model xr come from its table; remove it".into());
            }
            Some(LawTable::Sparte { friction, .. }) => friction.scale(shaft),
            Some(LawTable::Jog {}) | None => {}
        }
        for layer in layers {
            if let Some(wall) = &mut layer.wall {
                dent(wall, tip);
            }
            if let Some(cutting) = &mut layer.cutting {
                cutting.inwards_n *= tip;
                cutting.outwards_n *= tip;
            }
            layer.friction_n_per_mm = layer.friction_n_per_mm.map(|friction| friction * shaft);
        }
        Ok(())
    }
}

/// Lets a wall give way at `factor` times its force. The tissue is as stiff as before: a needle
/// that takes more force dents it further.
fn dent(wall: &mut Wall, factor: f64) {
    let further = factor.sqrt();
    wall.puncture_mm *= further;
    for parabola in [&mut wall.elastic, &mut wall.relief] {
        parabola.vertex_mm *= further;
        parabola.base_n *= factor;
    }
}

#[cfg(test)]
mod tests {
    use crate::named_files::Text;
    use crate::profile::{BUILT_IN, Profile};
    use crate::session::Source;
    use control_core::config::Law;

    fn with(name: &str, needle: &str) -> Result<Profile, String> {
        let file = BUILT_IN.iter().find(|(own, _)| *own == name).expect("it is built in").1;
        let text =
            format!("{}\n[needle]\n{needle}\n", file.replace("force_scale = 0.65", "force_scale = 0.3"));
        Profile::parse(Text { origin: "test.toml".into(), text }).map_err(|refused| refused.to_string())
    }

    /// Force at which the adult's skin gives way and friction, relative to the file's.
    fn of_the_files(needle: &str) -> [f64; 2] {
        let of = |needle: &str| {
            let scene = with("adult", needle).expect(needle).scene(Source::Virtual, None);
            [scene.layers[0].puncture_force_n.expect("a wall"), scene.layers[0].friction_n_per_mm]
        };
        let (own, other) = (of(""), of(needle));
        [0, 1].map(|index: usize| other[index] / own[index])
    }

    fn near(found: [f64; 2], wanted: [f64; 2]) -> bool {
        found.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 0.01)
    }

    /// Diameters of ISO 9626: 20 G is 0.91 mm, 22 G 0.72 mm, 25 G 0.51 mm.
    #[test]
    fn tip_gauge_and_lubrication_scale_the_forces() {
        for (needle, wanted) in [
            ("tip = \"bevel\"\ngauge = 22\nlubricated = true", [1.0, 1.0]),
            ("gauge = 20", [0.91 / 0.72; 2]),
            ("gauge = 25", [0.51 / 0.72; 2]),
            ("tip = \"triangular\"", [0.8, 1.0]),
            ("tip = \"conical\"\ngauge = 25", [1.3 * 0.51 / 0.72, 0.51 / 0.72]),
        ] {
            assert!(near(of_the_files(needle), wanted), "{needle}: {:?}", of_the_files(needle));
        }
        // Schneider 1978: dry needles take 1.5 to 3 times the force of lubricated ones.
        let dry = of_the_files("lubricated = false");
        assert!(dry.iter().all(|factor| (1.5..=3.0).contains(factor)), "{dry:?}");
        // The tissue is as stiff as it was: 1 N after 3 mm in the file, 1.6 N after 3·√1.6 mm.
        let skin = with("adult", "lubricated = false").expect("it may run").config.patient.layers[0];
        let travel_mm: f64 = skin.wall.expect("a wall").puncture_travel.0.to_num();
        assert!((travel_mm - 3.0 * 1.6_f64.sqrt()).abs() < 1e-3, "{travel_mm} mm");
    }

    #[test]
    fn cutting_and_lugre_friction_follow_too() {
        let law = |needle: &str| match with("shoulder", needle).expect(needle).config.patient.law {
            Law::Sparte(law) => {
                [law.cutting[3].inwards, law.cutting[3].outwards, law.friction.sliding, law.friction.sticking]
                    .map(|force| force.0.to_num::<f64>())
            }
            other => panic!("{other:?}"),
        };
        let (own, other) = (law(""), law("tip = \"triangular\"\ngauge = 20"));
        let shaft = 0.91 / 0.72;
        for (index, factor) in [0.8 * shaft, 0.8 * shaft, shaft, shaft].into_iter().enumerate() {
            assert!((other[index] / own[index] - factor).abs() < 0.01, "{index}: {own:?} and {other:?}");
        }
    }

    #[test]
    fn a_needle_that_cannot_be_is_refused() {
        for (name, needle, hint) in [
            ("adult", "gauge = 26", "needle.gauge is 26; use one of 14, 16"),
            ("adult", "tip = \"blunt\"", "blunt"),
            ("phantom", "gauge = 20", "come from its table"),
            ("adult", "gauge = 14\nlubricated = false", "layer"),
        ] {
            let said = with(name, needle).expect_err(needle);
            assert!(said.contains(hint) && said.contains("test.toml"), "{needle}: {said}");
        }
    }
}
