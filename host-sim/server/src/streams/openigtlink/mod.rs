//! OpenIGTLink, 3D Slicer's way: the needle's pose and the probe's as TRANSFORM messages, the
//! ultrasound image as IMAGE messages, the device's condition as STATUS messages.
//!
//! [`message`] is the protocol's bytes, `image` those of an image and its probe. Written here
//! because the crate of that name brings a TLS library and a logger for what is a header of 58
//! bytes.

mod image;
mod message;

use super::feed::Snapshot;
use super::spec::Token;
use super::ultrasound_image::{self, Images};
use super::{MOST_CLIENTS, SEND_TIMEOUT};
use message::{Status, transform};
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{Semaphore, watch};
use tokio::time::{Instant, sleep, timeout};

/// Between two poses to one client: 60 a second, a screen's rate.
const POSE_PERIOD: Duration = Duration::from_micros(16_667);
/// A status goes out at the latest after this, and at once when it changes.
const STATUS_PERIOD: Duration = Duration::from_secs(1);
/// A client that owes a token has this long.
const TOKEN_TIME: Duration = Duration::from_secs(5);
/// After a connection that could not be accepted (no file handles left).
const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Serves at `address`.
pub(super) async fn serve(
    address: SocketAddr,
    newest: watch::Receiver<Snapshot>,
    token: Option<Token>,
) -> io::Result<SocketAddr> {
    let listener = TcpListener::bind(address).await?;
    let bound = listener.local_addr()?;
    let places = Arc::new(Semaphore::new(MOST_CLIENTS));
    let images = ultrasound_image::begin(newest.clone())?;
    tokio::spawn(async move {
        loop {
            let Ok((stream, _)) = listener.accept().await else {
                sleep(ACCEPT_PAUSE).await;
                continue;
            };
            // One too many is closed at once.
            let Ok(place) = places.clone().try_acquire_owned() else { continue };
            let (newest, images, token) = (newest.clone(), images.clone(), token.clone());
            tokio::spawn(async move {
                let _place = place;
                client(stream, newest, images, token).await;
            });
        }
    });
    Ok(bound)
}

async fn client(stream: TcpStream, newest: watch::Receiver<Snapshot>, images: Images, token: Option<Token>) {
    let _ = stream.set_nodelay(true);
    let (mut reader, writer) = stream.into_split();
    if let Some(token) = token
        && !matches!(timeout(TOKEN_TIME, says(&mut reader, &token)).await, Ok(Ok(true)))
    {
        return;
    }
    tokio::select! {
        () = throw_away(reader) => {}
        () = stream_to(writer, newest, images.watch()) => {}
    }
}

/// True if the first message is a STRING with the token.
async fn says(reader: &mut OwnedReadHalf, token: &Token) -> io::Result<bool> {
    let mut header = [0; message::HEADER];
    reader.read_exact(&mut header).await?;
    let Some(length) = message::string_length(&header) else { return Ok(false) };
    let mut body = vec![0; length];
    reader.read_exact(&mut body).await?;
    Ok(message::string_text(&body).is_some_and(|said| token.is(said)))
}

/// Reads whatever the client says, which changes nothing, until it leaves.
async fn throw_away(mut reader: OwnedReadHalf) {
    let mut bytes = [0; 1_024];
    while matches!(reader.read(&mut bytes).await, Ok(count) if count > 0) {}
}

async fn stream_to(
    mut writer: OwnedWriteHalf,
    mut newest: watch::Receiver<Snapshot>,
    mut images: ultrasound_image::Watched,
) {
    let mut told: Option<(Status, Instant)> = None;
    newest.mark_changed();
    loop {
        // A quiet device still says how it is.
        let _ = timeout(STATUS_PERIOD, newest.changed()).await;
        let snapshot = newest.borrow_and_update().clone();
        let mut out = Vec::new();
        let status = Status::of(&snapshot);
        if told.as_ref().is_none_or(|(last, when)| *last != status || when.elapsed() >= STATUS_PERIOD) {
            out.extend(status.bytes());
            told = Some((status, Instant::now()));
        }
        if let Some(pose) = &snapshot.pose {
            out.extend(transform(pose));
        }
        if let Some(image) = images.next() {
            out.extend(image::messages(&image));
        }
        if !matches!(timeout(SEND_TIMEOUT, writer.write_all(&out)).await, Ok(Ok(()))) {
            return;
        }
        sleep(POSE_PERIOD).await;
    }
}
