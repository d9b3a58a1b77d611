//! The ultrasound image as an IMAGE message of OpenIGTLink version 1, and its probe as a TRANSFORM:
//! 3D Slicer shows the image at its place.

use super::message::message;
use crate::streams::ultrasound_image::{COLUMNS, Image, ROWS};

/// Names in Slicer.
const ULTRASOUND: &str = "Ultrasound";
const PROBE: &str = "Probe";
/// Version of the image's own header, components of a pixel, the type of an 8-bit number without
/// sign, big-endian, and axes as they are (right, anterior, superior).
const FORMAT: [u8; 6] = [0, 1, 1, 3, 1, 1];

/// Both messages, one after the other.
pub(super) fn messages(image: &Image) -> Vec<u8> {
    [transform(image), body(image)].concat()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn numbers<'a>(values: impl IntoIterator<Item = &'a f64>) -> Vec<u8> {
    values.into_iter().flat_map(|value| (*value as f32).to_be_bytes()).collect()
}

/// The middle of the probe's face; its first axis along the image, its second into the body.
fn transform(image: &Image) -> Vec<u8> {
    let columns = [image.across, image.down, cross(image.across, image.down), image.face_mm];
    message("TRANSFORM", PROBE, image.t_s, &numbers(columns.iter().flatten()))
}

fn body(image: &Image) -> Vec<u8> {
    let spacing = [image.size_mm[0] / COLUMNS as f64, image.size_mm[1] / ROWS as f64];
    // A slice as thick as a column is wide: one slice needs some thickness.
    let axes = [
        image.across.map(|part| part * spacing[0]),
        image.down.map(|part| part * spacing[1]),
        cross(image.across, image.down).map(|part| part * spacing[0]),
    ];
    let half_depth = image.size_mm[1] / 2.0;
    let centre = [0, 1, 2].map(|axis| image.face_mm[axis] + half_depth * image.down[axis]);
    let size = [COLUMNS as u16, ROWS as u16, 1];
    let mut body = Vec::with_capacity(72 + image.pixels.len());
    body.extend(FORMAT);
    body.extend(size.iter().flat_map(|count| count.to_be_bytes()));
    body.extend(numbers(axes.iter().flatten().chain(&centre)));
    // The whole image, from its first pixel.
    body.extend([0; 6]);
    body.extend(size.iter().flat_map(|count| count.to_be_bytes()));
    body.extend(&image.pixels);
    message("IMAGE", ULTRASOUND, image.t_s, &body)
}

#[cfg(test)]
mod tests {
    use super::super::message::HEADER;
    use super::*;

    #[test]
    fn an_image_has_the_header_of_the_protocol() {
        let image = Image {
            t_s: 1.5,
            pixels: vec![7; ROWS * COLUMNS],
            size_mm: [25.6, 51.2],
            face_mm: [13.0, 0.0, -1.0],
            across: [1.0, 0.0, 0.0],
            down: [0.0, 0.0, -1.0],
        };
        let bytes = body(&image);
        assert_eq!(&bytes[2..8], b"IMAGE\0");
        assert_eq!(bytes.len(), HEADER + 72 + ROWS * COLUMNS);
        let own = &bytes[HEADER..];
        assert_eq!(own[..12], [0, 1, 1, 3, 1, 1, 1, 0, 2, 0, 0, 1], "256 by 512 by 1, 8 bits");
        let floats: Vec<f32> =
            own[12..60].chunks(4).map(|four| f32::from_be_bytes(four.try_into().expect("four"))).collect();
        // Columns along the skin, rows down, then across; the middle is half the depth below the
        // face.
        assert_eq!(floats, [0.1, 0.0, 0.0, 0.0, 0.0, -0.1, 0.0, 0.1, 0.0, 13.0, 0.0, -26.6]);
        assert_eq!(own[60..72], [0, 0, 0, 0, 0, 0, 1, 0, 2, 0, 0, 1]);
    }
}
