//! Read-only WebSocket: sends a page each new text. What the page says goes to a listener, if there
//! is one; a class has none.

use axum::extract::ws::{Message, WebSocket};
use axum::extract::{State, WebSocketUpgrade};
use axum::response::Response;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::{MissedTickBehavior, interval, timeout};

/// The source of one page's messages: the next JSON text, if there is one.
pub type Watch = Box<dyn FnMut() -> Option<String> + Send>;
/// A [`Watch`] for each page that comes.
pub type Watches = Arc<dyn Fn() -> Watch + Send + Sync>;

/// Takes what a page says; false where it is nonsense, which ends that page's connection.
pub type Said = Arc<dyn Fn(&str) -> bool + Send + Sync>;

/// The connection of a page of this kind.
#[derive(Clone)]
pub(super) struct Watched {
    pub(super) watches: Watches,
    pub(super) said: Option<Said>,
}

/// Between two looks: ten a second are enough for an overview.
const PERIOD: Duration = Duration::from_millis(100);
/// A page that takes nothing for so long is gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest message that is read, in bytes.
const LONGEST_MESSAGE: usize = 1_024;

pub(super) async fn live(State(watched): State<Watched>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(LONGEST_MESSAGE)
        .max_frame_size(LONGEST_MESSAGE)
        .on_upgrade(move |socket| tell(socket, (watched.watches)(), watched.said))
}

async fn tell(mut socket: WebSocket, mut watch: Watch, listener: Option<Said>) {
    let mut due = interval(PERIOD);
    due.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tokio::select! {
            said = socket.recv() => match said {
                Some(Ok(Message::Text(text))) => match &listener {
                    Some(take) if !take(&text) => return,
                    _ => continue,
                },
                Some(Ok(_)) => continue,
                _ => return,
            },
            _ = due.tick() => {}
        }
        let Some(text) = watch() else { continue };
        if !matches!(timeout(SEND_TIMEOUT, socket.send(Message::Text(text.into()))).await, Ok(Ok(()))) {
            return;
        }
    }
}
