//! A patient's file as it is written, and its numbers as the control law holds them.

use super::force_table::Forces;
use super::needle::Needle;
use super::person::{self, Thickness};
use super::{Beside, Person, Slope, TissueName, body, goal, law};
use control_core::Patient;
use control_core::config;
use control_core::units::{FrictionPerMillimetre, JogCompliance, Millimetres, Newtons, Stiffness};
use fixed::types::I16F16;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) format: u32,
    pub(super) name: String,
    /// Angle of the needle to the skin at entry, 5 to 90 degrees.
    pub(super) entry_deg: f64,
    /// The range of angles to the skin that the device's barrier leaves.
    pub(super) slope_deg: Option<Slope>,
    /// In N; without it, as much as the device gives.
    pub(super) largest_force_n: Option<f64>,
    /// Share of the law's forces that is given to the hand, where the motor is too weak for them.
    pub(super) force_scale: Option<f64>,
    pub(super) procedure: Option<String>,
    #[serde(default)]
    pub(super) patient: Person,
    pub(super) law: Option<law::LawTable>,
    pub(super) friction: Option<law::Friction>,
    pub(super) needle: Option<Needle>,
    pub(super) force_table: Option<Forces>,
    pub(super) layer: Vec<Layer>,
    pub(super) body: Option<body::Written>,
    pub(super) vessel: Option<Vessel>,
    pub(super) target: Option<goal::Written>,
    #[serde(default)]
    pub(super) beside: Vec<Beside>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Vessel {
    /// Across the vessel, mm; its height is from its near to its far wall.
    pub(super) width_mm: f64,
    /// Distance of its axis from the needle's plane, mm.
    #[serde(default)]
    pub(super) offset_mm: f64,
}

#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Layer {
    pub(super) tissue: TissueName,
    /// True if the needle must avoid it; by default as in Paper 002, tendon and cartilage.
    pub(super) spare: Option<bool>,
    /// Perpendicular to the skin; in a body it follows from the line and is in no file.
    pub(super) depth_mm: Option<f64>,
    /// The rule for its thickness; the layers below move with it.
    pub(super) thickness: Option<Thickness>,
    /// Bone lies under it, this far below its top, mm; in a body it follows from the line.
    pub(super) over_bone_mm: Option<f64>,
    pub(super) wall: Option<Wall>,
    /// For the jog law.
    pub(super) friction_n_per_mm: Option<f64>,
    /// For the law of Paper 002.
    pub(super) cutting: Option<law::Cut>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Wall {
    /// Force while it is pushed in.
    pub(super) elastic: Parabola,
    /// Travel past contact along the needle at which it gives way, mm.
    pub(super) puncture_mm: f64,
    /// Force from there on.
    pub(super) relief: Parabola,
    /// Slope by which its force falls when the needle is drawn back, N/mm.
    pub(super) unload_n_per_mm: f64,
    /// An assumption where it is left out: nobody gives it.
    pub(super) spring_back: Option<f64>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parabola {
    /// Travel n at which the force is least, mm; `(T − n)²/a + b` is the force after a travel T.
    pub(super) vertex_mm: f64,
    /// a, mm²/N.
    pub(super) compliance_mm2_per_n: f64,
    /// The least force b, N.
    pub(super) base_n: f64,
}

/// A decimal number as the control law holds it; one that it cannot hold is refused by name.
pub(crate) fn fix(key: &str, value: f64) -> Result<I16F16, String> {
    I16F16::checked_from_num(value)
        .ok_or_else(|| format!("{key} is {value}; it must be a number between -32768 and 32768"))
}

impl File {
    pub(super) fn config(&self) -> Result<Patient, String> {
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
    pub(super) fn is_spared(&self) -> bool {
        self.spare.unwrap_or(matches!(self.tissue, TissueName::Tendon | TissueName::Cartilage))
    }

    /// True if a needle that comes into it from a layer `above` feels no change.
    pub(super) fn feels_like(&self, above: &Self) -> bool {
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
