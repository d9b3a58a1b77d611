//! From batches of 10 kHz samples and 1 kHz poses to what a picture needs with every picture. Pure:
//! no clock, no socket.

use super::messages::{self, Bucket, Device, Range, Timing};
use crate::session::{Batch, Hand, Happening, state_name, vessel_name};
use link::build::Build;
use link::frames::{self, EventKind, Hello, Pose, Stage};
use std::collections::BTreeMap;

/// Length of a [`Bucket`] in ticks: 5 ms, so that 10 s are 2,000 of them, more than a plot has
/// columns.
pub(crate) const BUCKET_TICKS: u64 = 50;
/// Ticks a second until a device has said otherwise.
const DEFAULT_TICK_HZ: u32 = control_core::TICK_HZ;

/// Remembers between batches what the next one needs.
#[derive(Debug, Default)]
pub struct Condenser {
    hello: Option<Hello>,
    open: BTreeMap<u64, Ranges>,
    last_tick: u64,
    last_motor_n: f64,
    last_torque_mnm: f64,
    jumps: u64,
}

/// A bucket that is still being filled.
#[derive(Clone, Copy, Debug, Default)]
struct Ranges {
    depth: Range,
    law: Range,
    motor: Range,
}

impl Condenser {
    /// Returns the messages of `batch` for the page: the device, if it changed, and everything but
    /// who moves the needle.
    pub fn take(&mut self, mut batch: Batch) -> (Option<Device>, messages::Frame) {
        let device = batch.hello.take().map(|hello| self.begin(hello));
        self.notice_restart(&batch);
        for (tick, sample) in &batch.samples {
            self.sample(*tick, sample.count, sample.dac);
        }
        let events = batch.events.iter().map(|happening| self.event(happening)).collect();
        for pose in &batch.poses {
            let ranges = self.open.entry(pose.tick / BUCKET_TICKS).or_default();
            ranges.law.take(fine(pose.force.0.to_num()));
            ranges.depth.take(fine(pose.depth.0.to_num()));
            self.last_tick = self.last_tick.max(pose.tick);
        }
        let frame = messages::Frame {
            pose: batch.poses.last().map(|pose| self.pose(pose)),
            trace: self.finished(),
            events,
            link: batch.link,
            hand: Hand::default(),
            timing: batch.timing.map(timing),
            needle: batch.needle,
        };
        (device, frame)
    }

    /// A device that says hello may have another scale.
    fn begin(&mut self, hello: Hello) -> Device {
        let device = device(&hello);
        self.hello = Some(hello);
        device
    }

    /// Ticks that begin again are another run, or another place of a recording: what is half done
    /// of the old one is dropped.
    fn notice_restart(&mut self, batch: &Batch) {
        let jumps = batch.link.replay.map_or(0, |replay| replay.jumps);
        let jumped = std::mem::replace(&mut self.jumps, jumps) != jumps;
        let first =
            batch.poses.first().map(|p| p.tick).into_iter().chain(batch.samples.first().map(|s| s.0)).min();
        if jumped || first.is_some_and(|first| first + u64::from(DEFAULT_TICK_HZ) < self.last_tick) {
            self.open.clear();
            self.last_tick = 0;
        }
    }

    fn sample(&mut self, tick: u64, count: i32, dac: u16) {
        self.last_tick = self.last_tick.max(tick);
        let Some(hello) = &self.hello else { return };
        let scale = Scale::new(hello);
        self.last_torque_mnm = scale.torque_mnm(dac);
        self.last_motor_n = -self.last_torque_mnm / scale.roller_radius_mm;
        let ranges = self.open.entry(tick / BUCKET_TICKS).or_default();
        ranges.depth.take(fine(f64::from(count) * scale.mm_per_count));
        ranges.motor.take(fine(self.last_motor_n));
    }

    /// Buckets that nothing can be added to any more.
    fn finished(&mut self) -> Vec<Bucket> {
        let later = self.open.split_off(&(self.last_tick / BUCKET_TICKS));
        let finished = std::mem::replace(&mut self.open, later);
        let seconds = |bucket: u64| self.seconds(bucket * BUCKET_TICKS);
        finished.into_iter().map(|(at, r)| Bucket(seconds(at), r.depth, r.law, r.motor)).collect()
    }

    fn seconds(&self, tick: u64) -> f64 {
        let tick_hz = self.hello.as_ref().map_or(DEFAULT_TICK_HZ, |hello| hello.tick_hz.max(1));
        // Exact up to 2^53 ticks, 28,000 years.
        tick as f64 / f64::from(tick_hz)
    }

