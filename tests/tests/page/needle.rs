//! One needle in the hand of a person, by mouse and by finger: a millimetre of the hand is a
//! millimetre of the needle at every depth and size, tip and hub stay in the picture, and the
//! layers are drawn at their depths at any angle.

use serde_json::{Value, json};
use std::path::Path;
use tests::browser::{Chromium, Error, Page, Places, Program, check};

/// A size of the page: width and height in CSS pixels, and true if a finger drags instead of a
/// mouse.
pub(crate) type Size = (u32, u32, bool);
/// Desktop, laptop, phone and a 4K screen.
pub(crate) const SIZES: [Size; 4] =
    [(1_440, 900, false), (1_280, 720, false), (390, 844, true), (3_840, 2_160, false)];
/// Condition that the page shows live data.
pub(crate) const LIVE: &str = "document.body.dataset.link === 'live' && !isNaN(__stats.firstFrameMs)";
/// Stiffness of the hand's grip, in N/mm (`host-sim/procedures/venepuncture.toml`): a force bends
/// it.
const GRIP_N_PER_MM: f64 = 1.0;
/// Largest error of hand and needle, as a share of the depth.
const TRUE_WITHIN: f64 = 0.02;
/// Places behind the adult's far wall, which gives way at about 15.6 mm at 30°, in mm along the
/// needle.
const BEHIND_THE_WALL_MM: [f64; 4] = [16.0, 18.0, 20.0, 22.0];
/// Length of the adult's needle at 30°, in mm: the hub is on the skin.
const LENGTH_MM: f64 = 25.0;
/// Angle in degrees at which the far wall is so far along the needle that a needle of 50 mm is
/// used.
const FLAT_DEG: &str = "14";

#[test]
fn a_mm_of_the_hand_is_a_mm_of_the_needle() {
    if let Err(error) = follow_at_every_size() {
        panic!("{error}");
    }
}

fn follow_at_every_size() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-needle")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    for size in SIZES {
        resize(&mut page, size)?;
        follow(&mut page, size, &BEHIND_THE_WALL_MM, Some(LENGTH_MM))?;
        photographs(&mut page, size, &scratch)?;
    }
    complaints(&mut page)?;
    drop(page);
    drop(program);
    let program = Program::start_with(&places.program, &["run", "--port", "0", "--angle", FLAT_DEG])?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    for size in [SIZES[0], SIZES[2]] {
        resize(&mut page, size)?;
        follow(&mut page, size, &[40.0], None)?;
    }
    complaints(&mut page)
}

#[test]
fn layers_are_at_their_depths_at_any_angle() {
    if let Err(error) = turn() {
        panic!("{error}");
    }
}

/// Opens the page and waits for live data.
pub(crate) fn open(browser: &Chromium, url: &str, (width, height, phone): Size) -> Result<Page, Error> {
    let mut page = Page::open(browser, url, width, height, phone)?;
    page.wait("live data", LIVE)?;
    Ok(page)
}

/// Gives the page another size and waits until the section is drawn in it.
pub(crate) fn resize(page: &mut Page, (width, height, phone): Size) -> Result<(), Error> {
    page.resize(width, height, phone)?;
    let resized = format!("innerWidth === {width} && innerHeight === {height}");
    page.wait("the new size", &resized)?;
    pictures(page, 3)
}

/// Waits for `count` more pictures.
pub(crate) fn pictures(page: &mut Page, count: u32) -> Result<(), Error> {
    page.evaluate("window.__seen = __stats.frames")?;
    page.wait("pictures", &format!("__stats.frames >= __seen + {count}"))
}

/// Fails if the console has errors.
pub(crate) fn complaints(page: &mut Page) -> Result<(), Error> {
    let complaints = page.complaints()?;
    check("no errors in the console", complaints.is_empty(), &complaints)
}

