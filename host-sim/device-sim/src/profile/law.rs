//! The `[law]` of a profile and what it needs elsewhere in the file: which law of force counts,
//! with its own numbers. Numbers are only taken over here; whether they may run is the control
//! law's to say.

use super::force_table::{Forces, mrad};
use super::{Layer, fix};
use control_core::config::{Cutting, Fixture, FrictionLaw, Law, Lugre, Sparte};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, Newtons, Stiffness};
use fixed::types::I8F24;
use serde::Deserialize;

/// The law of force, by the name that `--model` has for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// The jog effect and friction cone of the venepuncture device (Paper 001).
    Jog,
    /// Tracking walls and LuGre friction of the joint injection simulator (Paper 002).
    Sparte,
    /// The fitted force table of the layered-tissue simulator (Paper 000).
    Xr,
}

impl Model {
    /// As `--model` and `law.model` call it.
    pub fn name(self) -> &'static str {
        match self {
            Model::Jog => "jog",
            Model::Sparte => "sparte",
            Model::Xr => "xr",
        }
    }

    /// The built-in patient whose law it is.
    pub fn patient(self) -> &'static str {
        match self {
            Model::Jog => "adult",
            Model::Sparte => "shoulder",
            Model::Xr => "phantom",
        }
    }

    /// The one that `law` is.
    pub fn of(law: &Law) -> Self {
        match law {
            Law::Jog(_) => Model::Jog,
            Law::Sparte(_) => Model::Sparte,
            Law::Xr(_) => Model::Xr,
        }
    }
}

/// Share of the cutting force that is left where a wall has just given way; an assumption where it
/// is left out: the paper gives none.
fn after_puncture() -> f64 {
    0.6
}

/// `[law]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, tag = "model", rename_all = "kebab-case")]
pub(super) enum LawTable {
    /// Its friction is in `[friction]`.
    Jog {},
    /// The polynomials of its walls and its cutting forces are in the layers.
    Sparte {
        tracking_n_per_mm: f64,
        relax_ms: u16,
        #[serde(default = "after_puncture")]
        after_puncture: f64,
        /// A wall resists no more to a fast needle if it is left out: the paper has no rate term.
        #[serde(default)]
        wall_rate_s_per_mm: f64,
        friction: Bristles,
        fixture: Direction,
    },
    /// Its table is in `[force_table]`, as `fit-force` writes it.
    Xr { stiffness_n_per_mm: f64, withdrawal: f64 },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Bristles {
    stiffness_n_per_mm: f64,
    damping_n_s_per_mm: f64,
    viscous_n_s_per_mm: f64,
    sliding_n: f64,
    sticking_n: f64,
    stribeck_mm_s: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Direction {
    lateral_n_per_deg: f64,
    largest_deg: f64,
}

/// `[friction]`, of the jog law.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, tag = "law", rename_all = "kebab-case")]
pub(super) enum Friction {
    Paper {
        level_length_mm: f64,
        level_cap: f64,
        anchor_ms: u16,
        stiffness_n_per_mm: f64,
        limit_n: f64,
        /// T_f_min as a magnitude; that of T_f_max if left out.
        limit_out_n: Option<f64>,
    },
    Cone {
        stiffness_n_per_mm: f64,
    },
    StickSlip {
        stiffness_n_per_mm: f64,
        sliding: f64,
    },
}

/// `cutting` of a layer.
#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Cut {
    pub(super) inwards_n: f64,
    pub(super) outwards_n: f64,
}

/// The law that a file's parts make, or in a sentence which key is missing or too many. Without a
/// `[friction]`, the jog law keeps `usual`.
pub(super) fn law(
    table: Option<&LawTable>,
    friction: Option<&Friction>,
    forces: Option<&Forces>,
    layers: &[Layer],
    usual: &Law,
) -> Result<Law, String> {
    let law = match table {
        None | Some(LawTable::Jog {}) => match friction {
            Some(friction) => Law::Jog(friction.law()?),
            None => usual.clone(),
        },
        Some(LawTable::Sparte {
            tracking_n_per_mm,
            relax_ms,
            after_puncture,
            wall_rate_s_per_mm,
            friction,
            fixture,
        }) => Law::Sparte(Sparte {
            tracking: Stiffness(fix("tracking_n_per_mm", *tracking_n_per_mm)?),
            relax_ms: *relax_ms,
            after_puncture: fix("after_puncture", *after_puncture)?,
            cutting: cutting(layers)?.into_iter().collect(),
            friction: friction.lugre()?,
            fixture: fixture.fixture()?,
            wall_rate: fix("wall_rate_s_per_mm", *wall_rate_s_per_mm)?,
        }),
        Some(LawTable::Xr { stiffness_n_per_mm, withdrawal }) => {
            let forces = forces
                .ok_or("[force_table] is missing; law.model xr needs the table that fit-force writes")?;
            Law::Xr(forces.table(*stiffness_n_per_mm, *withdrawal)?)
        }
    };
    let (model, name) = (Model::of(&law), Model::of(&law).name());
    let foreign = |key: &str, owner: Model| {
        Err(format!(
            "{key} is the law {}'s and law.model is {name}; remove it or change law.model",
            owner.name()
        ))
    };
    if friction.is_some() && model != Model::Jog {
        return foreign("[friction]", Model::Jog);
    }
    if forces.is_some() && model != Model::Xr {
        return foreign("[force_table]", Model::Xr);
    }
    if layers.iter().any(|layer| layer.cutting.is_some()) && model != Model::Sparte {
        return foreign("cutting", Model::Sparte);
    }
    let rubs = |layer: &Layer| layer.friction_n_per_mm.is_some();
    match model {
        Model::Jog if !layers.iter().all(rubs) => {
            Err("friction_n_per_mm is missing in a layer; law.model jog needs it in each".into())
        }
        Model::Sparte | Model::Xr if layers.iter().any(rubs) => foreign("friction_n_per_mm", Model::Jog),
        _ => Ok(law),
    }
}

/// Returns the cutting of each layer, of which there are not too many.
fn cutting(layers: &[Layer]) -> Result<Vec<Cutting>, String> {
    layers
        .iter()
        .map(|layer| {
            let cut = layer.cutting.as_ref();
            let cut = cut.ok_or(
                "cutting is missing in a layer; law.model sparte needs { inwards_n, outwards_n } in each",
            )?;
            Ok(Cutting {
                inwards: Newtons(fix("inwards_n", cut.inwards_n)?),
                outwards: Newtons(fix("outwards_n", cut.outwards_n)?),
            })
        })
        .collect()
}

impl Bristles {
    /// Multiplies the friction by `factor`; the stiffness of the bristles stays.
    pub(super) fn scale(&mut self, factor: f64) {
        for value in [
            &mut self.damping_n_s_per_mm,
            &mut self.viscous_n_s_per_mm,
            &mut self.sliding_n,
            &mut self.sticking_n,
        ] {
            *value *= factor;
        }
    }