    /// A pose as a page has it; the motor is that of the newest sample.
    pub fn pose(&self, pose: &Pose) -> messages::Pose {
        messages::Pose {
            t_s: self.seconds(pose.tick),
            depth_mm: fine(pose.depth.0.to_num()),
            speed_mm_s: fine(pose.speed.0.to_num()),
            force_n: fine(pose.force.0.to_num()),
            motor_n: fine(self.last_motor_n),
            torque_mnm: fine(self.last_torque_mnm),
            tilt_rad: f64::from(pose.tilt.0) / 1000.0,
            angle_rad: f64::from(pose.angle.0) / 1000.0,
            vessel: vessel_name(pose.vessel),
            lateral_n: fine(pose.lateral.0.to_num()),
            state: state_name(pose.state),
            limits: pose.limits.0,
        }
    }

    fn event(&self, Happening { event, before }: &Happening) -> messages::Event {
        let (kind, layer, cause, limits) = match event.kind {
            EventKind::Contact { layer } => ("contact", Some(layer), None, None),
            EventKind::Puncture { layer } => ("puncture", Some(layer), None, None),
            EventKind::Vessel { layer } => ("vessel", Some(layer), None, None),
            EventKind::Exit { layer } => ("exit", Some(layer), None, None),
            EventKind::Fault { cause } => ("fault", None, Some(cause.to_string()), None),
            EventKind::Limits { in_force } => ("limits", None, None, Some(in_force.0)),
            EventKind::Cleared => ("cleared", None, None, None),
            EventKind::Started => ("started", None, None, None),
            EventKind::Stopped => ("stopped", None, None, None),
            EventKind::NotSaved { cause } => ("not_saved", None, Some(cause.to_string()), None),
            EventKind::Flashback { layer } => ("flashback", Some(layer), None, None),
            EventKind::FarWall { layer } => ("far_wall", Some(layer), None, None),
            EventKind::Barrier => ("barrier", None, None, None),
            EventKind::InTrack { layer } => ("in_track", Some(layer), None, None),
            EventKind::HeatUnknown { .. } => ("heat_unknown", None, None, None),
        };
        let ends_in_s = match event.kind {
            EventKind::HeatUnknown { seconds } => Some(seconds),
            _ => None,
        };
        messages::Event {
            t_s: self.seconds(event.tick),
            kind,
            layer,
            depth_mm: before.map(|pose| fine(pose.depth.0.to_num())),
            force_n: before.map(|pose| fine(pose.force.0.to_num())),
            cause,
            limits,
            ends_in_s,
        }
    }
}

/// The scale from counts and codes to physical units.
struct Scale {
    mm_per_count: f64,
    roller_radius_mm: f64,
    mid_scale: f64,
    mnm_per_code: f64,
}

impl Scale {
    fn new(hello: &Hello) -> Self {
        let radius: f64 = hello.roller_radius.0.to_num();
        Self {
            mm_per_count: hello.mm_per_count.to_num(),
            // A radius of zero would make every force infinite; no device that may run has one.
            roller_radius_mm: if radius > 0.0 { radius } else { f64::INFINITY },
            mid_scale: f64::from(hello.dac.mid_scale()),
            mnm_per_code: hello.full_scale_torque.0.to_num::<f64>() / f64::from(hello.dac.span()),
        }
    }

    fn torque_mnm(&self, dac: u16) -> f64 {
        (f64::from(dac) - self.mid_scale) * self.mnm_per_code
    }
}

