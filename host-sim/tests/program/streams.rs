//! The live streams against clients by hand; `tests/clients` holds the independent ones from
//! package registries.

use control_core::units::{Millimetres, Milliradians};
use device_sim::session::{self, Publisher, Scene, SceneNeedle, Source};
use fixed::types::I16F16;
use link::frames::Pose;
use server::streams::{self, Kind, Spec, Streams, Token};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream, UdpSocket};
use std::time::{Duration, Instant};

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
        tilt_rad: 0.5,
        skin_tilt_rad: 0.0,
        slope_deg: None,
        vessel: None,
        body: None,
        beside: Vec::new(),
        needle: SceneNeedle::reaching(15.6),
        hand: true,
    }
}

fn pose(tick: u64, depth_mm: f64) -> Pose {
    Pose { tick, depth: Millimetres(I16F16::from_num(depth_mm)), tilt: Milliradians(500), ..Pose::default() }
}

fn open(specs: &[&str], token: Option<&str>) -> (Streams, Publisher) {
    let (session, publisher) = session::open(scene());
    let specs: Vec<Spec> = specs.iter().map(|text| text.parse().expect("a stream")).collect();
    let token: Option<Token> = token.map(|text| text.parse().expect("a token"));
    (streams::serve(&session, &specs, token.as_ref()).expect("free ports"), publisher)
}

