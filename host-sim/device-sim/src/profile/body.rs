//! `[body]` of a patient: a site in three dimensions with a point of entry, a direction and the
//! turn of the limb. The layers of the file then say what each tissue feels like, and the line
//! through the body says which are met and where.

use super::{File, Layer, TissueName};
use crate::session::{SceneBody, SceneOutline};
use anatomy::{Body, Line, Piece, Place, Site, Tissue};
use control_core::config::MAX_LAYERS;
use serde::Deserialize;

/// Pieces of a line that are thinner than this are not sent to the device, mm.
const THINNEST_MM: f64 = 0.2;
/// The length of the needle's line that is asked for layers, mm: within the device's travel, a
/// wall's puncture included.
const REACH_MM: f64 = 55.0;
/// Cartilage over the bone of a joint, mm: an assumption, 1 to 2 mm where it bears load.
const OVER_BONE_MM: f64 = 1.5;
/// The wall on the far side of an artery. It is no target and nothing to be spared: whoever comes
/// to it has entered the artery.
const FAR_ARTERIAL_WALL: &str = "far arterial wall";
/// Thickness that fat may have, mm.
const FAT_MM: [f64; 2] = [1.0, 60.0];

/// A site by its name in a file.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum SiteName {
    Shoulder,
    Forearm,
    Knee,
    Hip,
}

/// As the file has it.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Written {
    site: SiteName,
    along_mm: f64,
    around_deg: f64,
    #[serde(default)]
    azimuth_deg: f64,
    #[serde(default)]
    turn_deg: f64,
    /// Thickness of the fat; without it, that of the site.
    fat_mm: Option<f64>,
}

/// The body that a needle enters, its way and what it meets.
#[derive(Clone, Debug, PartialEq)]
pub struct InBody {
    /// The site.
    pub site: Site,
    /// Thickness of its fat, mm.
    pub fat_mm: f64,
    /// The point of entry, the direction and the limb's turn.
    pub place: Place,
    /// The structures.
    pub body: Body,
    /// The needle's way.
    pub line: Line,
    /// The pieces that it meets, in order.
    pub pieces: Vec<Piece>,
    /// The names of the layers that the device gets.
    pub names: Vec<String>,
}

impl Written {
    /// Returns the body for a needle that is inclined by `incline_deg`; `fat_mm` if the patient's
    /// own figures say how thick the fat is.
    pub(super) fn resolve(&self, incline_deg: f64, fat_mm: Option<f64>) -> Result<InBody, String> {
        let site = match self.site {
            SiteName::Shoulder => Site::Shoulder,
            SiteName::Forearm => Site::Forearm,
            SiteName::Knee => Site::Knee,
            SiteName::Hip => Site::Hip,
        };
        check_along("body.along_mm", self.along_mm, site)?;
        check_direction("body.around_deg", self.around_deg)?;
        check_direction("body.azimuth_deg", self.azimuth_deg)?;
        check_direction("body.turn_deg", self.turn_deg)?;
        let fat_mm = fat_mm.or(self.fat_mm).unwrap_or(site.usual_fat_mm());
        if !(FAT_MM[0]..=FAT_MM[1]).contains(&fat_mm) {
            return Err(format!(
                "body.fat_mm is {fat_mm} mm; it must be from {} to {} mm",
                FAT_MM[0], FAT_MM[1]
            ));
        }
        let place = Place {
            along_mm: self.along_mm,
            around_deg: self.around_deg,
            azimuth_deg: self.azimuth_deg,
            turn_deg: self.turn_deg,
            incline_deg,
        };
        let body = site.body(fat_mm);
        let line = place.line(&body).map_err(|refusal| format!("body: {refusal}"))?;
        let pieces = line.met(&body, REACH_MM);
        Ok(InBody { site, fat_mm, place, body, line, pieces, names: vec![] })
    }
}

/// Refuses a distance along the limb that the body does not have; `key` as the user wrote it.
pub(super) fn check_along(key: &str, mm: f64, site: Site) -> Result<(), String> {
    let [low, high] = site.along_mm();
    if (low..=high).contains(&mm) {
        return Ok(());
    }
    Err(format!("{key} is {mm} mm; it must be from {low} to {high} mm at the {}", site.name()))
}

