//! Boards that a test finds started: what many tests do first is done once in a program, and each
//! of them goes on from a snapshot of it, to the same bits (`tests/board/repeated.rs`).
//!
//! A snapshot lasts as long as the program: the board's tests are one program, and a file would
//! outlive the sources that it is of.

use std::any::Any;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use crate::pc::Pc;
use emulator::board::plant::PlantSide;
use emulator::board::{Board, Saved, Wiring};

/// A board as it was saved, the PC on its cable, and what else the test has at hand by then.
#[derive(Debug)]
pub struct Start {
    board: Saved,
    pc: Pc,
    kept: Box<dyn Any + Send + Sync>,
}

/// By name and wiring. A second test that asks for one waits while the first makes it.
static STARTS: Mutex<BTreeMap<String, Arc<OnceLock<Arc<Start>>>>> = Mutex::new(BTreeMap::new());

impl Start {
    /// Returns the start called `name` of a board wired as `wiring`, which `begin` makes where
    /// there is none yet.
    ///
    /// # Panics
    ///
    /// When `begin` does, or the board cannot be saved.
    pub fn of<K: Any + Send + Sync>(
        name: &str,
        wiring: Wiring,
        begin: impl FnOnce(Wiring) -> (Board, Pc, K),
    ) -> Arc<Self> {
        let key = format!("{name} {wiring:?}");
        let start = STARTS.lock().unwrap_or_else(PoisonError::into_inner).entry(key).or_default().clone();
        let start = start.get_or_init(|| {
            let (mut board, pc, kept) = begin(wiring);
            let board = board.save().unwrap_or_else(|why| panic!("{why}"));
            Arc::new(Self { board, pc, kept: Box::new(kept) })
        });
        start.clone()
    }

    /// A board that goes on from here, with `plant` on its shaft, and its PC.
    ///
    /// # Panics
    ///
    /// When the image has changed.
    #[must_use]
    pub fn on(&self, plant: impl PlantSide + 'static) -> (Board, Pc) {
        let board = Board::resumed(&self.board, plant).unwrap_or_else(|why| panic!("{why}"));
        (board, self.pc.clone())
    }

    /// Returns the value that was kept with the board.
    ///
    /// # Panics
    ///
    /// When it is not a `K`.
    #[must_use]
    pub fn kept<K: Any>(&self) -> &K {
        self.kept.downcast_ref().expect("a start of this name keeps a value of this type")
    }
}
