//! Foxglove's well-known messages as Protobuf: the needle's transform, and needle and tissue as a
//! scene. A program that knows these schemas draws them without further instructions.
//!
//! The schemas in `schemas/foxglove` are the descriptors of PyPI's `foxglove-schemas-protobuf`;
//! `cargo xtask test clients` compares them and reads what is written.

use crate::protobuf::Fields;
use device_sim::session::{Scene, SceneNeedle};

/// Topic, name of the schema, and the schema as a `FileDescriptorSet`.
pub(crate) const CHANNELS: [(&str, &str, &[u8]); 2] = [
    ("/tf", "foxglove.FrameTransform", include_bytes!("schemas/foxglove/FrameTransform.binpb")),
    ("/scene", "foxglove.SceneUpdate", include_bytes!("schemas/foxglove/SceneUpdate.binpb")),
];

/// The frame of the point of entry: x along the skin in the needle's plane, y across, z out of the
/// skin.
const SKIN: &str = "skin";
/// The frame of the tip: x in the direction of insertion.
const NEEDLE: &str = "needle";
/// Extent of the tissue along and across the skin, and of its deepest layer, in mm.
const ALONG_MM: f64 = 60.0;
const ACROSS_MM: f64 = 30.0;
const DEEPEST_MM: f64 = 10.0;
/// The turn about y that lays a cylinder, whose axis is z, along x.
const LAID: [f64; 4] = [0.0, std::f64::consts::FRAC_1_SQRT_2, 0.0, std::f64::consts::FRAC_1_SQRT_2];
const UPRIGHT: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
const STEEL: [f64; 4] = [0.7, 0.73, 0.77, 1.0];
const HUB: [f64; 4] = [0.04, 0.36, 0.61, 1.0];
const BLOOD: [f64; 4] = [0.66, 0.12, 0.2, 0.8];

/// `Vector3`, `Quaternion` and `Color` are numbers only.
fn numbers(values: &[f64]) -> Vec<u8> {
    Fields::default().doubles(values).bytes()
}

/// `google.protobuf.Timestamp`.
fn time(ns: u64) -> Vec<u8> {
    Fields::default().integer(1, ns / 1_000_000_000).integer(2, ns % 1_000_000_000).bytes()
}

fn metres(mm: [f64; 3]) -> Vec<u8> {
    numbers(&mm.map(|mm| mm / 1_000.0))
}

/// `FrameTransform` of a needle `depth_mm` past the point of entry, `tilt_rad` below the
/// horizontal.
pub(crate) fn transform(ns: u64, depth_mm: f64, tilt_rad: f64) -> Vec<u8> {
    let (sine, cosine) = tilt_rad.sin_cos();
    let (half_sine, half_cosine) = (tilt_rad / 2.0).sin_cos();
    Fields::default()
        .part(1, &time(ns))
        .part(2, SKIN.as_bytes())
        .part(3, NEEDLE.as_bytes())
        .part(4, &metres([cosine * depth_mm, 0.0, -sine * depth_mm]))
        // About the axis across: x points in the direction of insertion.
        .part(5, &numbers(&[0.0, half_sine, 0.0, half_cosine]))
        .bytes()
}

/// `SceneUpdate` with the needle and, where the layers are level, the tissue.
pub(crate) fn scene(ns: u64, scene: &Scene) -> Vec<u8> {
    let mut update = Fields::default().part(2, &needle(ns, &scene.needle));
    if scene.body.is_none() {
        update = update.part(2, &tissue(ns, scene));
    }
    update.bytes()
}

/// The beginning of a `SceneEntity`, which moves with its frame.
fn entity(ns: u64, frame: &str, name: &str) -> Fields {
    let entity = Fields::default().part(1, &time(ns)).part(2, frame.as_bytes());
    entity.part(3, name.as_bytes()).integer(5, 1)
}