/// Refuses a direction that is not from -180 to 180 degrees; `key` as the user wrote it.
pub(super) fn check_direction(key: &str, degrees: f64) -> Result<(), String> {
    if (-180.0..=180.0).contains(&degrees) {
        return Ok(());
    }
    Err(format!("{key} is {degrees} degrees; it must be from -180 to 180 degrees"))
}

/// The tissue of a file's layer that gives a structure its forces.
fn tissue_name(tissue: Tissue) -> TissueName {
    match tissue {
        Tissue::Skin => TissueName::Skin,
        Tissue::Fat => TissueName::Fat,
        Tissue::Muscle => TissueName::Muscle,
        Tissue::Vessel => TissueName::Vessel,
        Tissue::Artery => TissueName::Other,
        Tissue::Bursa => TissueName::Bursa,
        // A nerve resists no more than the tendon beside it.
        Tissue::Tendon | Tissue::Nerve => TissueName::Tendon,
        Tissue::Cartilage => TissueName::Cartilage,
    }
}

impl InBody {
    /// Returns the layers along the line, each with the forces of the file's layer of its tissue
    /// and its depth for a needle of this inclination, and notes their names. The device holds six:
    /// of more, those that feel like what they lie in are left out, and past the sixth the needle
    /// goes on in it.
    pub(super) fn layers(&mut self, kinds: &[Layer]) -> Result<Vec<Layer>, String> {
        let of = |tissue: TissueName| kinds.iter().find(|layer| layer.tissue == tissue);
        if let Some(missing) =
            self.body.structures.iter().find(|structure| of(tissue_name(structure.tissue)).is_none())
        {
            return Err(format!(
                "no [[layer]] has the forces of the {}; add one with tissue = \"{}\"",
                missing.name,
                tissue_name(missing.tissue).word()
            ));
        }
        let sine = libm::sin(self.place.incline_deg.to_radians());
        let mut met = self.met_along(&self.pieces);
        let is_needless = |above: TissueName, own: TissueName| {
            of(above).zip(of(own)).is_some_and(|(above, own)| own.feels_like(above))
        };
        while met.len() > MAX_LAYERS
            && let Some(needless) = met.windows(2).rposition(|pair| is_needless(pair[0].0, pair[1].0))
        {
            met.remove(needless + 1);
        }
        met.truncate(MAX_LAYERS);
        let layers = met.iter().filter_map(|(tissue, name, from_mm)| {
            let kind = of(*tissue)?.clone();
            let spare = if *name == FAR_ARTERIAL_WALL { Some(false) } else { kind.spare };
            Some(Layer { depth_mm: Some(from_mm * sine), thickness: None, spare, ..kind })
        });
        let layers = layers.collect();
        let names = met.into_iter().map(|(_, name, _)| name.to_owned()).collect();
        self.names = names;
        Ok(layers)
    }

    /// Returns tissue, name and beginning in mm of the layers that `pieces` of a line are.
    fn met_along(&self, pieces: &[Piece]) -> Vec<(TissueName, &'static str, f64)> {
        let (mut met, mut last, mut vessel, mut under_wall) = (Vec::new(), None, false, None);
        for piece in pieces {
            let structure = &self.body.structures[piece.structure];
            let tissue = tissue_name(structure.tissue);
            if tissue == TissueName::Skin && last.is_some() {
                // The needle comes out of the limb again: nothing resists it there.
                break;
            }
            let again = last == Some(piece.structure) || under_wall == Some(piece.from_mm);
            let second_vessel = tissue == TissueName::Vessel && vessel;
            if piece.to_mm - piece.from_mm < THINNEST_MM || second_vessel {
                continue;
            }
            last = Some(piece.structure);
            if again {
                continue;
            }
            met.push((tissue, structure.name, piece.from_mm));
            let far = match structure.tissue {
                Tissue::Vessel => (TissueName::FarWall, "far wall"),
                Tissue::Artery => (tissue, FAR_ARTERIAL_WALL),
                _ => continue,
            };
            vessel |= tissue == TissueName::Vessel;
            met.push((far.0, far.1, piece.to_mm));
            under_wall = Some(piece.to_mm);
        }
        met
    }

