//! One JSON datagram a pose, as PlotJuggler's UDP server reads it. What is not listened to is lost,
//! which costs nothing.

use super::feed::{NeedlePose, Snapshot};
use super::spec::Token;
use serde::Serialize;
use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr};
use tokio::net::UdpSocket;
use tokio::sync::watch;

/// A pose on the wire.
#[derive(Serialize)]
struct Datagram<'a> {
    /// PlotJuggler takes it for the time axis.
    timestamp: f64,
    #[serde(flatten)]
    pose: &'a NeedlePose,
    /// Lets a receiver on another computer distinguish our datagrams from others.
    #[serde(skip_serializing_if = "Option::is_none")]
    token: Option<&'a str>,
}

/// Sends every new pose to `address`.
pub(super) async fn serve(
    address: SocketAddr,
    mut newest: watch::Receiver<Snapshot>,
    token: Option<Token>,
) -> io::Result<SocketAddr> {
    let own: SocketAddr =
        if address.is_ipv4() { (Ipv4Addr::UNSPECIFIED, 0).into() } else { (Ipv6Addr::UNSPECIFIED, 0).into() };
    let socket = UdpSocket::bind(own).await?;
    tokio::spawn(async move {
        while newest.changed().await.is_ok() {
            let Some(pose) = newest.borrow_and_update().pose.clone() else { continue };
            let datagram =
                Datagram { timestamp: pose.t_s, pose: &pose, token: token.as_ref().map(Token::text) };
            // Only a map with keys that are not strings cannot be written, and no datagram has one.
            let Ok(text) = serde_json::to_vec(&datagram) else { continue };
            // Nobody may be listening: that is theirs.
            let _ = socket.send_to(&text, address).await;
        }
    });
    Ok(address)
}
