//! The state of a board for the page: read from every frame that comes, whoever asked for it.

use control_core::controller::Sample;
use control_core::event::Limits;
use device_sim::page::guide::Reading;
use device_sim::session::state_name;
use link::frames::{DeviceFrame, Event, EventKind, Hello, Pose, Stage, Timing};
use link::host::Reception;
use serde::Serialize;
use std::collections::VecDeque;
use std::time::Duration;

/// A board that sends no samples for this long is silent.
const SILENCE: Duration = Duration::from_secs(1);
/// Events that are shown.
const EVENTS: usize = 8;
/// Ticks that go back by more than this are another run of the board: 1 s.
const RESTART_TICKS: u64 = control_core::TICK_HZ as u64;
/// The limits by their names.
const LIMITS: [(Limits, &str); 6] = [
    (Limits::TORQUE, "torque at its limit"),
    (Limits::SLEW, "torque changes as fast as it may"),
    (Limits::FADE_IN, "fading in"),
    (Limits::THERMAL, "motor hot"),
    (Limits::PASSIVITY, "damped"),
    (Limits::ESTIMATED, "force estimated"),
];

/// The state of a board as its frames report it.
#[derive(Debug, Default)]
pub struct View {
    reception: Reception,
    hello: Option<Hello>,
    pose: Option<Pose>,
    sample: Option<Sample>,
    timing: Option<Timing>,
    fault: Option<String>,
    crash: Option<String>,
    events: VecDeque<Line>,
    last_tick: u64,
    last_samples: Option<Duration>,
    /// The tick at which the motor's heat is known again.
    cools_at: Option<u64>,
    has_restarted: bool,
}

/// An event, as it is shown.
#[derive(Clone, Debug, Serialize)]
struct Line {
    t_s: f64,
    text: String,
}

/// The message for the page.
#[derive(Debug, Serialize)]
struct Shown<'a> {
    #[serde(rename = "type")]
    kind: &'static str,
    live: bool,
    board: Option<Board>,
    needle: Option<Needle>,
    reading: Option<Reading>,
    fault: Option<&'a str>,
    crash: Option<&'a str>,
    timing: Option<Times>,
    frames: u64,
    lost_frames: u64,
    lost_samples: u64,
    events: &'a VecDeque<Line>,
}

#[derive(Debug, Serialize)]
struct Board {
    firmware: String,
    build: String,
    identity: String,
    roller_radius_mm: f64,
    full_scale_torque_mnm: f64,
}

#[derive(Debug, Serialize)]
struct Needle {
    depth_mm: f64,
    speed_mm_s: f64,
    force_n: f64,
    angle_deg: f64,
    tilt_deg: f64,
    state: &'static str,
    limits: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Times {
    tick_us: Option<f64>,
    late_codes: u32,
    missed_ticks: u32,
    dropped_samples: u32,
    garbage_frames: u32,
}

impl View {
    /// Takes what has come; gives every whole frame to `see`.
    pub fn take(&mut self, now: Duration, bytes: &[u8], mut see: impl FnMut(&DeviceFrame)) {
        for &byte in bytes {
            let Some(frame) = self.reception.push(byte) else { continue };
            self.see(now, &frame);
            see(&frame);
        }
    }

    /// True if samples come.
    pub fn is_live(&self, now: Duration) -> bool {
        self.last_samples.is_some_and(|last| now.saturating_sub(last) <= SILENCE)
    }

    /// Returns once that the board has started anew since the last call.
    pub fn take_restart(&mut self) -> bool {
        std::mem::take(&mut self.has_restarted)
    }

    /// Returns the newest readings.
    pub fn reading(&self) -> Option<Reading> {
        self.sample.map(|sample| Reading { counts: sample.count, tilt_deg: degrees(sample.tilt_mrad) })
    }

    fn see(&mut self, now: Duration, frame: &DeviceFrame) {
        match frame {
            DeviceFrame::Hello(hello) => {
                self.fault = hello.fault.map(|fault| fault.to_string());
                self.hello = Some(hello.clone());
                // It follows the hello, if it is unknown.
                self.cools_at = None;
            }
            DeviceFrame::Samples(block) => {
                self.has_restarted |= block.first_tick + RESTART_TICKS < self.last_tick;
                self.last_tick = block.first_tick;
                self.last_samples = Some(now);
                self.sample = block.samples.last().copied().or(self.sample);
            }
            DeviceFrame::Pose(pose) => self.pose = Some(*pose),
            DeviceFrame::Event(event) => self.happened(event),
            DeviceFrame::Timing(timing) => self.timing = Some(*timing),
            DeviceFrame::Crash(crash) => self.crash = Some(crash.to_string()),
            DeviceFrame::Ack(_) | DeviceFrame::Device(_) => {}
        }
    }