/// Rounds to 0.1 µm or 0.1 mN: a tenth of what the device resolves, and a third of the bytes.
fn fine(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn device(hello: &Hello) -> Device {
    let [major, minor, patch] = hello.firmware;
    Device {
        identity: hex(&hello.identity),
        firmware: match hello.build {
            Build { commit: 0, .. } => format!("{major}.{minor}.{patch}"),
            build => format!("{major}.{minor}.{patch} ({build})"),
        },
        config_hash: format!("{:08x}", hello.config_hash),
        tick_hz: hello.tick_hz,
        mm_per_count: hello.mm_per_count.to_num(),
        full_scale_torque_mnm: hello.full_scale_torque.0.to_num(),
        dac_bits: hello.dac.bits(),
        fault: hello.fault.map(|fault| fault.to_string()),
    }
}

fn timing(timing: frames::Timing) -> Timing {
    let longest = timing.stages.get(Stage::Tick as usize).map_or(0, |stage| stage.longest);
    // The virtual device has no clock of its own and reports ns.
    let per_us = if timing.clock_hz == 0 { 1e3 } else { f64::from(timing.clock_hz) / 1e6 };
    Timing {
        longest_tick_us: f64::from(longest) / per_us,
        missed_ticks: timing.missed_ticks,
        late_codes: timing.late_codes,
        dropped_samples: timing.dropped_samples,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control_core::config::Config;
    use control_core::controller::Sample;
    use control_core::event::{Limits, State};
    use control_core::units::{Millimetres, MillimetresPerSecond, Milliradians, Newtons};
    use fixed::types::{I2F30, I16F16};

    fn hello() -> Hello {
        let device = Config::commissioned_virtual().device;
        Hello {
            version: frames::PROTOCOL_VERSION,
            identity: [0; 12],
            firmware: [1, 2, 3],
            build: Build::default(),
            config_hash: 0xabcd,
            device_hash: 0xef,
            tick_hz: 10_000,
            pose_hz: 1_000,
            mm_per_count: I2F30::from_num(0.0157),
            roller_radius: device.roller_radius,
            full_scale_torque: device.full_scale_torque,
            dac: device.dac,
            fault: None,
        }
    }

    fn pose(tick: u64, depth_mm: f64, force_n: f64) -> Pose {
        Pose {
            tick,
            depth: Millimetres(I16F16::from_num(depth_mm)),
            speed: MillimetresPerSecond::default(),
            force: Newtons(I16F16::from_num(force_n)),
            tilt: Milliradians(524),
            state: State::Elastic as u8,
            limits: Limits::default(),
            angle: Milliradians(0),
            vessel: 0,
            lateral: Newtons::default(),
        }
    }

    fn samples(ticks: std::ops::Range<u64>, sample: impl Fn(u64) -> (i32, u16)) -> Vec<(u64, Sample)> {
        ticks
            .map(|tick| {
                let (count, dac) = sample(tick);
                (tick, Sample { count, dac, ..Sample::default() })
            })
            .collect()
    }

    #[test]
    fn one_sample_s_spike_reaches_the_plot() {
        let mut condenser = Condenser::default();
        let spike = samples(0..200, |tick| (100, if tick == 77 { 1024 } else { 2048 }));
        let (device, frame) =
            condenser.take(Batch { hello: Some(hello()), samples: spike, ..Batch::default() });
        assert_eq!(device.unwrap().firmware, "1.2.3");
        // Three buckets are over, the fourth may still grow.
        assert_eq!(frame.trace.len(), 3);
        let Bucket(at, depth, _, motor) = frame.trace[1];
        assert_eq!(at, 0.005);
        assert_eq!(depth, Range(Some(1.57), Some(1.57)));
        // A code of 1024 is half of 28.8 mN·m against insertion: 1.44 N at 10 mm.
        assert_eq!(motor.0, Some(0.0));
        assert!((motor.1.unwrap() - 1.4407).abs() < 1e-3, "{motor:?}");
    }

    #[test]
    fn a_bucket_cut_by_a_batch_is_sent_once_and_whole() {
        let mut condenser = Condenser::default();
        condenser.take(Batch { hello: Some(hello()), ..Batch::default() });
        let mut buckets = Vec::new();
        for begin in (0..1_000).step_by(30) {
            let samples = samples(begin..begin + 30, |tick| (i32::try_from(tick).unwrap(), 2048));
            buckets.extend(condenser.take(Batch { samples, ..Batch::default() }).1.trace);
        }
        assert_eq!(buckets.len(), 20);
        for (number, Bucket(at, depth, ..)) in buckets.into_iter().enumerate() {
            let first = 50.0 * number as f64;
            assert_eq!(at, number as f64 * 0.005);
            assert_eq!(depth, Range(Some(fine(first * 0.0157)), Some(fine((first + 49.0) * 0.0157))));
        }
    }

    #[test]
    fn a_puncture_is_reported_with_the_force_before_the_drop() {
        let event = |kind, before| Happening { event: frames::Event { tick: 20, kind }, before };
        let events = vec![
            event(EventKind::Puncture { layer: 0 }, Some(pose(10, 3.0, 1.0))),
            event(EventKind::Stopped, None),
        ];
        let poses = vec![pose(20, 3.01, 0.4)];
        let told = Condenser::default().take(Batch { poses, events, ..Batch::default() }).1.events;
        assert_eq!((told[0].kind, told[0].layer), ("puncture", Some(0)));
        assert_eq!((told[0].depth_mm, told[0].force_n), (Some(3.0), Some(1.0)));
        assert_eq!((told[1].kind, told[1].force_n), ("stopped", None));
    }

    #[test]
    fn a_device_that_starts_anew_begins_a_new_trace() {
        let mut condenser = Condenser::default();
        let late = samples(900_000..900_170, |_| (0, 2048));
        condenser.take(Batch { hello: Some(hello()), samples: late, ..Batch::default() });
        let early = samples(0..170, |_| (0, 2048));
        let frame = condenser.take(Batch { hello: Some(hello()), samples: early, ..Batch::default() }).1;
        assert_eq!(frame.trace.iter().map(|b| b.0).collect::<Vec<_>>(), [0.0, 0.005, 0.01]);
    }
}
