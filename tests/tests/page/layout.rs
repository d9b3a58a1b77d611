//! The layout on a desktop: nothing scrolls that could be seen at once, and the list of attempts
//! has room.

use crate::needle::{complaints, open, pictures, resize};
use std::time::Duration;
use tests::browser::{Chromium, Error, Page, Places, Program, check};

/// A list that shows at least five attempts below its heading.
const LIST_PX: f64 = 150.0;

#[test]
fn figures_and_attempts_fit_on_a_desktop() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-layout")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = open(&browser, &program.url, (1280, 720, false))?;
    let state = page.text("import('/link.js').then(({ Link }) => new Link(() => {}).condition)")?;
    check("a page that was just opened is connecting", state == "connecting", state)?;
    page.click("view-practice")?;
    for size in [(1280, 720, false), (1440, 900, false)] {
        resize(&mut page, size)?;
        fits(&mut page, size.0)?;
    }
    // A person's note is longer than the demo's.
    page.evaluate("document.getElementById('section').focus()")?;
    page.press("ArrowRight", "ArrowRight", 39)?;
    page.wait("the needle in a person's hand", "!document.getElementById('demo').disabled")?;
    for size in [(1280, 720, false), (1440, 900, false)] {
        resize(&mut page, size)?;
        fits(&mut page, size.0)?;
        page.photograph(&scratch.join(format!("{}.png", size.0)))?;
    }
    complaints(&mut page)
}

fn fits(page: &mut Page, width: u32) -> Result<(), Error> {
    pictures(page, 3)?;
    std::thread::sleep(Duration::from_millis(200));
    let hidden = page.number(
        "(() => { const e = document.querySelector('.readings'); return e.scrollHeight - e.clientHeight; })()",
    )?;
    check("the figures need no scrolling", hidden <= 0.0, (width, hidden))?;
    let lines = page.number("document.getElementById('hand-note').getClientRects().length")?;
    let title = page.number("document.getElementById('picture-title').clientHeight")?;
    check("the note of the hand is on one line", lines == 1.0 && title < 40.0, (width, lines, title))?;
    let list = page.number("document.querySelector('.attempts').clientHeight")?;
    check("the list of attempts has room", list >= LIST_PX, (width, list))
}
