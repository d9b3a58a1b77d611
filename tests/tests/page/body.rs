//! A body in three dimensions in the page: the site, the point of entry, the direction and the
//! limb's turn are chosen there, the device gets the layers of that line, and the probe is dragged
//! over the skin.

use serde_json::Value;
use tests::browser::{Chromium, Error, Page, Places, Program, check};

const DRAWN: &str = "__body.frames > 5 && document.getElementById('body-note').textContent === ''";

#[test]
fn a_body_is_entered_where_and_how_one_likes() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-body")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start_with(&places.program, &["run", "--port", "0", "--profile", "forearm"])?;
    let mut page = Page::open(&browser, &program.url, 1_440, 900, false)?;
    page.wait("live data", "document.body.dataset.link === 'live' && !isNaN(__stats.firstFrameMs)")?;
    page.click("view-body")?;
    page.wait("the forearm", &format!("{DRAWN} && {}", meets("vein")))?;
    page.photograph(&scratch.join("forearm.png"))?;
    for (site, structure) in [("knee", "quadriceps"), ("hip", "gluteus"), ("shoulder", "rotator cuff")] {
        choose(&mut page, site)?;
        page.wait(site, &format!("{DRAWN} && __body.entry?.name === '{site}' && {}", meets(structure)))?;
        page.wait("the needle in it", "__stats.depthMm > 10")?;
        page.photograph(&scratch.join(format!("{site}.png")))?;
    }
    entry_and_turn(&mut page)?;
    by_pointer(&mut page)?;
    page.click("view-section")?;
    page.wait("the section", "document.getElementById('section').clientHeight > 100")?;
    page.photograph(&scratch.join("section.png"))?;
    let complaints = page.complaints()?;
    check("no errors in the console", complaints.is_empty(), &complaints)
}

/// The list of what the device's layers are has this structure.
fn meets(structure: &str) -> String {
    format!("__body.structures?.includes('{structure}')")
}

fn choose(page: &mut Page, site: &str) -> Result<Value, Error> {
    page.evaluate(&format!(
        "{{ const s = document.getElementById('site'); s.value = '{site}'; s.dispatchEvent(new Event('change')); __body.frames = 0; }}"
    ))
}

fn slide(page: &mut Page, id: &str, value: i32) -> Result<Value, Error> {
    page.evaluate(&format!(
        "{{ const s = document.getElementById('{id}'); s.value = {value}; s.dispatchEvent(new Event('input')); }}"
    ))
}

/// A person's needle is drawn out, enters over the shoulder's vein, which it then meets, and the
/// skin of the picture slopes as the limb turns.
fn entry_and_turn(page: &mut Page) -> Result<(), Error> {
    slide(page, "needle-depth", 6)?;
    page.wait("a person's needle inside", "__stats.depthMm > 2")?;
    let level = page.number("__body.skinBesideMm")?;
    for (id, value) in [("place-along", 30), ("place-around", 39), ("place-azimuth", 0), ("place-turn", -39)]
    {
        slide(page, id, value)?;
    }
    slide(page, "angle", 85)?;
    page.wait(
        "the needle drawn out and the vein on its line",
        &format!("__stats.depthMm < 0 && {}", meets("vein")),
    )?;
    slide(page, "place-turn", -15)?;
    page.wait("the limb turned", "__body.entry.turn_deg === -15")?;
    let turned = page.number("__body.skinBesideMm")?;
    check("the drawn skin slopes with the limb", (turned - level).abs() > 2.0, (level, turned))?;
    // Along the sky: refused with its reason, and the line that counts stays.
    slide(page, "place-turn", 80)?;
    page.wait("a reason", "document.getElementById('place-note').textContent.includes('turn the limb')")?;
    page.wait("the slider back", "document.getElementById('place-turn').value === '-15'")
}

/// A click on the skin enters there, and the probe follows a pointer that takes it.
fn by_pointer(page: &mut Page) -> Result<(), Error> {
    slide(page, "place-turn", -39)?;
    page.wait("the limb back", "__body.entry.turn_deg === -39")?;
    let find = |page: &mut Page, wanted: &str| -> Result<(f64, f64), Error> {
        let script = format!(
            "(() => {{ const box = document.getElementById('limb').getBoundingClientRect();
                for (let y = box.top + 4; y < box.bottom; y += 4) for (let x = box.left + 4; x < box.right; x += 4) {{
                    const at = __body.sight(x, y); if (at && ({wanted})) return [x, y]; }} return null; }})()"
        );
        let found = page.evaluate(&script)?;
        let number = |index: usize| found[index].as_f64();
        number(0).zip(number(1)).ok_or_else(|| format!("no skin with {wanted}"))
    };
    let probe =
        find(page, "Math.hypot(at.place[0] - __body.probe.along, at.place[1] - __body.probe.across) < 3")?;
    let away = find(
        page,
        "Math.abs(Math.hypot(at.place[0] - __body.probe.along, at.place[1] - __body.probe.across) - 8) < 1.5",
    )?;
    let [along, across] = [0, 1].map(|index| format!("__body.sight({}, {}).place[{index}]", away.0, away.1));
    let (along, across) = (page.number(&along)?, page.number(&across)?);
    page.mouse("mousePressed", probe)?;
    page.mouse("mouseMoved", away)?;
    page.mouse("mouseReleased", away)?;
    page.wait(
        "the probe there",
        &format!("Math.hypot(__body.probe.along - {along}, __body.probe.across - {across}) < 3"),
    )?;
    let entry = find(page, "at.place[0] < -12 && Math.abs(at.place[1]) > 6")?;
    let wanted = page.number(&format!("__body.sight({}, {}).along", entry.0, entry.1))?;
    page.mouse("mousePressed", entry)?;
    page.mouse("mouseReleased", entry)?;
    page.wait("the entry where one clicked", &format!("Math.abs(__body.entry.along_mm - {wanted}) < 2"))
}
