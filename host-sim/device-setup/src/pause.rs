//! The pause at the end of each exchange with a device, and the loop of a program that may block.

use std::future::poll_fn;
use std::pin::pin;
use std::task::{Context, Poll, Waker};

/// Gives control back once to whoever polls the dialogue.
pub async fn pause() {
    let mut is_over = false;
    poll_fn(|_| if std::mem::replace(&mut is_over, true) { Poll::Ready(()) } else { Poll::Pending }).await;
}

/// Runs a dialogue to its end on a line whose exchanges wait for the device by themselves.
pub fn block_on<T>(dialogue: impl Future<Output = T>) -> T {
    let mut dialogue = pin!(dialogue);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        if let Poll::Ready(result) = dialogue.as_mut().poll(&mut context) {
            return result;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pause_gives_control_back_once() {
        let mut dialogue = pin!(async {
            pause().await;
            7
        });
        let mut context = Context::from_waker(Waker::noop());
        assert_eq!(dialogue.as_mut().poll(&mut context), Poll::Pending);
        assert_eq!(dialogue.as_mut().poll(&mut context), Poll::Ready(7));
        assert_eq!(block_on(async { pause().await }), ());
    }
}
