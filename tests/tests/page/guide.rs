//! The guide in the page: `commission --page` asks before each step and shows what came of it;
//! `compensate`'s gains are changed in the page while a hand feels them.

use std::fs;
use std::time::Duration;
use tests::browser::{Chromium, Error, Page, Places, Program};

/// A start on a busy machine.
const SOME_TIME: Duration = Duration::from_secs(60);
/// Steps of commissioning.
const STEPS: usize = 5;
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
    page.wait("the first step", SOME_TIME, asked)?;
    std::thread::sleep(Duration::from_secs(1));
    page.wait("still the first step", Duration::from_secs(1), asked)?;
    for step in 1..=STEPS {
        let button = format!("document.querySelector('.step:nth-child({step})[data-stage=asked] .begin')");
        page.wait(&format!("step {step}"), SOME_TIME, &format!("{button} !== null"))?;
        let moves = format!("{button}.closest('li').hasAttribute('data-moves')");
        if page.evaluate(&moves)?.as_bool() != Some(step == STEPS) {
            return Err(format!("step {step}: the motor moves in the last one and no other"));
        }
        page.evaluate(&format!("{button}.click()"))?;
    }
    page.wait("the end", SOME_TIME, "document.getElementById('end').hasAttribute('data-well')")?;
    page.photograph(&scratch.join("done.png"))?;
    let lines = page.text("document.getElementById('end').innerText")?;
    if !lines.contains("4000 counts a turn") {
        return Err(format!("the page says: {lines}"));
    }
    if page.text("document.getElementById('counts').textContent")? == "–" {
        return Err("the encoder's reading was never shown".into());
    }
    page.click("leave")?;
    program.ended(SOME_TIME)
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
    page.wait("the slider", SOME_TIME, "!document.getElementById('own-forces').hidden")?;
    page.wait("all of it", SOME_TIME, "document.getElementById('own-value').textContent === '100 %'")?;
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
