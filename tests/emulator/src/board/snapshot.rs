//! Boards that start from where another one stood, to the bit: what many tests do first is done
//! once.
//!
//! A snapshot holds all but the plant, which the test brings: the core, its memory, the part's
//! peripherals, the chips, the cable with its host, the flash, the wires, the log and the time. It
//! does not hold what a test has asked of the probe.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;

use rigless::snapshot::{Snapshot, Taken};

use super::plant::{Nanos, PlantSide};
use super::run::Order;
use super::{Board, Refused, Wiring};

/// A board's state.
#[derive(Debug)]
pub struct Saved {
    pub(super) snapshot: Snapshot,
    pub(super) now: Nanos,
    image: PathBuf,
    wiring: Wiring,
}

impl Board {
    /// Saves the board as it is, for others to go on from.
    ///
    /// # Errors
    ///
    /// If it restarts at this instant.
    ///
    /// # Panics
    ///
    /// While the probe counts or changes something.
    pub fn save(&mut self) -> Result<Saved, Refused> {
        assert!(self.probe.tally().is_idle(), "a snapshot does not hold what a test has asked of the probe");
        let (answer, answered) = channel();
        self.order(Order::Save(answer));
        let taken = answered.recv().expect("the order was carried out");
        let refuse = |error: rigless::snapshot::Error| Refused(error.to_string());
        let snapshot = taken.and_then(read_back).map_err(refuse)?;
        Ok(Saved { snapshot, now: self.now, image: self.image.clone(), wiring: self.wiring })
    }

    /// A board that goes on from where `saved` stood, with `plant` on its shaft.
    ///
    /// # Errors
    ///
    /// If its image has changed since.
    pub fn resumed(saved: &Saved, plant: impl PlantSide + 'static) -> Result<Self, Refused> {
        Self::start(&saved.image, saved.wiring, Box::new(plant), Some(saved))
    }
}

/// The emulator reads snapshots from files only.
fn read_back(taken: Taken) -> Result<Snapshot, rigless::snapshot::Error> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let number = COUNT.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("board-{}-{number}.snapshot", std::process::id()));
    let written = std::fs::write(&path, taken.file);
    let snapshot = written
        .map_err(|source| rigless::snapshot::Error::Io { path: path.clone(), source })
        .and_then(|()| Snapshot::read(&path));
    let _ = std::fs::remove_file(&path);
    snapshot
}
