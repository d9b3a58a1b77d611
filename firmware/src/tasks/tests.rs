//! The tasks on a board made of memory: each by itself, at the edges of what it is for.

mod fake;
mod telemetry;
mod tick;
mod watch;
