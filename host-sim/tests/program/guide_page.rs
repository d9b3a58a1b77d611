//! The guide in the page: it waits for a person before each step, takes nonsense for nothing, shows
//! what came of it, and ends where the person or the program does.

use device_sim::error::Error;
use serde_json::{Value, json};
use server::guide::{Guide, Reading};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

const SOME_TIME: Duration = Duration::from_secs(20);

fn guide() -> (Guide, Arc<AtomicBool>) {
    let stop = Arc::new(AtomicBool::new(false));
    (Guide::new("Commissioning", "virtual", stop.clone()), stop)
}

/// Returns the message to a page that opens now.
fn told(guide: &Guide) -> Value {
    let text = guide.watches()()().expect("there is always something to tell");
    serde_json::from_str(&text).expect("JSON")
}

fn wait_for(guide: &Guide, what: &str, is_so: impl Fn(&Value) -> bool) {
    let begin = Instant::now();
    while !is_so(&told(guide)) {
        assert!(begin.elapsed() < SOME_TIME, "{what}: {}", told(guide));
        thread::sleep(Duration::from_millis(5));
    }
}

fn says(guide: &Guide, message: Value) -> bool {
    guide.said()(&message.to_string())
}

#[test]
fn a_step_begins_when_the_page_says_so_and_not_before() {
    let (guide, stop) = guide();
    let asking = {
        let guide = guide.clone();
        thread::spawn(move || guide.ask(&"turn the roller", false))
    };
    wait_for(&guide, "asked", |told| told["steps"][0]["stage"] == "asked");
    // A step of before, one that nobody asked for, nonsense.
    assert!(
        says(&guide, json!({ "do": "begin", "step": 0 }))
            && says(&guide, json!({ "do": "begin", "step": 2 }))
    );
    assert!(!says(&guide, json!({ "do": "start" })) && !guide.said()("no JSON"));
    thread::sleep(Duration::from_millis(300));
    assert!(!asking.is_finished());
    assert!(says(&guide, json!({ "do": "begin", "step": 1 })));
    assert!(asking.join().expect("it ends").is_ok());
    guide.read(Reading { counts: 4_000, tilt_deg: 30.0 });
    let now = told(&guide);
    assert_eq!((&now["steps"][0]["stage"], &now["reading"]["counts"]), (&json!("running"), &json!(4_000)));
    // An agreement to one step does not cover the next.
    let asking = {
        let guide = guide.clone();
        thread::spawn(move || guide.ask(&"the motor moves", true))
    };
    wait_for(&guide, "the next", |told| {
        told["steps"][1]["stage"] == "asked" && told["steps"][0]["stage"] == "done"
    });
    assert!(told(&guide)["steps"][1]["moves"] == true && !asking.is_finished());
    assert!(!stop.load(Ordering::Relaxed));
    says(&guide, json!({ "do": "leave" }));
    assert!(asking.join().expect("it ends").is_err(), "left before the motor moved");
    assert!(stop.load(Ordering::Relaxed), "a step in progress ends too");
}

#[test]
fn the_program_ends_a_guide_that_nobody_looks_at() {
    let (guide, stop) = guide();
    let asking = {
        let guide = guide.clone();
        thread::spawn(move || guide.ask(&"turn the roller", false))
    };
    stop.store(true, Ordering::Relaxed);
    let why = asking.join().expect("it ends").expect_err("nobody agreed").to_string();
    assert!(why.contains("begin again"), "{why}");
}

#[test]
fn the_result_stays_until_it_has_been_read() {
    let (guide, _stop) = guide();
    let ending = {
        let guide = guide.clone();
        thread::spawn(move || guide.end(Err(&Error::failed("the leads are off"))))
    };
    wait_for(&guide, "the end", |told| told["end"]["well"] == false);
    assert_eq!(told(&guide)["end"]["lines"][0], "the leads are off");
    assert!(!ending.is_finished());
    says(&guide, json!({ "do": "leave" }));
    ending.join().expect("it ends");
}
