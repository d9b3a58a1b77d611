//! Hands on the needle: the paths that several tests move it along.

use emulator::board::plant::{self, Nanos, PlantSide};
use emulator::board::{Board, Wiring, image_for};

/// Counts of the encoder for a millimetre of needle, at the default configuration's 10 mm roller
/// and 4,000 counts a turn, rounded down.
pub const COUNTS_PER_MM: i64 = 63;

const SECOND: Nanos = 1_000_000_000;

/// A hand that draws the needle back 5 mm, inserts it through skin, holds, inserts it through the
/// vessel's wall, holds, and withdraws it, from `start` on, in eight seconds.
#[must_use]
pub fn venepuncture(start: Nanos) -> impl PlantSide {
    let mm = |depth: i64| depth * COUNTS_PER_MM;
    let at = |tenths: u64| start + tenths * SECOND / 10;
    plant::by_hand(plant::path(vec![
        (start, 0),
        (at(5), mm(-5)),
        (at(10), mm(-5)),
        (at(25), mm(4)),
        (at(40), mm(4)),
        (at(50), mm(12)),
        (at(60), mm(12)),
        (at(78), mm(-3)),
    ]))
}

/// The same as far in as the deepest layer of [`crate::laws`], with a rest on the way, in nine
/// seconds.
#[must_use]
pub fn deep(start: Nanos) -> impl PlantSide {
    let mm = |depth: i64| depth * COUNTS_PER_MM;
    let at = |tenths: u64| start + tenths * SECOND / 10;
    plant::by_hand(plant::path(vec![
        (start, 0),
        (at(5), mm(-2)),
        (at(8), mm(-2)),
        (at(30), mm(22)),
        (at(40), mm(22)),
        (at(52), mm(38)),
        (at(58), mm(38)),
        (at(88), mm(-3)),
    ]))
}

/// The board with the flash image on it, wired as it is meant to be.
///
/// # Panics
///
/// When there is no image.
#[must_use]
pub fn board(plant: impl PlantSide + 'static) -> Board {
    board_wired(Wiring::default(), plant)
}

/// The board of this wiring with its flash image on it, and a motor that it takes for cold.
///
/// # Panics
///
/// When there is no image.
#[must_use]
pub fn board_wired(wiring: Wiring, plant: impl PlantSide + 'static) -> Board {
    let board = Board::on(&image_for(&wiring.pins), wiring, plant);
    let mut board = board.unwrap_or_else(|why| panic!("{why}"));
    board.cool_motor();
    board
}