    /// Returns where the line of a needle that has turned meets each layer of the device, mm along
    /// it; none for a layer that it does not meet. The line begins at `origin_mm` in the needle's
    /// plane, along it and below the point of entry, and is inclined by `incline_rad`.
    pub(crate) fn tops_mm(&self, origin_mm: [f64; 2], incline_rad: f64) -> Vec<Option<f64>> {
        let pieces = self.pieces_along(origin_mm, incline_rad);
        let met = self.met_along(&pieces);
        let mut from = 0;
        let top = |name: &String| {
            let found = from + met[from..].iter().position(|(_, own, _)| own == name)?;
            from = found + 1;
            Some(met[found].2)
        };
        self.names.iter().map(top).collect()
    }

    /// Returns where such a line meets bone, under its cartilage, mm along it; none if it does not.
    pub(crate) fn bone_mm(&self, origin_mm: [f64; 2], incline_rad: f64) -> Option<f64> {
        let pieces = self.pieces_along(origin_mm, incline_rad);
        let is_joint = |piece: &&Piece| {
            let tissue = self.body.structures[piece.structure].tissue;
            tissue == Tissue::Cartilage && piece.to_mm - piece.from_mm > 2.0 * OVER_BONE_MM
        };
        pieces.iter().find(is_joint).map(|piece| piece.from_mm + OVER_BONE_MM)
    }

    fn pieces_along(&self, origin_mm: [f64; 2], incline_rad: f64) -> Vec<Piece> {
        let block = &self.line.block;
        let origin = block.to_limb([origin_mm[0], 0.0, origin_mm[1]]);
        let direction = block.direction_to_limb([libm::cos(incline_rad), 0.0, libm::sin(incline_rad)]);
        self.body.met(origin, direction, REACH_MM)
    }

    /// Returns the body for a picture.
    pub(super) fn scene(&self) -> SceneBody {
        let word = |number: usize| tissue_name(self.body.structures[number].tissue).word().to_owned();
        let outlines = self.body.outlines(&self.line.block);
        let outlines = outlines.into_iter().map(|outline| SceneOutline {
            name: self.body.structures[outline.structure].name.to_owned(),
            tissue: word(outline.structure),
            points_mm: outline.points_mm,
        });
        SceneBody {
            site: Site::ALL.iter().position(|site| *site == self.site).unwrap_or(0),
            name: self.site.name().to_owned(),
            along_mm: self.place.along_mm,
            around_deg: self.place.around_deg,
            azimuth_deg: self.place.azimuth_deg,
            turn_deg: self.place.turn_deg,
            incline_deg: self.place.incline_deg,
            fat_mm: self.fat_mm,
            reach_mm: self.site.along_mm(),
            inwards: self.line.inwards,
            outlines: outlines.collect(),
        }
    }
}

impl File {
    /// Replaces the layers, which say what each tissue feels like, by those that the needle's line
    /// meets in the body, if there is one.
    pub(super) fn take_body(&mut self) -> Result<Option<InBody>, String> {
        let Some(written) = self.body else { return Ok(None) };
        if self.force_table.is_some() || self.vessel.is_some() || !self.beside.is_empty() {
            return Err("a patient with [body] takes its vessels and what is beside them from the body and has no force table; remove [vessel], \
                 [[beside]] and [force_table]"
                .into());
        }
        if let Some(layer) = self.layer.iter().find(|layer| layer.depth_mm.is_some()) {
            let word = layer.tissue.word();
            return Err(format!(
                "depth_mm of the {word} is given, and [body] says where it is; remove depth_mm"
            ));
        }
        if self.layer.iter().any(|layer| layer.over_bone_mm.is_some()) {
            return Err("over_bone_mm is given, and [body] says where bone is; remove over_bone_mm".into());
        }
        let by_person = self.layer.iter().find_map(|layer| layer.thickness);
        let fat_mm = by_person.map(|rule| rule.of_mm(&self.patient)).transpose()?;
        let mut body = written.resolve(self.entry_deg, fat_mm)?;
        self.layer = body.layers(&self.layer)?;
        Ok(Some(body))
    }
}

#[cfg(test)]
mod tests;
