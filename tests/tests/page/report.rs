//! The plots of a report: values under the pointer, a stretch that is dragged over shown alone with
//! values and ticks of its own, in the plots over the same quantity too, and the whole again. The
//! curve is a known one, so that the values can be checked.

use std::fmt::Write as _;
use std::process::Command;

use tests::browser::{Chromium, Error, Page, Places, check};

/// The recorded position, rad, over the time, s.
fn position(t: f64) -> f64 {
    3.0 * (1.3 * t).sin()
}

const COUNTS_PER_UNIT: f64 = 636.619_772_4;
const SECONDS: f64 = 10.0;
/// A row that reads 1 rad too much.
const SPIKE_ROW: u32 = 4_503;
/// The first plot, with the place of a part of its width in the window.
const PLOT: &str = "const svg = document.querySelector('svg[data-x]'); svg.scrollIntoView({ block: 'center' }); \
                    const box = svg.getBoundingClientRect();";

#[test]
fn a_stretch_of_a_plot_is_shown_alone_with_its_values() {
    if let Err(error) = visit() {
        panic!("{error}");
    }
}

fn visit() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-report")?;
    let mut csv = String::from("time_s,command,position_counts\n");
    for row in 0..(SECONDS * 1e3) as u32 {
        let t = f64::from(row) * 1e-3;
        let spike = if row == SPIKE_ROW { 1.0 } else { 0.0 };
        let _ = writeln!(csv, "{t:.4},0,{:.0}", (position(t) + spike) * COUNTS_PER_UNIT);
    }
    let recording = scratch.join("recording.csv");
    std::fs::write(&recording, csv).map_err(|error| error.to_string())?;
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/hidden.toml");
    let mut program = Command::new(&places.program);
    program
        .args(["--quiet", "simulate", "--rig", rig, "--recording"])
        .arg(&recording)
        .arg("--out")
        .arg(&scratch);
    let made = program.output().map_err(|error| error.to_string())?;
    check("a page of the simulation", made.status.success(), String::from_utf8_lossy(&made.stderr))?;

    let browser = Chromium::start(&scratch)?;
    let url = format!("file://{}", scratch.join("simulation.html").display());
    let mut page = Page::open(&browser, &url, 1_440, 900, false)?;
    page.wait("a plot", "document.querySelector('svg[data-x] + output') !== null")?;
    check("the readout of the whole", reads(&mut page, 0.5)?, said(&mut page)?)?;
    let whole = labels(&mut page)?;
    let (from, to) = (place(&mut page, 0.4)?, place(&mut page, 0.5)?);
    page.mouse("mousePressed", from)?;
    page.mouse("mouseMoved", to)?;
    page.mouse("mouseReleased", to)?;
    let zoomed = labels(&mut page)?;
    check("other ticks for the stretch", zoomed != whole && !zoomed.is_empty(), &zoomed)?;
    // A tenth of the width, of which the plot is nine tenths.
    for part in [0.3, 0.5, 0.8] {
        check("the readout of the stretch", reads(&mut page, part)?, said(&mut page)?)?;
    }
    let (first, second) = (labels_of(&mut page, 0)?, labels_of(&mut page, 1)?);
    check("the plot below shows the same stretch", first == second, format!("{first}; {second}"))?;
    let both = page.text("[...document.querySelectorAll('output')].slice(0, 2).map((one) => one.textContent.split(' · ')[0]).join('; ')")?;
    let times: Vec<&str> = both.split("; ").collect();
    check("the plot below points at the same time", times.len() == 2 && times[0] == times[1], &both)?;
    // A row is 0.054 of the drawing's units wide; recorded is the last curve.
    let seen = page.number(
        "(() => { const all = document.querySelector('svg[data-x]').querySelectorAll('path[data-name]'); \
         const ys = [...all].at(-1).getAttribute('d').split(/[ML]/).filter(Boolean).map((part) => Number(part.split(' ')[1])); \
         return ys.filter((y, i) => i > 0 && i < ys.length - 1 && Math.abs(2 * y - ys[i - 1] - ys[i + 1]) > 15).length; })()",
    )?;
    check("one row among ten thousand is in the picture", seen >= 1.0, seen)?;
    page.photograph(&scratch.join("stretch.png"))?;
    page.evaluate(
        "document.querySelector('svg[data-x]').dispatchEvent(new MouseEvent('dblclick', { bubbles: true }))",
    )?;
    let again = labels(&mut page)?;
    check("the whole again", again == whole, again)?;
    let complaints = page.complaints()?;
    check("nothing in the console", complaints.is_empty(), complaints)
}

/// The place in the window at a part of the first plot's width.
fn place(page: &mut Page, part: f64) -> Result<(f64, f64), Error> {
    let x = page.number(&format!("(() => {{ {PLOT} return box.left + {part} * box.width; }})()"))?;
    let y = page.number(&format!("(() => {{ {PLOT} return box.top + 0.5 * box.height; }})()"))?;
    Ok((x, y))
}

fn said(page: &mut Page) -> Result<String, Error> {
    page.text("document.querySelector('svg[data-x] + output').textContent")
}

/// True if the readout under the pointer gives the recorded position at the time that it gives.
fn reads(page: &mut Page, part: f64) -> Result<bool, Error> {
    let at = place(page, part)?;
    page.mouse("mouseMoved", at)?;
    let text = said(page)?;
    let after = |word: &str| -> Option<f64> {
        let rest = text.split(word).nth(1)?;
        rest.split_whitespace().next()?.replace('−', "-").parse().ok()
    };
    let (Some(time), Some(recorded)) = (after("time "), after("recorded ")) else { return Ok(false) };
    Ok((recorded - position(time)).abs() < 0.1)
}

fn labels(page: &mut Page) -> Result<String, Error> {
    labels_of(page, 0)
}

/// Labels of the ticks along a plot that are shown.
fn labels_of(page: &mut Page, plot: usize) -> Result<String, Error> {
    page.text(&format!(
        "[...document.querySelectorAll('svg[data-x]')[{plot}].querySelectorAll('text:not([text-anchor=end])')]\
         .filter((text) => text.style.display !== 'none').map((text) => text.textContent).join(' ')"
    ))
}
