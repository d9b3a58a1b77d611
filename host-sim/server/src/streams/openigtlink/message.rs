//! The bytes of OpenIGTLink version 1 messages, after the protocol's specification
//! (openigtlink.org, "Protocol" v2): a header of 58 bytes, big-endian, then the body, whose CRC-64
//! the header carries.

use crate::streams::feed::{NeedlePose, Snapshot};
use crc::{CRC_64_ECMA_182, Crc};

/// Length of a header in bytes.
pub(super) const HEADER: usize = 58;
/// Longest STRING taken, in bytes.
const LONGEST_STRING: u64 = 512;
/// The transform's name in Slicer.
const NEEDLE: &str = "Needle";
/// The status's name: some clients keep one message per name.
const DEVICE: &str = "NeedleDevice";

const CRC: Crc<u64> = Crc::<u64>::new(&CRC_64_ECMA_182);

/// The condition of the device as the protocol's status codes say it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Status {
    code: u16,
    name: &'static str,
    text: String,
}

impl Status {
    pub(super) fn of(snapshot: &Snapshot) -> Self {
        let status = |code, name, text: &str| Self { code, name, text: text.to_owned() };
        if let Some(fault) = &snapshot.fault {
            return status(18, "HardwareFailure", fault);
        }
        match &snapshot.pose {
            _ if !snapshot.connected => status(13, "NotReady", "no answer from the device"),
            Some(pose) if pose.state == "idle" => status(15, "Disabled", "the torque is off"),
            Some(_) => status(1, "OK", "rendering"),
            None => status(13, "NotReady", "no pose yet"),
        }
    }

    pub(super) fn bytes(&self) -> Vec<u8> {
        let mut body = Vec::with_capacity(30 + self.text.len() + 1);
        body.extend(self.code.to_be_bytes());
        body.extend(0_i64.to_be_bytes());
        body.extend(padded::<20>(self.name));
        body.extend(self.text.as_bytes());
        body.push(0);
        // A status has no time of the device's clock.
        message("STATUS", DEVICE, 0.0, &body)
    }
}

/// The tip in mm and the needle's direction, in the axes of [`NeedlePose::tip_mm`]. The third axis
/// of the transform points back along the needle, the second one across.
pub(super) fn transform(pose: &NeedlePose) -> Vec<u8> {
    let [along, _, out] = pose.direction;
    // Columns of a rotation: normal to the needle in its plane, across, back along the needle.
    let columns = [[-out, 0.0, along], [0.0, 1.0, 0.0], [-along, 0.0, -out]];
    let mut body = Vec::with_capacity(48);
    for number in columns.iter().flatten().chain(&pose.tip_mm) {
        body.extend((*number as f32).to_be_bytes());
    }
    message("TRANSFORM", NEEDLE, pose.t_s, &body)
}

/// A whole message; `t_s` becomes the protocol's seconds with 32 binary places.
pub(super) fn message(kind: &str, name: &str, t_s: f64, body: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + body.len());
    bytes.extend(1_u16.to_be_bytes());
    bytes.extend(padded::<12>(kind));
    bytes.extend(padded::<20>(name));
    bytes.extend(((t_s.max(0.0) * 4_294_967_296.0) as u64).to_be_bytes());
    bytes.extend((body.len() as u64).to_be_bytes());
    bytes.extend(CRC.checksum(body).to_be_bytes());
    bytes.extend(body);
    bytes
}

/// `text` in a field of `N` bytes, shortened to what fits.
fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    field.iter_mut().zip(text.bytes()).for_each(|(place, byte)| *place = byte);
    field
}

/// Length of the body that follows, where the header is of a STRING that may be a token.
pub(super) fn string_length(header: &[u8; HEADER]) -> Option<usize> {
    let is_string = header[2..14].starts_with(b"STRING\0");
    let length = u64::from_be_bytes(header[42..50].try_into().ok()?);
    (is_string && (4..=LONGEST_STRING).contains(&length)).then_some(length as usize)
}

/// The text in the body of a STRING: encoding, length, bytes. Version 2 puts a header of its own
/// before and metadata after.
pub(super) fn string_text(body: &[u8]) -> Option<&[u8]> {
    let at =
        |offset: usize| Some(usize::from(u16::from_be_bytes(body.get(offset..offset + 2)?.try_into().ok()?)));
    // Version 2 begins with the size of its extended header, 12; version 1 with the encoding of the
    // text, 3.
    let begin = if at(0)? == 12 { 12 } else { 0 };
    let length = at(begin + 2)?;
    body.get(begin + 4..begin + 4 + length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use device_sim::page::messages;

    #[test]
    fn a_transform_is_a_rotation_and_the_tip() {
        let pose = messages::Pose { depth_mm: 10.0, tilt_rad: 0.5, t_s: 1.5, ..messages::Pose::default() };
        let bytes = transform(&NeedlePose::from(&pose));
        assert_eq!(bytes.len(), HEADER + 48);
        assert_eq!(&bytes[2..11], b"TRANSFORM");
        assert_eq!(bytes[34..42], (3_u64 << 31).to_be_bytes(), "one and a half seconds");
        let numbers: Vec<f32> =
            bytes[HEADER..].chunks(4).map(|four| f32::from_be_bytes(four.try_into().unwrap())).collect();
        let column = |n: usize| [numbers[3 * n], numbers[3 * n + 1], numbers[3 * n + 2]];
        let dot = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        for a in 0..3 {
            for b in 0..3 {
                let wanted = if a == b { 1.0 } else { 0.0 };
                assert!((dot(column(a), column(b)) - wanted).abs() < 1e-6, "columns {a} and {b}");
            }
        }
        let (x, y, z) = (column(0), column(1), column(2));
        let cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
        assert!((dot(cross, z) - 1.0).abs() < 1e-6, "right-handed");
        assert!((dot(column(3), z) + 10.0).abs() < 1e-5, "the third axis points back along the needle");
    }

    #[test]
    fn the_checksum_is_the_protocols() {
        // The check value of CRC-64/ECMA-182.
        assert_eq!(CRC.checksum(b"123456789"), 0x6C40_DF5F_0B49_7347);
    }

    #[test]
    fn a_string_gives_its_text_in_both_versions() {
        let first = [&3_u16.to_be_bytes()[..], &2_u16.to_be_bytes(), b"ab"].concat();
        assert_eq!(string_text(&first), Some(&b"ab"[..]));
        let second = [&12_u16.to_be_bytes()[..], &[0; 10], &first, b"metadata"].concat();
        assert_eq!(string_text(&second), Some(&b"ab"[..]));
        assert_eq!(string_text(&[0, 3, 0xff, 0xff, 1]), None);
        assert_eq!(string_text(&[]), None);
    }

    #[test]
    fn the_status_follows_the_device() {
        let mut snapshot = Snapshot::default();
        assert_eq!(Status::of(&snapshot).code, 13);
        snapshot.connected = true;
        let pose = messages::Pose { state: "friction", ..messages::Pose::default() };
        snapshot.pose = Some(NeedlePose::from(&pose));
        assert_eq!(Status::of(&snapshot).code, 1);
        snapshot.fault = Some("the PC was silent".into());
        let bytes = Status::of(&snapshot).bytes();
        assert_eq!(bytes[HEADER..HEADER + 2], [0, 18]);
        assert!(bytes.ends_with(b"the PC was silent\0"));
    }
}
