//! Practice on tablets and phones: with fifty attempts in the list nothing covers what a finger is
//! to touch, and the picture is seen together with the buttons of the tasks.

use crate::needle::{LIVE, Size, complaints, open, resize};
use tests::browser::{Chromium, Error, Page, Places, Program, check};

const SIZES: [Size; 6] = [
    (1440, 900, false),
    (1280, 720, false),
    (1024, 768, true),
    (768, 1024, true),
    (390, 844, true),
    (844, 390, true),
];
/// The least width and height of what a finger touches, CSS px (WCAG 2.2, 2.5.5).
const FINGER_PX: f64 = 44.0;
/// Keeps the page's socket, so that attempts can be put into it as from the program.
const KEEP_SOCKET: &str =
    "WebSocket = class extends WebSocket { constructor(...all) { super(...all); window.socket = this; } };";
const FIFTY_ATTEMPTS: &str = "for (let number = 1; number <= 50; number++) socket.onmessage({ data: JSON.stringify({
    type: 'attempt', number, patient: 'adult', by_person: true, path: [],
    figures: { time_s: 5.1, peak_force_n: 1.2, in_lumen_s: 0.6, verdict: { passed: number % 3 === 0, reasons: [] } } }) })";

#[test]
fn nothing_covers_what_a_finger_is_to_touch() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-tablet")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start_in(&places.program, &scratch, &["run", "--port", "0"])?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    page.before_load(KEEP_SOCKET)?;
    page.evaluate("location.reload()")?;
    page.wait("the page again", &format!("Boolean(window.socket) && {LIVE}"))?;
    page.wait("tasks", "document.querySelectorAll('#tasks button').length > 0")?;
    page.evaluate("document.getElementById('view-practice').click()")?;
    page.evaluate(FIFTY_ATTEMPTS)?;
    for size in SIZES {
        resize(&mut page, size)?;
        can_be_touched(&mut page, size)?;
        page.evaluate("scrollTo(0, 0)")?;
        page.photograph(&scratch.join(format!("{}x{}.png", size.0, size.1)))?;
        if size.2 {
            is_seen_with_tasks(&mut page, size)?;
        }
    }
    tap_records(&mut page)?;
    complaints(&mut page)
}

/// Scrolled to, each control is on top at its middle, and large enough for a finger.
fn can_be_touched(page: &mut Page, size: Size) -> Result<(), Error> {
    let least = if size.2 { FINGER_PX } else { 0.0 };
    let wrong = page.text(&format!(
        "[...document.querySelectorAll('#record, #record-name, #curve, #stop, #view-events, #tasks button, #language, .picture .heading button')].map((e) => {{
            e.scrollIntoView({{ block: 'center' }});
            const r = e.getBoundingClientRect();
            const hit = document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2);
            if (!e.contains(hit)) return `${{e.id || e.dataset.task}} below ${{hit?.id || hit?.tagName}}`;
            return Math.min(r.width, r.height) >= {least} ? '' : `${{e.id || e.dataset.task}} ${{r.width}}x${{r.height}}`;
        }}).filter(Boolean).join(', ')"
    ))?;
    check("nothing is covered or too small", wrong.is_empty(), (size, wrong))
}

/// At the top of the page half of the picture is in view, above the buttons of the tasks.
fn is_seen_with_tasks(page: &mut Page, size: Size) -> Result<(), Error> {
    let share = page.number(
        "(() => { const p = document.getElementById('section').getBoundingClientRect();
                  const t = document.getElementById('tasks').getBoundingClientRect();
                  return t.bottom <= innerHeight ? (Math.min(t.top, p.bottom) - p.top) / p.height : -1; })()",
    )?;
    check("the picture is seen with the tasks", share >= 0.5, (size, share))
}

fn tap_records(page: &mut Page) -> Result<(), Error> {
    resize(page, (390, 844, true))?;
    page.evaluate("document.getElementById('record').scrollIntoView({ block: 'center' })")?;
    let at = page.middle("record")?;
    page.touch("touchStart", at)?;
    page.touch("touchEnd", at)?;
    page.wait(
        "a recording",
        "document.getElementById('recording').textContent.includes('Recording practice')",
    )
}