/// Screen coordinates of a point that the section has drawn.
pub(crate) fn drawn(page: &mut Page, what: &str) -> Result<(f64, f64), Error> {
    let rectangle = "document.getElementById('section').getBoundingClientRect()";
    let at = page.evaluate(&format!(
        "[{rectangle}.x + __stats.drawn.{what}.x, {rectangle}.y + __stats.drawn.{what}.y]"
    ))?;
    let part = |i: usize| at[i].as_f64().ok_or_else(|| format!("{what} is drawn nowhere"));
    Ok((part(0)?, part(1)?))
}

/// A pressed mouse or finger on the hub, and what its pixels mean.
pub(crate) struct Grab {
    finger: bool,
    at: (f64, f64),
    /// Depth of the hand when it took the needle, in mm.
    pub(crate) begin_mm: f64,
    scale: f64,
    angle: f64,
}

impl Grab {
    /// Takes the needle at the end of its hub.
    pub(crate) fn take(page: &mut Page, finger: bool) -> Result<Self, Error> {
        page.evaluate("document.getElementById('section').scrollIntoView({ block: 'center' })")?;
        pictures(page, 2)?;
        let at = drawn(page, "hub")?;
        if finger {
            page.touch("touchStart", at)?
        } else {
            page.mouse("mousePressed", at)?
        }
        let held = "document.getElementById('section').dataset.held === 'true'";
        page.wait("the needle taken", held)?;
        pictures(page, 2)?;
        let seen = page.evaluate("[__stats.drawn.scale, __stats.drawn.angle, __stats.handMm]")?;
        let part = |i: usize| seen[i].as_f64().ok_or("the page has no hand");
        Ok(Self { finger, at, scale: part(0)?, angle: part(1)?, begin_mm: part(2)? })
    }

    /// The pixel at which the hand wants the tip at `mm` along the needle.
    fn place(&self, mm: f64) -> (f64, f64) {
        let px = (mm - self.begin_mm) * self.scale;
        (self.at.0 + px * self.angle.cos(), self.at.1 + px * self.angle.sin())
    }

    /// Moves the hand to `mm`; each step is drawn before the next.
    pub(crate) fn move_to(&self, page: &mut Page, mm: f64) -> Result<(), Error> {
        let at = self.place(mm);
        if self.finger {
            page.touch("touchMove", at)?
        } else {
            page.mouse("mouseMoved", at)?
        }
        pictures(page, 1)
    }

    /// Lets go of the needle, with the hand at `mm`.
    pub(crate) fn let_go(&self, page: &mut Page, mm: f64) -> Result<(), Error> {
        let at = self.place(mm);
        if self.finger { page.touch("touchEnd", at) } else { page.mouse("mouseReleased", at) }
    }
}

/// A depth outside at which the scripted hand begins, too, within a millimetre.
pub(crate) const OUTSIDE_MM: f64 = -5.0;

/// Drags the needle in single millimetres to each of `depths`, which lie behind the far wall,
/// beyond its hub, and out again.
fn follow(page: &mut Page, size: Size, depths: &[f64], hub_at: Option<f64>) -> Result<(), Error> {
    page.wait("the needle outside", "__stats.depthMm < -4")?;
    let grab = Grab::take(page, size.2)?;
    let mut wanted = grab.begin_mm.ceil();
    for depth in depths {
        while wanted < *depth {
            grab.move_to(page, wanted)?;
            wanted += 1.0;
        }
        grab.move_to(page, *depth)?;
        needle_is_at(page, *depth, size, &grab)?;
        in_sight(page, size, "held")?;
    }
    if let Some(length) = hub_at {
        grab.move_to(page, 40.0)?;
        needle_is_at(page, length, size, &grab)?;
        grab.move_to(page, depths[0])?;
        needle_is_at(page, depths[0], size, &grab)?;
    }
    let frozen = page.number("__stats.drawn.scale")?;
    check("the scale of the grab to its end", frozen == grab.scale, (size, grab.scale, frozen))?;
    // Not to where it was taken: the script may have gone on a little before.
    grab.move_to(page, OUTSIDE_MM)?;
    page.wait("the needle outside", "__stats.depthMm < -4")?;
    grab.let_go(page, OUTSIDE_MM)
}

