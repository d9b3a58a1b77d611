//! Recorded insertions judged: scores, comparisons of attempts, learning curves, practice goals.

pub mod debrief;
pub mod goal;
pub mod language;
pub mod live_score;
pub mod practice;
pub mod score;
pub mod verdict;
pub mod xapi;
