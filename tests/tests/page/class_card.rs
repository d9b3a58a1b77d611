//! The card of a trainee on the page of a class: goal and reasons are read whole, in three
//! languages, on a desktop, a tablet and a phone.

use crate::needle::{SOON, Size, open, resize};
use tests::browser::{Chromium, Error, Page, Places, Program, check};

const SIZES: [Size; 6] = [
    (1440, 900, false),
    (1280, 720, false),
    (1024, 768, true),
    (768, 1024, true),
    (390, 844, true),
    (844, 390, true),
];
const PAGE: &str = include_str!("../../../host-sim/page/js/class.html");
/// Keeps the page's socket, so that a message can be put into it as from the instructor's program.
const KEEP_SOCKET: &str =
    "WebSocket = class extends WebSocket { constructor(...all) { super(...all); window.socket = this; } };";
/// A trainee who did much wrong.
const MEMBER: &str = "socket.onmessage({ data: JSON.stringify({ type: 'class', name: 'ward-3', address: '10.0.0.1:7447', members: [{
    name: 'bed-1', trainee: 'Anna', connected: true, gone: false, silent_s: 0, stuck: null, recording: false, events: [], scene: null, pose: null,
    score: { insertions: 3, passed: 1, last: { time_s: 12.5, peak_force_n: 1.25, verdict: { goal: 'Put a catheter into the vein', reasons: [
        { words: 'the skin was pierced at 45°, not at 10–30°' }, { words: 'it went through the far wall' },
        { words: 'the needle left the vein before the catheter was in' }, { words: 'the tourniquet was left on' }] } } } }] }) })";

#[test]
fn reasons_are_read_whole_in_three_languages() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-class")?;
    let browser = Chromium::start(&scratch)?;
    // Only its files are wanted: the page of a class is written over that of the device.
    let program = Program::start(&places.program, 0, None)?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    page.before_load(KEEP_SOCKET)?;
    for (language, first, last) in [
        ("en", "the skin was pierced at 45°, not at 10–30°", "the tourniquet was left on"),
        ("de", "die Haut wurde unter 45° durchstochen", "Stauschlauch"),
        ("fr", "peau", "garrot"),
    ] {
        page.languages(language)?;
        page.evaluate("window.__old = true, location.reload()")?;
        page.wait("the page anew", SOON, "!window.__old && document.readyState === 'complete'")?;
        let html = serde_json::to_string(PAGE).map_err(|cause| Error::from(cause.to_string()))?;
        page.evaluate(&format!(
            "window.socket = undefined, document.open(), document.write({html}), document.close()"
        ))?;
        page.wait(
            "the class's page",
            SOON,
            "Boolean(window.socket?.onmessage) && Boolean(document.getElementById('cards'))",
        )?;
        page.evaluate(MEMBER)?;
        page.wait("a card", SOON, "document.querySelectorAll('.card').length === 1")?;
        let text = page.text("document.querySelector('[data-figure=reasons]').textContent")?;
        check(
            &format!("{language}: the reasons are in the language"),
            text.contains(first) && text.contains(last) && text.matches(';').count() == 3,
            &text,
        )?;
        for size in SIZES {
            resize(&mut page, size)?;
            is_whole(&mut page, language, size)?;
            page.photograph(&scratch.join(format!("{language}-{}x{}.png", size.0, size.1)))?;
        }
    }
    Ok(())
}

/// Nothing of goal and reasons is cut off, and nothing is wider than the page.
fn is_whole(page: &mut Page, language: &str, size: Size) -> Result<(), Error> {
    let cut = page.text(
        "[...document.querySelectorAll('[data-figure=goal], [data-figure=reasons], .card h2, #class-name')] \
         .filter(e => e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1) \
         .map(e => e.dataset.figure ?? e.tagName).concat(document.documentElement.scrollWidth > innerWidth ? ['page'] : []).join(' ')",
    )?;
    check(&format!("{language}: all is read whole"), cut.is_empty(), (size, cut))
}
