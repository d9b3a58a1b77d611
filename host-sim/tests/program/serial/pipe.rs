//! Two byte queues in memory: the cable of a board that does not exist.

use device_sim::device::Wire;
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Bytes that a direction holds: more than 2 s of samples.
const CAPACITY: usize = 1 << 18;

#[derive(Default)]
struct Direction {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    bytes: VecDeque<u8>,
    closed: bool,
}

impl Direction {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One end of a cable; dropped, the other end sees it pulled.
pub(crate) struct End {
    incoming: Arc<Direction>,
    outgoing: Arc<Direction>,
}

/// A cable's two ends.
pub(crate) fn cable() -> (End, End) {
    let (there, back) = (Arc::<Direction>::default(), Arc::<Direction>::default());
    (End { incoming: back.clone(), outgoing: there.clone() }, End { incoming: there, outgoing: back })
}

impl End {
    /// Bytes that still fit on the way to the other end.
    pub(crate) fn room(&self) -> usize {
        CAPACITY - self.outgoing.lock().bytes.len().min(CAPACITY)
    }
}

impl Wire for End {
    fn read(&mut self, into: &mut [u8], patience: Duration) -> io::Result<usize> {
        let mut state = self.incoming.lock();
        if state.bytes.is_empty() && !state.closed && !patience.is_zero() {
            let waited = self.incoming.changed.wait_timeout(state, patience);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        if state.bytes.is_empty() && state.closed {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let count = into.len().min(state.bytes.len());
        for (place, byte) in into.iter_mut().zip(state.bytes.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        let mut state = self.outgoing.lock();
        if state.closed {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        // A cable whose far end has stopped reading for seconds is as good as pulled.
        if state.bytes.len() + bytes.len() > CAPACITY {
            return Err(io::ErrorKind::TimedOut.into());
        }
        state.bytes.extend(bytes);
        self.outgoing.changed.notify_one();
        Ok(())
    }
}

impl Drop for End {
    fn drop(&mut self) {
        for direction in [&self.incoming, &self.outgoing] {
            direction.lock().closed = true;
            direction.changed.notify_all();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_arrive_in_order_before_a_pulled_cable_is_noticed() {
        let (mut near, mut far) = cable();
        near.write(b"one").expect("open");
        near.write(b"two").expect("open");
        drop(near);
        let mut got = [0; 4];
        assert_eq!(far.read(&mut got, Duration::ZERO).expect("bytes wait"), 4);
        assert_eq!(&got, b"onet");
        assert_eq!(far.read(&mut got, Duration::ZERO).expect("bytes wait"), 2);
        assert!(far.read(&mut got, Duration::from_secs(1)).is_err());
        assert!(far.write(b"x").is_err());
    }

    #[test]
    fn a_full_cable_refuses_and_says_how_much_fits() {
        let (mut near, mut far) = cable();
        near.write(&vec![7; near.room()]).expect("it fits");
        assert_eq!(near.room(), 0);
        assert!(near.write(b"x").is_err());
        let mut got = [0; 100];
        assert_eq!(far.read(&mut got, Duration::ZERO).expect("bytes wait"), 100);
        assert_eq!(near.room(), 100);
    }
}
