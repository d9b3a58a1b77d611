//! The contents of a recording, channel by channel: the frames of the link in decimal numbers, with
//! the unit in the name.

use control_core::config::DacWidth;
use control_core::controller::Sample;
use control_core::event::{Fault, Limits};
use control_core::units::{Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians, Newtons};
use device_sim::procedure::purpose::Purpose;
use device_sim::session::{ProbeView, TaskDone};
use fixed::types::{I2F30, I16F16};
use link::build::Build;
use link::frames;
use serde::{Deserialize, Serialize};

/// Topic and JSON schema of every channel.
pub(crate) const CHANNELS: [(&str, &str, &str); 8] = [
    ("/setup", "Setup", include_str!("schemas/setup.json")),
    ("/hello", "Hello", include_str!("schemas/hello.json")),
    ("/samples", "Samples", include_str!("schemas/samples.json")),
    ("/pose", "Pose", include_str!("schemas/pose.json")),
    ("/event", "Event", include_str!("schemas/event.json")),
    ("/link", "Link", include_str!("schemas/link.json")),
    ("/probe", "Probe", include_str!("schemas/probe.json")),
    ("/task", "Task", include_str!("schemas/task.json")),
];

/// The setup before anything moved.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Setup {
    /// Version of the program that recorded.
    pub program: String,
    /// The source of the samples.
    pub source: String,
    /// The profile's file as it stood, which the configuration can be made from again.
    pub profile_toml: String,
    /// The file's name in errors.
    pub profile_origin: String,
    /// Name of the scripted procedure, where a hand followed one.
    pub procedure: Option<String>,
    /// The device's part as it was given, which the configuration can be made from again; none
    /// where it was the device's own.
    #[serde(default)]
    pub device_toml: Option<String>,
    /// The procedure's purpose; none in a recording from before it was recorded.
    #[serde(default)]
    pub purpose: Option<Purpose>,
}

/// The device's identity and scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hello {
    /// Version of the link's protocol.
    pub version: u16,
    /// The microcontroller's unique number, hexadecimal.
    pub identity: String,
    /// Version of the firmware.
    pub firmware: [u8; 3],
    /// The commit that the firmware was built from; unknown in a recording from before it was
    /// reported.
    #[serde(default)]
    pub build: Build,
    /// CRC-32 of the configuration in force, both parts.
    pub config_hash: u32,
    /// CRC-32 of its device's part; 0 in a recording from before it was reported.
    #[serde(default)]
    pub device_hash: u32,
    /// Samples a second.
    pub tick_hz: u32,
    /// Poses a second.
    pub pose_hz: u16,
    /// Length of one count along the needle.
    pub mm_per_count: f64,
    /// Radius of the roller.
    pub roller_radius_mm: f64,
    /// Torque at full scale of the converter.
    pub full_scale_torque_mnm: f64,
    /// 8 to 16.
    pub dac_bits: u8,
    /// The fault that had latched.
    pub fault: Option<Fault>,
}

/// Consecutive samples, a column each.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Samples {
    /// Tick of the first one; the others follow, 100 µs apart.
    pub first_tick: u64,
    /// Counts past the zero.
    pub count: Vec<i32>,
    /// The codes written to the converter.
    pub dac: Vec<u16>,
    /// State, by its number.
    pub state: Vec<u8>,
    /// Inclination below the horizontal.
    pub tilt_mrad: Vec<i16>,
}

/// The needle's pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Its tick.
    pub tick: u64,
    /// Depth past the zero.
    pub depth_mm: f64,
    /// Speed, positive inwards.
    pub speed_mm_s: f64,
    /// Force that the law asked for.
    pub force_n: f64,
    /// Inclination below the horizontal.
    pub tilt_mrad: i16,
    /// State, by its number.
    pub state: u8,
    /// The limits that held torque back, a bit each.
    pub limits: u8,
    /// Angle to the skin at which the layers were met; 0 in a recording from before it was
    /// reported.
    #[serde(default)]
    pub angle_mrad: i16,
    /// The tip's place relative to the vessel, by its number.
    #[serde(default)]
    pub vessel: u8,
    /// Force across the needle that would have held its direction.
    #[serde(default)]
    pub lateral_n: f64,
}

/// The ultrasound probe on the skin, and how much of the needle its image shows. Only while the
/// page shows the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Probe {
    /// Tick of the newest samples when it came.
    pub tick: u64,
    /// Its place, and the needle in its image.
    #[serde(flatten)]
    pub view: ProbeView,
}

/// Totals of the link since the session began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Link {
    /// Frames that arrived whole.
    pub frames: u64,
    /// Frames whose number is missing.
    pub lost_frames: u64,
    /// Samples that arrived.
    pub samples: u64,
    /// Samples that did not.
    pub lost_samples: u64,
    /// Pieces between frames that were none.
    pub garbage: u64,
}

/// Anything that a recording holds.
#[derive(Clone, Debug, PartialEq)]
#[expect(missing_docs, reason = "each variant carries the message that it is named after")]
pub enum Message {
    Setup(Setup),
    Hello(Hello),
    Samples(Samples),
    Pose(Pose),
    Event(frames::Event),
    Link(Link),
    Probe(Probe),
    Task(TaskDone),
}