    /// Layers are shown counted from 1, the outermost.
    fn happened(&mut self, event: &Event) {
        let text = match event.kind {
            EventKind::Fault { cause } => {
                self.fault = Some(cause.to_string());
                format!("fault: {cause}")
            }
            EventKind::Cleared => {
                (self.fault, self.crash) = (None, None);
                "fault cleared".into()
            }
            EventKind::Started => "torque on".into(),
            EventKind::Stopped => "torque off".into(),
            EventKind::Contact { layer } => format!("contact with layer {}", u16::from(layer) + 1),
            EventKind::Puncture { layer } => format!("puncture of layer {}", u16::from(layer) + 1),
            EventKind::Vessel { layer } => format!("vessel reached in layer {}", u16::from(layer) + 1),
            EventKind::Exit { layer } => format!("left layer {}", u16::from(layer) + 1),
            EventKind::Flashback { layer } => {
                format!("blood: in the vessel of layer {}", u16::from(layer) + 1)
            }
            EventKind::FarWall { layer } => format!("through the far wall of layer {}", u16::from(layer) + 1),
            EventKind::NotSaved { cause } => cause.to_string(),
            EventKind::HeatUnknown { seconds } => {
                self.cools_at = Some(event.tick + u64::from(seconds) * u64::from(control_core::TICK_HZ));
                format!("the motor's heat is unknown: at most its continuous torque for {seconds} s")
            }
            EventKind::Barrier => "turned further than the tissue allows".into(),
            // They come in the hundreds, and the needle's own line shows the limits.
            EventKind::Limits { .. } | EventKind::InTrack { .. } => return,
        };
        self.events.truncate(EVENTS - 1);
        self.events.push_front(Line { t_s: event.tick as f64 / f64::from(control_core::TICK_HZ), text });
    }

    /// Returns the message for the page.
    pub fn tell(&self, now: Duration) -> String {
        let counts = self.reception.counts();
        let shown = Shown {
            kind: "board",
            live: self.is_live(now),
            board: self.hello.as_ref().map(board),
            needle: self.pose.as_ref().map(|pose| needle(pose, self.cools_at)),
            reading: self.reading(),
            fault: self.fault.as_deref(),
            crash: self.crash.as_deref(),
            timing: self.timing.as_ref().map(times),
            frames: counts.frames,
            lost_frames: counts.lost_frames,
            lost_samples: counts.lost_samples,
            events: &self.events,
        };
        // Only a map whose keys are not strings cannot be written, and there is no such map here.
        serde_json::to_string(&shown).unwrap_or_default()
    }
}

fn board(hello: &Hello) -> Board {
    let [major, minor, patch] = hello.firmware;
    Board {
        firmware: format!("{major}.{minor}.{patch}"),
        build: hello.build.to_string(),
        identity: hello.identity.iter().map(|byte| format!("{byte:02x}")).collect(),
        roller_radius_mm: hello.roller_radius.0.to_num(),
        full_scale_torque_mnm: hello.full_scale_torque.0.to_num(),
    }
}

fn needle(pose: &Pose, cools_at: Option<u64>) -> Needle {
    let left = cools_at.and_then(|at| at.checked_sub(pose.tick)).filter(|ticks| *ticks > 0);
    let cooling = left.map(|ticks| {
        format!("motor's heat unknown for {} s", ticks.div_ceil(u64::from(control_core::TICK_HZ)))
    });
    Needle {
        depth_mm: pose.depth.0.to_num(),
        speed_mm_s: pose.speed.0.to_num(),
        force_n: pose.force.0.to_num(),
        angle_deg: degrees(pose.angle.0),
        tilt_deg: degrees(pose.tilt.0),
        state: state_name(pose.state),
        limits: LIMITS
            .iter()
            .filter(|(limit, _)| pose.limits.contains(*limit))
            .map(|(_, name)| (*name).to_owned())
            .chain(cooling)
            .collect(),
    }
}

fn times(timing: &Timing) -> Times {
    let longest = timing.stages.get(Stage::Tick as usize).map_or(0, |stage| stage.longest);
    // The virtual device, whose clock is 0, gives ns.
    let per_us = if timing.clock_hz == 0 { 1e3 } else { f64::from(timing.clock_hz) * 1e-6 };
    Times {
        tick_us: (longest > 0).then(|| f64::from(longest) / per_us),
        late_codes: timing.late_codes,
        missed_ticks: timing.missed_ticks,
        dropped_samples: timing.dropped_samples,
        garbage_frames: timing.garbage_frames,
    }
}

fn degrees(mrad: i16) -> f64 {
    (f64::from(mrad) * 1e-3).to_degrees()
}
