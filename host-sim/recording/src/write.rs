//! Writes a recording while it happens. What is on disk can be read at any moment: a chunk is
//! closed every quarter of a second, so that a full disk, a kill or a power cut cost no more than
//! that.

use super::foxglove;
use super::messages::{CHANNELS, Hello, Link, Pose, Probe, Samples, Setup};
use super::protobuf::{self, Fields};
use control_core::TICK_HZ;
use control_core::controller::Sample;
use device_sim::error::Error;
use device_sim::named_files::Text;
use device_sim::profile::Profile;
use device_sim::session::{ProbeView, Source, TaskDone};
use link::frames;
use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

/// Recordings of one name.
const MOST_OF_A_NAME: u32 = 9_999;
/// Ticks from one flush to the next: 0.25 s.
const FLUSH_TICKS: u64 = TICK_HZ as u64 / 4;
/// Ticks from one transform for Foxglove to the next: 100 a second.
const TRANSFORM_TICKS: u64 = TICK_HZ as u64 / 100;
/// Topic, package, name and fields of the numbers that are written with each transform: the last
/// one is the torque at the converter then, and no number before the device has said its scale.
const NUMBERS: (&str, &str, &str, [&str; 4]) =
    ("/needle", "needle", "Numbers", ["depth_mm", "speed_mm_s", "force_n", "torque_mnm"]);
const NS_PER_TICK: u64 = 1_000_000_000 / TICK_HZ as u64;

/// A recording in progress.
pub struct Recorder<W: Write + Seek = BufWriter<File>> {
    file: String,
    writer: Writer<Counted<W>>,
    /// By the order of [`CHANNELS`].
    channels: Vec<u16>,
    /// By the order of [`foxglove::CHANNELS`].
    drawn: Vec<u16>,
    /// The channel of [`NUMBERS`].
    numbers: u16,
    /// The device's scale; none before it said it.
    hello: Option<Hello>,
    /// Torque of the newest sample, mN·m.
    torque_mnm: f64,
    /// Tick of the last transform.
    drawn_at: Option<u64>,
    /// Time of tick 0, ns since 1970.
    epoch_ns: u64,
    tick: u64,
    flushed: u64,
    bytes: Arc<AtomicU64>,
    text: Vec<u8>,
}

impl Recorder {
    /// Begins a recording in a new file; an old one of this name is replaced.
    pub fn create(path: &Path, setup: &Setup) -> Result<Self, Error> {
        let shown = path.display().to_string();
        let file = File::create(path).map_err(|cause| {
            Error::input(format_args!("{shown}: cannot be created ({cause}); choose another --record file"))
        })?;
        Self::begin(shown, BufWriter::with_capacity(1 << 16, file), setup)
    }

    /// Begins a recording called `name` in the current folder. An older one is never replaced:
    /// after `monday` come `monday-2` and so on.
    pub fn create_new(name: &str, setup: &Setup) -> Result<Self, Error> {
        for number in 1..=MOST_OF_A_NAME {
            let shown = if number == 1 { format!("{name}.mcap") } else { format!("{name}-{number}.mcap") };
            match File::create_new(&shown) {
                Ok(file) => return Self::begin(shown, BufWriter::with_capacity(1 << 16, file), setup),
                Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => {}
                Err(cause) => {
                    return Err(Error::failed(format_args!(
                        "{shown}: cannot be created ({cause}); start the program in a folder that can be written"
                    )));
                }
            }
        }
        Err(Error::failed(format_args!(
            "there are {MOST_OF_A_NAME} recordings called {name}; choose another name"
        )))
    }
}

impl<W: Write + Seek> Recorder<W> {
    /// Begins a recording in anything; `file` is what errors call it.
    pub fn begin(file: String, to: W, setup: &Setup) -> Result<Self, Error> {
        let options = WriteOptions::new()
            .compression(None)
            .profile("needle-insertion")
            .library(crate::version::program())
            .chunk_size(None)
            .disable_seeking(true);
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let bytes = Arc::<AtomicU64>::default();
        let mut recorder = Self {
            writer: Writer::with_options(Counted { inner: to, bytes: bytes.clone() }, options)
                .map_err(|cause| lost(&file, &cause, 0))?,
            file,
            channels: Vec::new(),
            drawn: Vec::new(),
            numbers: 0,
            hello: None,
            torque_mnm: f64::NAN,
            drawn_at: None,
            epoch_ns: u64::try_from(since_1970.as_nanos()).unwrap_or(0),
            tick: 0,
            flushed: 0,
            bytes,
            text: Vec::new(),
        };
        for (topic, name, schema) in CHANNELS {
            let added = recorder
                .writer
                .add_schema(name, "jsonschema", schema.as_bytes())
                .and_then(|id| recorder.writer.add_channel(id, topic, "json", &BTreeMap::new()));
            recorder.channels.push(added.map_err(|cause| recorder.lost(&cause))?);
        }
        for (topic, name, schema) in foxglove::CHANNELS {
            let added = recorder
                .writer
                .add_schema(name, "protobuf", schema)
                .and_then(|id| recorder.writer.add_channel(id, topic, "protobuf", &BTreeMap::new()));
            recorder.drawn.push(added.map_err(|cause| recorder.lost(&cause))?);
        }
        let (topic, package, name, fields) = NUMBERS;
        let schema = protobuf::numbers(package, name, &fields);
        let added = recorder
            .writer
            .add_schema(&format!("{package}.{name}"), "protobuf", &schema)
            .and_then(|id| recorder.writer.add_channel(id, topic, "protobuf", &BTreeMap::new()));
        recorder.numbers = added.map_err(|cause| recorder.lost(&cause))?;
        recorder.setup(setup)?;
        recorder.flush()?;
        Ok(recorder)
    }

