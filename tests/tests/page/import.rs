//! `import --page`: a log is dropped on the page, its columns get units, the rig its values, and
//! the report names what the rig lacks.

use std::fmt::Write as _;
use tests::browser::{Chromium, Error, Page, Places, Program, check};

/// The machine of the log; its rig knows no viscous friction.
const INERTIA: f64 = 2e-4;
const GAIN: f64 = 0.02;
const VISCOUS: f64 = 9e-4;
const COULOMB: f64 = 4e-3;

#[test]
fn a_dropped_log_ends_in_a_report_of_what_its_rig_lacks() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

/// 24 s of a motor under five tones, in small steps of Euler's: time, current and degrees.
fn log() -> String {
    let mut text = String::from("t,current,theta\n");
    let (mut angle, mut speed) = (0.0_f64, 0.0_f64);
    for row in 0..12_000 {
        let t = f64::from(row) * 2e-3;
        let tones = [0.4, 0.9, 1.7, 3.1, 5.3].into_iter().zip([0.3, 1.9, 4.0, 5.1, 2.2]);
        let current: f64 =
            tones.map(|(hertz, phase)| 0.55 * (std::f64::consts::TAU * hertz * t + phase).sin()).sum();
        let _ = writeln!(text, "{t:.4},{current:.6},{:.4}", angle.to_degrees());
        for _ in 0..20 {
            let free = GAIN * current - VISCOUS * speed;
            let friction =
                if speed == 0.0 { free.clamp(-COULOMB, COULOMB) } else { COULOMB * speed.signum() };
            let next = speed + (free - friction) / INERTIA * 1e-4;
            speed = if speed * next < 0.0 && free.abs() <= COULOMB { 0.0 } else { next };
            angle += speed * 1e-4;
        }
    }
    text
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-import")?;
    let out = scratch.join("imported").display().to_string();
    let browser = Chromium::start(&scratch)?;
    let program = Program::start_with(&places.program, &["import", "--page", "--port", "0", "--out", &out])?;
    let mut page = Page::open(&browser, &program.url, 1_200, 900, false)?;
    let dropped = |name: &str, text: &str| {
        format!(
            "(() => {{ const data = new DataTransfer(); data.items.add(new File([{text:?}], {name:?})); \
             document.body.dispatchEvent(new DragEvent('drop', {{ dataTransfer: data, bubbles: true }})); }})()"
        )
    };
    page.wait("a page", "document.readyState === 'complete'")?;
    page.evaluate(&dropped("photo.bin", "\u{1}\u{2}no table"))?;
    page.wait("a refusal in words", "document.getElementById('banner').textContent.includes('photo.bin')")?;
    page.evaluate(&dropped("../log.csv", &log()))?;
    page.wait("three columns", "document.getElementById('columns').rows.length === 3")?;
    let roles =
        page.text("[...document.querySelectorAll('#columns select')].map((one) => one.value).join(' ')")?;
    check("roles by their names", roles == "time command position", roles)?;
    let inked = "[...document.querySelectorAll('#columns canvas')].every((one) => one.getContext('2d')\
                 .getImageData(0, 0, one.width, one.height).data.some((value) => value > 0))";
    check("a course of each", page.text(&format!("String({inked})"))? == "true", "an empty plot")?;
    for (column, unit) in [("t", "s"), ("current", "A"), ("theta", "deg")] {
        page.evaluate(&format!(
            "document.querySelector(\"[aria-label='the unit of {column}']\").value = '{unit}'"
        ))?;
    }
    page.photograph(&scratch.join("columns.png"))?;
    page.evaluate("document.getElementById('read').click()")?;
    page.wait("the rig's values", "!document.getElementById('rig').hidden")?;
    page.evaluate("document.getElementById('diagnose').click()")?;
    page.wait(
        "a missing value named",
        "document.getElementById('banner').textContent.includes('model.inertia is needed')",
    )?;
    for (key, value) in [("model.inertia", INERTIA), ("model.coulomb", COULOMB), ("actuator.gain", GAIN)] {
        page.evaluate(&format!("document.querySelector(\"[data-key='{key}']\").value = '{value}'"))?;
    }
    page.evaluate("document.getElementById('diagnose').click()")?;
    page.wait("progress", "document.getElementById('stage').textContent.includes('%')")?;
    page.wait("a report", "!document.getElementById('found').hidden")?;
    let said = "document.getElementById('report').contentDocument?.querySelector('h1')?.textContent ?? ''";
    page.wait("its sentence", &format!("({said}) !== ''"))?;
    let sentence = page.text(said)?;
    check("what the rig lacks", sentence.contains("friction that grows with speed"), &sentence)?;
    check("the folder has it", scratch.join("imported/report/report.html").is_file(), &out)?;
    page.resize(500, 900, true)?;
    let over = page.number("document.documentElement.scrollWidth - window.innerWidth")?;
    check("nothing beside the screen of a phone", over <= 0.0, over)?;
    page.photograph(&scratch.join("report.png"))?;
    let refused = page.text("document.getElementById('banner').textContent")?;
    check("no error at the end", refused.is_empty(), refused)
}
