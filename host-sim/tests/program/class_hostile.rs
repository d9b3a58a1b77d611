//! Programs that mean harm, against the instructor's listener of a class: noise, endless frames,
//! silence, nonsense on the class' keys, a flood. The page stays up, a device's control path is
//! never late, memory stays bounded. Runs where the feature `class` is built: `cargo xtask nightly
//! class`.

use crate::common::host_sim;
use server::class::{self, Meeting};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};
use zenoh::qos::CongestionControl;
use zenoh::{Config, Session, Wait};

const ATTACK_S: u64 = 8;
const SILENT: usize = 200;
/// The most that the instructor's program may hold, MiB: 200 devices at 64 KiB a message, and its
/// threads.
const MOST_MEMORY_MIB: u64 = 256;
const PAGE_PATIENCE: Duration = Duration::from_secs(2);

/// Bytes without a pattern, the same in each run: xorshift (Marsaglia 2003).
fn noise(length: usize, mut state: u64) -> Vec<u8> {
    let next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as u8
    };
    std::iter::repeat_with(next).take(length).collect()
}

/// `host-sim class` in a program of its own, and where its page is.
fn instructor(meeting: &Meeting) -> (Child, SocketAddr) {
    let at = meeting.address.to_string();
    let mut command = host_sim(&["class", meeting.class.as_str(), "--listen", &at, "--port", "0"]);
    let mut child =
        command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts");
    let lines = BufReader::new(child.stdout.take().expect("piped")).lines();
    let page = lines.map_while(Result::ok).find_map(|line| {
        let (_, url) = line.split_once("class page at http://")?;
        url.trim_end_matches('/').parse().ok()
    });
    (child, page.expect("it says where its page is"))
}

