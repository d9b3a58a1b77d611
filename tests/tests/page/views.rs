//! The second view of the page (limb and ultrasound) from the program, and the whole simulator from
//! a folder without a server, as `cargo xtask site` writes it.

use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;
use tests::browser::{Chromium, Error, Page, Places, Program};

const DRAWN: &str = "__body.frames > 5 && document.getElementById('body-note').textContent === ''";
const IN_PLANE: &str = "__body.share > 0.5";

#[test]
fn limb_and_ultrasound_are_drawn_and_the_folder_needs_no_server() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-views")?;
    let browser = Chromium::start(&scratch)?;
    let file = scratch.join("probe.mcap");
    let program = Program::start(&places.program, 0, Some(&file))?;
    look(&browser, &program.url, &scratch.join("program.png"))?;
    drop(program);
    probe_is_recorded(&places.program, &file)?;
    look(&browser, &site(&places.target)?, &scratch.join("site.png"))
}

/// The recording says where the probe was: the tip was seen in one insertion for some of the time
/// and in another less.
fn probe_is_recorded(program: &Path, file: &Path) -> Result<(), Error> {
    let output = Command::new(program).arg("score").arg(file).arg("--json").output();
    let output = output.map_err(|cause| format!("score does not start: {cause}"))?;
    let score: Value = serde_json::from_slice(&output.stdout).map_err(|cause| format!("score: {cause}"))?;
    let shares = score["insertions"].as_array().into_iter().flatten();
    let shares: Vec<f64> = shares.filter_map(|one| one["tip_seen_share"].as_f64()).collect();
    let (least, most) = shares.iter().fold((1.0_f64, 0.0_f64), |(low, high), s| (low.min(*s), high.max(*s)));
    if most > 0.2 && least < most { Ok(()) } else { Err(format!("shares of the tip seen: {shares:?}")) }
}

/// The folder's page: in the target folder, or where `cargo xtask site` put it for this one.
fn site(target: &Path) -> Result<String, Error> {
    let page: PathBuf = target.join("site/index.html");
    if page.exists() {
        return Ok(format!("file://{}", page.display()));
    }
    Err(format!("no site at {}: run `cargo xtask site`", page.display()))
}

/// The needle goes in by itself; the second view shows it, in the ultrasound's plane, until the
/// probe is moved away.
fn look(browser: &Chromium, url: &str, photograph: &Path) -> Result<(), Error> {
    let mut page = Page::open(browser, url, 1_440, 900, false)?;
    page.wait("a needle", "__stats.depthMm > -100")?;
    page.click("view-body")?;
    page.wait("limb and ultrasound", DRAWN)?;
    page.wait("the needle in the image", IN_PLANE)?;
    page.photograph(photograph)?;
    page.wait("the needle outside", "__stats.depthMm < 0")?;
    page.evaluate(
        "{ const s = document.getElementById('probe-across'); s.value = 6; s.dispatchEvent(new Event('input')); }",
    )?;
    page.wait("the needle inside again", "__stats.depthMm > 6")?;
    std::thread::sleep(Duration::from_millis(500));
    let share = page.number("__body.share")?;
    if share > 0.01 {
        return Err(format!("with the probe 6 mm beside it {share} of the needle is in its plane"));
    }
    table_1(&mut page)?;
    page.click("view-section")?;
    page.wait("the section", "document.getElementById('section').clientHeight > 100")
}

/// Table 1 of Paper 000 replaces the limb, is drawn and imaged, and gives way to the limb again.
fn table_1(page: &mut Page) -> Result<(), Error> {
    let choose = |page: &mut Page, value: &str| {
        page.evaluate(&format!(
            "{{ const s = document.getElementById('tissue-model'); s.value = '{value}'; s.dispatchEvent(new Event('change')); }}"
        ))?;
        page.evaluate("__body.frames = 0")?;
        page.wait("a picture", DRAWN)?;
        page.number("__body.particles")
    };
    let limb = page.number("__body.particles")?;
    let table = choose(page, "table-1")?;
    page.wait("the needle deep in Table 1", "__stats.depthMm > 6 && __body.frames > 20")?;
    let note = page.text("document.getElementById('body-note').textContent")?;
    let again = choose(page, "limb")?;
    if table > 10.0 && table != limb && again == limb && note.is_empty() {
        return Ok(());
    }
    Err(format!(
        "particles of the limb {limb}, of Table 1 {table}, of the limb again {again}; the page says: {note}"
    ))
}
