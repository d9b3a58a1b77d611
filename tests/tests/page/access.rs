//! Stop is never covered, keys stop the torque, and axe-core finds nothing to complain about: at
//! every size, in every state of the page, light and dark.

use crate::needle::{SIZES, Size, complaints, open, pictures, resize};
use serde_json::json;
use std::path::Path;
use tests::browser::{Chromium, Error, Page, Places, Program, check};

/// Sizes at which parts of the page change places.
const MORE_SIZES: [Size; 4] = [(1_100, 640, false), (820, 1_180, true), (844, 390, true), (320, 568, true)];
const STOPPED: &str = "document.getElementById('state').textContent === 'Stopped, torque off'";
const RUNNING: &str = "document.getElementById('state').textContent.startsWith('Running')";
/// Buttons that open something over the page.
const OPENERS: [&str; 1] = ["patient"];
/// axe-core's rules: WCAG 2.2, levels A and AA.
const RULES: &str = "['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa', 'wcag22aa']";
/// Smallest contrast of text that WCAG allows at level AA.
const LEAST_CONTRAST: f64 = 4.5;

#[test]
fn stop_is_never_covered_and_keys_stop() {
    if let Err(error) = stop_and_keys() {
        panic!("{error}");
    }
}

fn stop_and_keys() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-stop")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    every_dialog_has_an_opener(&mut page)?;
    for size in SIZES.into_iter().chain(MORE_SIZES) {
        resize(&mut page, size)?;
        stop_is_on_top(&mut page, size, &scratch)?;
    }
    resize(&mut page, SIZES[0])?;
    keys(&mut page)?;
    complaints(&mut page)
}

/// A dialog that this test does not open would not be seen to cover Stop.
fn every_dialog_has_an_opener(page: &mut Page) -> Result<(), Error> {
    let dialogs = page.number("document.querySelectorAll('dialog').length")?;
    check("each dialog is opened by this test", dialogs == OPENERS.len() as f64, dialogs)
}

/// The element at Stop's centre is Stop, whatever is open over the page, at its top and at its end.
fn stop_is_on_top(page: &mut Page, size: Size, scratch: &Path) -> Result<(), Error> {
    hit(page, size, "nothing open")?;
    for view in ["view-body", "view-section"] {
        page.evaluate(&format!("document.getElementById('{view}').click()"))?;
        hit(page, size, view)?;
        for opener in OPENERS {
            page.evaluate(&format!("document.getElementById('{opener}').click()"))?;
            page.wait("a dialog", "document.querySelector('dialog[open]') !== null")?;
            pictures(page, 2)?;
            hit(page, size, opener)?;
            page.evaluate("scrollTo(0, document.documentElement.scrollHeight)")?;
            hit(page, size, opener)?;
            page.photograph(&scratch.join(format!("{}-{opener}.png", size.0)))?;
            page.evaluate("scrollTo(0, 0), document.querySelector('dialog[open]').close()")?;
        }
    }
    Ok(())
}

fn hit(page: &mut Page, size: Size, what: &str) -> Result<(), Error> {
    let hit = page.text(
        "(() => { const r = document.getElementById('stop').getBoundingClientRect(); \
         const hit = document.elementFromPoint(r.x + r.width / 2, r.y + r.height / 2); \
         return hit?.closest('#stop') ? 'stop' : hit ? hit.id || hit.tagName : 'nothing'; })()",
    )?;
    check(&format!("Stop on top with {what}"), hit == "stop", (size, hit))
}

/// Escape stops and closes; Space stops, but not where a control has the focus.
fn keys(page: &mut Page) -> Result<(), Error> {
    page.click("patient")?;
    page.wait("the editor", "document.querySelector('dialog[open]') !== null")?;
    page.evaluate("document.querySelector('#patient-editor input').focus()")?;
    page.press("Escape", "Escape", 27)?;
    page.wait("a stop from within a dialog", STOPPED)?;
    let closed = page.evaluate("document.querySelector('dialog[open]') === null")?;
    check("the dialog is closed", closed == json!(true), "open")?;
    start(page)?;
    // A stop by one of these keys would be an event in the list.
    let stops = "document.querySelectorAll('#events [data-kind=stopped]').length";
    let before = page.number(stops)?;
    for control in ["angle", "patient", "view-section"] {
        page.evaluate(&format!("document.getElementById('{control}').focus()"))?;
        page.press(" ", "Space", 32)?;
    }
    page.evaluate("document.activeElement.blur()")?;
    page.press(" ", "Space", 32)?;
    page.wait("a stop by Space", STOPPED)?;
    page.wait("one more stop in the list", &format!("{stops} > {before}"))?;
    let after = page.number(stops)?;
    check("one stop, not by the control", after == before + 1.0, (before, after))?;
    page.evaluate("document.querySelector('dialog[open]')?.close()")?;
    start(page)
}

