//! The page in a real browser: the main job as a person meets it, from the address that the program
//! prints to the stop.
//!
//! One browser and one program, one step after the other, and no other test at the same time
//! (`.config/nextest.toml`): two cores are not enough for several at once to keep 60 pictures a
//! second. Writes what it measured to `target/page.json`.

mod controls;
mod drag;
mod latency;
mod watch;

use controls::{stop, turn_and_go_through, zero_and_turn};
use drag::drag;
use latency::latency;
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::time::Duration;
use tests::browser::{Chromium, Error, Page, Places, Program, check};
use watch::watch;

const DESKTOP: (u32, u32) = (1440, 900);
const PHONE: (u32, u32) = (390, 844);
/// The entry angle of every default profile.
const TILT_RAD: f64 = std::f64::consts::FRAC_PI_6;

/// The oldest puncture in the list.
const FIRST_PUNCTURE: &str =
    "[...document.querySelectorAll('#events [data-kind=puncture]')].at(-1)?.textContent ?? 'none'";

#[test]
fn a_person_watches_takes_the_needle_stops_and_comes_back() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-test")?;
    let browser = Chromium::start(&scratch)?;
    let recording = scratch.join("watched.mcap");
    let mut program = Program::start(&places.program, 0, Some(&recording))?;
    let mut page = Page::open_lively(&browser, &program.url, DESKTOP.0, DESKTOP.1, false)?;
    let mut rows = watch(&mut page, &browser)?;
    photographs(&mut page, &scratch)?;
    drag(&mut page)?;
    rows.extend(latency(&mut page)?);
    stop(&mut page)?;
    zero_and_turn(&mut page)?;
    turn_and_go_through(&mut page, &scratch)?;
    let complaints = page.complaints()?;
    check("no errors in the console", complaints.is_empty(), &complaints)?;
    come_back(&mut page, &mut program, &places.program)?;
    let told = page.text(FIRST_PUNCTURE)?;
    drop(page);
    phone(&browser, &program.url, &told, &scratch)?;
    let report = json!({ "rows": rows });
    let file = places.target.join("page.json");
    fs::write(&file, format!("{report:#}\n")).map_err(|e| format!("cannot write {}: {e}", file.display()))?;
    println!("{report:#}");
    Ok(())
}

/// The page as it is, to be looked at: light and dark.
fn photographs(page: &mut Page, scratch: &Path) -> Result<(), Error> {
    page.photograph(&scratch.join("desktop.png"))?;
    page.dark(true)?;
    std::thread::sleep(Duration::from_millis(300));
    page.photograph(&scratch.join("desktop-dark.png"))?;
    page.dark(false)
}

/// The program ends and is started again: the page says so, shows old data as old, and is back by
/// itself.
fn come_back(page: &mut Page, program: &mut Program, path: &Path) -> Result<(), Error> {
    program.end();
    page.wait(
        "a word about the missing program",
        "document.body.dataset.link === 'lost' && /no data for [2-9] s/.test(document.getElementById('banner').textContent)",
    )?;
    *program = Program::start(path, program.port()?, None)?;
    page.wait(
        "the page back",
        "document.body.dataset.link === 'live' && document.getElementById('banner').hidden",
    )?;
    page.wait("the needle deep again", "__stats.depthMm > 6")?;
    // The browser itself notes each attempt to reach a program that is not there; nothing else may
    // be noted.
    let complaints: Vec<_> =
        page.complaints()?.into_iter().filter(|text| !text.contains("WebSocket connection")).collect();
    check("no other errors in the console", complaints.is_empty(), &complaints)
}

/// A phone: nothing sticks out, the stop is in reach, a finger drags.
fn phone(browser: &Chromium, url: &str, told: &str, scratch: &Path) -> Result<(), Error> {
    let mut page = Page::open_lively(browser, url, PHONE.0, PHONE.1, true)?;
    page.wait("live data", "document.body.dataset.link === 'live' && !isNaN(__stats.firstFrameMs)")?;
    let told_later = page.text(FIRST_PUNCTURE)?;
    check("what happened before it was opened, in the same words", told == told_later, (told, &told_later))?;
    let width = page.number("document.documentElement.scrollWidth")?;
    check("nothing wider than the screen", width <= f64::from(PHONE.0), width)?;
    let stop = "document.getElementById('stop').getBoundingClientRect()";
    let (top, bottom) = (page.number(&format!("{stop}.top"))?, page.number(&format!("{stop}.bottom"))?);
    check("the stop on the screen", top > 0.0 && bottom <= f64::from(PHONE.1), (top, bottom))?;
    page.wait("the needle outside", "__stats.depthMm < -3")?;
    let before = page.number("__stats.depthMm")?;
    let mut at = page.middle("section")?;
    page.touch("touchStart", at)?;
    for _ in 0..15 {
        at = (at.0 + 2.0 * TILT_RAD.cos(), at.1 + 2.0 * TILT_RAD.sin());
        page.touch("touchMove", at)?;
        std::thread::sleep(Duration::from_millis(20));
    }
    page.wait("the needle to follow the finger", &format!("__stats.depthMm > {before} + 1"))?;
    page.touch("touchEnd", at)?;
    page.photograph(&scratch.join("phone.png"))?;
    page.click("demo")?;
    let complaints = page.complaints()?;
    check("no errors in the console", complaints.is_empty(), &complaints)
}

fn row(name: &str, value: f64, unit: &str, better: &str) -> Value {
    json!({ "row": name, "value": (value * 1000.0).round() / 1000.0, "unit": unit, "wanted": null, "better": better,
            "peer": null, "peer_value": null })
}
