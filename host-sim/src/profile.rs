//! A patient's tissue and the device's limits, as a person writes them (TOML, decimal numbers with their unit in the key),
//! and as the control law takes them ([`Config`], fixed point). What the control law refuses is refused here too.

use crate::failure::Failure;
use crate::library::{self, Text};
use crate::session::{Scene, SceneLayer, Source, tissue_name};
use control_core::config::{self, Config, DacWidth, FrictionLaw, SpeedMethod, Tissue};
use control_core::units::{
    Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillinewtonMetres, Newtons, Stiffness,
};
use control_core::{Plan, plan};
use fixed::types::{I8F24, I16F16};
use serde::Deserialize;

/// The profiles that come with the program.
pub const BUILT_IN: [(&str, &str); 4] = [
    ("adult", include_str!("../profiles/adult.toml")),
    ("thin-elderly", include_str!("../profiles/thin-elderly.toml")),
    ("high-body-mass", include_str!("../profiles/high-body-mass.toml")),
    ("firm-skin", include_str!("../profiles/firm-skin.toml")),
];

/// A profile that may run.
#[derive(Clone, Debug)]
pub struct Profile {
    /// What it is called.
    pub name: String,
    /// Inclination of the needle below the horizontal at entry, in rad.
    pub entry_rad: f64,
    /// What the device is configured with.
    pub config: Config,
    /// The same, checked.
    pub plan: Plan,
    /// The text that it came from, for recordings.
    pub source: Text,
}

impl Profile {
    /// A built-in profile by its name, or a file by its path.
    pub fn find(wanted: &str) -> Result<Self, Failure> {
        Self::parse(library::find("profile", wanted, &BUILT_IN)?)
    }

    /// Checks the text of a profile.
    pub fn parse(source: Text) -> Result<Self, Failure> {
        let file: File = library::parse(&source)?;
        let refuse = |what: String| Failure::input(format_args!("{}: {what}", source.origin));
        if file.format != 1 {
            return Err(refuse(format!("format is {}; this program reads format 1", file.format)));
        }
        if !(-90.0..=90.0).contains(&file.entry_deg) {
            return Err(refuse(format!("entry_deg is {}; it must lie from -90 to 90", file.entry_deg)));
        }
        let config = file.config().map_err(refuse)?;
        let plan = Plan::new(&config).map_err(|refusal| refuse(say(&refusal, &file)))?;
        Ok(Self { name: file.name, entry_rad: file.entry_deg.to_radians(), config, plan, source })
    }

    /// What a picture needs to know.
    pub fn scene(&self, source: Source, procedure: Option<String>) -> Scene {
        let layers = self.config.layers.iter().map(|layer| SceneLayer {
            name: tissue_name(layer.tissue).to_owned(),
            is_vessel: layer.tissue == Tissue::Vessel,
            top_mm: layer.top.0.to_num(),
            puncture_depth_mm: puncture_depth_mm(layer),
            puncture_force_n: layer.wall.map(|wall| force_n(&wall.elastic, wall.puncture_travel.0.to_num())),
            friction_n_per_mm: layer.friction.0.to_num(),
        });
        Scene {
            hand: source == Source::Virtual,
            source,
            profile: self.name.clone(),
            procedure,
            layers: layers.collect(),
            roller_radius_mm: self.config.device.roller_radius.0.to_num(),
            travel_mm: self.config.limits.travel.0.to_num(),
            largest_force_n: self.plan.largest_force().0.to_num(),
            tilt_rad: self.entry_rad,
        }
    }
}

/// Depth in mm at which the wall of `layer` gives way, where it has one.
pub fn puncture_depth_mm(layer: &config::Layer) -> Option<f64> {
    layer.wall.map(|wall| layer.top.0.to_num::<f64>() + wall.puncture_travel.0.to_num::<f64>())
}

/// `(T − n)²/a + b` of seed 001, eq. 1, in N; `travel_mm` is T.
fn force_n(parabola: &config::Parabola, travel_mm: f64) -> f64 {
    let from_vertex = travel_mm - parabola.vertex.0.to_num::<f64>();
    from_vertex * from_vertex / parabola.compliance.0.to_num::<f64>() + parabola.base.0.to_num::<f64>()
}

