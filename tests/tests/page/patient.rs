//! A patient is chosen and edited in the page while the demo goes on; a recording is played and
//! scrubbed.

use serde_json::json;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;
use tests::browser::{Chromium, Error, Page, Places, Program, check};

const DESKTOP: (u32, u32) = (1440, 900);
/// Firm skin gives way at 1.5 N, the adult's at 1 N. Read from the list, which begins anew with
/// each patient: the force itself is there for a few ms, and a browser without a graphics processor
/// may not draw them.
const FIRM_SKIN_PUNCTURED: &str = "[...document.querySelectorAll('#events [data-kind=puncture] span')].some(e => \
     /^Skin punctured at \\d+\\.\\d\\smm, 1\\.[2-9]\\d\\sN$/.test(e.textContent))";

#[test]
fn a_patient_is_edited_and_a_replay_scrubbed() {
    if let Err(error) = edit_and_scrub() {
        panic!("{error}");
    }
}

fn edit_and_scrub() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-test-patients")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = Page::open(&browser, &program.url, DESKTOP.0, DESKTOP.1, false)?;
    page.wait("live data", "document.body.dataset.link === 'live' && !isNaN(__stats.firstFrameMs)")?;
    patients(&mut page, &scratch)?;
    drop(page);
    drop(program);
    let recording = scratch.join("scrubbed.mcap");
    record(&places.program, &recording)?;
    scrub(&browser, &places.program, &recording)
}

/// A patient is chosen, edited and sent: the device takes it whole, or refuses it and the page says
/// why.
fn patients(page: &mut Page, scratch: &Path) -> Result<(), Error> {
    page.click("patient")?;
    page.wait("the editor", "document.getElementById('patient-editor').open")?;
    let taken = "document.getElementById('patient-answer').textContent === 'The device has taken it.'";
    let is =
        |name: &str| format!("document.getElementById('subtitle').textContent.includes('Profile {name} ')");
    let choose = |name: &str| {
        format!(
            "(() => {{ const choice = document.getElementById('patient-choice'); choice.value = '{name}'; \
             choice.dispatchEvent(new Event('change')); }})()"
        )
    };
    page.evaluate(&choose("firm-skin"))?;
    page.wait("firm skin taken", &format!("{taken} && {}", is("firm-skin")))?;
    page.wait("the demo in firm skin", FIRM_SKIN_PUNCTURED)?;
    let edit = |value: &str| {
        format!(
            "(() => {{ const input = document.querySelector('#patient-fields [data-key=friction_n_per_mm]'); \
             input.value = '{value}'; input.dispatchEvent(new Event('input')); \
             document.getElementById('patient-send').click(); }})()"
        )
    };
    page.evaluate(&edit("-5"))?;
    page.wait(
        "a refusal at the figure, in its words",
        "document.getElementById('patient-answer').dataset.tone === 'bad' && \
         document.querySelector('#patient-fields [data-key=friction_n_per_mm][aria-invalid]')?.parentElement.nextSibling.textContent \
         .startsWith('Friction: −5\\u00a0N/mm is out of range; choose 0 to ')",
    )?;
    page.photograph(&scratch.join("patient.png"))?;
    page.evaluate(&edit("0.03"))?;
    page.wait("an edited patient taken", taken)?;
    page.wait("the demo in it", FIRM_SKIN_PUNCTURED)?;
    page.evaluate(&choose("adult"))?;
    page.wait("the adult again", &format!("{taken} && {}", is("adult")))?;
    page.click("patient-close")
}

/// Two rounds of the scripted venepuncture.
fn record(path: &Path, recording: &Path) -> Result<(), Error> {
    let mut run = Command::new(path);
    run.args(["run", "--headless", "--fast", "--seconds", "12", "--record"]).arg(recording);
    let status =
        run.stdout(Stdio::null()).status().map_err(|e| format!("cannot start {}: {e}", path.display()))?;
    check("a recording", status.success(), status)
}

/// A recording is played, paused, and moved to and fro: the page shows that place and nothing of
/// another.
fn scrub(browser: &Chromium, path: &Path, recording: &Path) -> Result<(), Error> {
    let file = recording.to_str().ok_or("the target folder has a plain name")?;
    let program = Program::start_with(path, &["replay", file, "--port", "0"])?;
    let mut page = Page::open(browser, &program.url, DESKTOP.0, DESKTOP.1, false)?;
    page.wait("the slider", "!document.getElementById('scrub').hidden && !isNaN(__stats.firstFrameMs)")?;
    page.click("stop")?;
    page.wait("a pause", "document.getElementById('state').textContent === 'Recording paused'")?;
    // Into the first insertion's hold, before it, and into it again.
    let punctures = "document.querySelectorAll('#events [data-kind=puncture]').length";
    for (at_s, place, given) in
        [(4.2, "__stats.depthMm > 6", 2), (0.4, "__stats.depthMm < -3", 0), (4.2, "__stats.depthMm > 6", 2)]
    {
        page.evaluate(&format!(
            "(() => {{ const place = document.getElementById('scrub-place'); place.value = '{at_s}'; \
             place.dispatchEvent(new Event('input')); }})()"
        ))?;
        page.wait(&format!("the needle at {at_s} s"), &format!("{place} && {punctures} === {given}"))?;
    }
    only_what_a_recording_has(&mut page)?;
    let paused = page.number("__stats.depthMm")?;
    std::thread::sleep(Duration::from_millis(600));
    let still = page.number("__stats.depthMm")?;
    check("a pause that stands still", paused == still, (paused, still))?;
    page.click("start")?;
    page.wait("the recording to go on", "__stats.depthMm < 0")?;
    let complaints = page.complaints()?;
    check("no errors in the console", complaints.is_empty(), &complaints)
}

/// A recording has no device to start, no hand and no patient to choose: their controls are not
/// there, and its computed force is drawn at the place that was sought.
fn only_what_a_recording_has(page: &mut Page) -> Result<(), Error> {
    let shown = page.evaluate(
        "[...document.querySelectorAll('button, input, select')].filter(e => e.checkVisibility()).map(e => e.id)",
    )?;
    let expected = json!(["language", "start", "stop", "view-section", "view-body", "scrub-place"]);
    check("no dead controls", shown == expected, &shown)?;
    let says = page.text("[...['start', 'stop'].map(id => document.getElementById(id).firstChild.data), document.getElementById('hand-note').textContent].join()")?;
    check("words of a recording", says == "Play,Pause,Recording", &says)?;
    page.wait("the computed force", COMPUTED_IS_DRAWN)
}

/// Some pixels of the plot against time have the colour of the computed force.
const COMPUTED_IS_DRAWN: &str = "(() => {
    const n = parseInt(getComputedStyle(document.documentElement).getPropertyValue('--force').trim().slice(1), 16);
    const plot = document.getElementById('time-plot');
    const { data } = plot.getContext('2d').getImageData(60, 0, plot.width - 60, plot.height);
    let same = 0;
    for (let i = 0; i < data.length; i += 4) same += (data[i] << 16 | data[i + 1] << 8 | data[i + 2]) === n;
    return same > 100;
})()";
