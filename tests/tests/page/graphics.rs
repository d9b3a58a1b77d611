//! The limb by WebGPU, which most browsers have and headless ones only on request: it is the same
//! picture as by WebGL 2, and where the graphics processor is lost the page goes on with WebGL 2.

use serde_json::Value;
use tests::browser::{Chromium, Error, Page, Places, Program};

const COMPARE: &str = include_str!("graphics.js");
/// Keeps the page's device where this test finds it.
const KEEP_DEVICE: &str = "{
    const ask = GPUAdapter.prototype.requestDevice;
    GPUAdapter.prototype.requestDevice = async function () { return (window.device = await ask.apply(this)); };
}";

#[test]
fn webgpu_draws_what_webgl_draws_and_its_loss_is_survived() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-graphics")?;
    let browser = Chromium::start_with_webgpu(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = Page::open(&browser, &format!("{}?graphics=webgpu", program.url), 1_440, 900, false)?;
    page.wait("a needle", "__stats.depthMm > -100")?;
    same_picture(&page.evaluate(COMPARE)?)?;
    page.evaluate(KEEP_DEVICE)?;
    page.click("view-body")?;
    page.wait("WebGPU in the page", "__body.graphics === 'webgpu' && __body.frames > 5")?;
    page.evaluate("window.before = __body.frames, device.destroy()")?;
    let on = "__body.graphics === 'webgl2' && __body.frames > before + 20";
    page.wait("WebGL instead", on)?;
    page.photograph(&scratch.join("after-loss.png"))?;
    let note = page.text("document.getElementById('body-note').textContent")?;
    if note.is_empty() { Ok(()) } else { Err(format!("the page says: {note}")) }
}

/// Edges are smoothed otherwise, nothing else.
fn same_picture(compared: &Value) -> Result<(), Error> {
    let number = |name: &str| compared[name].as_f64().ok_or_else(|| format!("no comparison: {compared}"));
    let (mean, unlike, tones) = (number("mean")?, number("unlike")?, number("tones")?);
    println!("mean difference {mean:.2} of 255, {:.2} % of the pixels unlike, {tones} tones", 100.0 * unlike);
    if tones < 50.0 {
        return Err(format!("WebGPU drew {tones} tones, no limb"));
    }
    if mean > 1.0 || unlike > 0.01 {
        return Err(format!("mean difference {mean} of 255, {unlike} of the pixels unlike"));
    }
    Ok(())
}
