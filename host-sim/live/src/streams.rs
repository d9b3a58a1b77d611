//! The flags of the live streams.

use clap::Args;
use device_sim::error::Error;
use device_sim::session::Session;
use server::streams::{self, Spec, Streams, Token};

#[derive(Args)]
pub(crate) struct StreamFlags {
    /// Stream poses live; may be repeated: openigtlink (3D Slicer, port 18944), websocket (JSON,
    /// 8711), udp (JSON for PlotJuggler, 9870), foxglove (8765); on this computer unless an address
    /// is given
    #[arg(long = "stream", value_name = "KIND[=ADDRESS:PORT]")]
    streams: Vec<Spec>,
    /// Token that a client on another computer must send first; at least 12 characters
    #[arg(long = "stream-token", value_name = "TOKEN")]
    token: Option<Token>,
}

impl StreamFlags {
    /// Checks the options beyond what clap can.
    pub(crate) fn check(&self) -> Result<(), Error> {
        self.streams.iter().try_for_each(|spec| spec.check(self.token.as_ref())).map_err(Error::input)
    }

    /// Serves the requested streams and prints their addresses.
    pub(crate) fn serve(&self, session: &Session) -> Result<Option<Streams>, Error> {
        if self.streams.is_empty() {
            return Ok(None);
        }
        let served = streams::serve(session, &self.streams, self.token.as_ref()).map_err(Error::failed)?;
        for (kind, address) in served.addresses() {
            note!("{kind} stream at {address}");
        }
        Ok(Some(served))
    }
}
