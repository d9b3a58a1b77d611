//! The device that settles its diagnosis: a virtual one with a concealed mechanism, or a real one
//! behind a port.

use super::Plant;
use crate::characterise::mechanism::BareDevice;
use crate::characterise::programme::Programme;
use crate::characterise::writer::{Track, nominal_rig};
use crate::characterise::{self, News, configuration};
use crate::commission::bench::{Line, WireLine};
use crate::commission::mechanism::VirtualLine;
use control_core::Config;
use device_setup::bench::DeviceDialogue;
use device_setup::pause::block_on;
use device_sim::device::{Port, Wire};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use std::sync::atomic::AtomicBool;

/// The device that settles its diagnosis.
pub enum Subject<'a> {
    /// A virtual one.
    Virtual(Box<Plant>),
    /// A real one, whose torque `stop` takes away.
    Real {
        /// The way to it.
        port: &'a mut dyn Port,
        /// Set by a person who ends the run.
        stop: &'a AtomicBool,
    },
}

impl Subject<'_> {
    /// The simulation of its data sheet.
    ///
    /// # Errors
    /// A sentence if a real device does not answer or has not been commissioned.
    pub fn data_sheet_rig(&mut self) -> Result<Rig, Error> {
        Ok(nominal_rig(&characterise::scale(&self.config()?)?))
    }

    /// Its configuration, with a patient that it does not use.
    pub(super) fn config(&mut self) -> Result<Config, Error> {
        let Self::Real { port, stop } = self else { return Ok(configuration()) };
        let mut line = WireLine::new(opened(*port)?, stop);
        let device = block_on(async { DeviceDialogue::open(&mut line).await?.device().await })?;
        if !device.commissioned {
            return Err(Error::failed("the device has not been commissioned; run host-sim commission first"));
        }
        Ok(Config { device, ..configuration() })
    }

    /// Plays programmes. A virtual device rests before each until it is cold.
    pub(super) fn play(
        &mut self,
        programmes: &[Programme],
        mut played: impl FnMut(f64),
    ) -> Result<Vec<Track>, Error> {
        let mut news = |news: News| {
            if let News::Played(seconds) = news {
                played(seconds);
            }
        };
        match self {
            Self::Real { port, stop } => characterise::on_port(*port, programmes, stop, news),
            Self::Virtual(plant) => {
                let mut tracks = Vec::new();
                for programme in programmes {
                    let mut device = BareDevice::new(&plant.rig, &plant.file)?;
                    tracks.extend(characterise::on_virtual(
                        &mut device,
                        std::slice::from_ref(programme),
                        &mut news,
                    )?);
                }
                Ok(tracks)
            }
        }
    }

    /// Talks to it; `radius_mm` is its roller's.
    pub(super) fn talk<T>(
        &mut self,
        radius_mm: f64,
        talk: impl FnOnce(&mut dyn Line) -> Result<T, Error>,
    ) -> Result<T, Error> {
        match self {
            Self::Real { port, stop } => talk(&mut WireLine::new(opened(*port)?, stop)),
            Self::Virtual(plant) => talk(&mut VirtualLine::commissioned(&plant.rig, &plant.file, radius_mm)?),
        }
    }
}

fn opened(port: &mut dyn Port) -> Result<Box<dyn Wire>, Error> {
    port.open().map_err(|cause| {
        Error::failed(format_args!("the device cannot be opened ({cause}); plug it in and try again"))
    })
}