    fn lugre(&self) -> Result<Lugre, String> {
        Ok(Lugre {
            stiffness: Stiffness(fix("stiffness_n_per_mm", self.stiffness_n_per_mm)?),
            damping: damping("damping_n_s_per_mm", self.damping_n_s_per_mm)?,
            viscous: damping("viscous_n_s_per_mm", self.viscous_n_s_per_mm)?,
            sliding: Newtons(fix("sliding_n", self.sliding_n)?),
            sticking: Newtons(fix("sticking_n", self.sticking_n)?),
            speed: MillimetresPerSecond(fix("stribeck_mm_s", self.stribeck_mm_s)?),
        })
    }
}

fn damping(key: &str, value: f64) -> Result<Damping, String> {
    I8F24::checked_from_num(value)
        .map(Damping)
        .ok_or_else(|| format!("{key} is {value}; it must be a number between -128 and 128"))
}

impl Direction {
    fn fixture(&self) -> Result<Fixture, String> {
        Ok(Fixture {
            per_mrad: Newtons(fix("lateral_n_per_deg", self.lateral_n_per_deg * 1f64.to_degrees() * 1e-3)?),
            largest: mrad("largest_deg", self.largest_deg)?,
        })
    }
}

impl Friction {
    fn law(&self) -> Result<FrictionLaw, String> {
        Ok(match *self {
            Friction::Paper {
                level_length_mm,
                level_cap,
                anchor_ms,
                stiffness_n_per_mm,
                limit_n,
                limit_out_n,
            } => FrictionLaw::Paper {
                level_length: Millimetres(fix("level_length_mm", level_length_mm)?),
                level_cap: fix("level_cap", level_cap)?,
                anchor_ms,
                stiffness: Stiffness(fix("stiffness_n_per_mm", stiffness_n_per_mm)?),
                limit: Newtons(fix("limit_n", limit_n)?),
                limit_out: Newtons(fix("limit_out_n", limit_out_n.unwrap_or(limit_n))?),
            },
            Friction::Cone { stiffness_n_per_mm } => {
                FrictionLaw::Cone { stiffness: Stiffness(fix("stiffness_n_per_mm", stiffness_n_per_mm)?) }
            }
            Friction::StickSlip { stiffness_n_per_mm, sliding } => FrictionLaw::StickSlip {
                stiffness: Stiffness(fix("stiffness_n_per_mm", stiffness_n_per_mm)?),
                sliding: fix("sliding", sliding)?,
            },
        })
    }
}
