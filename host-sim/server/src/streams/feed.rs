//! The newest pose of a session, for whoever asks.

use device_sim::page::condense::Condenser;
use device_sim::page::messages;
use device_sim::session::{Happening, ProbeView, Scene, Subscription};
use serde::Serialize;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::watch;
use tokio::time::{MissedTickBehavior, interval};

/// Between two looks at the session: 4 ms, at most 250 poses a second.
const PERIOD: Duration = Duration::from_millis(4);

/// The present state.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Snapshot {
    /// The newest pose; none before the first.
    pub pose: Option<NeedlePose>,
    /// True if the device answers.
    pub connected: bool,
    /// The fault that has latched, in words.
    pub fault: Option<String>,
    /// The events.
    pub events: Events,
    /// The scene; none before the first look.
    pub scene: Option<SharedScene>,
    /// The ultrasound probe as a page holds it; none before it has.
    pub probe: Option<ProbeView>,
    /// The place at which the needle's line has depth 0, mm along the skin and below it.
    pub needle_mm: [f64; 2],
}

/// A scene that equals itself and no other: it is compared with each pose.
#[derive(Clone, Debug)]
pub struct SharedScene(pub Arc<Scene>);

impl PartialEq for SharedScene {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// The number of events since the device connected, and the last of them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Events {
    total: u64,
    last: VecDeque<messages::Event>,
}

impl Events {
    /// More events than a device reports between two sends of a stream that keeps up.
    const KEPT: usize = 64;

    fn add(&mut self, event: messages::Event) {
        self.total += 1;
        self.last.push_back(event);
        if self.last.len() > Self::KEPT {
            self.last.pop_front();
        }
    }

    /// Returns their number.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// Returns the events after the first `told`, oldest first; a stream that is far behind misses
    /// the oldest of them.
    pub fn since(&self, told: u64) -> impl Iterator<Item = &messages::Event> {
        let new = self.total.saturating_sub(told).min(self.last.len() as u64) as usize;
        self.last.range(self.last.len() - new..)
    }
}

/// The needle's pose and force as sent in JSON; units are in the names.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NeedlePose {
    /// Seconds of the device's own clock.
    pub t_s: f64,
    /// Depth of the tip along the needle past the zero.
    pub depth_mm: f64,
    /// Speed, positive inwards.
    pub speed_mm_s: f64,
    /// Force that the control core asked for, positive where it resists insertion.
    pub force_n: f64,
    /// Force that the motor gives at the needle after all limits, the same sign.
    pub motor_n: f64,
    /// Inclination of the needle below the horizontal.
    pub tilt_rad: f64,
    /// Tip from the point of entry: along the skin, across, and out of the skin (negative inside).
    pub tip_mm: [f64; 3],
    /// Unit vector of the needle in the direction of insertion, the same axes.
    pub direction: [f64; 3],
    /// Angle to the skin that the layers are met at.
    pub angle_rad: f64,
    /// The state of the control law, as [`messages::Pose::state`] names it.
    pub state: &'static str,
    /// The tip's place relative to the vessel, as [`messages::Pose::vessel`] names it.
    pub vessel: &'static str,
}

impl From<&messages::Pose> for NeedlePose {
    fn from(pose: &messages::Pose) -> Self {
        let (sine, cosine) = pose.tilt_rad.sin_cos();
        let direction = [cosine, 0.0, -sine];
        Self {
            t_s: pose.t_s,
            depth_mm: pose.depth_mm,
            speed_mm_s: pose.speed_mm_s,
            force_n: pose.force_n,
            motor_n: pose.motor_n,
            tilt_rad: pose.tilt_rad,
            tip_mm: direction.map(|part| part * pose.depth_mm),
            direction,
            angle_rad: pose.angle_rad,
            state: pose.state,
            vessel: pose.vessel,
        }
    }
}

/// Keeps `publish` at the newest of `subscription` for ever.
pub(super) async fn run(mut subscription: Subscription, publish: watch::Sender<Snapshot>) {
    let mut condenser = Condenser::default();
    let mut due = interval(PERIOD);
    due.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        due.tick().await;
        let batch = subscription.drain();
        let faults = batch.events.iter().filter_map(fault).next_back();
        let connected = batch.link.connected;
        let scene = batch.scene.clone().map(|scene| SharedScene(Arc::new(scene)));
        let probe = batch.probe;
        let (_, frame) = condenser.take(batch);
        publish.send_if_modified(|snapshot| {
            let before = snapshot.clone();
            snapshot.connected = connected;
            snapshot.scene = scene.or_else(|| snapshot.scene.take());
            snapshot.probe = probe.or(snapshot.probe);
            snapshot.needle_mm = frame.needle.unwrap_or(snapshot.needle_mm);
            if let Some(fault) = faults {
                snapshot.fault = fault;
            }
            if let Some(pose) = &frame.pose {
                snapshot.pose = Some(pose.into());
            }
            frame.events.into_iter().for_each(|event| snapshot.events.add(event));
            *snapshot != before
        });
    }
}

/// Returns an event's effect on the latched fault: one latches, a person clears it, others
/// have none.
fn fault(happening: &Happening) -> Option<Option<String>> {
    match happening.event.kind {
        link::frames::EventKind::Fault { cause } => Some(Some(cause.to_string())),
        link::frames::EventKind::Cleared => Some(None),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_events_of_one_look_are_sent_and_the_oldest_lost_first() {
        let event = |t_s| messages::Event { t_s, ..messages::Event::default() };
        let mut events = Events::default();
        (0..3).for_each(|n| events.add(event(f64::from(n))));
        let since = |events: &Events, told| events.since(told).map(|e| e.t_s).collect::<Vec<_>>();
        assert_eq!(since(&events, 0), [0.0, 1.0, 2.0]);
        assert_eq!((since(&events, 2), since(&events, 3).len(), events.total()), (vec![2.0], 0, 3));
        (3..100).for_each(|n| events.add(event(f64::from(n))));
        let late = since(&events, 0);
        assert_eq!((late.len(), late[0], events.total()), (Events::KEPT, 36.0, 100));
    }

    #[test]
    fn the_tip_goes_down_along_the_needle() {
        let pose =
            messages::Pose { depth_mm: 9.6, tilt_rad: 30_f64.to_radians(), ..messages::Pose::default() };
        let needle = NeedlePose::from(&pose);
        assert!((needle.tip_mm[2] + 4.8).abs() < 1e-9, "{:?}", needle.tip_mm);
        assert!((needle.tip_mm[0] - 9.6 * 30_f64.to_radians().cos()).abs() < 1e-9);
        assert!((needle.direction.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