fn pose(centre_mm: [f64; 3], turn: &[f64; 4]) -> Vec<u8> {
    Fields::default().part(1, &metres(centre_mm)).part(2, &numbers(turn)).bytes()
}

/// A `CylinderPrimitive` along x: its middle, its heights perpendicular to the skin and across, its
/// length.
fn tube(centre_mm: [f64; 3], size_mm: [f64; 3], colour: &[f64; 4]) -> Vec<u8> {
    let cylinder = Fields::default().part(1, &pose(centre_mm, &LAID)).part(2, &metres(size_mm));
    cylinder.double(3, 1.0).double(4, 1.0).part(5, &numbers(colour)).bytes()
}

fn needle(ns: u64, needle: &SceneNeedle) -> Vec<u8> {
    let SceneNeedle { length_mm, diameter_mm, hub_length_mm, hub_diameter_mm, .. } = *needle;
    let cannula = tube([-length_mm / 2.0, 0.0, 0.0], [diameter_mm, diameter_mm, length_mm], &STEEL);
    let hub_middle = -length_mm - hub_length_mm / 2.0;
    let hub = tube([hub_middle, 0.0, 0.0], [hub_diameter_mm, hub_diameter_mm, hub_length_mm], &HUB);
    entity(ns, NEEDLE, NEEDLE).part(10, &cannula).part(10, &hub).bytes()
}

/// Draws slabs between the layers' tops; the vessel, which the needle points along, is in one of
/// them.
fn tissue(ns: u64, scene: &Scene) -> Vec<u8> {
    let slabs: Vec<_> = scene.layers.iter().filter(|layer| !layer.is_vessel && !layer.is_far_wall).collect();
    let deepest = scene.layers.last().map_or(0.0, |layer| layer.depth_mm) + DEEPEST_MM;
    let mut entity = entity(ns, SKIN, "tissue");
    for (number, layer) in slabs.iter().enumerate() {
        let end_mm = slabs.get(number + 1).map_or(deepest, |next| next.depth_mm);
        let middle = [0.0, 0.0, -(layer.depth_mm + end_mm) / 2.0];
        let cube = Fields::default()
            .part(1, &pose(middle, &UPRIGHT))
            .part(2, &metres([ALONG_MM, ACROSS_MM, end_mm - layer.depth_mm]))
            .part(3, &numbers(&colour(&layer.name)));
        entity = entity.part(8, &cube.bytes());
    }
    if let Some(vessel) = &scene.vessel {
        let middle = [0.0, vessel.offset_mm, -vessel.axis_mm];
        entity = entity.part(10, &tube(middle, [vessel.height_mm, vessel.width_mm, ALONG_MM], &BLOOD));
    }
    entity.bytes()
}

/// The colour of a tissue, that can be seen through, as the page has it.
fn colour(tissue: &str) -> [f64; 4] {
    let [red, green, blue] = match tissue {
        "skin" => [0.93, 0.76, 0.65],
        "fat" => [0.96, 0.87, 0.65],
        "muscle" => [0.84, 0.54, 0.49],
        "bursa" => [0.74, 0.85, 0.87],
        "tendon" => [0.92, 0.89, 0.82],
        "cartilage" => [0.79, 0.83, 0.9],
        _ => [0.85, 0.78, 0.73],
    };
    [red, green, blue, 0.35]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transform_has_the_bytes_of_its_fields() {
        let bytes = transform(1_500_000_000, 0.0, 0.0);
        let stamp = [0x0a, 8, 0x08, 1, 0x10, 0x80, 0xca, 0xb5, 0xee, 0x01];
        assert_eq!(bytes[..10], stamp, "1 s and 500,000,000 ns");
        assert_eq!(bytes[10..24], *b"\x12\x04skin\x1a\x06needle");
        let w = &bytes[bytes.len() - 8..];
        assert_eq!(w, 1.0_f64.to_le_bytes(), "no turn");
    }
}
