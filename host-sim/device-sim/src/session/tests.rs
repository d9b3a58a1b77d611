use super::*;
use link::frames::EventKind;

fn scene() -> Scene {
    Scene {
        source: Source::Virtual,
        profile: "adult".into(),
        procedure: None,
        layers: Vec::new(),
        roller_radius_mm: 10.0,
        travel_mm: 60.0,
        largest_force_n: 2.88,
        force_scale: 1.0,
        tilt_rad: 0.0,
        skin_tilt_rad: 0.0,
        slope_deg: None,
        vessel: None,
        body: None,
        beside: Vec::new(),
        needle: SceneNeedle::reaching(15.6),
        hand: true,
    }
}

#[test]
fn a_slow_looker_loses_the_oldest_and_learns_how_many() {
    let (session, publisher) = open(scene());
    let (mut slow, mut quick) = (session.subscribe(), session.subscribe());
    let block = [Sample::default(); 32];
    let mut seen = 0;
    for block_number in 0..1_000 {
        publisher.samples(block_number * 32, &block);
        seen += quick.drain().samples.len();
    }
    assert_eq!(seen, 32_000);
    let late = slow.drain();
    assert_eq!((late.samples.len(), late.link.skipped_samples), (20_000, 12_000));
    assert_eq!(late.samples.first().map(|s| s.0), Some(12_000));
    assert_eq!(slow.drain().samples.len(), 0);
}

#[test]
fn what_comes_after_a_jump_drops_none_of_it() {
    let (session, publisher) = open(scene());
    let mut looker = session.subscribe();
    let poses: Vec<_> = (0..10_000).map(|ms| Pose { tick: ms * 10, ..Pose::default() }).collect();
    let samples: Vec<_> = (0..100_000).map(|tick| (tick, Sample::default())).collect();
    publisher.jump(&samples, &poses, &[]);
    publisher.pose(Pose { tick: 100_000, ..Pose::default() });
    publisher.samples(100_000, &[Sample::default()]);
    let batch = looker.drain();
    assert!(batch.poses.len() >= 10_000 && batch.samples.len() >= 100_000);
    assert!(batch.poses[0].tick <= 10, "the ten seconds before are there");
}

#[test]
fn late_subscribers_get_the_same_state_and_dropped_ones_go() {
    let (session, publisher) = open(scene());
    let mut early = session.subscribe();
    let pose = |tick| publisher.pose(Pose { tick, ..Pose::default() });
    let event = |tick| publisher.event(Event { tick, kind: EventKind::Puncture { layer: 0 } });
    pose(10);
    // It overtakes the pose of its millisecond, and the pose of its own tick is from after the
    // drop.
    event(30);
    pose(20);
    pose(30);
    event(90_000);
    let told = |batch: &Batch| -> Vec<_> {
        batch.events.iter().map(|h| (h.event.tick, h.before.map(|pose| pose.tick))).collect()
    };
    let seen = told(&early.drain());
    assert_eq!(seen, [(30, Some(20)), (90_000, None)]);
    drop(early);
    pose(40);
    assert!(lock(&session.hub.state).subscribers.is_empty());
    let batch = session.subscribe().drain();
    assert_eq!(told(&batch), seen);
    assert!(batch.poses.is_empty());
}

#[test]
fn poses_of_a_restarted_device_do_not_change_earlier_events() {
    let (session, publisher) = open(scene());
    publisher.pose(Pose { tick: 490, ..Pose::default() });
    publisher.event(Event { tick: 500, kind: EventKind::Stopped });
    publisher.pose(Pose::default());
    let events = session.subscribe().drain().events;
    assert_eq!(events[0].before.map(|pose| pose.tick), Some(490));
}

#[test]
fn controls_arrive_in_order_and_outlive_their_device() {
    let (session, publisher) = open(scene());
    session.control(Control::Start);
    session.control(Control::Drag { depth_mm: 3.0 });
    assert_eq!(publisher.next_control(), Some(Control::Start));
    assert_eq!(publisher.next_control(), Some(Control::Drag { depth_mm: 3.0 }));
    assert_eq!(publisher.next_control(), None);
    drop(publisher);
    session.control(Control::Stop);
}
