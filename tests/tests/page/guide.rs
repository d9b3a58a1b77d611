//! The guide in the page: `commission --page` and `settle --page` ask before each step and show
//! what came of it; `compensate`'s gains are changed in the page while a hand feels them.

use std::fs;
use std::time::Duration;
use tests::browser::{Chromium, Error, Page, Places, Program, check};

/// Steps of commissioning.
const STEPS: usize = 5;
/// A step waits for its press.
const ASKED: &str = "document.querySelector('.step[data-stage=asked]') !== null";
/// The program has said what came of it all.
const ENDED: &str = "!document.getElementById('end').hidden";
/// A device's part with a weight that is compensated.
const COMPENSATED: &str = r#"
format = 1
name = "bench"
commissioned = true
[compensation]
version = 1
rest_speed_mm_s = 2.0
full_speed_mm_s = 6.0
weight_mnm = 1.0
offset_mnm = 0.0
deadband_mnm = 0.0
[compensation.inwards]
dry_mnm = 0.0
viscous_n_s_per_mm = 0.0
[compensation.outwards]
dry_mnm = 0.0
viscous_n_s_per_mm = 0.0
[compensation.gains]
angle = 0.0
friction = 0.0
weight = 0.9
drive = 0.0
"#;

#[test]
fn commissioning_goes_on_only_where_a_person_says_so() {
    if let Err(error) = commission() {
        panic!("{error}");
    }
}

fn commission() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-guide")?;
    let browser = Chromium::start(&scratch)?;
    let mut program = Program::start_with(&places.program, &["commission", "--page", "--port", "0"])?;
    let mut page = Page::open(&browser, &program.url, 390, 844, true)?;
    let asked = "document.querySelectorAll('.step').length === 1 && document.querySelector('.step').dataset.stage === 'asked'";
    page.wait("the first step", asked)?;
    std::thread::sleep(Duration::from_secs(1));
    page.wait("still the first step", asked)?;
    for step in 1..=STEPS {
        let button = format!("document.querySelector('.step:nth-child({step})[data-stage=asked] .begin')");
        page.wait(&format!("step {step}"), &format!("{button} !== null"))?;
        let moves = format!("{button}.closest('li').hasAttribute('data-moves')");
        if page.evaluate(&moves)?.as_bool() != Some(step == STEPS) {
            return Err(format!("step {step}: the motor moves in the last one and no other"));
        }
        page.evaluate(&format!("{button}.click()"))?;
    }
    page.wait("the end", "document.getElementById('end').hasAttribute('data-well')")?;
    page.photograph(&scratch.join("done.png"))?;
    let lines = page.text("document.getElementById('end').innerText")?;
    if !lines.contains("4000 counts a turn") {
        return Err(format!("the page says: {lines}"));
    }
    if page.text("document.getElementById('counts').textContent")? == "–" {
        return Err("the encoder's reading was never shown".into());
    }
    page.click("leave")?;
    program.ended()
}

/// Takes some 20 s: a round is simulated and diagnosed, and its outcome is fed forward.
#[test]
fn settling_asks_before_each_movement_and_shows_what_it_found() {
    if let Err(error) = settle() {
        panic!("{error}");
    }
}

