//! The limb in a headset, with Meta's emulation of one (`iwer`): two eyes see it, the head moves,
//! the needle is the device's. What only a real headset shows, such as its pictures a second and
//! how it feels, is not tested here.

use serde_json::{Value, json};
use tests::browser::{Chromium, Error, Page, Places, Program, check};

/// A headset that does not move, its eyes 64 mm apart.
const EMULATE: &str = "{
    window.emulated = new IWER.XRDevice(IWER.metaQuest3, { stereoEnabled: true, ipd: 0.064 });
    emulated.installRuntime({ forceInstall: true });
    emulated.position.set(0, 1.6, 0);
}";
const BUTTON: &str = "document.getElementById('headset')";
/// The entry's place in each eye's picture, −1 to 1 from left to right and from bottom to top, and
/// the eye's in mm.
const SEEN: &str = "__body.headset.eyes.map(({ view, eye, target }) => ({
    across: view[12] / view[15], up: view[13] / view[15], eye: [...eye], viewport: [...target.viewport],
}))";
/// Counts the tones that the next picture has in each eye's part.
const COUNT_TONES: &str = "{
    const { renderer } = __body.headset.limb;
    renderer.end = () => {
        const { gl } = renderer;
        const [x, y, width, height] = gl.getParameter(gl.VIEWPORT);
        const pixels = new Uint8Array(4 * width * height);
        gl.readPixels(x, y, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
        const tones = new Set();
        for (let i = 0; i < pixels.length; i += 4) tones.add(pixels[i] * 65536 + pixels[i + 1] * 256 + pixels[i + 2]);
        (window.tones ??= {})[x] = tones.size;
    };
}";

#[test]
fn a_headset_shows_the_limb_to_both_eyes() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-headset")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    without_one(&mut Page::open_lively(&browser, &format!("{}#body", program.url), 1_440, 900, false)?)?;
    let mut page = Page::open_lively(&browser, &program.url, 1_440, 900, false)?;
    page.wait("a needle", "__stats.depthMm > -100")?;
    let file = places.target.join("node/node_modules/iwer/build/iwer.min.js");
    let emulation = std::fs::read_to_string(&file).map_err(|cause| {
        format!("{} is missing ({cause}): run `cargo xtask test browser`", file.display())
    })?;
    page.evaluate(&format!("{{ {emulation} }}"))?;
    page.evaluate(EMULATE)?;
    page.click("view-body")?;
    page.wait("the button", &format!("!{BUTTON}.hidden && __body.frames > 5"))?;
    page.photograph(&scratch.join("button.png"))?;
    page.evaluate(&format!("{BUTTON}.click()"))?;
    page.wait("pictures in the headset", "__body.headset.frames > 5")?;
    page.evaluate(COUNT_TONES)?;
    both_eyes(&mut page)?;
    page.photograph(&scratch.join("headset.png"))?;
    needle_goes_on(&mut page)?;
    page.evaluate(&format!("{BUTTON}.click()"))?;
    page.wait("the page again", &format!("!__body.headset.session && {BUTTON}.textContent === 'Headset'"))?;
    page.evaluate("window.before = __body.frames")?;
    page.wait("the page's own pictures", "__body.frames > before + 5")
}

/// Tests that nothing is offered if the browser has no headset.
fn without_one(page: &mut Page) -> Result<(), Error> {
    page.wait("the limb", "__body.frames > 5")?;
    let hidden = page.evaluate(&format!("{BUTTON}.hidden"))?;
    check("no button without a headset", hidden == json!(true), hidden)
}

fn eyes(page: &mut Page) -> Result<Vec<Value>, Error> {
    let seen = page.evaluate(SEEN)?;
    seen.as_array().cloned().ok_or_else(|| format!("no eyes: {seen}"))
}

/// Each eye has its half, sees the entry from its own side, and sees more than a sky; the head's
/// way is the eyes'.
fn both_eyes(page: &mut Page) -> Result<(), Error> {
    let before = eyes(page)?;
    let [left, right] = before.as_slice() else { return Err(format!("two eyes and not {before:?}")) };
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let (x0, x1) = (number(&left["viewport"][0]), number(&right["viewport"][0]));
    check("each eye has its part of the picture", x0 == 0.0 && x1 >= number(&left["viewport"][2]), &before)?;
    let (a, b) = (number(&left["across"]), number(&right["across"]));
    check(
        "the entry is ahead of both eyes",
        a.abs() < 0.9 && b.abs() < 0.9 && number(&left["up"]).abs() < 0.9,
        &before,
    )?;
    check("the left eye sees it further to the right", a > b, &before)?;
    // The limb is four times as large as it is: 64 mm between the eyes are 16 of its own.
    let apart = number(&right["eye"][0]) - number(&left["eye"][0]);
    check("the eyes are as far apart as they are", (apart - 16.0).abs() < 0.5, apart)?;
    page.wait("a picture in each eye", "Object.keys(window.tones ?? {}).length === 2")?;
    let tones = page.evaluate("Object.values(tones)")?;
    let is_drawn = tones.as_array().is_some_and(|all| all.iter().all(|one| number(one) > 50.0));
    check("a limb in each eye", is_drawn, tones)?;
    page.evaluate("emulated.position.x += 0.1, window.before = __body.headset.frames")?;
    page.wait("a few pictures", "__body.headset.frames > before + 3")?;
    let after = eyes(page)?;
    let moved = number(&after[0]["eye"][0]) - number(&left["eye"][0]);
    check("the head's 100 mm are 25 of the limb's", (moved - 25.0).abs() < 0.5, moved)
}

/// The needle in the headset is the device's, and the tissue goes on with it.
fn needle_goes_on(page: &mut Page) -> Result<(), Error> {
    page.wait("the needle outside", "__stats.depthMm < 0")?;
    // The page's figure is of its last picture, and here pictures are slow.
    let is_the_devices =
        "__stats.depthMm > 6 && Math.abs(__body.headset.step(0.016)[1].depth - __stats.depthMm) < 0.5";
    page.wait("the device's needle, deep inside", is_the_devices)
}
