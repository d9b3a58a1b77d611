//! Work shared among a few threads, with a progress line where a person watches.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Applies `work` to every item on `jobs` threads; results in the items' order, `None` for what was
/// not begun within `budget`. Progress goes to standard error if it is a terminal and nowhere
/// otherwise.
pub(crate) fn map<T: Sync, R: Send>(
    jobs: usize,
    budget: Option<Duration>,
    label: &str,
    items: &[T],
    work: impl Fn(&T) -> R + Sync,
) -> Vec<Option<R>> {
    map_and_save(jobs, budget, label, items, work, |_| ())
}

/// As [`map`]; `save` gets the results so far after each item, one call at a time, so that a run
/// that is stopped has not been for nothing.
pub(crate) fn map_and_save<T: Sync, R: Send>(
    jobs: usize,
    budget: Option<Duration>,
    label: &str,
    items: &[T],
    work: impl Fn(&T) -> R + Sync,
    save: impl Fn(&[Option<R>]) + Sync,
) -> Vec<Option<R>> {
    let next = AtomicUsize::new(0);
    let done = AtomicUsize::new(0);
    let results: Mutex<Vec<Option<R>>> = Mutex::new(items.iter().map(|_| None).collect());
    let watched = std::io::stderr().is_terminal();
    let start = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, items.len().max(1)) {
            scope.spawn(|| {
                while budget.is_none_or(|b| start.elapsed() < b) {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(i) else { break };
                    let result = work(item);
                    {
                        let mut results = results.lock().expect("no holder of the lock panics");
                        results[i] = Some(result);
                        save(&results);
                    }
                    let count = done.fetch_add(1, Ordering::Relaxed) + 1;
                    if watched {
                        let spent = start.elapsed().as_secs_f64();
                        let left = spent / count as f64 * (items.len() - count) as f64;
                        let mut err = std::io::stderr().lock();
                        // A terminal that went away is no reason to stop.
                        let _ = write!(err, "\r{label}: {count}/{} · {left:.0} s left   ", items.len());
                        let _ = err.flush();
                    }
                }
            });
        }
    });
    if watched {
        eprintln!();
    }
    results.into_inner().expect("no holder of the lock panics")
}

#[cfg(test)]
mod tests {
    #[test]
    fn results_keep_the_order() {
        let items: Vec<usize> = (0..100).collect();
        let squares: Vec<Option<usize>> = items.iter().map(|i| Some(i * i)).collect();
        assert_eq!(super::map(3, None, "", &items, |i| i * i), squares);
    }

    #[test]
    fn every_result_is_saved_when_it_is_there() {
        let saved = std::sync::Mutex::new(Vec::new());
        let save = |results: &[Option<usize>]| saved.lock().unwrap().push(results.to_vec());
        super::map_and_save(1, None, "", &[1, 2], |i| i * 2, save);
        assert_eq!(saved.into_inner().unwrap(), [[Some(2), None], [Some(2), Some(4)]]);
    }

    #[test]
    fn nothing_begins_after_the_budget() {
        let items = [1, 2, 3];
        let done = super::map(1, Some(std::time::Duration::ZERO), "", &items, |i| i * 2);
        assert_eq!(done, [None, None, None]);
    }
}
