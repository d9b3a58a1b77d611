//! The page while nobody touches it: what it shows, and at which rate.

use super::{A_FEW_INSERTIONS, SOON, row};
use serde_json::Value;
use std::time::Duration;
use tests::browser::{Chromium, Error, Page, check, loop_time};

/// Pictures a second that the page has to reach, on a machine that can.
const FEWEST_FPS: f64 = 50.0;
/// Seconds in which it may reach them: a headless browser draws without a graphics processor, and
/// what else runs shares its processor. A page that is too slow in itself does not reach them in
/// any.
const FPS_WINDOWS: usize = 20;
/// Processor time of one picture over that of [`loop_time`], at most, on a machine that reaches
/// fewer. Measured: 1.58 with 54 pictures a second, 1.63 with 17 while four programs ran that do
/// nothing but count.
const MOST_LOOPS_A_PICTURE: f64 = 2.5;

/// The needle moves, both punctures are listed, the plots change, and all of it at the rate of the
/// screen.
pub(super) fn watch(page: &mut Page, browser: &Chromium) -> Result<Vec<Value>, Error> {
    page.wait("live data", SOON, "document.body.dataset.link === 'live' && !isNaN(__stats.firstFrameMs)")?;
    let first_frame_s = page.number("__stats.firstFrameMs")? / 1000.0;
    let megabytes = page.transferred_bytes()? / 1e6;
    page.wait(
        "a recording shown",
        SOON,
        "document.getElementById('recording').textContent.includes('watched.mcap')",
    )?;

    let pixels = "(id => { const c = document.getElementById(id); let hash = 7; \
         for (const v of c.getContext('2d').getImageData(0, 0, c.width, c.height).data) hash = (hash * 31 + v) | 0; \
         return hash; })";
    let before: Vec<f64> = ["section", "time-plot", "phase-plot"]
        .iter()
        .map(|id| page.number(&format!("{pixels}('{id}')")))
        .collect::<Result<_, _>>()?;
    page.wait("the needle outside", A_FEW_INSERTIONS, "__stats.depthMm < -3")?;
    page.wait("the needle deep", A_FEW_INSERTIONS, "__stats.depthMm > 6")?;
    for (id, before) in ["section", "time-plot", "phase-plot"].iter().zip(before) {
        check("another picture", page.number(&format!("{pixels}('{id}')"))? != before, id)?;
    }
    for layer in ["Skin", "Vessel"] {
        page.wait(
            &format!("puncture of the {layer} with its depth and force"),
            A_FEW_INSERTIONS,
            &format!(
                "[...document.querySelectorAll('#events [data-kind=puncture] span')].some(e => \
                 /^{layer} punctured at \\d+\\.\\d\\smm, \\d\\.\\d\\d\\sN$/.test(e.textContent))"
            ),
        )?;
    }
    page.wait("the vessel entered", SOON, "document.querySelector('#events [data-kind=vessel]') !== null")?;
    check(
        "nothing lost",
        page.text("document.getElementById('link').textContent")? == "Link: nothing lost",
        "link",
    )?;

    let rate = picture_rate(page, browser)?;
    check("fresh messages", page.number("__stats.lastMessageAgeMs")? < 500.0, "age")?;
    Ok(vec![
        row("page_first_frame_s", first_frame_s, "s", "lower"),
        row("page_mb", megabytes, "MB", "lower"),
        row("page_fps", rate.fps, "1/s", "higher"),
        row("page_loops_per_picture", rate.loops_per_picture, "loops", "lower"),
    ])
}

struct PictureRate {
    /// The best second's.
    fps: f64,
    /// Processor time of a picture over that of a fixed loop on the same machine.
    loops_per_picture: f64,
}

/// The rate of the screen; where a slow machine does not reach it, a picture may not take more of
/// the processor than on others.
fn picture_rate(page: &mut Page, browser: &Chromium) -> Result<PictureRate, Error> {
    let loop_s = loop_time().as_secs_f64();
    let mut rates = Vec::new();
    let (begin_s, begin) = (browser.processor_s()?, page.number("__stats.frames")?);
    while rates.len() < FPS_WINDOWS && rates.iter().all(|fps| *fps < FEWEST_FPS) {
        std::thread::sleep(Duration::from_millis(1_100));
        rates.push(page.number("__stats.fps")?);
    }
    let pictures = page.number("__stats.frames")? - begin;
    let loops_per_picture = (browser.processor_s()? - begin_s) / pictures / loop_s;
    let fps = rates.iter().copied().fold(0.0, f64::max);
    let holds = fps >= FEWEST_FPS || loops_per_picture <= MOST_LOOPS_A_PICTURE;
    check(
        &format!("{FEWEST_FPS} pictures a second, or one in {MOST_LOOPS_A_PICTURE} loops of {loop_s:.4} s"),
        holds,
        (&rates, loops_per_picture),
    )?;
    Ok(PictureRate { fps, loops_per_picture })
}
