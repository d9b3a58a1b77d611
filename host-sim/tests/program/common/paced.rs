//! A virtual device in real time, as `host-sim run` runs it, and how late its control path was
//! meanwhile.

use device_sim::device::virtual_device::VirtualDevice;
use device_sim::driver::Driver;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use device_sim::session::{self, Publisher, Session, Source};
use recording::run_stats::RunStats;
use server::outlets::Outlets;
use server::realtime_clock::RealtimeClock;
use server::run_loop::{RunLoop, RunOutcome};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// A firmware whose PC is silent for longer takes the torque away: nothing may hold the control
/// path up for so long.
pub(crate) const HEARTBEAT_LIMIT: Duration = Duration::from_millis(200);

/// The adult's session, and the end that feeds it.
pub(crate) fn open() -> (Session, Publisher) {
    let profile = Profile::find("adult").expect("it is built in");
    let (session, publisher) = session::open(profile.scene(Source::Virtual, None));
    (session, publisher)
}

/// The result of a run.
pub(crate) struct Paced {
    /// Its totals.
    pub(crate) outcome: RunOutcome,
    /// The lag of the control path behind the clock, every 100 ms, in ascending order.
    pub(crate) late: Vec<Duration>,
}

impl Paced {
    /// The most that it was behind.
    pub(crate) fn worst(&self) -> Duration {
        self.late.last().copied().unwrap_or_default()
    }

    /// The median of how late it was.
    pub(crate) fn median(&self) -> Duration {
        self.late[self.late.len() / 2]
    }
}

/// The end of a run.
#[allow(dead_code, reason = "each test program uses the way that it needs")]
pub(crate) enum End<'a> {
    /// After so many seconds.
    After(u64),
    /// When the flag is set, however long that takes on a slow machine.
    When(&'a AtomicBool),
}

/// Runs the scripted venepuncture; `started` says whether the torque is on or waits for a person.
pub(crate) fn run(publisher: Publisher, end: End, started: bool) -> Paced {
    let profile = Profile::find("adult").expect("it is built in");
    let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
    let device = VirtualDevice::new(&profile, procedure);
    let never = AtomicBool::new(false);
    let (samples, stop) = match end {
        End::After(seconds) => (Some(seconds * 10_000), &never),
        End::When(stop) => (None, stop),
    };
    let outlets = Outlets::new(publisher, None, RunStats::new(samples));
    let run_loop = RunLoop::new(Driver::new(profile.config.patient.clone()), outlets, stop);
    let run_loop = if started { run_loop } else { run_loop.wait_for_a_person() };
    let (begin, mut looks, mut late) = (Instant::now(), 0_u32, Vec::new());
    let look = |_| {
        // The first look comes with tick 1,000, whose exchange was due 1 ms before it.
        looks += 1;
        let due = Duration::from_millis(100) * looks - Duration::from_millis(1);
        late.push(begin.elapsed().saturating_sub(due));
    };
    let outcome = run_loop.run_in_step(device, RealtimeClock::real_time(), look).expect("it runs");
    late.sort();
    Paced { outcome, late }
}