/// The control law names layers by number; a person by what they are.
fn say(refusal: &plan::Refusal, file: &File) -> String {
    use plan::Refusal::{
        BeyondTravel, ContactStep, Overlap, ReliefAboveElastic, TooStiff, TooStrong, WrongWay,
    };
    let layer = match *refusal {
        TooStiff { layer, .. } | TooStrong { layer, .. } | Overlap { layer } | ContactStep { layer, .. } => {
            layer
        }
        WrongWay { layer } | ReliefAboveElastic { layer } | BeyondTravel { layer } => layer,
        _ => return refusal.to_string(),
    };
    match file.layer.get(usize::from(layer)) {
        Some(named) => format!("{refusal} (layer {layer} is {})", tissue_name(named.tissue.into())),
        None => refusal.to_string(),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    name: String,
    entry_deg: f64,
    device: Option<Device>,
    limits: Option<Limits>,
    control: Option<Control>,
    friction: Option<Friction>,
    layer: Vec<Layer>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Device {
    roller_radius_mm: f64,
    counts_per_turn: u16,
    full_scale_torque_mnm: f64,
    dac_bits: u8,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Limits {
    torque_mnm: f64,
    continuous_torque_mnm: f64,
    winding_time_s: u16,
    slew_mnm_per_tick: f64,
    fade_in_ms: u16,
    max_counts_per_tick: u16,
    travel_mm: f64,
    stiffness_n_per_mm: f64,
    heartbeat_ms: u16,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Control {
    speed: Speed,
    damping_n_s_per_mm: f64,
    passivity_damping_n_s_per_mm: f64,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Speed {
    Window,
    EdgeTiming,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, tag = "law", rename_all = "kebab-case")]
enum Friction {
    Paper { level_length_mm: f64, level_cap: f64, anchor_ms: u16, stiffness_n_per_mm: f64, limit_n: f64 },
    Cone { stiffness_n_per_mm: f64 },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Layer {
    tissue: TissueName,
    top_mm: f64,
    wall: Option<Wall>,
    friction_n_per_mm: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum TissueName {
    Skin,
    Fat,
    Muscle,
    Vessel,
    Other,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wall {
    elastic: Parabola,
    puncture_mm: f64,
    relief: Parabola,
    unload_n_per_mm: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parabola {
    vertex_mm: f64,
    compliance_mm2_per_n: f64,
    base_n: f64,
}

impl From<TissueName> for Tissue {
    fn from(name: TissueName) -> Self {
        match name {
            TissueName::Skin => Tissue::Skin,
            TissueName::Fat => Tissue::Fat,
            TissueName::Muscle => Tissue::Muscle,
            TissueName::Vessel => Tissue::Vessel,
            TissueName::Other => Tissue::Other,
        }
    }
}

/// A decimal number as the control law holds it; one that it cannot hold is refused by name.
fn fix(key: &str, value: f64) -> Result<I16F16, String> {
    I16F16::checked_from_num(value)
        .ok_or_else(|| format!("{key} is {value}; it must be a number between -32768 and 32768"))
}

fn damping(key: &str, value: f64) -> Result<Damping, String> {
    let held = I8F24::checked_from_num(value);
    held.map(Damping).ok_or_else(|| format!("{key} is {value}; it must be a small number: 0.00002 is usual"))
}

impl File {
    fn config(&self) -> Result<Config, String> {
        let mut config = Config::default();
        config.layers.clear();
        for layer in &self.layer {
            config.layers.push(layer.config()?).map_err(|_| {
                format!("there are {} layers; at most {} are possible", self.layer.len(), config::MAX_LAYERS)
            })?;
        }
        if let Some(device) = &self.device {
            config.device = config::Device {
                roller_radius: Millimetres(fix("roller_radius_mm", device.roller_radius_mm)?),
                counts_per_turn: device.counts_per_turn,
                full_scale_torque: MillinewtonMetres(fix(
                    "full_scale_torque_mnm",
                    device.full_scale_torque_mnm,
                )?),
                dac: match device.dac_bits {
                    8 => DacWidth::Bits8,
                    12 => DacWidth::Bits12,
                    other => return Err(format!("dac_bits is {other}; it must be 8 or 12")),
                },
            };
        }
        if let Some(limits) = &self.limits {
            config.limits = config::SafetyConfig {
                torque: MillinewtonMetres(fix("torque_mnm", limits.torque_mnm)?),
                continuous_torque: MillinewtonMetres(fix(
                    "continuous_torque_mnm",
                    limits.continuous_torque_mnm,
                )?),
                winding_time_s: limits.winding_time_s,
                slew_per_tick: MillinewtonMetres(fix("slew_mnm_per_tick", limits.slew_mnm_per_tick)?),
                fade_in_ms: limits.fade_in_ms,
                max_counts_per_tick: limits.max_counts_per_tick,
                travel: Millimetres(fix("travel_mm", limits.travel_mm)?),
                stiffness: Stiffness(fix("stiffness_n_per_mm", limits.stiffness_n_per_mm)?),
                heartbeat_ms: limits.heartbeat_ms,
            };
        }
        if let Some(control) = &self.control {
            config.speed = match control.speed {
                Speed::Window => SpeedMethod::Window,
                Speed::EdgeTiming => SpeedMethod::EdgeTiming,
            };
            config.damping = damping("damping_n_s_per_mm", control.damping_n_s_per_mm)?;
            config.passivity_damping =
                damping("passivity_damping_n_s_per_mm", control.passivity_damping_n_s_per_mm)?;
        }
        if let Some(friction) = &self.friction {
            config.friction = friction.law()?;
        }
        Ok(config)
    }
}

impl Friction {
    fn law(&self) -> Result<FrictionLaw, String> {
        Ok(match *self {
            Friction::Paper { level_length_mm, level_cap, anchor_ms, stiffness_n_per_mm, limit_n } => {
                FrictionLaw::Paper {
                    level_length: Millimetres(fix("level_length_mm", level_length_mm)?),
                    level_cap: fix("level_cap", level_cap)?,
                    anchor_ms,
                    stiffness: Stiffness(fix("stiffness_n_per_mm", stiffness_n_per_mm)?),
                    limit: Newtons(fix("limit_n", limit_n)?),
                }
            }
            Friction::Cone { stiffness_n_per_mm } => {
                FrictionLaw::Cone { stiffness: Stiffness(fix("stiffness_n_per_mm", stiffness_n_per_mm)?) }
            }
        })
    }
}

impl Layer {
    fn config(&self) -> Result<config::Layer, String> {
        let wall = self.wall.as_ref().map(|wall| {
            Ok::<_, String>(config::Wall {
                elastic: wall.elastic.config()?,
                puncture_travel: Millimetres(fix("puncture_mm", wall.puncture_mm)?),
                relief: wall.relief.config()?,
                unload: Stiffness(fix("unload_n_per_mm", wall.unload_n_per_mm)?),
            })
        });
        Ok(config::Layer {
            tissue: self.tissue.into(),
            top: Millimetres(fix("top_mm", self.top_mm)?),
            wall: wall.transpose()?,
            friction: FrictionPerMillimetre(fix("friction_n_per_mm", self.friction_n_per_mm)?),
        })
    }
}

impl Parabola {
    fn config(&self) -> Result<config::Parabola, String> {
        Ok(config::Parabola {
            vertex: Millimetres(fix("vertex_mm", self.vertex_mm)?),
            compliance: JogCompliance(fix("compliance_mm2_per_n", self.compliance_mm2_per_n)?),
            base: Newtons(fix("base_n", self.base_n)?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(text: impl Into<String>) -> Text {
        Text { origin: "test.toml".into(), text: text.into() }
    }

    #[test]
    fn built_in_profiles_give_way_at_the_forces_and_depths_of_the_design_notes() {
        let table = [
            ("adult", 1.0, 0.5, 4.8, 0.02),
            ("thin-elderly", 0.7, 0.35, 3.0, 0.015),
            ("high-body-mass", 1.2, 0.5, 7.0, 0.03),
            ("firm-skin", 1.5, 0.6, 4.8, 0.025),
        ];
        for (name, skin_n, vein_n, vein_mm, friction) in table {
            let profile = Profile::find(name).expect("it is built in");
            assert!((profile.entry_rad - 30_f64.to_radians()).abs() < 1e-9);
            let scene = profile.scene(Source::Virtual, None);
            let walls: Vec<_> = scene.layers.iter().filter(|l| l.puncture_force_n.is_some()).collect();
            let force = |index: usize| walls[index].puncture_force_n.expect("it is a wall");
            assert!((force(0) - skin_n).abs() < 0.01, "{name}: skin {} N", force(0));
            assert!((force(1) - vein_n).abs() < 0.01, "{name}: vein {} N", force(1));
            assert!(walls[1].is_vessel && (walls[1].top_mm - vein_mm).abs() < 1e-3);
            assert!(scene.layers.iter().all(|l| (l.friction_n_per_mm - friction).abs() < 1e-4));
        }
    }

    #[test]
    fn what_the_control_law_refuses_is_refused_by_file_layer_and_reason() {
        let stiff = BUILT_IN[0].1.replacen("compliance_mm2_per_n = 9.0", "compliance_mm2_per_n = 0.1", 1);
        let said = Profile::parse(text(stiff)).expect_err("60 N/mm would ring").to_string();
        assert!(said.contains("test.toml") && said.contains("N/mm") && said.contains("skin"), "{said}");
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        for (wrong, hint) in [
            (BUILT_IN[0].1.replace("top_mm = 2.0", "top_mm = \"deep\""), "line 24"),
            (BUILT_IN[0].1.replace("friction_n", "frction_n"), "frction_n_per_mm"),
            (BUILT_IN[0].1.replace("format = 1", "format = 9"), "format is 9"),
            (BUILT_IN[0].1.replace("top_mm = 2.0", "top_mm = nan"), "top_mm"),
            (BUILT_IN[0].1.replace("top_mm = 2.0", "top_mm = 1e300"), "top_mm"),
            ("[[layer]".into(), "line 1"),
            (String::new(), "format"),
        ] {
            let said = Profile::parse(text(wrong)).expect_err(hint).to_string();
            assert!(said.contains(hint) && said.contains("test.toml") && !said.contains('\n'), "{said}");
        }
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones() {
        let said = Profile::find("giant").expect_err("there is none").to_string();
        assert!(said.contains("giant") && said.contains("adult, thin-elderly"), "{said}");
        let said = Profile::find("/no/such.toml").expect_err("there is none").to_string();
        assert!(said.contains("/no/such.toml") && said.contains("cannot be read"), "{said}");
    }
}
