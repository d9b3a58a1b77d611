//! A patient for tomorrow's class, made by somebody who writes no file: four sliders with a
//! picture, a step taken back, a name. It can be chosen in another run and the needle is driven
//! into it.

use crate::needle::{SIZES, complaints, open, pictures, resize};
use std::path::Path;
use std::time::{Duration, Instant};
use tests::browser::{Chromium, Error, Page, Places, Program, check};

/// The time in which a person is to be done. The test, which does not think, has to be done in it
/// as well.
const A_MINUTE: Duration = Duration::from_secs(60);
const ANSWER: &str = "document.getElementById('patient-answer')";

#[test]
fn a_patient_is_shaped_saved_and_driven_without_a_file() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-editor")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start_in(&places.program, &scratch, &["run", "--port", "0"])?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    let begin = Instant::now();
    shape(&mut page)?;
    save(&mut page, "anna", "anna.toml")?;
    check("a patient within a minute", begin.elapsed() < A_MINUTE, begin.elapsed())?;
    let subtitle = "document.getElementById('subtitle').textContent.includes('Profile anna ')";
    page.wait("the patient that counts", subtitle)?;
    driven(&mut page)?;
    save(&mut page, "anna", "anna-2.toml")?;
    too_firm(&mut page)?;
    for size in SIZES {
        resize(&mut page, size)?;
        page.photograph(&scratch.join(format!("editor-{}.png", size.0)))?;
    }
    complaints(&mut page)?;
    drop(page);
    drop(program);
    tomorrow(&browser, &places.program, &scratch)
}

/// Sets a slider as a hand does: it moves, then it is let go.
fn slide(page: &mut Page, name: &str, value: &str) -> Result<(), Error> {
    page.evaluate(&format!(
        "(() => {{ const s = document.getElementById('patient-{name}'); s.value = '{value}'; \
         s.dispatchEvent(new Event('input', {{ bubbles: true }})); s.dispatchEvent(new Event('change', {{ bubbles: true }})); }})()"
    ))?;
    pictures(page, 1)
}

fn value(page: &mut Page, name: &str) -> Result<String, Error> {
    page.text(&format!("document.getElementById('patient-{name}-value').textContent"))
}

/// The pixels of both pictures as one number.
fn picture(page: &mut Page) -> Result<f64, Error> {
    page.number(
        "['patient-picture', 'patient-force'].reduce((hash, id) => { const c = document.getElementById(id); \
         for (const v of c.getContext('2d').getImageData(0, 0, c.width, c.height).data) hash = (hash * 31 + v) | 0; return hash; }, 7)",
    )
}

/// Each slider changes its figure and the picture; a step is taken back.
fn shape(page: &mut Page) -> Result<(), Error> {
    page.click("patient")?;
    page.wait(
        "the editor",
        "document.getElementById('patient-editor').open && !document.getElementById('patient-shape').hidden",
    )?;
    pictures(page, 2)?;
    let mut seen = picture(page)?;
    for (name, to, says) in [
        ("depth", "6.5", "6.5 mm"),
        ("size", "3", "3.0 mm"),
        ("skin", "1.3", "gives way at 1.30 N"),
        ("wall", "0.7", "gives way at 0.70 N"),
    ] {
        slide(page, name, to)?;
        let said = value(page, name)?;
        check(&format!("the figure of {name}"), said == says, said)?;
        let now = picture(page)?;
        check(&format!("another picture with {name}"), now != seen, now)?;
        seen = now;
    }
    slide(page, "depth", "11")?;
    page.click("patient-undo")?;
    let (back, again) = (value(page, "depth")?, picture(page)?);
    check("one step taken back", back == "6.5 mm" && again == seen, (back, again == seen))?;
    let wall =
        page.number("Number(document.querySelectorAll('#patient-fields [data-key=puncture_mm]')[1].value)")?;
    let compliance = page.number(
        "Number(document.querySelectorAll('#patient-fields [data-key=compliance_mm2_per_n]')[2].value)",
    )?;
    let force = wall * wall / compliance;
    check("the wall's own figures say the same", (force - 0.7).abs() < 0.005, force)
}

fn save(page: &mut Page, name: &str, file: &str) -> Result<(), Error> {
    page.evaluate(&format!("document.getElementById('patient-name').value = '{name}'"))?;
    page.click("patient-save")?;
    page.wait(
        "the patient saved",
        &format!(
            "{ANSWER}.dataset.tone === 'good' && /^Saved as patients.{file}; /.test({ANSWER}.textContent)"
        ),
    )?;
    let listed = page.evaluate(&format!(
        "[...document.getElementById('patient-choice').options].some(o => o.value === '{}')",
        file.trim_end_matches(".toml")
    ))?;
    check("it is in the list", listed == true, file)
}

/// The scripted hand pierces skin and vein at the forces that were asked for.
fn driven(page: &mut Page) -> Result<(), Error> {
    let pierced = |layer: &str, force: &str| {
        format!(
            "[...document.querySelectorAll('#events [data-kind=puncture] span')].some(e => /^{layer} punctured at .*, {force}\\sN$/.test(e.textContent))"
        )
    };
    page.wait("the skin at its force", &pierced("Skin", "1\\.[23]\\d"))?;
    page.wait("the vein", &pierced("Vessel", "\\d\\.\\d\\d"))
}

/// Tests that the slider refuses what the device cannot render, in its words.
fn too_firm(page: &mut Page) -> Result<(), Error> {
    page.evaluate(
        "(() => { const f = document.querySelector('#patient-fields [data-key=compliance_mm2_per_n]'); f.value = '0.5'; \
         f.dispatchEvent(new Event('input', { bubbles: true })); document.getElementById('patient-send').click(); })()",
    )?;
    page.wait(
        "a refusal at the slider",
        "document.getElementById('patient-skin').getAttribute('aria-invalid') === 'true' && \
         /^Skin: .* make it softer, to .* at most\\.$/.test(document.getElementById('patient-wrong').textContent)",
    )?;
    page.click("patient-undo")?;
    page.wait("the mark gone", "document.getElementById('patient-wrong') === null")
}

/// Another run in the same folder has the patient.
fn tomorrow(browser: &Chromium, path: &Path, folder: &Path) -> Result<(), Error> {
    let program = Program::start_in(path, folder, &["run", "--port", "0"])?;
    let mut page = open(browser, &program.url, SIZES[0])?;
    page.click("patient")?;
    page.evaluate(
        "(() => { const c = document.getElementById('patient-choice'); c.value = 'anna'; c.dispatchEvent(new Event('change')); })()",
    )?;
    page.wait("the patient of yesterday", &format!("{ANSWER}.textContent === 'The device has taken it.'"))?;
    let depth = value(&mut page, "depth")?;
    check("as it was shaped", depth == "6.5 mm", depth)?;
    driven(&mut page)
}
