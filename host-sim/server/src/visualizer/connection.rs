//! One page: what it is sent, and what it asks for. The two ways are independent, so that the stop
//! of a page that is too slow to read still arrives.

use super::shared::Shared;
use axum::extract::ws::{CloseFrame, Message, Utf8Bytes, WebSocket, close_code};
use control_core::TICK_HZ;
use device_sim::page::condense::Condenser;
use device_sim::page::messages::ToPage;
use device_sim::session::{Control, Hand, TaskDone};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt, StreamExt};
use std::sync::atomic::Ordering;
use std::time::Duration;
use tokio::time::{Instant, MissedTickBehavior, interval, timeout};

/// Between two frames to the page: half of the 16.7 ms of a screen, so that news waits 4 ms on
/// average instead of 8, and each picture has some.
const FRAME_PERIOD: Duration = Duration::from_millis(8);
/// Between two frames that have nothing new of the needle.
const QUIET_PERIOD: Duration = Duration::from_millis(250);
/// A page that takes nothing for so long is gone.
const SEND_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest reason that a closing WebSocket may give, in bytes.
const LONGEST_REASON: usize = 120;

/// Serves one page until it leaves.
pub(super) async fn run(socket: WebSocket, shared: Shared) {
    let (mut sink, stream) = socket.split();
    let why = tokio::select! {
        () = stream_to(&mut sink, &shared) => None,
        why = obey(stream, &shared) => why,
    };
    if let Some(why) = why {
        let frame = CloseFrame { code: close_code::POLICY, reason: shortened(why) };
        // It may have gone already.
        let _ = timeout(SEND_TIMEOUT, sink.send(Message::Close(Some(frame)))).await;
    }
}

/// Sends what the device does until the page leaves or takes nothing any more.
async fn stream_to(sink: &mut SplitSink<WebSocket, Message>, shared: &Shared) {
    let mut subscription = shared.session.subscribe();
    let mut condenser = Condenser::default();
    let mut due = interval(FRAME_PERIOD);
    // A page that was slow gets the newest at once, not all that it missed.
    due.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut last_sent = Instant::now();
    loop {
        due.tick().await;
        let mut batch = subscription.drain();
        let scene = batch.scene.take().map(ToPage::Scene);
        let patient = batch.patient.take().map(ToPage::Patient);
        let practice = batch.practice.take().map(ToPage::Practice);
        let attempts: Vec<ToPage> = batch.attempts.drain(..).map(ToPage::Attempt).collect();
        let done =
            |task: TaskDone| ToPage::Task { t_s: task.tick as f64 / f64::from(TICK_HZ), name: task.name };
        let tasks: Vec<ToPage> = batch.tasks.drain(..).map(done).collect();
        let (device, mut frame) = condenser.take(batch);
        let news = scene.into_iter().chain(patient).chain(practice).chain(tasks).chain(attempts);
        for news in news.chain(device.map(ToPage::Device)) {
            if !send(sink, &news).await {
                return;
            }
        }
        let news = frame.pose.is_some() || !frame.trace.is_empty() || !frame.events.is_empty();
        if !news && last_sent.elapsed() < QUIET_PERIOD {
            continue;
        }
        frame.hand = if shared.person.load(Ordering::Relaxed) { Hand::Person } else { Hand::Demo };
        last_sent = Instant::now();
        if !send(sink, &ToPage::Frame(frame)).await {
            return;
        }
    }
}

async fn send(sink: &mut SplitSink<WebSocket, Message>, message: &ToPage) -> bool {
    // Only a map with keys that are not strings cannot be written, and no message has one.
    let Ok(text) = serde_json::to_string(message) else { return false };
    matches!(timeout(SEND_TIMEOUT, sink.send(Message::Text(text.into()))).await, Ok(Ok(())))
}

/// Does what the page asks for until it leaves; the reason where it asked for nonsense.
async fn obey(mut stream: SplitStream<WebSocket>, shared: &Shared) -> Option<String> {
    while let Some(Ok(message)) = stream.next().await {
        let Message::Text(text) = message else { continue };
        match Control::parse(&text) {
            Ok(control) => carry_out(control, shared),
            Err(why) => return Some(why),
        }
    }
    None
}

fn carry_out(control: Control, shared: &Shared) {
    if let Some(hand) = control.hand() {
        let is_person = hand == Hand::Person && shared.session.scene().hand;
        shared.person.store(is_person, Ordering::Relaxed);
    }
    shared.session.control(control);
}

fn shortened(mut why: String) -> Utf8Bytes {
    let end = (0..=LONGEST_REASON.min(why.len())).rev().find(|at| why.is_char_boundary(*at)).unwrap_or(0);
    why.truncate(end);
    why.into()
}
