//! Serving a page until a signal ends the program.

use crate::output;
use device_sim::error::Error;
use device_sim::session::Session;
use server::visualizer;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Serves the page and prints its address.
pub fn serve(session: Session, port: u16) -> Result<visualizer::Server, Error> {
    let server = visualizer::serve(session, port).map_err(Error::failed)?;
    output::page("visualizer", &server.url());
    Ok(server)
}

/// Ends the run cleanly on Ctrl-C and SIGTERM: torque off, recording closed, last line printed.
pub fn stop_on_signals(stop: &Arc<AtomicBool>) -> Result<(), Error> {
    for signal in [signal_hook::consts::SIGINT, signal_hook::consts::SIGTERM] {
        // Not more: some send a signal twice, and the first must be able to close the recording.
        signal_hook::flag::register(signal, stop.clone())
            .map_err(|cause| Error::failed(format_args!("signal handlers cannot be installed ({cause})")))?;
    }
    Ok(())
}
