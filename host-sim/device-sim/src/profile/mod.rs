//! A patient, as a person writes one (TOML, decimal numbers with their unit in the key), and as the
//! control law takes it ([`Patient`], fixed point). It holds nothing of the device: that is
//! `crate::device::device_config`. What the control law refuses is refused here too.

mod beside;
mod body;
mod bone;
mod condition;
mod entry;
mod force_table;
mod goal;
mod law;
mod needle;
mod person;
mod refusal;
mod rupture;
mod scene;
mod tissues;

use crate::error::Error;
use crate::named_files::{self, Text};
use crate::session::tissue_name;
use control_core::config::{self, Config, Tissue};
use control_core::units::{FrictionPerMillimetre, JogCompliance, Millimetres, Newtons, Stiffness};
use control_core::{Device, Patient, Plan};
use fixed::types::I16F16;
use force_table::Forces;
use needle::Needle;
use person::Thickness;
use serde::Deserialize;

pub use beside::Beside;
pub use body::InBody;
pub(crate) use entry::check_entry;
pub use entry::{Entry, Slope};
pub use goal::Goal;
pub use law::Model;
pub use person::{Difficulty, Person, Sex, Site};
pub(crate) use tissues::TissueName;

/// The procedure of a patient whose file names none.
pub(crate) const USUAL_PROCEDURE: &str = "venepuncture";

/// The profiles that come with the program.
pub const BUILT_IN: [(&str, &str); 12] = [
    ("adult", include_str!("../../../profiles/adult.toml")),
    ("thin-elderly", include_str!("../../../profiles/thin-elderly.toml")),
    ("high-body-mass", include_str!("../../../profiles/high-body-mass.toml")),
    ("firm-skin", include_str!("../../../profiles/firm-skin.toml")),
    ("dorsal-hand", include_str!("../../../profiles/dorsal-hand.toml")),
    ("child", include_str!("../../../profiles/child.toml")),
    ("shoulder", include_str!("../../../profiles/shoulder.toml")),
    ("phantom", include_str!("../../../profiles/phantom.toml")),
    ("shoulder-joint", include_str!("../../../profiles/shoulder-joint.toml")),
    ("forearm", include_str!("../../../profiles/forearm.toml")),
    ("knee", include_str!("../../../profiles/knee.toml")),
    ("hip", include_str!("../../../profiles/hip.toml")),
];

/// A profile that may run.
#[derive(Clone, Debug)]
pub struct Profile {
    /// Its name.
    pub name: String,
    /// Angle of the needle to the skin at entry, in rad.
    pub entry_rad: f64,
    /// The angles to the skin between which the device's barrier holds the needle, if it has one.
    pub slope: Option<Slope>,
    /// The device's configuration: its own part and this patient.
    pub config: Config,
    /// The same, checked.
    pub plan: Plan,
    /// The person whom it represents.
    pub person: Person,
    /// The default procedure of a scripted hand.
    pub procedure: String,
    /// Layers, by their numbers, that the needle is to spare.
    pub spared: Vec<u8>,
    /// Structures next to the needle's way that it is to spare.
    pub beside: Vec<Beside>,
    /// Bone under level layers, perpendicular to the skin, mm.
    pub(crate) bone_mm: Option<f64>,
    /// The body that its layers come from, if it has one.
    pub body: Option<InBody>,
    /// The needle's target.
    goal: Option<goal::Written>,
    /// True if the patient has a vein that is not to be spared, on the needle's line or off it.
    has_vein: bool,
    /// The text that it came from, for recordings.
    pub source: Text,
}

impl Profile {
    /// A built-in profile by its name, or a file by its path, for the built-in device.
    pub fn find(wanted: &str) -> Result<Self, Error> {
        Self::find_for(wanted, &Device::commissioned_virtual())
    }

    /// A built-in profile by its name, or a file by its path, for `device`.
    pub fn find_for(wanted: &str, device: &Device) -> Result<Self, Error> {
        Self::parse_for(named_files::find("profile", wanted, &BUILT_IN)?, device)
    }

    /// Checks the text of a profile for the built-in device.
    pub fn parse(source: Text) -> Result<Self, Error> {
        Self::parse_for(source, &Device::commissioned_virtual())
    }

