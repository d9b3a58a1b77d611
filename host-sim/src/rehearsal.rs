//! A procedure on the virtual device from its beginning to its end, as fast as it goes, recorded: what `reproduce` draws and tests
//! read. The control core, the link and the recording are those of any other run.

use crate::device::virtual_device::VirtualDevice;
use crate::driver::Driver;
use crate::failure::Failure;
use crate::outlets::Outlets;
use crate::pace::Pace;
use crate::procedure::Procedure;
use crate::profile::Profile;
use crate::recording::messages::Setup;
use crate::recording::read::Recording;
use crate::recording::write::Recorder;
use crate::session::{self, Source};
use crate::station::Station;
use crate::tally::Tally;
use control_core::TICK_HZ;
use std::path::Path;
use std::sync::atomic::AtomicBool;

/// One round of `procedure` on `profile`, recorded in `file`, and read from there.
pub fn record(profile: &Profile, procedure: Procedure, file: &Path) -> Result<Recording, Failure> {
    let (_, publisher) = session::open(profile.scene(Source::Virtual, Some(procedure.name.clone())));
    let setup = Setup {
        program: crate::version::program(),
        source: "virtual".into(),
        profile_toml: profile.source.text.clone(),
        profile_origin: profile.source.origin.clone(),
        procedure: Some(procedure.name.clone()),
        device_toml: None,
    };
    let recorder = Recorder::create(file, &setup)?;
    let ticks = (procedure.round_s * f64::from(TICK_HZ)).ceil() as u64;
    let outlets = Outlets::new(publisher, Some(recorder), Tally::new(Some(ticks)));
    let stop = AtomicBool::new(false);
    let driver = Driver::new(profile.config.patient.clone());
    let device = VirtualDevice::new(profile, procedure);
    Station::new(driver, outlets, &stop).run_in_step(device, Pace::Free, |_| {})?;
    Recording::read(file)
}
