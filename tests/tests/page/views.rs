//! The second view of the page (limb and ultrasound) from the program, and the whole simulator from a folder without a
//! server, as `cargo xtask site` writes it.

use std::path::{Path, PathBuf};
use std::time::Duration;
use tests::browser::{Chromium, Failure, Page, Places, Program};

/// A start on a busy machine; a scripted insertion takes 6 s.
const SOME_TIME: Duration = Duration::from_secs(60);
const DRAWN: &str = "__body.frames > 5 && document.getElementById('body-note').textContent === ''";
const IN_PLANE: &str = "__body.share > 0.5";

#[test]
fn limb_and_ultrasound_are_drawn_and_the_folder_needs_no_server() {
    if let Err(failure) = visit() {
        panic!("{failure}");
    }
}

fn visit() -> Result<(), Failure> {
    let places = Places::find()?;
    let scratch = places.scratch("page-views")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    look(&browser, &program.url, &scratch.join("program.png"))?;
    drop(program);
    look(&browser, &site(&places.target)?, &scratch.join("site.png"))
}

/// The folder's page: in the target directory, or where `cargo xtask site` put it for this one.
fn site(target: &Path) -> Result<String, Failure> {
    let page: PathBuf = target.join("site/index.html");
    if page.exists() {
        return Ok(format!("file://{}", page.display()));
    }
    Err(format!("no site at {}: run `cargo xtask site`", page.display()))
}

/// The needle goes in by itself; the second view shows it, in the ultrasound's plane, until the probe is moved away.
fn look(browser: &Chromium, url: &str, photograph: &Path) -> Result<(), Failure> {
    let mut page = Page::open(browser, url, 1_440, 900, false)?;
    page.wait("a needle", SOME_TIME, "__stats.depthMm > -100")?;
    page.click("view-body")?;
    page.wait("limb and ultrasound", SOME_TIME, DRAWN)?;
    page.wait("the needle in the image", SOME_TIME, IN_PLANE)?;
    page.photograph(photograph)?;
    page.wait("the needle outside", SOME_TIME, "__stats.depthMm < 0")?;
    page.evaluate(
        "{ const s = document.getElementById('probe-across'); s.value = 6; s.dispatchEvent(new Event('input')); }",
    )?;
    page.wait("the needle inside again", SOME_TIME, "__stats.depthMm > 6")?;
    std::thread::sleep(Duration::from_millis(500));
    let share = page.number("__body.share")?;
    if share > 0.01 {
        return Err(format!("with the probe 6 mm beside it {share} of the needle is in its plane"));
    }
    page.click("view-section")?;
    page.wait("the section", SOME_TIME, "document.getElementById('section').clientHeight > 100")
}
