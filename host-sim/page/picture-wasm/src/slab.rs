//! Level layers and a straight vessel as the picture shows them, and the surfaces of any tissue.

use crate::drawn::{Given, Kind, SurfaceView, TISSUES};
use tissue::body::Part;
use tissue::needle::WallName;
use tissue::{Configuration, Layer, Tissue, Vessel};

/// Deepest that is drawn, mm.
const DEEPEST_MM: f32 = 40.0;
/// Thinner layers are drawn as part of the next, mm.
const THINNEST_MM: f32 = 0.3;

/// Returns the depth of the block that is drawn, mm.
pub(crate) fn bottom_mm(given: &[Given]) -> f32 {
    let depth =
        |wanted: fn(&Given) -> bool| given.iter().find(|layer| wanted(layer)).map(|layer| layer.depth_mm);
    let (near, far) = (depth(|layer| layer.is_vessel), depth(|layer| layer.is_far));
    let innermost = given.iter().map(|layer| layer.depth_mm).fold(6.0, f32::max);
    let bottom = far.or(near.map(|near| near + 3.0)).map_or(innermost + 6.0, |far| far + 8.0);
    if bottom.is_finite() { bottom.clamp(14.0, DEEPEST_MM) } else { 16.0 }
}

/// Layers and vessel for the tissue picture, and which of its walls belongs to which layer of the
/// scene.
pub(crate) fn configure(
    given: &[Given],
    [width, offset]: [f32; 2],
    angle: f32,
) -> (Configuration, Vec<Option<WallName>>) {
    let standard = Configuration::default();
    let depth =
        |wanted: fn(&Given) -> bool| given.iter().find(|layer| wanted(layer)).map(|layer| layer.depth_mm);
    let near = depth(|layer| layer.is_vessel);
    let far = depth(|layer| layer.is_far);
    let bottom = bottom_mm(given);
    let mut layers: Vec<Layer> = vec![];
    let mut walls = vec![None; given.len()];
    let bands: Vec<(usize, &Given)> =
        given.iter().enumerate().filter(|(_, layer)| !layer.is_vessel && !layer.is_far).collect();
    for (place, (number, band)) in bands.iter().enumerate() {
        let top = if layers.is_empty() { 0.0 } else { band.depth_mm };
        let end =
            bands[place + 1..].iter().map(|(_, next)| next.depth_mm).find(|next| *next > top + THINNEST_MM);
        let end = end.unwrap_or(bottom).min(bottom);
        let drawn_to = layers.last().map_or(0.0, |layer: &Layer| layer.top_mm + layer.thickness_mm);
        if (top - drawn_to).abs() > 1e-3 || end - top < THINNEST_MM {
            continue;
        }
        let kind = TISSUES.get(band.kind as usize).copied().unwrap_or("other");
        let mut layer = Layer::of(kind, top, end - top);
        layer.gives_mm = band.travel_mm.clamp(0.0, 30.0);
        walls[*number] = Some(WallName::Layer(layers.len()));
        layers.push(layer);
    }
    let travel = |wanted: fn(&Given) -> bool| {
        given.iter().find(|layer| wanted(layer)).map_or(0.0, |layer| layer.travel_mm.clamp(0.0, 30.0))
    };
    let vessel = near.map(|near| {
        let height = far.map_or(3.0, |far| (far - near).clamp(0.5, 20.0));
        let number = |value: f32, or: f32, low: f32, high: f32| {
            if value.is_finite() { value.clamp(low, high) } else { or }
        };
        Vessel {
            top_mm: near,
            vertical_mm: height,
            horizontal_mm: number(width, height, 0.5, 14.0),
            // In the middle of what is drawn, so that the path to it is.
            centre_mm: [near / angle.tan(), number(offset, 0.0, -8.0, 8.0)].map(|c| c.clamp(-8.0, 20.0)),
            near_gives_mm: travel(|layer| layer.is_vessel),
            far_gives_mm: travel(|layer| layer.is_far),
            ..Vessel::default()
        }
    });
    for (slot, layer) in walls.iter_mut().zip(given) {
        if layer.is_vessel {
            *slot = Some(WallName::Near);
        } else if layer.is_far {
            *slot = Some(WallName::Far);
        }
    }
    (Configuration { layers, vessel, ..standard }, walls)
}

/// The surfaces as the page draws them.
pub(crate) fn views(tissue: &Tissue, walls: &[Option<WallName>]) -> Vec<SurfaceView> {
    let scene_layer =
        |layer: usize| walls.iter().position(|wall| *wall == Some(WallName::Layer(layer))).unwrap_or(0);
    let mut views = vec![];
    for surface in tissue.surfaces() {
        let view = |kind, layer| SurfaceView { kind, layer, tissue: 0, triangles: surface.triangles.clone() };
        match surface.part {
            Part::SkinBehind => views.push(view(Kind::SkinBehind, 0)),
            Part::SkinBefore => views.push(view(Kind::SkinBefore, 0)),
            Part::Section(layer) => views.push(view(Kind::Section, scene_layer(layer))),
            Part::Vessel => {
                let is_behind = |triangle: &&[u32; 3]| {
                    triangle.iter().map(|index| tissue.rest()[*index as usize][1]).sum::<f32>() < 0.0
                };
                let (behind, before) = surface.triangles.iter().partition(is_behind);
                let layer = walls.iter().position(|wall| *wall == Some(WallName::Near)).unwrap_or(0);
                views.push(SurfaceView { kind: Kind::VesselBehind, layer, tissue: 0, triangles: behind });
                views.push(SurfaceView { kind: Kind::VesselBefore, layer, tissue: 0, triangles: before });
            }
            Part::Top(_) | Part::End(_) => {}
        }
    }
    views
}
