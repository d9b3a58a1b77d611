//! Recordings that are damaged, cut or made of several sessions: read as far as they go, never a
//! panic.

use crate::common::{folder, run_well, text};
use control_core::controller::Sample;
use convert::export::export;
use device_sim::error::Error;
use device_sim::profile::Profile;
use link::device::{Endpoint, Identity};
use link::frames::{Event, EventKind, Hello};
use recording::messages::{Link, Setup};
use recording::read::Recording;
use recording::stretches::stretches;
use recording::write::Recorder;
use std::io::{self, Cursor, Seek, SeekFrom, Write};
use training::score::score;

fn setup() -> Setup {
    let profile = Profile::find("adult").expect("it is built in");
    Setup {
        program: "test".into(),
        source: "virtual".into(),
        profile_toml: profile.source.text,
        profile_origin: profile.source.origin,
        procedure: None,
        device_toml: None,
        purpose: None,
    }
}

fn hello() -> Hello {
    let profile = Profile::find("adult").expect("it is built in");
    Endpoint::new(Identity { serial: [7; 12], firmware: [1, 2, 3], ..Identity::VIRTUAL }, &profile.plan, None)
        .hello()
}

fn minute_of_blocks(recorder: &mut Recorder<impl Write + Seek>, from: u64, blocks: u64) -> Result<(), Error> {
    (0..blocks)
        .try_for_each(|b| recorder.samples(from + b * 32, &[Sample { dac: 2048, ..Sample::default() }; 32]))
}

#[test]
fn a_cut_at_any_place_and_any_flipped_byte_is_survived() {
    let dir = folder("damage");
    let mcap = dir.join("a.mcap");
    run_well(&["run", "--headless", "--fast", "--seconds", "5", "--record", text(&mcap)]);
    let whole = std::fs::read(&mcap).expect("it was recorded");
    let samples = |bytes: &[u8]| -> Option<usize> {
        let recording = Recording::parse("a.mcap".into(), bytes).ok()?;
        let insertions = score(&recording, None).ok()?.insertions;
        assert!(insertions.len() < 10);
        Some(stretches(&recording).iter().map(|s| s.samples.len()).sum())
    };
    assert_eq!(samples(&whole), Some(50_000));
    let mut best = 0;
    for cut in (0..whole.len()).step_by(whole.len() / 60) {
        let got = samples(&whole[..cut]).unwrap_or(0);
        assert!(got >= best, "a later cut leaves more: {got} after {best}");
        best = got;
        // A chunk is a quarter of a second.
        let expected = (50_000.0 * cut as f64 / whole.len() as f64 - 5_000.0).max(0.0) as usize;
        assert!(got >= expected, "{got} samples of {cut} bytes");
    }
    let mut random = 1_u64;
    for _ in 0..300 {
        let mut damaged = whole[..whole.len() / 8].to_vec();
        for _ in 0..3 {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            let place = (random >> 20) as usize % damaged.len();
            damaged[place] ^= 1 << (random >> 61);
        }
        samples(&damaged);
    }
    // Every bit of a beginning: lengths of records and chunks among them.
    let beginning = &whole[..whole.len().min(8_000)];
    for bit in 0..8 * 4_000 {
        let mut damaged = beginning.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        samples(&damaged);
    }
}

#[test]
fn events_stay_in_their_session_when_ticks_restart() {
    let mut file = Cursor::new(Vec::new());
    let mut recorder = Recorder::begin("two.mcap".into(), &mut file, &setup()).expect("memory is enough");
    for session in 0..2 {
        recorder.hello(&hello()).expect("written");
        for (tick, kind) in [
            (100, EventKind::Contact { layer: 0 }),
            (200, EventKind::Puncture { layer: 0 }),
            (300, EventKind::Exit { layer: 0 }),
        ] {
            // The device of the second session is only touched.
            if session == 0 || !matches!(kind, EventKind::Puncture { .. }) {
                recorder.event(&Event { tick, kind }).expect("written");
            }
        }
        minute_of_blocks(&mut recorder, 0, 100).expect("written");
        minute_of_blocks(&mut recorder, 10_000, 10).expect("written");
    }
    recorder.finish(Link::default()).expect("written");
    let recording = Recording::parse("two.mcap".into(), file.get_ref()).expect("it is whole");
    assert_eq!(recording.cut, None);
    let lengths: Vec<_> = stretches(&recording).iter().map(|s| (s.first_tick, s.samples.len())).collect();
    assert_eq!(lengths, [(0, 3200), (10_000, 320), (0, 3200), (10_000, 320)]);
    let scored = score(&recording, None).expect("its profile was recorded");
    let punctures: Vec<_> = scored.insertions.iter().map(|one| one.punctures).collect();
    assert_eq!(punctures, [1, 0]);

    let dir = folder("sessions");
    let exported = export(&recording, &dir).expect("the folder can be written");
    assert_eq!(exported.recordings.iter().map(|r| r.1).collect::<Vec<_>>(), [3200, 320, 3200, 320]);
    let rig = diagnosis::rig::Rig::read(&exported.rig).expect("the diagnosis reads it");
    assert!((rig.actuator.gain * 2047.0 - 0.0288).abs() < 1e-7, "full scale is 28.8 mN·m");
    assert!((rig.encoder.counts_per_unit - 4000.0 / std::f64::consts::TAU).abs() < 1e-3);
    let csv =
        diagnosis::recording::Recording::read(&exported.recordings[0].0).expect("the diagnosis reads it");
    assert_eq!((csv.len(), csv.command[0]), (3200, 0.0));
}

/// A disk with room for so many bytes.
struct Disk {
    file: Cursor<Vec<u8>>,
    room: usize,
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let fits = bytes.len().min(self.room - self.file.get_ref().len());
        if fits == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        self.file.write(&bytes[..fits])
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Seek for Disk {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

#[test]
fn a_full_disk_is_reported_and_loses_at_most_one_chunk() {
    for room in [0, 100, 5_000, 20_000, 100_000, 250_001] {
        let mut disk = Disk { file: Cursor::new(Vec::new()), room };
        let mut kept = 0;
        let written = Recorder::begin("full.mcap".into(), &mut disk, &setup()).and_then(|mut recorder| {
            recorder.hello(&hello())?;
            for block in 0..10_000 {
                minute_of_blocks(&mut recorder, block * 32, 1)?;
                kept = (block + 1) * 32;
            }
            recorder.finish(Link::default())
        });
        let said = written.expect_err("it does not fit").to_string();
        assert!(
            said.contains("full.mcap") && said.contains("can be read") && said.lines().count() == 1,
            "{said}"
        );
        if kept > 10_000 {
            let recording =
                Recording::parse("full.mcap".into(), disk.file.get_ref()).expect("it can be read");
            assert!(recording.cut.is_some());
            let read: u64 = stretches(&recording).iter().map(|s| s.samples.len() as u64).sum();
            assert!(read + 2 * 2_500 >= kept, "{read} of {kept} samples");
        }
    }
}
