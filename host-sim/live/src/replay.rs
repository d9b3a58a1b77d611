//! `host-sim replay`: a recording in the visualizer.

use crate::serving::{serve, stop_on_signals};
use clap::Args;
use device_sim::error::Error;
use device_sim::session::{self, Source};
use recording::read::Recording;
use server::replay::Replay as Player;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Play a recording in the visualizer, in a loop; Stop and Start on the page pause and resume it, a
/// slider moves it.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim replay session.mcap --port 8711"))]
pub struct Replay {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Port of the page on this computer; 0 for any free port
    #[arg(long, default_value_t = 8710, value_name = "N")]
    port: u16,
    /// Play it once and exit
    #[arg(long)]
    once: bool,
}

/// Reads a recording and warns if it is cut off.
pub fn read(file: &Path) -> Result<Recording, Error> {
    let recording = Recording::read(file)?;
    if let Some(why) = &recording.cut {
        eprintln!("host-sim: {} ends early ({why}); continuing with the complete part", recording.file);
    }
    Ok(recording)
}

impl Replay {
    pub(crate) fn run(self) -> Result<(), Error> {
        let recording = read(&self.file)?;
        let profile = recording.profile()?;
        let source = Source::Recording { file: recording.file.clone() };
        let scene = profile.scene(source, recording.setup.procedure.clone());
        let (session, publisher) = session::open(scene);
        let _server = serve(session, self.port)?;
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;
        let samples = Player::new(&recording, &publisher, &stop).run(!self.once);
        say!("samples={samples}");
        Ok(())
    }
}
