//! A patient, as a person writes one (TOML, decimal numbers with their unit in the key), and as the
//! control law takes it ([`Patient`], fixed point). It holds nothing of the device: that is
//! `crate::device::device_config`. What the control law refuses is refused here too.

mod beside;
mod body;
mod bone;
mod condition;
mod entry;
mod file;
mod force_table;
mod goal;
mod law;
mod needle;
mod person;
mod refusal;
mod rupture;
mod tissues;

use crate::error::Error;
use crate::named_files::{self, Text};
use crate::session::{Scene, SceneBeside, SceneLayer, SceneNeedle, SceneVessel, Source, tissue_name};
use control_core::config::{self, Config, Tissue};
use control_core::{Device, Plan};

pub use beside::Beside;
pub use body::InBody;
pub(crate) use entry::check_entry;
pub use entry::{Entry, Slope};
pub(crate) use file::fix;
use file::{File, Layer};
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

    /// Returns the scene for a picture.
    pub fn scene(&self, source: Source, procedure: Option<String>) -> Scene {
        let ruptures = rupture::ruptures(&self.config.patient, self.entry_rad);
        let sine = libm::sin(self.entry_rad);
        let goal = self.goal();
        let layers = self.config.patient.layers.iter().enumerate().map(|(index, layer)| SceneLayer {
            name: tissue_name(layer.tissue).to_owned(),
            structure: self.body.as_ref().and_then(|body| body.names.get(index).cloned()),
            is_vessel: layer.tissue == Tissue::Vessel,
            is_far_wall: layer.tissue == Tissue::FarWall,
            depth_mm: layer.depth.0.to_num(),
            reach_mm: goal.as_ref().filter(|goal| usize::from(goal.layer) == index).and_then(|goal| {
                let (from, to) = goal.reach_mm?;
                Some([from, to])
            }),
            puncture_travel_mm: match layer.wall {
                Some(wall) => Some(wall.puncture_travel.0.to_num()),
                None => ruptures.iter().find(|r| r.layer == index).map(|r| r.below_mm / sine),
            },
            spring_back: layer.wall.map(|wall| wall.spring_back.to_num()),
            puncture_force_n: match layer.wall {
                Some(wall) => Some(force_n(&wall.elastic, wall.puncture_travel.0.to_num())),
                None => ruptures.iter().find(|r| r.layer == index).map(|r| r.force_n),
            },
            friction_n_per_mm: layer.friction.0.to_num(),
        });
        let deepest_mm = self.config.patient.layers.last().map_or(0.0, |layer| layer.depth.0.to_num::<f64>());
        Scene {
            hand: source == Source::Virtual,
            source,
            profile: self.name.clone(),
            procedure,
            layers: layers.collect(),
            roller_radius_mm: self.config.device.roller_radius.0.to_num(),
            travel_mm: self.config.device.limits.travel.0.to_num(),
            largest_force_n: self.plan.largest_force().0.to_num(),
            force_scale: self.config.patient.scale.to_num(),
            tilt_rad: self.tilt_rad(),
            skin_tilt_rad: self.skin_tilt_rad(),
            slope_deg: self.slope.map(|slope| [slope.smallest, slope.largest]),
            vessel: self.vessel().filter(|_| self.body.is_none()),
            body: self.body.as_ref().map(InBody::scene),
            beside: self.beside.iter().map(SceneBeside::from).collect(),
            needle: SceneNeedle::reaching(deepest_mm / libm::sin(self.entry_rad)),
        }
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

    fn vessel(&self) -> Option<SceneVessel> {
        let layers = &self.config.patient.layers;
        let depth_mm = |tissue| {
            let layer = layers.iter().find(|layer| layer.tissue == tissue)?;
            Some(layer.depth.0.to_num::<f64>())
        };
        let (near, far) = (depth_mm(Tissue::Vessel)?, depth_mm(Tissue::FarWall)?);
        let shape = self.config.patient.vessel;
        Some(SceneVessel {
            axis_mm: (near + far) / 2.0,
            height_mm: far - near,
            width_mm: shape.map_or(far - near, |shape| shape.width.0.to_num()),
            offset_mm: shape.map_or(0.0, |shape| shape.offset.0.to_num()),
        })
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

/// `(T − n)²/a + b` of Paper 001, eq. 1, in N; `travel_mm` is T.
fn force_n(parabola: &config::Parabola, travel_mm: f64) -> f64 {
    let from_vertex = travel_mm - parabola.vertex.0.to_num::<f64>();
    from_vertex * from_vertex / parabola.compliance.0.to_num::<f64>() + parabola.base.0.to_num::<f64>()
}

#[cfg(test)]
mod tests;
