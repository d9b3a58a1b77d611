//! Live streams to the tools that people already use: OpenIGTLink (3D Slicer), a WebSocket of JSON
//! poses (Unity and the like), UDP JSON (PlotJuggler), Foxglove's WebSocket.
//!
//! `feed` keeps the newest pose of a session and nothing else; each stream sends it at its own
//! pace, so that a stalled or slow client loses poses and costs nobody anything. No stream takes an
//! order: none can start torque.
//!
//! This module may not touch the device, the link or a recording: it knows a [`Session`] and
//! nothing behind it.

mod feed;
#[cfg(feature = "foxglove")]
mod foxglove;
mod openigtlink;
mod spec;
mod udp;
mod ultrasound_image;
mod websocket;

pub use feed::{NeedlePose, Snapshot};
pub use spec::{Kind, Spec, Token};

use device_sim::session::Session;
use std::fmt;
use std::io;
use std::net::SocketAddr;
use std::sync::mpsc;
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::{oneshot, watch};

/// Clients of one stream at the same time; one more is turned away.
const MOST_CLIENTS: usize = 32;
/// A client that takes nothing for so long is gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(5);

/// The reason why a stream cannot be served.
#[derive(Debug)]
pub struct StreamError {
    spec: Spec,
    cause: String,
}

impl StreamError {
    fn new(spec: &Spec, cause: impl fmt::Display) -> Self {
        Self { spec: *spec, cause: cause.to_string() }
    }
}

impl fmt::Display for StreamError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Spec { kind, address } = self.spec;
        write!(
            f,
            "the {kind} stream at {address} cannot be served: {}; choose another address with --stream {kind}=ADDRESS:PORT",
            self.cause
        )
    }
}

impl std::error::Error for StreamError {}

/// Streams being served; dropped, they are not any more.
#[derive(Debug)]
pub struct Streams {
    /// The address of each stream, in the order of the request.
    addresses: Vec<(Kind, SocketAddr)>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Streams {
    /// Returns the address of each stream (for UDP, the destination), in the order of the request.
    pub fn addresses(&self) -> &[(Kind, SocketAddr)] {
        &self.addresses
    }
}

impl Drop for Streams {
    fn drop(&mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// Serves `session` by every stream of `specs`, all on one thread of their own.
pub fn serve(session: &Session, specs: &[Spec], token: Option<&Token>) -> Result<Streams, StreamError> {
    let first = specs.first().copied().unwrap_or(Spec::of(Kind::Websocket));
    let failed = |error: io::Error| StreamError::new(&first, error);
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let (stop, stopped) = oneshot::channel();
    let (opened, addresses) = mpsc::channel();
    let specs = specs.to_vec();
    let token = token.cloned();
    // Here, so that a pose published once this has returned is not lost.
    let subscription = session.subscribe();
    let run = move || {
        runtime.block_on(async {
            let (publish, newest) = watch::channel(Snapshot::default());
            let mut bound = Vec::new();
            for spec in &specs {
                match open(spec, &newest, token.as_ref()).await {
                    Ok(address) => bound.push((spec.kind, address)),
                    Err(error) => {
                        let _ = opened.send(Err(error));
                        return;
                    }
                }
            }
            let _ = opened.send(Ok(bound));
            tokio::select! {
                () = feed::run(subscription, publish) => {}
                _ = stopped => {}
            }
        });
        // Ends connections too; nothing in them blocks.
        runtime.shutdown_background();
    };
    let thread = std::thread::Builder::new().name("streams".into()).spawn(run).map_err(failed)?;
    let gone = || Err(failed(io::Error::other("its thread ended")));
    let addresses = addresses.recv().unwrap_or_else(|_| gone())?;
    Ok(Streams { addresses, stop: Some(stop), thread: Some(thread) })
}

/// Opens one stream; its tasks live as long as the runtime.
async fn open(
    spec: &Spec,
    newest: &watch::Receiver<Snapshot>,
    token: Option<&Token>,
) -> Result<SocketAddr, StreamError> {
    let failed = |error: io::Error| StreamError::new(spec, error);
    // On this computer no token is asked for.
    let token = if spec.address.ip().is_loopback() { None } else { token.cloned() };
    match spec.kind {
        Kind::Openigtlink => openigtlink::serve(spec.address, newest.clone(), token).await.map_err(failed),
        Kind::Websocket => websocket::serve(spec.address, newest.clone(), token).await.map_err(failed),
        Kind::Udp => udp::serve(spec.address, newest.clone(), token).await.map_err(failed),
        #[cfg(feature = "foxglove")]
        Kind::Foxglove => {
            foxglove::serve(spec.address, newest.clone()).await.map_err(|cause| StreamError::new(spec, cause))
        }
        #[cfg(not(feature = "foxglove"))]
        Kind::Foxglove => Err(StreamError::new(
            spec,
            "this program was built without it; build it with `cargo run --release --features foxglove`",
        )),
    }
}
