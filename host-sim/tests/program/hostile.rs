//! Clients that mean harm, against every listener of a running device: floods, frames of impossible
//! sizes, silence, thousands of connections. The control path must not notice, and torque must stay
//! off. `class.rs` does the same to a class.

use server::streams::{self, Kind, Spec};
use server::visualizer;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const CONNECTIONS: usize = 1_000;
/// An attack lasts so long, or longer where a slow machine needs it to reach every listener.
const ATTACK: Duration = Duration::from_secs(6);

/// Each client is a file handle, and so is the server's end, in this one process.
#[cfg(unix)]
fn allow_many_files() {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let Rlimit { maximum, .. } = getrlimit(Resource::Nofile);
    setrlimit(Resource::Nofile, Rlimit { current: maximum, maximum }).expect("up to the hard limit");
}
#[cfg(not(unix))]
fn allow_many_files() {}

fn connect(address: SocketAddr) -> Option<TcpStream> {
    let stream = TcpStream::connect(address).ok()?;
    stream.set_nonblocking(true).ok()?;
    Some(stream)
}

/// Writes as much as the other end takes within a moment.
fn pour(stream: &mut TcpStream, bytes: &[u8]) {
    for chunk in bytes.chunks(65_536) {
        if stream.write_all(chunk).is_err() {
            return;
        }
    }
}

fn upgrade(path: &str, port: u16) -> Vec<u8> {
    format!(
        "GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
    .into_bytes()
}

/// A masked text frame that says it has 2^62 bytes, and the first quarter of a megabyte of them.
fn endless_frame() -> Vec<u8> {
    let mut bytes = vec![0x81, 0xff, 0x40, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    bytes.resize(1 << 18, b'x');
    bytes
}

/// An OpenIGTLink header that says its body has 2^63 bytes, and the first quarter of a megabyte of
/// it.
fn endless_body() -> Vec<u8> {
    let mut bytes = vec![0; 58];
    bytes[1] = 1;
    bytes[2..8].copy_from_slice(b"STRING");
    bytes[42] = 0x80;
    bytes.resize(1 << 18, 0xff);
    bytes
}

/// Everything at once, again and again; connections are held until the next round. Every listener
/// has its round, however long that takes, and what each round connected is counted.
fn attack(listeners: &[(SocketAddr, &str)]) -> Vec<usize> {
    let begin = Instant::now();
    let mut rounds = Vec::new();
    for (address, path) in listeners.iter().cycle() {
        if rounds.len() >= listeners.len() && begin.elapsed() >= ATTACK {
            break;
        }
        let mut held: Vec<TcpStream> = (0..CONNECTIONS).filter_map(|_| connect(*address)).collect();
        rounds.push(held.len());
        let port = address.port();
        let words = [
            // Half a request, and nothing after it.
            b"GET / HT".to_vec(),
            [upgrade(path, port), endless_frame()].concat(),
            // Never reads what it asked for.
            upgrade(path, port),
            endless_body(),
            vec![b'A'; 1 << 18],
        ];
        for (stream, said) in held.iter_mut().zip(words.iter().cycle()) {
            pour(stream, said);
        }
    }
    rounds
}

/// True if a well-behaved client receives something.
fn is_served(address: SocketAddr, greeting: &[u8]) -> bool {
    (0..200).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        let Ok(mut stream) = TcpStream::connect(address) else { return false };
        let _ = stream.set_read_timeout(Some(Duration::from_secs(2)));
        let mut bytes = [0; 200];
        stream.write_all(greeting).is_ok() && stream.read_exact(&mut bytes).is_ok()
    })
}

#[test]
fn the_control_path_does_not_notice_hostile_clients() {
    allow_many_files();
    let (session, publisher) = crate::common::paced::open();
    let specs: Vec<Spec> = ["openigtlink=127.0.0.1:0", "websocket=127.0.0.1:0", "udp=127.0.0.1:9"]
        .iter()
        .map(|text| text.parse().expect("a stream"))
        .collect();
    let streams = streams::serve(&session, &specs, None).expect("free ports");
    let page = visualizer::serve(session, 0).expect("a free port");
    let at = |kind| streams.addresses().iter().find(|(known, _)| *known == kind).expect("served").1;
    let (openigtlink, websocket) = (at(Kind::Openigtlink), at(Kind::Websocket));
    let page_address = SocketAddr::from(([127, 0, 0, 1], page.port()));
    let listeners = [(openigtlink, "/"), (websocket, "/pose"), (page_address, "/live")];

    let over = AtomicBool::new(false);
    let (run, rounds) = std::thread::scope(|scope| {
        let attacker = scope.spawn(|| {
            let rounds = attack(&listeners);
            over.store(true, Ordering::Relaxed);
            rounds
        });
        let run = crate::common::paced::run(publisher, crate::common::paced::End::When(&over), false);
        (run, attacker.join().expect("it ends"))
    });
    println!(
        "{rounds:?} connections; late by {:?} in the median, by at most {:?}",
        run.median(),
        run.worst()
    );
    assert!(rounds.iter().all(|&connected| connected == CONNECTIONS), "a listener refused: {rounds:?}");
    assert!(run.median() < Duration::from_millis(100), "late by {:?} half of the time", run.median());
    assert!(run.worst() < crate::common::paced::HEARTBEAT_LIMIT, "late by {:?}", run.worst());
    assert!(run.outcome.stats.samples >= 1_000 * run.late.len() as u64 - 100, "no sample is lost");
    assert_eq!(run.outcome.link.lost_samples, 0);
    assert_eq!(run.outcome.stats.peak_force_n, 0.0, "nobody started the torque");

    assert!(is_served(openigtlink, b""), "3D Slicer is served again");
    assert!(is_served(websocket, &upgrade("/pose", websocket.port())), "Unity is served again");
    assert!(
        is_served(page_address, b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"),
        "the page is served again"
    );
}
