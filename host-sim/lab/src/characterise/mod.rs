//! `characterise`: makes a device run excitations that separate one physical effect from another,
//! with no hand on the needle, and writes down what `diagnose` reads. The same commands and bytes
//! serve a real device and the virtual one.

mod following;
pub mod mechanism;
pub mod programme;
pub mod sequencer;
pub mod writer;

use control_core::Config;
use device_sim::device::{Port, Wire};
use device_sim::error::Error;
use device_sim::lockstep;
use link::device::{Endpoint, Identity};
use mechanism::BareDevice;
use programme::{Programme, ProgrammeStep};
use recording::messages::Hello;
use sequencer::Sequencer;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use writer::Track;

/// The longest single wait for a real device.
const PATIENCE: Duration = Duration::from_millis(2);

/// The control configuration for characterising: no tissue matters, encoder and torque limits as
/// they are.
pub fn configuration() -> Config {
    Config::commissioned_virtual()
}

/// The scale of a device that is configured with `config`.
pub fn scale(config: &Config) -> Result<Hello, Error> {
    let plan = config.plan().map_err(Error::failed)?;
    let device = Endpoint::new(Identity::VIRTUAL, &plan, None);
    Ok(Hello::from(&device.hello()))
}

/// The progress that a caller is shown meanwhile.
#[derive(Clone, Copy, Debug)]
pub enum News<'a> {
    /// A recording begins.
    Recording(&'a Programme),
    /// A person has something to do during the step that begins now.
    Prompt(&'a str),
    /// Seconds played of this recording.
    Played(f64),
}

/// Records every programme on the virtual device. The clock is the device's: it takes as long as
/// the computing does.
pub fn on_virtual(
    device: &mut BareDevice,
    programmes: &[Programme],
    mut news: impl FnMut(News),
) -> Result<Vec<Track>, Error> {
    let mut tracks = Vec::new();
    for programme in programmes {
        news(News::Recording(programme));
        let mut sequencer = Sequencer::new(configuration(), programme)?;
        sequencer.connected(lockstep::time(device.ticks()));
        while !sequencer.is_over() {
            let now = lockstep::time(device.ticks());
            device.receive(sequencer.transmit(now, |step: &ProgrammeStep| {
                device_tilt(step, &mut news);
            }));
            for _ in 0..lockstep::TICKS {
                let tilt = sequencer.playing().map_or(0.0, |(step, since)| step.tilt_at(now - since));
                device.tick(tilt);
            }
            lockstep::empty(|frame| device.transmit(frame), |bytes| sequencer.receive(now, bytes));
            news(News::Played(sequencer.played_s()));
        }
        tracks.push(sequencer.finish()?);
    }
    Ok(tracks)
}

fn device_tilt(step: &ProgrammeStep, news: &mut impl FnMut(News)) {
    if let Some(prompt) = step.prompt {
        news(News::Prompt(prompt));
    }
}

/// Records every programme on the device behind `port`, in real time. A cable that is pulled ends
/// it.
pub fn on_port(
    port: &mut dyn Port,
    programmes: &[Programme],
    stop: &AtomicBool,
    mut news: impl FnMut(News),
) -> Result<Vec<Track>, Error> {
    let gone = |cause: std::io::Error| {
        Error::failed(format_args!("the device went away ({cause}); plug it in and characterise again"))
    };
    let mut wire: Box<dyn Wire> = port.open().map_err(gone)?;
    let mut bytes = vec![0; 1 << 14];
    let begin = Instant::now();
    let mut tracks = Vec::new();
    for programme in programmes {
        news(News::Recording(programme));
        let mut sequencer = Sequencer::new(configuration(), programme)?;
        sequencer.connected(begin.elapsed());
        while !sequencer.is_over() {
            if stop.load(Ordering::Relaxed) {
                let out = sequencer.stop(begin.elapsed()).to_vec();
                let _ = wire.write(&out);
                return Err(Error::failed("stopped before the end; what was being recorded is not kept"));
            }
            let now = begin.elapsed();
            let out = sequencer.transmit(now, |step| device_tilt(step, &mut news)).to_vec();
            if !out.is_empty() {
                wire.write(&out).map_err(gone)?;
            }
            let count = wire.read(&mut bytes, PATIENCE).map_err(gone)?;
            sequencer.receive(begin.elapsed(), &bytes[..count]);
            news(News::Played(sequencer.played_s()));
        }
        tracks.push(sequencer.finish()?);
    }
    Ok(tracks)
}

/// Checks that every step may be played under `config`; the device checks it again, and the
/// sequences too.
pub fn check(config: &Config, programmes: &[Programme]) -> Result<(), Error> {
    let refuse = |why: control_core::Refusal| Error::input(format_args!("this excitation is refused: {why}"));
    let plan = config.plan().map_err(refuse)?;
    programmes.iter().flat_map(|p| &p.steps).try_for_each(|step| step.excitation.check(&plan).map_err(refuse))
}