/// Connections that send noise, or the length of a frame and only half of it; held open for a
/// moment each.
fn send_noise(at: SocketAddr, stop: &AtomicBool) -> u64 {
    let mut connections = 0;
    // Zenoh's frames begin with two bytes of length: the longest that there is, and never whole.
    let half = [vec![0xff, 0xff], noise(30_000, 7)].concat();
    while !stop.load(Ordering::Relaxed) {
        for seed in 1..=20 {
            let Ok(mut stream) = TcpStream::connect(at) else { continue };
            let _ = stream.set_write_timeout(Some(Duration::from_millis(50)));
            let said = if seed % 2 == 0 { half.clone() } else { noise(100_000, seed) };
            // The other end may have closed already.
            let _ = stream.write_all(&said);
            connections += 1;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    connections
}

/// A Zenoh program of somebody else's.
fn stranger(meeting: &Meeting) -> Session {
    let mut config = Config::default();
    let endpoints = format!("[\"tcp/{}\"]", meeting.address);
    for (key, value) in [
        ("mode", "\"client\""),
        ("connect/endpoints", endpoints.as_str()),
        ("listen/endpoints", "[]"),
        ("scouting/multicast/enabled", "false"),
    ] {
        config.insert_json5(key, value).expect("a key of Zenoh's");
    }
    zenoh::open(config).wait().expect("the listener takes it")
}

/// Publishes until `stop`: what `message` gives for a number, as key after the class and bytes.
/// Returns how many.
fn publish(
    meeting: &Meeting,
    stop: &AtomicBool,
    published: &AtomicU64,
    message: impl Fn(u64) -> (String, Vec<u8>),
) {
    let session = stranger(meeting);
    for number in 0.. {
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let (key, bytes) = message(number);
        // Blocks: as much as the network takes. A session that was thrown out publishes nothing.
        let key = format!("needle/{}/{key}", meeting.class);
        if session.put(key, bytes).congestion_control(CongestionControl::Block).wait().is_ok() {
            published.fetch_add(1, Ordering::Relaxed);
        }
    }
    let _ = session.close().wait();
}

/// Nonsense of every kind, now and then far more than a message may have, under names that there
/// are and are not.
fn garbage(number: u64) -> (String, Vec<u8>) {
    let kind = ["pose", "event", "score", "about", "orders"][number as usize % 5];
    let device = ["bed-1".to_string(), format!("x{number}"), "x".repeat(60)][number as usize % 3].clone();
    let bytes = match number % 7 {
        0 => noise(40_000, number + 1),
        1 => b"[".repeat(60_000),
        2 if number % 140 == 2 => vec![b' '; 8 << 20],
        3 => br#"{"newest":1e999,"poses":[]}"#.to_vec(),
        _ => br#"{"kind":7}"#.to_vec(),
    };
    (format!("{device}/{kind}"), bytes)
}

/// Poses in good form from far more devices than a class has.
fn flood(number: u64) -> (String, Vec<u8>) {
    let pose = format!(r#"{{"newest":{{"depth_mm":{number}}},"poses":[[0,0,0,0]]}}"#);
    (format!("flood-{}/pose", number % 5_000), pose.into_bytes())
}

/// Returns the time in which the page loads; `None` if it does not.
fn page_takes(page: SocketAddr) -> Option<Duration> {
    let begin = Instant::now();
    let mut stream = TcpStream::connect_timeout(&page, PAGE_PATIENCE).ok()?;
    stream.set_read_timeout(Some(PAGE_PATIENCE)).ok()?;
    stream
        .write_all(format!("GET / HTTP/1.1\r\nHost: {page}\r\nConnection: close\r\n\r\n").as_bytes())
        .ok()?;
    let mut text = String::new();
    stream.read_to_string(&mut text).ok()?;
    (text.starts_with("HTTP/1.1 200") && text.contains("</html>")).then(|| begin.elapsed())
}

/// Largest memory that a process has held so far, MiB.
fn peak_memory_mib(pid: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{pid}/status")).expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).expect("Linux tells it");
    line.split_whitespace().next().and_then(|kib| kib.parse::<u64>().ok()).expect("a number") / 1_024
}

#[test]
fn neither_the_page_nor_a_device_notices_hostile_programs() {
    let free = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a free port");
    let meeting = Meeting { class: "besieged".parse().expect("a name"), address: free, token: None };
    let (mut child, page) = instructor(&meeting);
    let (session, publisher) = crate::common::paced::open();
    let membership = class::join(session, &meeting, &"bed-1".parse().expect("a name")).expect("it joins");

    let silent: Vec<TcpStream> = (0..SILENT).filter_map(|_| TcpStream::connect(free).ok()).collect();
    assert_eq!(silent.len(), SILENT);
    let (stop, nonsense, flooded) = (AtomicBool::new(false), AtomicU64::new(0), AtomicU64::new(0));
    let (run, connections, pages) = std::thread::scope(|scope| {
        let noisy = scope.spawn(|| send_noise(free, &stop));
        scope.spawn(|| publish(&meeting, &stop, &nonsense, garbage));
        scope.spawn(|| publish(&meeting, &stop, &flooded, flood));
        let looking = scope.spawn(|| {
            let mut pages = Vec::new();
            while !stop.load(Ordering::Relaxed) {
                pages.push(page_takes(page));
                std::thread::sleep(Duration::from_millis(200));
            }
            pages
        });
        let run = crate::common::paced::run(publisher, crate::common::paced::End::After(ATTACK_S), true);
        stop.store(true, Ordering::Relaxed);
        (run, noisy.join().expect("it ends"), looking.join().expect("it ends"))
    });
    let memory = peak_memory_mib(child.id());
    let (nonsense, flooded) = (nonsense.into_inner(), flooded.into_inner());
    let slowest = pages.iter().flatten().max().copied().unwrap_or_default();
    println!(
        "{connections} noisy connections, {nonsense} messages of nonsense, {flooded} of a flood: late by {:?} in the median, \
         by at most {:?}; {} pages, the slowest after {slowest:?}; at most {memory} MiB",
        run.median(),
        run.worst(),
        pages.len()
    );
    drop(silent);
    drop(membership);
    let is_running = child.try_wait().expect("it is ours").is_none();
    let _ = child.kill();
    let output = child.wait_with_output().expect("it ends");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(is_running && !said.contains("panicked"), "the instructor's program: {said}");
    assert!(nonsense > 100 && flooded > 1_000 && connections > 100, "too little of an attack");
    assert!(pages.len() > 5 && pages.iter().all(Option::is_some), "the page did not come: {pages:?}");
    assert!(memory < MOST_MEMORY_MIB, "{memory} MiB");
    assert!(run.median() < Duration::from_millis(20), "late by {:?} half of the time", run.median());
    assert!(run.worst() < crate::common::paced::HEARTBEAT_LIMIT, "late by {:?}", run.worst());
    assert_eq!(run.outcome.stats.samples, ATTACK_S * 10_000, "no sample is lost");
    assert_eq!(run.outcome.link.lost_samples, 0);
}
