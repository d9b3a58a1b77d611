//! A class over Zenoh, on loopback: devices and their instructor come, go and come back; a stalled
//! instructor, a wrong token and a server that never answers cost nobody anything. Runs where the
//! feature `class` is built: `cargo xtask nightly class`.

use crate::common::{figure, folder, host_sim, refused, run, text};
use server::class::board::{Board, MemberView, Sent};
use server::class::{self, Listener, Meeting};
use std::io::{BufRead, BufReader};
use std::net::TcpListener;
use std::process::{Child, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

const SOON: Duration = Duration::from_secs(15);
const MEMBERS: usize = 30;

/// A class of this name at a port that nobody uses.
fn meeting(class: &str, token: Option<&str>) -> Meeting {
    let free = TcpListener::bind("127.0.0.1:0").and_then(|l| l.local_addr()).expect("a free port");
    Meeting {
        class: class.parse().expect("a name"),
        address: free,
        token: token.map(|text| text.parse().expect("a token")),
    }
}

/// The instructor's end, in this process.
fn listen(meeting: &Meeting) -> (Arc<Board>, Listener) {
    let board = Arc::new(Board::default());
    let listener = class::listen(meeting, board.clone()).expect("the port is free");
    (board, listener)
}

/// `host-sim run` in the class as `name`.
fn device(meeting: &Meeting, name: &str, more: &[&str]) -> Child {
    let at = meeting.address.to_string();
    let mut command = host_sim(&[
        "run",
        "--headless",
        "--class",
        meeting.class.as_str(),
        "--class-as",
        name,
        "--class-at",
        &at,
    ]);
    command.args(more).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program starts")
}

fn view(board: &Board) -> Vec<MemberView> {
    board.view(Instant::now(), &mut Sent::default())
}

fn member(board: &Board, name: &str) -> Option<MemberView> {
    view(board).into_iter().find(|member| member.name == name)
}

/// Waits until `holds` of the class.
fn wait(what: &str, board: &Board, mut holds: impl FnMut(&Board) -> bool) {
    let begin = Instant::now();
    while !holds(board) {
        assert!(begin.elapsed() < SOON, "{what}: not within {SOON:?}; the class is {:?}", view(board));
        std::thread::sleep(Duration::from_millis(20));
    }
}

fn is_here(board: &Board, name: &str) -> bool {
    member(board, name).is_some_and(|m| !m.gone && m.connected && m.pose.is_some() && m.scene.is_some())
}

fn ended_well(child: Child) -> String {
    let output = child.wait_with_output().expect("it ends");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn members_leave_and_return_and_recordings_lose_no_sample() {
    let dir = folder("class");
    let meeting = meeting("ward-3", None);
    let recording = dir.join("steady.mcap");
    // There before its instructor.
    let steady = device(&meeting, "steady", &["--seconds", "25", "--record", text(&recording)]);
    std::thread::sleep(Duration::from_secs(1));
    let (board, listener) = listen(&meeting);
    wait("the steady one", &board, |b| is_here(b, "steady"));
    assert!(member(&board, "steady").is_some_and(|m| m.recording));
    let mut restless = device(&meeting, "restless", &[]);
    wait("the restless one", &board, |b| is_here(b, "restless"));

    restless.kill().expect("it runs");
    let _ = restless.wait();
    wait("one is gone", &board, |b| member(b, "restless").is_some_and(|m| m.gone));
    assert!(is_here(&board, "steady"), "and the other is not");
    let mut restless = device(&meeting, "restless", &[]);
    wait("it is back", &board, |b| is_here(b, "restless"));

    drop(listener);
    wait("both gone without an instructor", &board, |b| view(b).iter().all(|m| m.gone));
    let (board, _listener) = listen(&meeting);
    wait("both are back", &board, |b| is_here(b, "steady") && is_here(b, "restless"));
    let has_been_in =
        |m: MemberView| m.events.iter().any(|event| event["kind"] == "exit" && event["layer"] == 0);
    wait("a scripted insertion", &board, |b| member(b, "steady").is_some_and(has_been_in));
    assert_eq!(member(&board, "steady").map(|m| m.score.insertions), Some(0), "it is nobody's");
    restless.kill().expect("it runs");
    let _ = restless.wait();

    let said = ended_well(steady);
    assert_eq!((figure(&said, "samples"), figure(&said, "lost_samples")), (250_000.0, 0.0));
    let out = dir.join("exported");
    assert!(run(&["export", text(&recording), "--out", text(&out)]).status.success());
    let stretches = std::fs::read_dir(&out)
        .expect("written")
        .flatten()
        .filter(|e| e.path().extension().is_some_and(|extension| extension == "csv"));
    assert_eq!(stretches.count(), 1, "one stretch without a gap");
}

#[test]
fn a_wrong_token_or_none_is_not_let_in() {
    let token = "a-long-enough-token";
    let meeting = meeting("guarded", Some(token));
    let (board, _listener) = listen(&meeting);
    let mut children = [
        device(&meeting, "without", &[]),
        device(&meeting, "wrong", &["--class-token", "a-long-enough-tokem"]),
        device(&meeting, "right", &["--class-token", token]),
    ];
    wait("who knows the token", &board, |b| is_here(b, "right"));
    std::thread::sleep(Duration::from_secs(3));
    let names: Vec<String> = view(&board).into_iter().map(|m| m.name).collect();
    children.iter_mut().for_each(|child| {
        let _ = child.kill();
        let _ = child.wait();
    });
    assert_eq!(names, ["right"]);
}

#[test]
fn other_computers_need_a_token_and_a_used_port_is_reported() {
    for arguments in [
        &["class", "c", "--listen", "0.0.0.0:7447"][..],
        &["run", "--headless", "--class", "c", "--class-at", "192.0.2.1:7447"][..],
    ] {
        refused(&run(arguments), 2, &["--class-token", "12 characters"]);
    }
    refused(&run(&["class", "a/b"]), 2, &["letters"]);
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let at = taken.local_addr().expect("bound").to_string();
    refused(&run(&["class", "c", "--listen", &at, "--port", "0"]), 1, &["class c", &at]);
}

#[test]
fn a_stalled_instructor_and_a_mute_server_hold_up_nothing() {
    // A listener that takes connections and never says a word.
    let mute = TcpListener::bind("127.0.0.1:0").expect("a port");
    let nowhere = Meeting { address: mute.local_addr().expect("bound"), ..meeting("mute", None) };
    let (session, publisher) = crate::common::paced::open();
    let _membership = class::join(session, &nowhere, &"a".parse().expect("a name"));
    let run = crate::common::paced::run(publisher, crate::common::paced::End::After(3), true);
    check("a mute server", &run);

    // An instructor's program that is stopped in the middle of it all: its sockets stay open and
    // nobody reads.
    let stalled = meeting("stalled", None);
    let at = stalled.address.to_string();
    let mut instructor = host_sim(&["class", "stalled", "--listen", &at, "--port", "0"]);
    let mut instructor = instructor.stdout(Stdio::piped()).spawn().expect("the program starts");
    let mut lines = BufReader::new(instructor.stdout.take().expect("piped")).lines();
    assert!(lines.any(|line| line.is_ok_and(|line| line.starts_with("class page at"))));
    let (session, publisher) = crate::common::paced::open();
    let membership = class::join(session, &stalled, &"a".parse().expect("a name"));
    let pid = rustix::process::Pid::from_child(&instructor);
    let stop = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_secs(2));
        rustix::process::kill_process(pid, rustix::process::Signal::STOP)
    });
    // Longer than Zenoh waits for a silent end (10 s): then it is another mute server.
    let run = crate::common::paced::run(publisher, crate::common::paced::End::After(16), true);
    stop.join().expect("it ends").expect("it was running");
    check("a stalled instructor", &run);
    let begin = Instant::now();
    drop(membership);
    assert!(begin.elapsed() < Duration::from_secs(3), "the end waited {:?} for it", begin.elapsed());
    instructor.kill().expect("it is there");
    let _ = instructor.wait();
}

