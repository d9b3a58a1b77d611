//! A class: many devices, one instructor. Each device publishes its pose, events and scores over
//! Zenoh; the instructor's program gathers them and shows them in a page.
//!
//! [`publisher`] turns what a session brings into messages, [`board`] keeps the newest of every
//! device, `network` carries the messages. Only `network` needs the feature `class`: without it,
//! [`join`] and [`listen`] say which build has it.
//!
//! A device only publishes: it subscribes to nothing and answers nothing, so that nobody on the
//! network can start torque. It publishes from a thread of its own that reads the session's bounded
//! queue, so that the control path never waits for the network. This module may not touch the
//! device, the link or a recording's file.

pub mod board;
pub mod message;
#[cfg(feature = "class")]
mod network;
pub mod publisher;

use crate::streams::Token;
use std::fmt;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::str::FromStr;

#[cfg(feature = "class")]
pub use network::{Listener, Membership, join, listen};

/// The default address of the instructor's program: Zenoh's own port on this computer.
pub const USUAL_ADDRESS: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 7_447);

/// Name of a class or of a device in it: a part of a Zenoh key, hence 1 to 40 letters, digits or
/// `._-`.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Name(String);

impl Name {
    const LONGEST: usize = 40;

    /// The name of a device that was given none.
    pub fn device() -> Self {
        Self("device".into())
    }

    /// As written.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl FromStr for Name {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let plain = text.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"._-".contains(&byte));
        if text.is_empty() || text.len() > Self::LONGEST || !plain {
            let longest = Self::LONGEST;
            return Err(format!("a name has 1 to {longest} letters, digits or ._- and nothing else"));
        }
        Ok(Self(text.into()))
    }
}

/// The meeting point of a class: on the instructor's side the address to listen on, on a device's
/// side the one to connect to.
#[derive(Clone, Debug)]
pub struct Meeting {
    /// Name of the class.
    pub class: Name,
    /// The instructor's address.
    pub address: SocketAddr,
    /// The token that every device needs if other computers take part.
    pub token: Option<Token>,
}

impl Meeting {
    /// Checks that nobody but this computer can take part without a token; `flag` is the option
    /// that gave the address.
    pub fn check(&self, flag: &str) -> Result<(), String> {
        if self.address.port() == 0 {
            return Err(format!("{flag} {} needs a port that both sides know, such as 7447", self.address));
        }
        if self.address.ip().is_loopback() || self.token.is_some() {
            return Ok(());
        }
        let (address, shortest) = (self.address, Token::SHORTEST);
        Err(format!(
            "{flag} {address} is open to other computers; add --class-token with at least {shortest} characters"
        ))
    }
}

/// The reason why a class cannot meet.
#[derive(Debug)]
pub struct ClassError {
    sentence: String,
}

impl fmt::Display for ClassError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.sentence)
    }
}

impl std::error::Error for ClassError {}

#[cfg(not(feature = "class"))]
mod without {
    use super::board::Board;
    use super::{ClassError, Meeting, Name};
    use device_sim::session::Session;
    use std::convert::Infallible;
    use std::sync::Arc;

    /// A device in a class; it cannot be made in this build.
    #[derive(Debug)]
    pub struct Membership(#[allow(dead_code, reason = "cannot be made")] Infallible);

    /// The instructor's end; it cannot be made in this build.
    #[derive(Debug)]
    pub struct Listener(#[allow(dead_code, reason = "cannot be made")] Infallible);

    fn not_built() -> ClassError {
        let build = "cargo run --release --features class --";
        ClassError { sentence: format!("this program was built without classes; run it with `{build} …`") }
    }

    /// Says which build can publish.
    pub fn join(_: Session, _: &Meeting, _: &Name) -> Result<Membership, ClassError> {
        Err(not_built())
    }

    /// Says which build can listen.
    pub fn listen(_: &Meeting, _: Arc<Board>) -> Result<Listener, ClassError> {
        Err(not_built())
    }
}
#[cfg(not(feature = "class"))]
pub use without::{Listener, Membership, join, listen};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_fits_into_a_key() {
        for good in ["a", "ward-3.left_bed", &"x".repeat(40)] {
            assert_eq!(good.parse::<Name>().map(|name| name.to_string()), Ok(good.to_owned()));
        }
        for bad in ["", "a/b", "*", "a b", "ä", &"x".repeat(41)] {
            assert!(bad.parse::<Name>().is_err(), "{bad}");
        }
    }

    #[test]
    fn other_computers_need_a_token() {
        let meeting = |address: &str, token: Option<&str>| Meeting {
            class: "c".parse().unwrap(),
            address: address.parse().unwrap(),
            token: token.map(|text| text.parse().unwrap()),
        };
        assert_eq!(meeting("127.0.0.1:7447", None).check("--listen"), Ok(()));
        assert_eq!(meeting("0.0.0.0:7447", Some("abcdefghijkl")).check("--listen"), Ok(()));
        assert!(meeting("127.0.0.1:0", None).check("--listen").is_err());
        let said = meeting("0.0.0.0:7447", None).check("--listen").unwrap_err();
        assert!(said.contains("--class-token") && said.contains("--listen 0.0.0.0:7447"), "{said}");
    }

    #[cfg(not(feature = "class"))]
    #[test]
    fn a_build_without_it_names_the_one_with_it() {
        let meeting = Meeting { class: "c".parse().unwrap(), address: USUAL_ADDRESS, token: None };
        let said = listen(&meeting, std::sync::Arc::default()).unwrap_err().to_string();
        assert!(said.contains("--features class") && said.lines().count() == 1, "{said}");
    }
}
