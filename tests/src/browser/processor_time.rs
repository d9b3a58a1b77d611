//! Processor time of the browser, in units of a loop timed on the same machine: a judgement of a
//! picture's cost that holds on a slow machine as on a fast one.

use super::Error;
use super::chromium::Chromium;
use std::collections::HashMap;
use std::fs;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Ticks of the kernel's clock a second in `/proc/*/stat` (`USER_HZ` of Linux on every architecture
/// that Chromium is built for).
const TICKS_PER_S: f64 = 100.0;
/// Turns of the loop: some milliseconds.
const TURNS: u64 = 4_000_000;
const REPEATS: usize = 20;

impl Chromium {
    /// Seconds of processor time that the browser and all its processes have used, user's and
    /// kernel's.
    pub fn processor_s(&self) -> Result<f64, Error> {
        let processes = all_processes()?;
        let mut ticks = 0;
        let mut open = vec![self.id()];
        while let Some(id) = open.pop() {
            ticks += processes.get(&id).map_or(0, |one| one.ticks);
            open.extend(processes.iter().filter(|(_, one)| one.parent == id).map(|(child, _)| *child));
        }
        Ok(f64::from(ticks) / TICKS_PER_S)
    }
}

/// Time of the fixed loop, the least of several: what else runs on the machine interrupts some of
/// them, never all.
pub fn loop_time() -> Duration {
    let timed = || {
        let begin = Instant::now();
        let mut sum = 0_u64;
        for turn in 0..TURNS {
            sum = sum.wrapping_add(black_box(turn) * turn % 7);
        }
        black_box(sum);
        begin.elapsed()
    };
    (0..REPEATS).map(|_| timed()).min().unwrap_or_default()
}

struct Process {
    parent: u32,
    ticks: u32,
}

fn all_processes() -> Result<HashMap<u32, Process>, Error> {
    let folder = fs::read_dir("/proc").map_err(|e| format!("cannot read /proc: {e}"))?;
    let ids = folder.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    // A process may end between the two readings.
    Ok(ids
        .filter_map(|id| Some((id, process(&fs::read_to_string(format!("/proc/{id}/stat")).ok()?)?)))
        .collect())
}

/// Parent and times of a line of `/proc/*/stat`: the fields 4, 14 and 15 of proc(5), counted after
/// the name in brackets.
fn process(stat: &str) -> Option<Process> {
    let (_, rest) = stat.rsplit_once(')')?;
    let fields: Vec<&str> = rest.split_whitespace().collect();
    let field = |number: usize| fields.get(number - 3)?.parse::<u32>().ok();
    Some(Process { parent: field(4)?, ticks: field(14)? + field(15)? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_with_brackets_and_blanks_moves_no_field() {
        let line = "7 (a) b (c) S 3 7 7 0 -1 4194304 1 0 0 0 250 50 0 0 20 0 1 0 100 0 0";
        let read = process(line).unwrap();
        assert_eq!((read.parent, read.ticks), (3, 300));
    }

    #[test]
    fn the_time_of_this_test_is_counted() {
        let id = std::process::id();
        let ticks = || all_processes().unwrap()[&id].ticks;
        let before = ticks();
        while ticks() < before + 5 {
            loop_time();
        }
    }
}
