//! The streams to serve, as a person writes them: `KIND` or `KIND=ADDRESS:PORT`.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::str::FromStr;

/// A protocol that poses are streamed by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// OpenIGTLink TRANSFORM and STATUS messages: 3D Slicer.
    Openigtlink,
    /// One JSON text a pose over a WebSocket: Unity, web pages, scripts.
    Websocket,
    /// One JSON datagram a pose: PlotJuggler.
    Udp,
    /// Foxglove's WebSocket; only where the feature `foxglove` is built in.
    Foxglove,
}

impl Kind {
    /// Every kind with its name and usual port.
    const ALL: [(Self, &str, u16); 4] = [
        (Self::Openigtlink, "openigtlink", 18_944),
        (Self::Websocket, "websocket", 8_711),
        (Self::Udp, "udp", 9_870),
        (Self::Foxglove, "foxglove", 8_765),
    ];

    fn row(self) -> (&'static str, u16) {
        let row = Self::ALL.iter().find(|(kind, ..)| *kind == self);
        row.map_or(("websocket", 8_711), |(_, name, port)| (name, *port))
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.row().0)
    }
}

/// One stream to serve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spec {
    /// The protocol.
    pub kind: Kind,
    /// Its address; for UDP, the destination.
    pub address: SocketAddr,
}

impl Spec {
    /// `kind` at its usual port of this computer.
    pub const fn of(kind: Kind) -> Self {
        let port = match kind {
            Kind::Openigtlink => 18_944,
            Kind::Websocket => 8_711,
            Kind::Udp => 9_870,
            Kind::Foxglove => 8_765,
        };
        Self { kind, address: SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), port) }
    }

    /// Checks that nobody but this computer can take part without a token.
    pub fn check(&self, token: Option<&Token>) -> Result<(), String> {
        if self.address.ip().is_loopback() {
            return Ok(());
        }
        if self.kind == Kind::Foxglove {
            return Err(format!(
                "--stream foxglove={} would be open to everybody, as its protocol has no token; use 127.0.0.1 and a tunnel",
                self.address
            ));
        }
        if token.is_none() {
            return Err(format!(
                "--stream {}={} is open to other computers; add --stream-token with at least {} characters",
                self.kind,
                self.address,
                Token::SHORTEST
            ));
        }
        Ok(())
    }
}

impl FromStr for Spec {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, address) = text.split_once('=').map_or((text, None), |(name, at)| (name, Some(at)));
        let Some((kind, ..)) = Kind::ALL.iter().find(|(_, known, _)| *known == name) else {
            let names: Vec<_> = Kind::ALL.iter().map(|(_, name, _)| *name).collect();
            return Err(format!("`{name}` is not a stream; there are {}", names.join(", ")));
        };
        let usual = Self::of(*kind);
        let Some(address) = address else { return Ok(usual) };
        let address = address
            .parse()
            .map_err(|_| format!("`{address}` is no ADDRESS:PORT such as {}", usual.address))?;
        Ok(Self { kind: *kind, address })
    }
}

/// The token that a client beyond this computer must send first.
#[derive(Clone, PartialEq, Eq)]
pub struct Token(String);

impl Token {
    /// The smallest number of characters.
    pub(crate) const SHORTEST: usize = 12;

    /// True if `said` is the token; takes equally long wherever they first differ.
    pub(super) fn is(&self, said: &[u8]) -> bool {
        let own = self.0.as_bytes();
        own.len() == said.len() && own.iter().zip(said).fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
    }

    pub(crate) fn text(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Token(…)")
    }
}

impl FromStr for Token {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-_.~".contains(&byte));
        if text.len() < Self::SHORTEST || !plain {
            let shortest = Self::SHORTEST;
            return Err(format!("a token has at least {shortest} letters, digits or -_.~ and nothing else"));
        }
        Ok(Self(text.into()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stream_is_a_name_with_or_without_an_address() {
        assert_eq!("udp".parse::<Spec>(), Ok(Spec::of(Kind::Udp)));
        let spec: Spec = "openigtlink=127.0.0.1:4000".parse().unwrap();
        assert_eq!((spec.kind, spec.address.port()), (Kind::Openigtlink, 4000));
        for (wrong, hint) in
            [("ros", "openigtlink, websocket, udp, foxglove"), ("udp=here", "127.0.0.1:9870")]
        {
            let said = wrong.parse::<Spec>().unwrap_err();
            assert!(said.contains(hint), "{said}");
        }
        for (kind, name, port) in Kind::ALL {
            assert_eq!((kind.to_string().as_str(), Spec::of(kind).address.port()), (name, port));
        }
    }

    #[test]
    fn other_computers_need_a_token() {
        let open: Spec = "websocket=0.0.0.0:8711".parse().unwrap();
        let token: Token = "abcdefghijkl".parse().unwrap();
        assert!(open.check(None).unwrap_err().contains("--stream-token"));
        assert_eq!(open.check(Some(&token)), Ok(()));
        assert_eq!(Spec::of(Kind::Websocket).check(None), Ok(()));
        let foxglove: Spec = "foxglove=0.0.0.0:8765".parse().unwrap();
        assert!(foxglove.check(Some(&token)).unwrap_err().contains("tunnel"));
    }

    #[test]
    fn a_token_is_long_plain_and_compared_whole() {
        assert!("short".parse::<Token>().is_err() && "abcdefghijk&x=1".parse::<Token>().is_err());
        let token: Token = "abcdefghijkl".parse().unwrap();
        assert!(token.is(b"abcdefghijkl") && !token.is(b"abcdefghijkm") && !token.is(b"abcdefghijkl1"));
        assert_eq!(format!("{token:?}"), "Token(…)");
    }
}
