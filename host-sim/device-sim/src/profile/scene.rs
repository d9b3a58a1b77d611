//! The scene of a patient that a picture shows.

use super::{InBody, Profile, rupture};
use crate::session::{Scene, SceneBeside, SceneLayer, SceneNeedle, SceneVessel, Source, tissue_name};
use control_core::config::{self, Tissue};

impl Profile {
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

/// `(T − n)²/a + b` of Paper 001, eq. 1, in N; `travel_mm` is T.
fn force_n(parabola: &config::Parabola, travel_mm: f64) -> f64 {
    let from_vertex = travel_mm - parabola.vertex.0.to_num::<f64>();
    from_vertex * from_vertex / parabola.compliance.0.to_num::<f64>() + parabola.base.0.to_num::<f64>()
}