    /// Checks the text of a profile for `device`.
    pub fn parse_for(source: Text, device: &Device) -> Result<Self, Error> {
        let mut file: File = named_files::parse(&source)?;
        let refuse = |what: String| Error::input(format_args!("{}: {what}", source.origin));
        if file.format != 1 {
            return Err(refuse(format!("format is {}; this program reads format 1", file.format)));
        }
        file.slope_deg.map_or(Ok(()), Slope::check).map_err(refuse)?;
        check_entry("entry_deg", file.entry_deg, file.slope_deg).map_err(refuse)?;
        file.patient.check().map_err(refuse)?;
        file.beside.iter().try_for_each(Beside::check).map_err(refuse)?;
        condition::apply(&mut file.layer, &file.patient, file.force_table.is_some()).map_err(refuse)?;
        if let Some(needle) = file.needle {
            needle.apply(&mut file.layer, file.law.as_mut()).map_err(refuse)?;
        }
        file.target.map_or(Ok(()), |goal| goal.check(&file.layer)).map_err(refuse)?;
        check_vessels(&file.layer).map_err(refuse)?;
        let is_vein = |layer: &Layer| layer.tissue == TissueName::Vessel && !layer.is_spared();
        let has_vein = file.layer.iter().any(is_vein);
        let body = file.take_body().map_err(refuse)?;
        let config = Config { device: *device, patient: file.config().map_err(refuse)? };
        let bone_mm = file.bone_mm(&config.patient).map_err(refuse)?;
        let plan = config.plan().map_err(|refusal| refuse(refusal::say(&refusal, &file)))?;
        let spared =
            (0_u8..).zip(&file.layer).filter(|(_, layer)| layer.is_spared()).map(|(number, _)| number);
        Ok(Self {
            spared: spared.collect(),
            goal: file.target,
            has_vein,
            beside: file.beside,
            bone_mm,
            body,
            procedure: file.procedure.unwrap_or_else(|| USUAL_PROCEDURE.into()),
            person: file.patient,
            name: file.name,
            entry_rad: file.entry_deg.to_radians(),
            slope: file.slope_deg,
            config,
            plan,
            source,
        })
    }

    /// Its law of force.
    pub fn model(&self) -> Model {
        Model::of(&self.config.patient.law)
    }

    /// The same patient with another angle to the skin at entry, 5 to 90° and within its slope.
    pub fn at_angle(self, degrees: f64) -> Result<Self, Error> {
        check_entry("--angle", degrees, self.slope).map_err(Error::input)?;
        if self.body.is_some() {
            return self.entered(&Entry { angle_deg: Some(degrees), ..Entry::default() });
        }
        Ok(Self { entry_rad: degrees.to_radians(), ..self })
    }

    /// Returns the name of layer `number`.
    pub fn layer_name(&self, number: u8) -> Option<String> {
        if let Some(body) = &self.body {
            return body.names.get(usize::from(number)).cloned();
        }
        let layer = self.config.patient.layers.get(usize::from(number))?;
        Some(tissue_name(layer.tissue).to_owned())
    }

    /// Returns the number of the vessel's far wall.
    pub fn far_wall(&self) -> Option<u8> {
        let mut layers = (0_u8..).zip(&self.config.patient.layers);
        layers.find(|(_, layer)| layer.tissue == Tissue::FarWall).map(|(number, _)| number)
    }

    /// Returns for each layer, outermost first, whether it has a wall that gives way.
    pub fn walls(&self) -> Vec<bool> {
        goal::walls(&self.config.patient, self.entry_rad)
    }

    /// Returns the needle's target: that of the file, else the vessel's lumen if there is a vessel.
    pub fn goal(&self) -> Option<Goal> {
        goal::goal(self.goal, &self.config.patient, self.entry_rad, self.body.is_some())
    }

    /// Returns the tissue that the needle is to come into: that of the file, else a vein that is
    /// not to be spared. It does not depend on the needle's line.
    pub fn aim(&self) -> Option<Tissue> {
        self.goal.map(goal::Written::tissue).or(self.has_vein.then_some(Tissue::Vessel))
    }

    /// Inclination of the needle laid on the skin, in rad.
    pub fn skin_tilt_rad(&self) -> f64 {
        f64::from(self.config.device.skin_tilt.0) * 1e-3
    }

    /// Inclination of the needle below the horizontal at entry, in rad.
    pub fn tilt_rad(&self) -> f64 {
        self.entry_rad + self.skin_tilt_rad()
    }
}

/// Depth in mm along a needle at `angle_rad` to the skin at which the wall of `layer` gives way,
/// where it has one.
pub(crate) fn puncture_path_mm(layer: &config::Layer, angle_rad: f64) -> Option<f64> {
    let wall = layer.wall?;
    Some(layer.depth.0.to_num::<f64>() / libm::sin(angle_rad) + wall.puncture_travel.0.to_num::<f64>())
}