fn check(what: &str, run: &crate::common::paced::Paced) {
    println!("{what}: late by {:?} in the median, by at most {:?}", run.median(), run.worst());
    assert!(run.median() < Duration::from_millis(20), "{what}: {:?}", run.median());
    assert!(run.worst() < crate::common::paced::HEARTBEAT_LIMIT, "{what}: {:?}", run.worst());
    assert_eq!(run.outcome.link.lost_samples, 0, "{what}");
}

/// CPU time that a process has used, s: the 14th and 15th field of its `stat`, in hundredths.
#[cfg(target_os = "linux")]
fn cpu_s(pid: u32) -> f64 {
    let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).expect("it runs");
    let fields: Vec<&str> = stat.rsplit(')').next().expect("a name in brackets").split_whitespace().collect();
    let ticks = |at: usize| fields[at].parse::<f64>().expect("a number");
    (ticks(11) + ticks(12)) / 100.0
}

/// Programs and their instructor's, each with a virtual device at 10 kHz and 1,000 poses a second:
/// the CPU time in s that all of them take in some seconds, those seconds, and the poses that each
/// sends in one of them.
#[cfg(target_os = "linux")]
fn measured(members: usize) -> (f64, f64, f64) {
    const SECONDS: f64 = 10.0;
    let meeting = meeting(&format!("of-{members}"), None);
    let (board, _listener) = listen(&meeting);
    let names: Vec<String> = (0..members).map(|number| format!("d{number:02}")).collect();
    let mut children: Vec<Child> = names.iter().map(|name| device(&meeting, name, &[])).collect();
    wait("all of them", &board, |b| names.iter().all(|name| is_here(b, name)));
    let used =
        || -> f64 { cpu_s(std::process::id()) + children.iter().map(|child| cpu_s(child.id())).sum::<f64>() };
    let poses = || -> u64 { view(&board).iter().map(|m| m.poses).sum() };
    let (begin, cpu, heard) = (Instant::now(), used(), poses());
    std::thread::sleep(Duration::from_secs_f64(SECONDS));
    let seconds = begin.elapsed().as_secs_f64();
    let (cpu, rate) = (used() - cpu, (poses() - heard) as f64 / seconds / members as f64);
    let here = names.iter().filter(|name| is_here(&board, name)).count();
    children.iter_mut().for_each(|child| {
        let _ = child.kill();
        let _ = child.wait();
    });
    assert_eq!(here, members);
    (cpu, seconds, rate)
}

/// The cores that thirty devices with their instructor may take. One is wanted, and 1.3 is what
/// they took when this was written.
#[cfg(target_os = "linux")]
const MOST_CORES: f64 = 1.6;

/// One, ten and thirty devices with their instructor. Prints the row of
/// `cargo xtask nightly class`, and for `cargo xtask bench` the CPU time of each class.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "measures: needs a machine that does nothing else, `cargo xtask nightly class` runs it"]
fn thirty_devices_cost_little_more_than_a_core() {
    for members in [1, 10, MEMBERS] {
        let (cpu, seconds, rate) = measured(members);
        let cores = cpu / seconds;
        println!("work.class.devices.{members}={cpu:.3}");
        println!("class_cores={cores:.2} class_poses_per_s={rate:.0}");
        assert!((950.0..=1_050.0).contains(&rate), "{rate} poses a second of each of {members}");
        assert!(cores <= MOST_CORES, "{cores} cores");
    }
}
