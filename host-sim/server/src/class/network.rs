//! Carries a class's messages over Zenoh. The instructor's program listens; every device connects
//! to it, again and again until it is there, and publishes. No scouting: nobody is found who was
//! not named. Where a token is given, both ends have to prove that they know it before anything is
//! taken.

use super::board::Board;
use super::message::Kind;
use super::publisher::ClassPublisher;
use super::{ClassError, Meeting, Name};
use device_sim::session::Session as NeedleSession;
use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::time::{Duration, Instant};
use zenoh::pubsub::{Publisher, Subscriber};
use zenoh::qos::CongestionControl;
use zenoh::{Config, Session, Wait};

/// Between two looks at the session: 25 messages a second with forty poses each. A message costs
/// both ends far more than a pose in it, and the instructor's page changes ten times a second.
const PERIOD: Duration = Duration::from_millis(40);
/// The longest wait at the program's end for a goodbye that the network may not take.
const GOODBYE: Duration = Duration::from_millis(500);
/// The most bytes of a message put together from pieces; Zenoh's own limit is 1 GiB. The board
/// takes half of it.
const LONGEST_TRANSFER: &str = "131072";
/// The longest time in which a connection must authenticate, ms. Zenoh's own limit is 10 s with 100
/// of them at a time: silent ones would keep devices out for so long.
const ACCEPT_TIMEOUT_MS: &str = "2000";
/// Connections at a time that have not said who they are; one more is closed.
const ACCEPT_PENDING: &str = "400";
/// The prefix of every key of this project.
const PREFIX: &str = "needle";
/// The only user that there is; the token is its password.
const USER: &str = "class";

/// A device that publishes; dropped, it does not any more.
#[derive(Debug)]
pub struct Membership {
    stop: Arc<AtomicBool>,
    /// Disconnected by the thread's end.
    ended: mpsc::Receiver<()>,
}

impl Drop for Membership {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        let _ = self.ended.recv_timeout(GOODBYE);
    }
}

/// The instructor's end; dropped, it listens no more.
#[derive(Debug)]
pub struct Listener {
    /// Declared for as long as it lives.
    _subscriber: Subscriber<()>,
    session: Session,
}

impl Drop for Listener {
    fn drop(&mut self) {
        let _ = self.session.close().wait();
    }
}

/// Publishes what `session` does as `name`, from a thread of its own. The instructor may come and
/// go.
pub fn join(session: NeedleSession, meeting: &Meeting, name: &Name) -> Result<Membership, ClassError> {
    let failed = |cause| failed(meeting, "joined", cause);
    let zenoh = open(meeting, Side::Device).map_err(failed)?;
    let publishers = Publishers::declare(&zenoh, meeting, name).map_err(failed)?;
    let stop = Arc::new(AtomicBool::new(false));
    let (alive, ended) = mpsc::channel();
    let stopped = stop.clone();
    let run = move || {
        let _alive: mpsc::Sender<()> = alive;
        publish(&session, &publishers, &stopped);
        drop(publishers);
        let _ = zenoh.close().wait();
    };
    std::thread::Builder::new().name("class".into()).spawn(run).map_err(|cause| failed(cause.into()))?;
    Ok(Membership { stop, ended })
}

/// Listens for the devices of `meeting` and puts what they say on `board`.
pub fn listen(meeting: &Meeting, board: Arc<Board>) -> Result<Listener, ClassError> {
    let failed = |cause| failed(meeting, "listened to", cause);
    let session = open(meeting, Side::Instructor).map_err(failed)?;
    let subscriber = session
        .declare_subscriber(format!("{PREFIX}/{}/*/*", meeting.class))
        .callback(move |sample| {
            let mut parts = sample.key_expr().as_str().rsplit('/');
            if let (Some(kind), Some(device)) = (parts.next(), parts.next()) {
                board.hear(device, kind, &sample.payload().to_bytes(), Instant::now());
            }
        })
        .wait()
        .map_err(failed)?;
    Ok(Listener { _subscriber: subscriber, session })
}

fn failed(meeting: &Meeting, what: &str, cause: zenoh::Error) -> ClassError {
    let Meeting { class, address, .. } = meeting;
    ClassError {
        sentence: format!(
            "the class {class} cannot be {what} at {address}: {cause}; check that the address is this computer's and free, or \
             give another one"
        ),
    }
}