/// Refuses a vessel without a far wall: through it a needle would stay in the lumen for ever.
fn check_vessels(layers: &[Layer]) -> Result<(), String> {
    let number = |tissue| layers.iter().position(|layer| layer.tissue == tissue);
    match (number(TissueName::Vessel), number(TissueName::FarWall)) {
        (Some(near), None) => Err(format!(
            "layer {near} is a vessel without a far wall; add a layer of tissue \"far-wall\" below it"
        )),
        _ => Ok(()),
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    name: String,
    /// Angle of the needle to the skin at entry, 5 to 90 degrees.
    entry_deg: f64,
    /// The range of angles to the skin that the device's barrier leaves.
    slope_deg: Option<Slope>,
    /// In N; without it, as much as the device gives.
    largest_force_n: Option<f64>,
    /// Share of the law's forces that is given to the hand, where the motor is too weak for them.
    force_scale: Option<f64>,
    procedure: Option<String>,
    #[serde(default)]
    patient: Person,
    law: Option<law::LawTable>,
    friction: Option<law::Friction>,
    needle: Option<Needle>,
    force_table: Option<Forces>,
    layer: Vec<Layer>,
    body: Option<body::Written>,
    vessel: Option<Vessel>,
    target: Option<goal::Written>,
    #[serde(default)]
    beside: Vec<Beside>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Vessel {
    /// Across the vessel, mm; its height is from its near to its far wall.
    width_mm: f64,
    /// Distance of its axis from the needle's plane, mm.
    #[serde(default)]
    offset_mm: f64,
}

#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Layer {
    tissue: TissueName,
    /// True if the needle must avoid it; by default as in Paper 002, tendon and cartilage.
    spare: Option<bool>,
    /// Perpendicular to the skin; in a body it follows from the line and is in no file.
    depth_mm: Option<f64>,
    /// The rule for its thickness; the layers below move with it.
    thickness: Option<Thickness>,
    /// Bone lies under it, this far below its top, mm; in a body it follows from the line.
    over_bone_mm: Option<f64>,
    wall: Option<Wall>,
    /// For the jog law.
    friction_n_per_mm: Option<f64>,
    /// For the law of Paper 002.
    cutting: Option<law::Cut>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Wall {
    /// Force while it is pushed in.
    elastic: Parabola,
    /// Travel past contact along the needle at which it gives way, mm.
    puncture_mm: f64,
    /// Force from there on.
    relief: Parabola,
    /// Slope by which its force falls when the needle is drawn back, N/mm.
    unload_n_per_mm: f64,
    /// An assumption where it is left out: nobody gives it.
    spring_back: Option<f64>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct Parabola {
    /// Travel n at which the force is least, mm; `(T − n)²/a + b` is the force after a travel T.
    vertex_mm: f64,
    /// a, mm²/N.
    compliance_mm2_per_n: f64,
    /// The least force b, N.
    base_n: f64,
}

/// A decimal number as the control law holds it; one that it cannot hold is refused by name.
pub(crate) fn fix(key: &str, value: f64) -> Result<I16F16, String> {
    I16F16::checked_from_num(value)
        .ok_or_else(|| format!("{key} is {value}; it must be a number between -32768 and 32768"))
}

impl File {
    fn config(&self) -> Result<Patient, String> {
        let mut patient = Patient::default();
        patient.layers.clear();
        for (layer, depth_mm) in self.layer.iter().zip(person::depths_mm(&self.layer, &self.patient)?) {
            patient.layers.push(layer.config(depth_mm)?).map_err(|_| {
                format!("there are {} layers; at most {} are possible", self.layer.len(), config::MAX_LAYERS)
            })?;
        }
        if let Some(force) = self.largest_force_n {
            patient.largest_force = Some(Newtons(fix("largest_force_n", force)?));
        }
        patient.vessel = match &self.vessel {
            None => None,
            Some(vessel) => Some(config::Vessel {
                width: Millimetres(fix("width_mm", vessel.width_mm)?),
                offset: Millimetres(fix("offset_mm", vessel.offset_mm)?),
            }),
        };
        if let Some(scale) = self.force_scale {
            patient.scale = fix("force_scale", scale)?;
        }
        patient.law = law::law(
            self.law.as_ref(),
            self.friction.as_ref(),
            self.force_table.as_ref(),
            &self.layer,
            &patient.law,
        )?;
        Ok(patient)
    }
}

impl Layer {
    fn is_spared(&self) -> bool {
        self.spare.unwrap_or(matches!(self.tissue, TissueName::Tendon | TissueName::Cartilage))
    }

    /// True if a needle that comes into it from a layer `above` feels no change.
    fn feels_like(&self, above: &Self) -> bool {
        let is_like = self.cutting == above.cutting && self.friction_n_per_mm == above.friction_n_per_mm;
        self.wall.is_none() && !self.is_spared() && is_like
    }

    fn config(&self, depth_mm: f64) -> Result<config::Layer, String> {
        let wall = self.wall.as_ref().map(|wall| {
            Ok::<_, String>(config::Wall {
                elastic: wall.elastic.config()?,
                puncture_travel: Millimetres(fix("puncture_mm", wall.puncture_mm)?),
                relief: wall.relief.config()?,
                unload: Stiffness(fix("unload_n_per_mm", wall.unload_n_per_mm)?),
                spring_back: match wall.spring_back {
                    Some(share) => fix("spring_back", share)?,
                    None => config::SPRING_BACK,
                },
            })
        });
        Ok(config::Layer {
            tissue: self.tissue.into(),
            depth: Millimetres(fix("depth_mm", depth_mm)?),
            wall: wall.transpose()?,
            friction: FrictionPerMillimetre(fix(
                "friction_n_per_mm",
                self.friction_n_per_mm.unwrap_or_default(),
            )?),
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
mod tests;
