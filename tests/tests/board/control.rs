//! The board computes what control-core computes, tick for tick and bit for bit. Each test takes
//! more than 5 s: a whole insertion and withdrawal at a speed for which the laws were made, ten
//! seconds of the board.

use control_core::event::State;
use tests::follow::follows;
use tests::laws;
use tests::scenario::{board, deep, venepuncture};

#[test]
fn the_board_writes_the_codes_that_control_core_computes() {
    let (states, punctures) = follows(board(venepuncture(1_000_000_000)), None);
    for state in [State::Approach, State::Elastic, State::Friction, State::Withdrawal] {
        assert!(states[state as usize] > 500, "{state:?} was hardly reached: {states:?}");
    }
    // The emulated board is tilted by 30°: the vein is 9.6 mm along the needle.
    assert_eq!(punctures, 2, "the skin and the vein");
}

#[test]
fn the_board_computes_the_law_of_seed_002_to_the_bit() {
    let (states, punctures) = follows(board(deep(1_000_000_000)), Some(laws::shoulder()));
    for state in [State::Approach, State::Elastic, State::Puncture, State::Friction, State::Withdrawal] {
        assert!(states[state as usize] > 200, "{state:?} was hardly reached: {states:?}");
    }
    assert_eq!(punctures, 2, "the skin and the bursa");
}

#[test]
fn the_board_computes_the_table_of_seed_000_to_the_bit() {
    let (states, _) = follows(board(deep(1_000_000_000)), Some(laws::phantom()));
    for state in [State::Approach, State::Friction, State::Withdrawal] {
        assert!(states[state as usize] > 500, "{state:?} was hardly reached: {states:?}");
    }
}
