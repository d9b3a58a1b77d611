//! `host-sim class`: the instructor's page; and the flags by which `run` joins a class.

use crate::output;
use crate::serving::stop_on_signals;
use clap::Args;
use device_sim::error::Error;
use device_sim::session::Session;
use server::class::board::{Board, Sent};
use server::class::{self, Meeting, Membership, Name, USUAL_ADDRESS};
use server::streams::Token;
use server::visualizer::{self, Watch};
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The period of looking at the signals.
const PAUSE: Duration = Duration::from_millis(100);

/// Show a class of devices: everyone's needle, live scores, who is stuck, who is gone.
///
/// Devices join with `run --class NAME`. The page only shows: it cannot start anything. Needs a
/// build with `--features class`.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim class ward-3
  host-sim class ward-3 --listen 192.168.1.20:7447 --class-token a-long-secret"))]
pub struct Class {
    /// Name of the class: letters, digits, ._-
    name: Name,
    /// Address that devices connect to; one that other computers reach needs --class-token
    #[arg(long, default_value_t = USUAL_ADDRESS, value_name = "ADDRESS:PORT")]
    listen: SocketAddr,
    /// Token that every device must know; at least 12 characters
    #[arg(long, value_name = "TOKEN")]
    class_token: Option<Token>,
    /// Port of the page on this computer; 0 for any free port
    #[arg(long, default_value_t = 8720, value_name = "N")]
    port: u16,
}

impl Class {
    pub(crate) fn run(self) -> Result<(), Error> {
        let meeting = Meeting { class: self.name, address: self.listen, token: self.class_token };
        meeting.check("--listen").map_err(Error::input)?;
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;
        let board = Arc::new(Board::default());
        let _listener = class::listen(&meeting, board.clone()).map_err(Error::failed)?;
        let Meeting { class: name, address, .. } = meeting;
        let shown = name.clone();
        let watch = move || -> Watch {
            let (board, name, mut sent) = (board.clone(), shown.clone(), Sent::default());
            Box::new(move || board.text(&name, address, Instant::now(), &mut sent))
        };
        let server = visualizer::serve_watched(Arc::new(watch), self.port).map_err(Error::failed)?;
        note!("class {name} listens on {address}");
        output::page("class page", &server.url());
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(PAUSE);
        }
        Ok(())
    }
}

/// The options by which a run joins a class.
#[derive(Args)]
pub(crate) struct ClassFlags {
    /// Publish pose, events and scores to the class of this name; needs a build with --features
    /// class
    #[arg(long, value_name = "NAME")]
    class: Option<Name>,
    /// Name of this device in the class; without it, this computer's name
    #[arg(long, value_name = "NAME", requires = "class")]
    class_as: Option<Name>,
    /// Address of the instructor's program; another computer's needs --class-token
    #[arg(long, default_value_t = USUAL_ADDRESS, value_name = "ADDRESS:PORT")]
    class_at: SocketAddr,
    /// The class's token, as the instructor gave it
    #[arg(long, value_name = "TOKEN", requires = "class")]
    class_token: Option<Token>,
}

impl ClassFlags {
    /// Checks the options beyond what clap can.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.meeting().map_or(Ok(()), |meeting| meeting.check("--class-at")).map_err(Error::input)
    }

    /// Joins the class if one was given, and says so.
    pub(crate) fn join(&self, session: &Session) -> Result<Option<Membership>, Error> {
        let Some(meeting) = self.meeting() else { return Ok(None) };
        let name = self.class_as.clone().unwrap_or_else(computer);
        let membership = class::join(session.clone(), &meeting, &name).map_err(Error::failed)?;
        say!("class {} at {} as {name}", meeting.class, meeting.address);
        Ok(Some(membership))
    }

    /// True if the run joins a class.
    pub(crate) fn is_wanted(&self) -> bool {
        self.class.is_some()
    }

    fn meeting(&self) -> Option<Meeting> {
        let class = self.class.clone()?;
        Some(Meeting { class, address: self.class_at, token: self.class_token.clone() })
    }
}

/// This computer's name, as far as it fits into a key.
fn computer() -> Name {
    let told = std::fs::read_to_string("/etc/hostname").ok();
    let told = told.or_else(|| std::env::var("COMPUTERNAME").ok()).unwrap_or_default();
    let plain: String =
        told.trim().chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).take(40).collect();
    plain.parse().unwrap_or_else(|_| Name::device())
}