fn start(page: &mut Page) -> Result<(), Error> {
    page.wait("Start to be had", "!document.getElementById('start').disabled")?;
    page.click("start")?;
    page.wait("a start", RUNNING)
}

#[test]
fn axe_core_finds_no_barrier() {
    if let Err(error) = accessible() {
        panic!("{error}");
    }
}

fn accessible() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-axe")?;
    let file = places.target.join("node/node_modules/axe-core/axe.min.js");
    let axe = std::fs::read_to_string(&file)
        .map_err(|_| format!("no {}: run `cargo xtask test browser`, which installs it", file.display()))?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    page.evaluate(&format!("{axe}; true"))?;
    // Colours that fade would be measured half-way. The page's policy allows no inline style.
    page.evaluate(
        "(() => { const still = new CSSStyleSheet(); still.replaceSync('* { transition: none !important; }'); \
         document.adoptedStyleSheets.push(still); return true; })()",
    )?;
    for (dark, scheme) in [(false, "light"), (true, "dark")] {
        page.dark(dark)?;
        for size in [SIZES[0], SIZES[2]] {
            resize(&mut page, size)?;
            for state in ["section", "body", "practice", "patient"] {
                show(&mut page, state)?;
                axe_finds_nothing(&mut page, &format!("{state}, {scheme}, {} wide", size.0))?;
                page.photograph(&scratch.join(format!("{state}-{}-{scheme}.png", size.0)))?;
                page.evaluate("document.querySelector('dialog[open]')?.close()")?;
            }
        }
        let weakest = page.number(WEAKEST_CONTRAST)?;
        check(&format!("readable names, {scheme}"), weakest >= LEAST_CONTRAST, weakest)?;
    }
    complaints(&mut page)
}

/// Brings the page into a state: a view, the list of attempts, or the editor.
fn show(page: &mut Page, state: &str) -> Result<(), Error> {
    let clicks: &[&str] = match state {
        "body" => &["view-body", "view-events"],
        "practice" => &["view-section", "view-practice"],
        "patient" => &["view-section", "view-events", "patient"],
        _ => &["view-section", "view-events"],
    };
    for id in clicks {
        page.evaluate(&format!("document.getElementById('{id}').click()"))?;
    }
    pictures(page, 3)
}

fn axe_finds_nothing(page: &mut Page, state: &str) -> Result<(), Error> {
    let found = page.evaluate(&format!(
        "axe.run(document, {{ runOnly: {RULES} }}).then(r => r.violations.map(v => \
         [v.id, ...v.nodes.map(n => n.target.join(' ') + ': ' + (n.any[0]?.message ?? n.failureSummary))]))"
    ))?;
    check(&format!("accessible: {state}"), found == json!([]), &found)
}

/// The weakest contrast of words on the section, which axe-core cannot see: names on their ground
/// of 85 % panel over each tissue, and the force on its edge.
const WEAKEST_CONTRAST: &str = "(() => {
    const style = getComputedStyle(document.documentElement);
    const rgb = name => { const n = parseInt(style.getPropertyValue('--' + name).trim().slice(1, 7), 16); return [n >> 16, (n >> 8) & 255, n & 255]; };
    const light = c => { const [r, g, b] = c.map(x => x / 255).map(x => x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
    const contrast = (a, b) => { const [x, y] = [light(a), light(b)].sort((p, q) => q - p); return (x + 0.05) / (y + 0.05); };
    const mix = (a, b, share) => a.map((x, i) => share * x + (1 - share) * b[i]);
    const tissues = ['skin', 'fat', 'muscle', 'bursa', 'tendon', 'cartilage', 'other', 'lumen', 'sky'].map(rgb);
    const names = tissues.map(t => contrast(rgb('text'), mix(rgb('panel'), t, 0.85)));
    return Math.min(...names, contrast(rgb('force'), rgb('panel')), contrast(rgb('muted'), rgb('sky')));
})()";
