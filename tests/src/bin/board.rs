//! Runs the board by hand.
fn main() {}