/// Waits until hand and needle are at `depth`: the needle lags by what its force bends the grip.
fn needle_is_at(page: &mut Page, depth: f64, size: Size, grab: &Grab) -> Result<(), Error> {
    // A pointer is on whole pixels.
    let allowed = TRUE_WITHIN * depth.abs() + 1.0 / grab.scale;
    let hand = format!("Math.abs(__stats.handMm - {depth}) <= {allowed}");
    let tip = format!("__stats.depthMm + __stats.motorN / {GRIP_N_PER_MM}");
    let needle = format!("Math.abs({tip} - __stats.handMm) <= {TRUE_WITHIN} * __stats.handMm");
    let came = page.wait(&format!("hand and needle at {depth} mm"), &format!("{hand} && {needle}"));
    let seen = page.evaluate(&format!("[__stats.handMm, __stats.depthMm, {tip}]"))?;
    came.map_err(|error| format!("{size:?}: hand, needle, unbent: {seen}; {error}"))
}

/// Fails unless tip, hub and the hub's upper corner are drawn within the canvas.
fn in_sight(page: &mut Page, size: Size, when: &str) -> Result<(), Error> {
    let seen = page.evaluate(
        "(() => { const c = document.getElementById('section'), { tip, hub, hubTop, angle } = __stats.drawn; \
         const inside = p => p.x >= 0 && p.y >= 0 && p.x <= c.clientWidth && p.y <= c.clientHeight; \
         return { ok: inside(tip) && inside(hub) && inside(hubTop), tip, hub, hubTop, angle, width: c.clientWidth, height: c.clientHeight }; })()",
    )?;
    check(&format!("tip and hub in sight, {when}"), seen["ok"] == json!(true), (size, &seen))
}

fn photographs(page: &mut Page, (width, ..): Size, scratch: &Path) -> Result<(), Error> {
    for (dark, name) in [(false, "light"), (true, "dark")] {
        page.dark(dark)?;
        pictures(page, 3)?;
        page.photograph(&scratch.join(format!("{width}-{name}.png")))?;
    }
    page.dark(false)
}

fn turn() -> Result<(), Error> {
    let places = Places::find()?;
    let scratch = places.scratch("page-turned")?;
    let browser = Chromium::start(&scratch)?;
    let program = Program::start(&places.program, 0, None)?;
    let mut page = open(&browser, &program.url, SIZES[0])?;
    for degrees in [90.0_f64, 60.0, 30.0] {
        page.evaluate(&format!(
            "(() => {{ const angle = document.getElementById('angle'); angle.value = '{degrees}'; \
             angle.dispatchEvent(new Event('input')); }})()"
        ))?;
        let turned = format!("Math.abs(__stats.drawn.angle - {}) < 0.004", degrees.to_radians());
        for (when, place) in [("outside", "__stats.depthMm < -4"), ("deep", "__stats.depthMm > 9")] {
            let what = format!("the needle {when} at {degrees}°");
            page.wait(&what, &format!("{turned} && {place}"))?;
            in_sight(&mut page, SIZES[0], when)?;
        }
        page.photograph(&scratch.join(format!("turned-{degrees}.png")))?;
        layers_at_their_depths(&mut page, degrees)?;
    }
    complaints(&mut page)
}

/// The adult's skin, fat, vein and far wall.
fn layers_at_their_depths(page: &mut Page, degrees: f64) -> Result<(), Error> {
    let depths =
        page.evaluate("__stats.drawn.tops.map(y => (y - __stats.drawn.entry.y) / __stats.drawn.scale)")?;
    let depths: Vec<f64> = depths.as_array().into_iter().flatten().filter_map(Value::as_f64).collect();
    let expected = [0.0, 2.0, 4.8, 7.8];
    let holds =
        depths.len() == 4 && depths.iter().zip(expected).all(|(is, wanted)| (is - wanted).abs() < 0.02);
    check("layers at their depths", holds, (degrees, &depths))
}