/// The ways that a device publishes by.
struct Publishers([(Kind, Publisher<'static>); 4]);

impl Publishers {
    fn declare(zenoh: &Session, meeting: &Meeting, name: &Name) -> Result<Self, zenoh::Error> {
        let declare = |kind: Kind| {
            let key = format!("{PREFIX}/{}/{name}/{}", meeting.class, kind.as_str());
            // What a slow instructor has no room for is dropped: the newest comes soon.
            let publisher =
                zenoh.declare_publisher(key).congestion_control(CongestionControl::Drop).wait()?;
            Ok::<_, zenoh::Error>((kind, publisher))
        };
        Ok(Self([declare(Kind::Pose)?, declare(Kind::Event)?, declare(Kind::Score)?, declare(Kind::About)?]))
    }

    fn put(&self, kind: Kind, bytes: Vec<u8>) {
        if let Some((_, publisher)) = self.0.iter().find(|(known, _)| *known == kind) {
            // It is not an error if nobody is there: whoever joins receives everything within a
            // second.
            let _ = publisher.put(bytes).wait();
        }
    }
}

fn publish(session: &NeedleSession, publishers: &Publishers, stop: &AtomicBool) {
    let mut subscription = session.subscribe();
    let mut publisher = ClassPublisher::default();
    let begin = Instant::now();
    while !stop.load(Ordering::Relaxed) {
        for (kind, bytes) in publisher.take(subscription.drain(), begin.elapsed()) {
            publishers.put(kind, bytes);
        }
        std::thread::sleep(PERIOD);
    }
}

/// The side of a class that a program is on.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    /// Connects.
    Device,
    /// Listens.
    Instructor,
}

fn open(meeting: &Meeting, side: Side) -> Result<Session, zenoh::Error> {
    let mut config = Config::default();
    let at = format!("[\"tcp/{}\"]", meeting.address);
    let (connect, listen) = match side {
        Side::Device => (at.as_str(), "[]"),
        Side::Instructor => ("[]", at.as_str()),
    };
    for (key, value) in [
        ("mode", "\"peer\""),
        ("connect/endpoints", connect),
        ("listen/endpoints", listen),
        ("connect/retry", "{ period_init_ms: 250, period_max_ms: 1000, period_increase_factor: 2 }"),
        // Neither waits for the other to be there.
        ("open/return_conditions", "{ connect_scouted: false, declares: false }"),
        ("scouting/multicast/enabled", "false"),
        ("scouting/gossip/enabled", "false"),
        ("transport/link/rx/max_message_size", LONGEST_TRANSFER),
        ("transport/unicast/accept_timeout", ACCEPT_TIMEOUT_MS),
        ("transport/unicast/accept_pending", ACCEPT_PENDING),
    ] {
        config.insert_json5(key, value)?;
    }
    let Some(token) = &meeting.token else { return zenoh::open(config).wait() };
    let dictionary = Dictionary::write(token.text())?;
    let path = dictionary.0.to_str().ok_or("the folder for temporary files has no plain name")?;
    let quoted = |text: &str| serde_json::to_string(text);
    config.insert_json5("transport/auth/usrpwd/user", &quoted(USER)?)?;
    config.insert_json5("transport/auth/usrpwd/password", &quoted(token.text())?)?;
    config.insert_json5("transport/auth/usrpwd/dictionary_file", &quoted(path)?)?;
    zenoh::open(config).wait()
}

/// The token as Zenoh reads it: in a file that only this user can read, gone as soon as it has been
/// read.
struct Dictionary(PathBuf);

impl Dictionary {
    fn write(token: &str) -> std::io::Result<Self> {
        let unique = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default();
        let name = format!("needle-class-{}-{}", std::process::id(), unique.as_nanos());
        let path = std::env::temp_dir().join(name);
        let mut options = std::fs::OpenOptions::new();
        options.write(true).create_new(true);
        #[cfg(unix)]
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
        let mut file = options.open(&path)?;
        let dictionary = Self(path);
        writeln!(file, "{USER}:{token}")?;
        Ok(dictionary)
    }
}

impl Drop for Dictionary {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}
