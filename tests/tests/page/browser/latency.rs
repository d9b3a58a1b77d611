//! The time from a person's hand to the picture of the force that answers it.

use super::{TILT_RAD, row};
use serde_json::Value;
use std::time::Duration;
use tests::browser::{Error, Page};

/// Steps of the hand that are timed: enough for a median.
const LATENCY_STEPS: usize = 30;
/// As many as a 99th percentile needs; `cargo xtask bench` asks for them by [`tests::BENCH`].
const LATENCY_STEPS_OF_A_BENCH: usize = 100;

/// Time from the event of the mouse in the page to the first picture in which the force has
/// answered, by a tenth of the step or more. The way there and back: page, WebSocket, session,
/// link, control core and plant, and back.
pub(super) fn latency(page: &mut Page) -> Result<Vec<Value>, Error> {
    page.evaluate(
        "(() => { \
           const state = window.__latency = { start: null, from: 0, times: [] }; \
           document.getElementById('section').addEventListener('pointermove', event => { \
             if (event.movementX <= 0 || state.start !== null) return; \
             state.start = event.timeStamp; state.from = __stats.forceN; }); \
           const look = () => { \
             if (state.start !== null && __stats.forceN > state.from + 0.05) { \
               state.times.push(performance.now() - state.start); state.start = null; } \
             requestAnimationFrame(look); }; \
           requestAnimationFrame(look); })()",
    )?;
    let mut near = page.middle("section")?;
    page.mouse("mousePressed", near)?;
    // Back to where the skin is hardly pressed, then steps of 2 mm to and fro: the skin gives way
    // at 3 mm.
    for _ in 0..200 {
        if page.number("__stats.depthMm")? <= 0.5 {
            break;
        }
        near = (near.0 - 3.0 * TILT_RAD.cos(), near.1 - 3.0 * TILT_RAD.sin());
        page.mouse("mouseMoved", near)?;
        std::thread::sleep(Duration::from_millis(15));
    }
    let step_px = 2.0 * page.number("__stats.drawn.scale")?;
    let deep = (near.0 + step_px * TILT_RAD.cos(), near.1 + step_px * TILT_RAD.sin());
    let is_bench = std::env::var_os(tests::BENCH).is_some();
    for step in 0..if is_bench { LATENCY_STEPS_OF_A_BENCH } else { LATENCY_STEPS } {
        // Not in step with the screen.
        page.wait("the needle drawn back", "__stats.depthMm < 0.9")?;
        std::thread::sleep(Duration::from_millis(150 + (step as u64 * 7) % 17));
        page.mouse("mouseMoved", deep)?;
        page.wait("the force to answer", &format!("__latency.times.length > {step}"))?;
        std::thread::sleep(Duration::from_millis(30));
        page.mouse("mouseMoved", near)?;
    }
    page.mouse("mouseReleased", near)?;
    let answer = page.evaluate("__latency.times")?;
    let mut times: Vec<f64> = answer.as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    times.sort_by(f64::total_cmp);
    let rank = |share: f64| times[((times.len() as f64 * share).ceil() as usize).clamp(1, times.len()) - 1];
    let mut rows = vec![row("hand_to_page_p50_ms", rank(0.50), "ms", "lower")];
    if is_bench {
        rows.push(row("hand_to_page_p99_ms", rank(0.99), "ms", "lower"));
    }
    Ok(rows)
}
