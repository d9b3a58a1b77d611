//! A procedure on the virtual device from its beginning to its end, as fast as it goes, recorded:
//! what `reproduce` draws and tests read. The control core, the link and the recording are those of
//! any other run.

use crate::outlets::Outlets;
use crate::realtime_clock::RealtimeClock;
use crate::run_loop::RunLoop;
use control_core::TICK_HZ;
use device_sim::device::virtual_device::VirtualDevice;
use device_sim::driver::Driver;
use device_sim::error::Error;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use device_sim::session::{self, Source};
use recording::messages::Setup;
use recording::read::Recording;
use recording::run_stats::RunStats;
use recording::write::Recorder;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// One round of `procedure` on `profile`, recorded in `file`, and read from there.
pub fn record(profile: &Profile, procedure: Procedure, file: &Path) -> Result<Recording, Error> {
    record_with(profile, procedure, file, false)
}

/// The same with depth counted from the surface of the deformed tissue.
pub fn record_deformed(profile: &Profile, procedure: Procedure, file: &Path) -> Result<Recording, Error> {
    record_with(profile, procedure, file, true)
}

fn record_with(
    profile: &Profile,
    procedure: Procedure,
    file: &Path,
    is_deformed: bool,
) -> Result<Recording, Error> {
    let (_, publisher) = session::open(profile.scene(Source::Virtual, Some(procedure.name.clone())));
    let setup = Setup {
        program: recording::version::program(),
        source: if is_deformed { "virtual, depth from the deformed tissue" } else { "virtual" }.into(),
        profile_toml: profile.source.text.clone(),
        profile_origin: profile.source.origin.clone(),
        procedure: Some(procedure.name.clone()),
        device_toml: None,
        purpose: procedure.purpose,
    };
    let recorder = Recorder::create(file, &setup)?;
    let ticks = (procedure.round_s * f64::from(TICK_HZ)).ceil() as u64;
    let outlets = Outlets::new(publisher, Some(recorder), RunStats::new(Some(ticks)));
    let stop = AtomicBool::new(false);
    let driver = Driver::new(profile.config.patient.clone());
    let device = VirtualDevice::new(profile, procedure);
    let device = if is_deformed { device.with_deformed(profile)? } else { device };
    RunLoop::new(driver, outlets, &stop).following(profile).run_in_step(
        device,
        RealtimeClock::Free,
        |_| {},
    )?;
    Recording::read(file)
}