impl Message {
    /// Returns the tick of a message that has one.
    pub fn tick(&self) -> Option<u64> {
        match self {
            Message::Samples(block) => Some(block.first_tick),
            Message::Pose(pose) => Some(pose.tick),
            Message::Event(event) => Some(event.tick),
            Message::Probe(probe) => Some(probe.tick),
            Message::Task(task) => Some(task.tick),
            Message::Hello(_) | Message::Link(_) | Message::Setup(_) => None,
        }
    }
}

impl From<&frames::Hello> for Hello {
    fn from(hello: &frames::Hello) -> Self {
        Self {
            version: hello.version,
            identity: hello.identity.iter().map(|byte| format!("{byte:02x}")).collect(),
            firmware: hello.firmware,
            build: hello.build,
            config_hash: hello.config_hash,
            device_hash: hello.device_hash,
            tick_hz: hello.tick_hz,
            pose_hz: hello.pose_hz,
            mm_per_count: hello.mm_per_count.to_num(),
            roller_radius_mm: hello.roller_radius.0.to_num(),
            full_scale_torque_mnm: hello.full_scale_torque.0.to_num(),
            dac_bits: hello.dac.bits(),
            fault: hello.fault,
        }
    }
}

impl Hello {
    /// True if a device could have sent this: later code divides by it.
    pub fn is_plausible(&self) -> bool {
        (1e-6..=10.0).contains(&self.mm_per_count)
            && (0.1..=1_000.0).contains(&self.roller_radius_mm)
            && (1e-3..=100_000.0).contains(&self.full_scale_torque_mnm)
    }

    /// The converter.
    pub fn dac(&self) -> DacWidth {
        DacWidth::try_from(self.dac_bits).unwrap_or(DacWidth::BITS_12)
    }

    /// Force at the roller in N that resists insertion, for what was written to the converter.
    pub fn force_n(&self, dac: u16) -> f64 {
        let steps = f64::from(self.dac().mid_scale()) - f64::from(dac);
        steps * self.full_scale_torque_mnm / f64::from(self.dac().span()) / self.roller_radius_mm
    }

    /// As it came over the link; what does not fit a frame is held at its bounds.
    pub fn to_frame(&self) -> frames::Hello {
        let mut identity = [0; 12];
        for (index, byte) in identity.iter_mut().enumerate() {
            let digits = self.identity.get(index * 2..index * 2 + 2);
            *byte = digits.and_then(|two| u8::from_str_radix(two, 16).ok()).unwrap_or(0);
        }
        frames::Hello {
            version: self.version,
            identity,
            firmware: self.firmware,
            build: self.build,
            config_hash: self.config_hash,
            device_hash: self.device_hash,
            tick_hz: self.tick_hz,
            pose_hz: self.pose_hz,
            mm_per_count: I2F30::saturating_from_num(self.mm_per_count),
            roller_radius: Millimetres(held(self.roller_radius_mm)),
            full_scale_torque: MillinewtonMetres(held(self.full_scale_torque_mnm)),
            dac: self.dac(),
            fault: self.fault,
        }
    }
}

/// JSON numbers are never NaN, the one value that a saturating conversion would not take.
fn held(value: f64) -> I16F16 {
    I16F16::saturating_from_num(value)
}

impl Samples {
    /// A block as it came, or its first `keep` samples.
    pub(crate) fn from_block(first_tick: u64, samples: &[Sample]) -> Self {
        Self {
            first_tick,
            count: samples.iter().map(|s| s.count).collect(),
            dac: samples.iter().map(|s| s.dac).collect(),
            state: samples.iter().map(|s| s.state).collect(),
            tilt_mrad: samples.iter().map(|s| s.tilt_mrad).collect(),
        }
    }

    /// Row by row; as many as the shortest column has.
    pub fn rows(&self) -> impl Iterator<Item = (u64, Sample)> + '_ {
        let columns = self.count.iter().zip(&self.dac).zip(&self.state).zip(&self.tilt_mrad);
        (self.first_tick..).zip(columns.map(|(((count, dac), state), tilt)| Sample {
            count: *count,
            dac: *dac,
            state: *state,
            tilt_mrad: *tilt,
        }))
    }
}

impl From<&frames::Pose> for Pose {
    fn from(pose: &frames::Pose) -> Self {
        Self {
            tick: pose.tick,
            depth_mm: pose.depth.0.to_num(),
            speed_mm_s: pose.speed.0.to_num(),
            force_n: pose.force.0.to_num(),
            tilt_mrad: pose.tilt.0,
            state: pose.state,
            limits: pose.limits.0,
            angle_mrad: pose.angle.0,
            vessel: pose.vessel,
            lateral_n: pose.lateral.0.to_num(),
        }
    }
}

impl Pose {
    /// As it came over the link.
    pub fn to_frame(&self) -> frames::Pose {
        frames::Pose {
            tick: self.tick,
            depth: Millimetres(held(self.depth_mm)),
            speed: MillimetresPerSecond(held(self.speed_mm_s)),
            force: Newtons(held(self.force_n)),
            tilt: Milliradians(self.tilt_mrad),
            state: self.state,
            limits: Limits(self.limits),
            angle: Milliradians(self.angle_mrad),
            vessel: self.vessel,
            lateral: Newtons(held(self.lateral_n)),
        }
    }
}

impl From<link::host::Counts> for Link {
    fn from(counts: link::host::Counts) -> Self {
        Self {
            frames: counts.frames,
            lost_frames: counts.lost_frames,
            samples: counts.samples,
            lost_samples: counts.lost_samples,
            garbage: counts.garbage,
        }
    }
}
