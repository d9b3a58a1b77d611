//! Work shared among a few threads, with a progress line where a person watches.

use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// Applies `work` to every item on `jobs` threads; results in the items' order. Progress goes to standard error if it is a
/// terminal and nowhere otherwise.
pub(crate) fn map<T: Sync, R: Send>(
    jobs: usize,
    label: &str,
    items: &[T],
    work: impl Fn(&T) -> R + Sync,
) -> Vec<R> {
    let next = AtomicUsize::new(0);
    let done = AtomicUsize::new(0);
    let results: Mutex<Vec<Option<R>>> = Mutex::new(items.iter().map(|_| None).collect());
    let watched = std::io::stderr().is_terminal();
    let start = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, items.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let i = next.fetch_add(1, Ordering::Relaxed);
                    let Some(item) = items.get(i) else { break };
                    let result = work(item);
                    results.lock().expect("no holder of the lock panics")[i] = Some(result);
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
    let results = results.into_inner().expect("no holder of the lock panics");
    results.into_iter().map(|r| r.expect("every item was worked on")).collect()
}

#[cfg(test)]
mod tests {
    #[test]
    fn results_keep_the_order() {
        let items: Vec<usize> = (0..100).collect();
        assert_eq!(super::map(3, "", &items, |i| i * i), items.iter().map(|i| i * i).collect::<Vec<_>>());
    }
}
