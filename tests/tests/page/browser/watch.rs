//! The page while nobody touches it: what it shows, and at which rate.

use super::row;
use serde_json::Value;
use std::time::{Duration, Instant};
use tests::browser::{Chromium, Error, Page, check, loop_time};

/// Pictures a second that the page has to reach, on a machine that can.
const FEWEST_FPS: f64 = 50.0;
/// Seconds in which it may reach them: a headless browser draws without a graphics processor, and
/// what else runs shares its processor. A page that is too slow in itself does not reach them in
/// any.
const FPS_WINDOWS: usize = 20;
/// Loops of [`loop_time`] that a second of the page takes of the processor, at most, on a machine
/// that reaches fewer pictures: what a page of 50 pictures a second may take, so that one that is
/// too slow in itself takes more. Measured: 85 with 54 pictures a second, 97 with 14 while nine
/// other programs wanted the two cores.
const MOST_LOOPS_A_SECOND: f64 = 125.0;

/// The needle moves, both punctures are listed, the plots change, and all of it at the rate of the
/// screen.
pub(super) fn watch(page: &mut Page, browser: &Chromium) -> Result<Vec<Value>, Error> {
    page.wait("live data", "document.body.dataset.link === 'live' && !isNaN(__stats.firstFrameMs)")?;
    let first_frame_s = page.number("__stats.firstFrameMs")? / 1000.0;
    let megabytes = page.transferred_bytes()? / 1e6;
    page.wait(
        "a recording shown",
        "document.getElementById('recording').textContent.includes('watched.mcap')",
    )?;

    let pixels = "(id => { const c = document.getElementById(id); let hash = 7; \
         for (const v of c.getContext('2d').getImageData(0, 0, c.width, c.height).data) hash = (hash * 31 + v) | 0; \
         return hash; })";
    let before: Vec<f64> = ["section", "time-plot", "phase-plot"]
        .iter()
        .map(|id| page.number(&format!("{pixels}('{id}')")))
        .collect::<Result<_, _>>()?;
    page.wait("the needle outside", "__stats.depthMm < -3")?;
    page.wait("the needle deep", "__stats.depthMm > 6")?;
    for (id, before) in ["section", "time-plot", "phase-plot"].iter().zip(before) {
        check("another picture", page.number(&format!("{pixels}('{id}')"))? != before, id)?;
    }
    for layer in ["Skin", "Vessel"] {
        page.wait(
            &format!("puncture of the {layer} with its depth and force"),
            &format!(
                "[...document.querySelectorAll('#events [data-kind=puncture] span')].some(e => \
                 /^{layer} punctured at \\d+\\.\\d\\smm, \\d\\.\\d\\d\\sN$/.test(e.textContent))"
            ),
        )?;
    }
    page.wait("the vessel entered", "document.querySelector('#events [data-kind=vessel]') !== null")?;
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
        row("page_loops_per_second", rate.loops_per_second, "1/s", "lower"),
    ])
}

struct PictureRate {
    /// The best second's.
    fps: f64,
    /// Processor time of a second over that of a fixed loop on the same machine.
    loops_per_second: f64,
}

/// The rate of the screen; where a slow machine does not reach it, the page may not take more of
/// the processor than one that does.
fn picture_rate(page: &mut Page, browser: &Chromium) -> Result<PictureRate, Error> {
    let loop_s = loop_time().as_secs_f64();
    let mut rates = Vec::new();
    let (begin_s, begin) = (browser.processor_s()?, Instant::now());
    while rates.len() < FPS_WINDOWS && rates.iter().all(|fps| *fps < FEWEST_FPS) {
        std::thread::sleep(Duration::from_millis(1_100));
        rates.push(page.number("__stats.fps")?);
    }
    let loops_per_second = (browser.processor_s()? - begin_s) / begin.elapsed().as_secs_f64() / loop_s;
    let fps = rates.iter().copied().fold(0.0, f64::max);
    let holds = fps >= FEWEST_FPS || loops_per_second <= MOST_LOOPS_A_SECOND;
    check(
        &format!(
            "{FEWEST_FPS} pictures a second, or at most {MOST_LOOPS_A_SECOND} loops of {loop_s:.4} s in one"
        ),
        holds,
        (&rates, loops_per_second),
    )?;
    Ok(PictureRate { fps, loops_per_second })
}
