//! Stop, Start, Demo, zero and the angle, as a person uses them.

use std::path::Path;
use std::time::Duration;
use tests::browser::{Error, Page, check};

/// The tip stays within a fifth of a millimetre, as far as the hand trembles, for half a second.
const AT_REST: &str = "(() => { const now = performance.now(), mm = __stats.depthMm, rest = (window.__rest ??= { mm, since: now }); \
     if (Math.abs(mm - rest.mm) > 0.2) { window.__rest = { mm, since: now }; return false; } \
     return now - rest.since > 500; })()";

/// The stop takes the torque off, by button and by keys; Start brings it back; Demo gives the
/// needle back.
pub(super) fn stop(page: &mut Page) -> Result<(), Error> {
    let stopped =
        "document.getElementById('state').textContent === 'Stopped, torque off' && __stats.motorN === 0";
    let running = "document.getElementById('state').textContent.startsWith('Running')";
    page.click("stop")?;
    page.wait("a stop by the button", stopped)?;
    for (key, code, number) in [("Escape", "Escape", 27), (" ", "Space", 32)] {
        page.click("start")?;
        page.wait("a start", running)?;
        page.press(key, code, number)?;
        page.wait(&format!("a stop by the key {code}"), stopped)?;
    }
    page.wait("the stop in the list", "document.querySelector('#events [data-kind=stopped]') !== null")?;
    page.click("start")?;
    page.wait("a start", running)?;
    page.click("demo")?;
    page.wait("the demo", "document.getElementById('hand-note').textContent.startsWith('Demo')")?;
    page.wait("the scripted hand", "__stats.depthMm > 6")?;
    // Arrow keys take the needle from the script, too, and hold it.
    page.evaluate("document.getElementById('section').focus()")?;
    for _ in 0..5 {
        page.press("ArrowLeft", "ArrowLeft", 37)?;
    }
    page.wait("the needle taken", "document.getElementById('hand-note').textContent.startsWith('You hold')")?;
    std::thread::sleep(Duration::from_millis(2_500));
    let held = page.number("__stats.depthMm")?;
    let wanted = page.number("Number(document.getElementById('section').getAttribute('aria-valuenow'))")?;
    check("the needle where the keys put it", (held - wanted).abs() < 0.4, (held, wanted))?;
    page.click("demo")
}

/// The zero waits for torque off and then makes the tip's place depth 0; the slider turns the
/// simulated needle.
pub(super) fn zero_and_turn(page: &mut Page) -> Result<(), Error> {
    let locked = "document.getElementById('zero').disabled";
    page.wait("no zero while torque is on", locked)?;
    page.click("stop")?;
    page.wait("a zero to be had", &format!("!{locked}"))?;
    page.wait("the needle at rest, not at 0", &format!("__stats.depthMm < -3 && {AT_REST}"))?;
    page.click("zero")?;
    page.wait("the tip at depth 0", "Math.abs(__stats.depthMm) < 0.3")?;
    page.evaluate("document.getElementById('angle').focus()")?;
    for _ in 0..3 {
        page.press("ArrowRight", "ArrowRight", 39)?;
    }
    page.wait("the needle turned", "document.getElementById('tilt').textContent === '33'")?;
    page.click("start")?;
    page.wait("both walls from the new zero", "__stats.depthMm > 6")
}

/// The needle turns; steeper, the same way along the needle goes through the far wall, and is
/// reported as that.
pub(super) fn turn_and_go_through(page: &mut Page, scratch: &Path) -> Result<(), Error> {
    let turn = |degrees: u32| {
        format!(
            "(() => {{ const angle = document.getElementById('angle'); angle.value = '{degrees}'; \
             angle.dispatchEvent(new Event('input')); }})()"
        )
    };
    let drawn = |degrees: f64| {
        format!("__stats.depthMm < -3 && Math.abs(__stats.drawn.angle - {}) < 0.004", degrees.to_radians())
    };
    page.evaluate(&turn(30))?;
    page.wait("the needle outside at 30°", &drawn(30.0))?;
    page.evaluate(&turn(60))?;
    page.wait("the needle outside at 60°", &drawn(60.0))?;
    page.wait("blood in the hub", "__stats.vessel === 'in_lumen' && __stats.flashback")?;
    page.wait("a needle through the far wall", "__stats.vessel === 'through'")?;
    page.photograph(&scratch.join("through.png"))?;
    page.wait(
        "a through-puncture reported as one",
        "document.querySelector('#events [data-kind=far_wall]')?.textContent.includes('far wall')",
    )?;
    page.evaluate(&turn(30))?;
    page.wait("the needle outside at 30°", &drawn(30.0))
}