/// Publishes poses ever deeper until `done` or ten seconds are over; whether it was done.
fn publish_until(publisher: &Publisher, mut done: impl FnMut() -> bool) -> bool {
    let begin = Instant::now();
    for tick in (0..).step_by(10) {
        publisher.pose(pose(tick, 5.0));
        if done() {
            return true;
        }
        if begin.elapsed() > Duration::from_secs(10) {
            return false;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    false
}

#[test]
fn a_datagram_is_json_with_the_tip() {
    let listener = UdpSocket::bind("127.0.0.1:0").expect("a port");
    listener.set_nonblocking(true).expect("it can be");
    let spec = format!("udp={}", listener.local_addr().expect("bound"));
    let (_streams, publisher) = open(&[&spec], None);
    let mut bytes = [0; 1_024];
    let mut got = None;
    publish_until(&publisher, || {
        got = listener.recv(&mut bytes).ok();
        got.is_some()
    });
    let said: serde_json::Value = serde_json::from_slice(&bytes[..got.expect("a datagram")]).expect("JSON");
    assert_eq!(said["depth_mm"], 5.0);
    assert!((said["tip_mm"][2].as_f64().expect("a number") + 5.0 * 0.5_f64.sin()).abs() < 1e-3, "{said}");
    assert!(said["timestamp"].is_number() && said.get("token").is_none());
}

/// The next OpenIGTLink message: kind and body.
fn message(stream: &mut TcpStream) -> std::io::Result<(String, Vec<u8>)> {
    let mut header = [0; 58];
    stream.read_exact(&mut header)?;
    let kind = String::from_utf8_lossy(&header[2..14]).trim_end_matches('\0').to_owned();
    let length = u64::from_be_bytes(header[42..50].try_into().expect("eight bytes"));
    let mut body = vec![0; length as usize];
    stream.read_exact(&mut body)?;
    Ok((kind, body))
}

#[test]
fn a_slow_client_gets_the_newest_pose_and_no_queue_of_old_ones() {
    let (streams, publisher) = open(&["openigtlink=127.0.0.1:0"], None);
    let (kind, address) = streams.addresses()[0];
    assert_eq!(kind, Kind::Openigtlink);
    let mut stream = TcpStream::connect(address).expect("served");
    stream.set_read_timeout(Some(Duration::from_secs(10))).expect("it can be");
    let depth = |body: &[u8]| {
        let part = |n: usize| f32::from_be_bytes(body[n..n + 4].try_into().expect("four bytes"));
        part(36).hypot(part(44))
    };
    let begin = Instant::now();
    for tick in 0..2_000 {
        publisher.pose(pose(tick * 10, tick as f64 / 100.0));
    }
    std::thread::sleep(Duration::from_millis(100));
    let (first, _) = message(&mut stream).expect("a message");
    assert_eq!(first, "STATUS");
    // As many as 60 a second are since then, each with at most one status, and not one for each
    // pose.
    let most = 4 + 2 * 60 * (begin.elapsed().as_millis() as usize) / 1_000;
    let last = (0..most).find_map(|_| {
        let (kind, body) = message(&mut stream).expect("a message");
        (kind == "TRANSFORM" && depth(&body) > 19.9).then_some(())
    });
    assert!(last.is_some(), "the newest of 2,000 poses comes among the first messages");
}

#[test]
fn a_thousand_connections_and_a_flood_never_block_publishing() {
    let (streams, publisher) = open(&["openigtlink=127.0.0.1:0", "websocket=127.0.0.1:0"], None);
    let addresses: Vec<SocketAddr> = streams.addresses().iter().map(|(_, address)| *address).collect();
    let mut clients = Vec::new();
    for number in 0..1_000 {
        // One beyond the limit is closed; that it connects at all is the system's doing.
        if let Ok(mut stream) = TcpStream::connect(addresses[number % 2]) {
            stream.set_nonblocking(true).expect("it can be");
            // What none of the protocols allows.
            let _ = stream.write(&[0xff; 65_536]);
            clients.push(stream);
        }
    }
    let mut longest = Duration::ZERO;
    for tick in 0..3_000 {
        let begin = Instant::now();
        publisher.pose(pose(tick * 10, 1.0));
        longest = longest.max(begin.elapsed());
    }
    // Who waited for the client that does not read would wait for ever.
    assert!(longest < Duration::from_secs(5), "a pose took {longest:?} to publish");
    assert_eq!(publisher.next_control(), None, "no stream asks for anything");
    drop(clients);
    let served = (0..100).any(|_| {
        std::thread::sleep(Duration::from_millis(50));
        publisher.pose(pose(1, 1.0));
        let Ok(mut stream) = TcpStream::connect(addresses[0]) else { return false };
        stream.set_read_timeout(Some(Duration::from_secs(2))).expect("it can be");
        message(&mut stream).is_ok()
    });
    assert!(served, "once they are gone there is room again");
}

#[test]
fn another_computer_needs_the_token() {
    let (streams, publisher) =
        open(&["openigtlink=0.0.0.0:0", "websocket=0.0.0.0:0"], Some("a-long-enough-token"));
    let at = |n: usize| SocketAddr::from(([127, 0, 0, 1], streams.addresses()[n].1.port()));
    let string = |text: &str| {
        let mut body = 3_u16.to_be_bytes().to_vec();
        body.extend((text.len() as u16).to_be_bytes());
        body.extend(text.as_bytes());
        let mut bytes = 1_u16.to_be_bytes().to_vec();
        bytes.extend(b"STRING\0\0\0\0\0\0");
        bytes.extend([0; 28]);
        bytes.extend((body.len() as u64).to_be_bytes());
        bytes.extend([0; 8]);
        bytes.extend(body);
        bytes
    };
    for (said, is_let_in) in [("a-long-enough-tokem", false), ("a-long-enough-token", true)] {
        let mut stream = TcpStream::connect(at(0)).expect("served");
        stream.set_read_timeout(Some(Duration::from_secs(10))).expect("it can be");
        stream.write_all(&string(said)).expect("it is read");
        publisher.pose(pose(1, 1.0));
        assert_eq!(message(&mut stream).is_ok(), is_let_in, "{said}");
    }
    for (query, answer) in [("", "401"), ("?token=wrong", "401"), ("?token=a-long-enough-token", "101")] {
        let mut stream = TcpStream::connect(at(1)).expect("served");
        stream.set_read_timeout(Some(Duration::from_secs(10))).expect("it can be");
        let request = format!(
            "GET /pose{query} HTTP/1.1\r\nHost: needle\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
             Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
        );
        stream.write_all(request.as_bytes()).expect("it is read");
        let mut status = [0; 12];
        stream.read_exact(&mut status).expect("an answer");
        assert_eq!(&status[9..], answer.as_bytes(), "{query}");
    }
}

#[test]
fn an_address_in_use_is_one_clear_line() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let spec: Spec = format!("websocket={}", taken.local_addr().expect("bound")).parse().expect("a stream");
    let (session, _publisher) = session::open(scene());
    let error = streams::serve(&session, &[spec], None).expect_err("it is in use").to_string();
    assert!(
        error.contains("websocket") && error.contains("--stream") && error.lines().count() == 1,
        "{error}"
    );
}