    /// Set up anew: what follows is of another patient.
    pub fn setup(&mut self, setup: &Setup) -> Result<(), Error> {
        self.put(0, setup)?;
        let text = Text { origin: setup.profile_origin.clone(), text: setup.profile_toml.clone() };
        // A profile for a stronger device than the built-in one is recorded and not drawn.
        let Ok(profile) = Profile::parse(text) else { return Ok(()) };
        let scene = foxglove::scene(self.now_ns(), &profile.scene(Source::Virtual, None));
        self.write(self.drawn[1], &scene)
    }

    /// Writes the device's identity and scale.
    pub fn hello(&mut self, hello: &frames::Hello) -> Result<(), Error> {
        let hello = Hello::from(hello);
        self.put(1, &hello)?;
        self.hello = Some(hello).filter(Hello::is_plausible);
        Ok(())
    }

    /// Consecutive samples.
    pub fn samples(&mut self, first_tick: u64, samples: &[Sample]) -> Result<(), Error> {
        self.tick = first_tick;
        if let (Some(hello), Some(last)) = (&self.hello, samples.last()) {
            // The page's sign: torque that resists insertion is negative.
            self.torque_mnm = -hello.force_n(last.dac) * hello.roller_radius_mm;
        }
        self.put(2, &Samples::from_block(first_tick, samples))?;
        // A device that starts anew counts from 0 again.
        if first_tick.abs_diff(self.flushed) >= FLUSH_TICKS { self.flush() } else { Ok(()) }
    }

    /// A pose.
    pub fn pose(&mut self, pose: &frames::Pose) -> Result<(), Error> {
        let pose = Pose::from(pose);
        self.put(3, &pose)?;
        if self.drawn_at.is_some_and(|last| pose.tick.abs_diff(last) < TRANSFORM_TICKS) {
            return Ok(());
        }
        self.drawn_at = Some(pose.tick);
        let numbers = [pose.depth_mm, pose.speed_mm_s, pose.force_n, self.torque_mnm];
        self.write(self.numbers, &Fields::default().doubles(&numbers).bytes())?;
        let tilt_rad = f64::from(pose.tilt_mrad) / 1_000.0;
        let transform = foxglove::transform(self.now_ns(), pose.depth_mm, tilt_rad);
        self.write(self.drawn[0], &transform)
    }

    /// An event.
    pub fn event(&mut self, event: &frames::Event) -> Result<(), Error> {
        self.put(4, event)
    }

    /// The place of the ultrasound probe.
    pub fn probe(&mut self, view: ProbeView) -> Result<(), Error> {
        self.put(6, &Probe { tick: self.tick, view })
    }

    /// A task of the procedure that was done.
    pub fn task(&mut self, task: &TaskDone) -> Result<(), Error> {
        self.put(7, task)
    }

    /// Bytes on their way to the disk so far.
    pub fn bytes(&self) -> u64 {
        self.bytes.load(Ordering::Relaxed)
    }

    /// Returns the file's name for errors.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Closes the recording, with the totals of the link.
    pub fn finish(mut self, link: Link) -> Result<u64, Error> {
        self.put(5, &link)?;
        self.writer.finish().map_err(|cause| self.lost(&cause))?;
        let bytes = self.bytes();
        let flushed = self.writer.into_inner().flush();
        flushed.map_err(|cause| lost(&self.file, &McapError::Io(cause), bytes))?;
        Ok(bytes)
    }

    fn put(&mut self, channel: usize, message: &impl Serialize) -> Result<(), Error> {
        self.text.clear();
        // Only maps with odd keys and failing writers make this fail; there is neither.
        if serde_json::to_writer(&mut self.text, message).is_err() {
            return Err(Error::failed("a message could not be put into words; report this"));
        }
        let text = std::mem::take(&mut self.text);
        let written = self.write(self.channels[channel], &text);
        self.text = text;
        written
    }

    /// Time of the newest samples, ns since 1970.
    fn now_ns(&self) -> u64 {
        self.epoch_ns + self.tick * NS_PER_TICK
    }

    fn write(&mut self, channel_id: u16, message: &[u8]) -> Result<(), Error> {
        let time = self.now_ns();
        let header = MessageHeader { channel_id, sequence: 0, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, message).map_err(|cause| self.lost(&cause))
    }

    fn flush(&mut self) -> Result<(), Error> {
        self.flushed = self.tick;
        self.writer.flush().map_err(|cause| self.lost(&cause))
    }

    fn lost(&self, cause: &McapError) -> Error {
        lost(&self.file, cause, self.bytes())
    }
}

fn lost(file: &str, cause: &McapError, bytes: u64) -> Error {
    let why = match cause {
        McapError::Io(io) => io.to_string(),
        other => other.to_string(),
    };
    Error::failed(format_args!(
        "{file}: recording stopped after {bytes} bytes ({why}); what was written until then can be read; free some space"
    ))
}

/// A writer that counts what has gone through it.
struct Counted<W> {
    inner: W,
    bytes: Arc<AtomicU64>,
}

impl<W: Write> Write for Counted<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.inner.write(bytes)?;
        self.bytes.fetch_add(written as u64, Ordering::Relaxed);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

impl<W: Seek> Seek for Counted<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}