fn settle() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-settle")?;
    let browser = Chromium::start(&scratch)?;
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/hidden.toml");
    let out = scratch.join("settled");
    let folder = out.to_str().ok_or("the target folder has a plain name")?;
    let settle = ["settle", "--page", "--port", "0", "--plant", plant, "--out", folder];
    let one_round = ["--rounds", "1", "--motion", "40", "--inputs", "characterise"];
    let mut program = Program::start_with(&places.program, &[&settle[..], &one_round].concat())?;
    let mut page = Page::open(&browser, &program.url, 390, 844, true)?;
    page.wait("the first round", ASKED)?;
    let first = page.text("document.querySelector('.step .text').textContent")?;
    check("the page says what is asked and why", first.contains("round 1") && first.contains("why"), &first)?;
    check("nothing is played before the press", !out.join("round-1").exists(), &out)?;
    page.evaluate("window.said = new Set(); new MutationObserver(() => document.querySelectorAll('.going, .news').forEach((one) => said.add(one.textContent))).observe(document.getElementById('steps'), { subtree: true, childList: true, characterData: true })")?;
    let mut steps = 0;
    loop {
        page.wait("a step or the end", &format!("{ASKED} || {ENDED}"))?;
        if page.evaluate(ENDED)?.as_bool() == Some(true) {
            break;
        }
        steps += 1;
        page.evaluate("document.querySelector('.step[data-stage=asked] .begin').click()")?;
        page.wait("the step begins", &format!("!({ASKED}) || {ENDED}"))?;
    }
    page.photograph(&scratch.join("settled.png"))?;
    check("a round and the steps of feeding forward", steps >= 3, steps)?;
    let said = page.text("[...said].join(' ')")?;
    check("the page shows what goes on", said.contains("s played") && said.contains("% done"), &said)?;
    let end = page.text("document.getElementById('end').innerText")?;
    let found = fs::read_to_string(out.join("settle.json")).map_err(|e| e.to_string())?;
    let found: serde_json::Value = serde_json::from_str(&found).map_err(|e| e.to_string())?;
    let conclusion = found["conclusion"].as_str().ok_or("a conclusion")?;
    check("the page ends with the conclusion", end.contains(conclusion), (&end, conclusion))?;
    page.click("leave")?;
    program.ended()
}

#[test]
fn leaving_the_page_ends_settling_before_anything_moves() {
    if let Err(error) = leave_settling("page-settle-left", false) {
        panic!("{error}");
    }
}

#[test]
fn leaving_the_page_ends_settling_while_it_plays() {
    if let Err(error) = leave_settling("page-settle-stopped", true) {
        panic!("{error}");
    }
}

fn leave_settling(name: &str, while_it_plays: bool) -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch(name)?;
    let browser = Chromium::start(&scratch)?;
    let plant = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/hidden.toml");
    let out = scratch.join("settled");
    let folder = out.to_str().ok_or("the target folder has a plain name")?;
    let settle = ["settle", "--page", "--port", "0", "--plant", plant, "--out", folder];
    // The longest round there is, so that it still plays when it is left.
    let settle = [&settle[..], &["--inputs", "characterise", "--no-compensate"]].concat();
    let mut program = Program::start_with(&places.program, &settle)?;
    let mut page = Page::open(&browser, &program.url, 1_440, 900, false)?;
    page.wait("the first round", ASKED)?;
    if while_it_plays {
        page.evaluate("document.querySelector('.step[data-stage=asked] .begin').click()")?;
        page.wait("it plays", "document.querySelector('.news').textContent.includes('played')")?;
    }
    page.click("leave")?;
    let why = program.ended().err().unwrap_or_default();
    check("a run that was left is no success", why.contains("failed"), why)?;
    check("no recording is kept", !out.join("round-1/fit.csv").exists(), &out)?;
    page.wait("the page says so", "!document.getElementById('banner').hidden")?;
    let said = page.text("document.getElementById('banner').textContent")?;
    check("and that it can be closed", said.contains("close this page"), said)
}

#[test]
fn the_gains_of_a_compensated_device_are_changed_in_the_page() {
    if let Err(error) = change_gains() {
        panic!("{error}");
    }
}

fn change_gains() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-gains")?;
    let browser = Chromium::start(&scratch)?;
    let part = scratch.join("device.toml");
    fs::write(&part, COMPENSATED).map_err(|e| format!("{}: {e}", part.display()))?;
    let part = part.to_str().ok_or("the target folder has a plain name")?;
    let program = Program::start_with(&places.program, &["run", "--port", "0", "--device-config", part])?;
    let mut page = Page::open(&browser, &program.url, 1_440, 900, false)?;
    page.wait("the slider", "!document.getElementById('own-forces').hidden")?;
    page.wait("all of it", "document.getElementById('own-value').textContent === '100 %'")?;
    page.evaluate(
        "{ const s = document.getElementById('own-share'); s.value = 30; s.dispatchEvent(new Event('input')); }",
    )?;
    // Long enough for the server's own word to be shown again.
    std::thread::sleep(Duration::from_secs(2));
    page.photograph(&scratch.join("gains.png"))?;
    let value = page.text("document.getElementById('own-value').textContent")?;
    let banner = page.text("document.getElementById('banner').textContent")?;
    if value == "30 %" && banner.is_empty() { Ok(()) } else { Err(format!("{value}, {banner}")) }
}
