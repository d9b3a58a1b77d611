//! The files of `host-sim/page/js`, inside the program: the page needs no disk and no network.

/// A file as it is served.
pub(super) struct Asset {
    pub(super) path: &'static str,
    pub(super) content_type: &'static str,
    pub(super) body: &'static [u8],
}

const PAGE: &str = "text/html; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";

macro_rules! asset {
    ($path:literal, $file:literal, $content_type:expr) => {
        Asset {
            path: $path,
            content_type: $content_type,
            body: include_bytes!(concat!("../../../page/js/", $file)),
        }
    };
}

/// The page of one device.
pub(super) const DEVICE_PAGE: Asset = asset!("/", "index.html", PAGE);
/// The page of a class.
pub(super) const CLASS_PAGE: Asset = asset!("/", "class.html", PAGE);
/// The page of a guide.
pub(super) const GUIDE_PAGE: Asset = asset!("/", "guide.html", PAGE);
/// The page to drop a log on.
pub(super) const IMPORT_PAGE: Asset = asset!("/", "import.html", PAGE);

/// The files of the pages.
pub(super) const ASSETS: &[Asset] = &[
    asset!("/style.css", "style.css", "text/css; charset=utf-8"),
    asset!("/practice.css", "practice.css", "text/css; charset=utf-8"),
    asset!("/patient.css", "patient.css", "text/css; charset=utf-8"),
    asset!("/class.css", "class.css", "text/css; charset=utf-8"),
    asset!("/class.js", "class.js", SCRIPT),
    asset!("/guide.css", "guide.css", "text/css; charset=utf-8"),
    asset!("/guide.js", "guide.js", SCRIPT),
    asset!("/guide_steps.js", "guide_steps.js", SCRIPT),
    asset!("/import.css", "import.css", "text/css; charset=utf-8"),
    asset!("/import.js", "import.js", SCRIPT),
    asset!("/icon.svg", "icon.svg", "image/svg+xml"),
    asset!("/main.js", "main.js", SCRIPT),
    asset!("/language.js", "language.js", SCRIPT),
    asset!("/strings/en.js", "strings/en.js", SCRIPT),
    asset!("/strings/de.js", "strings/de.js", SCRIPT),
    asset!("/strings/fr.js", "strings/fr.js", SCRIPT),
    asset!("/link.js", "link.js", SCRIPT),
    asset!("/canvas.js", "canvas.js", SCRIPT),
    asset!("/panel.js", "panel.js", SCRIPT),
    asset!("/section.js", "section.js", SCRIPT),
    asset!("/needle.js", "needle.js", SCRIPT),
    asset!("/inset.js", "inset.js", SCRIPT),
    asset!("/tissue.js", "tissue.js", SCRIPT),
    asset!("/session_sheet.js", "session_sheet.js", SCRIPT),
    asset!("/vein.js", "vein.js", SCRIPT),
    asset!("/next_step.js", "next_step.js", SCRIPT),
    asset!("/plots.js", "plots.js", SCRIPT),
    asset!("/trace.js", "trace.js", SCRIPT),
    asset!("/events.js", "events.js", SCRIPT),
    asset!("/hand.js", "hand.js", SCRIPT),
    asset!("/patient.js", "patient.js", SCRIPT),
    asset!("/patient_fields.js", "patient_fields.js", SCRIPT),
    asset!("/patient_picture.js", "patient_picture.js", SCRIPT),
    asset!("/patient_sliders.js", "patient_sliders.js", SCRIPT),
    asset!("/place.js", "place.js", SCRIPT),
    asset!("/practice.js", "practice.js", SCRIPT),
    asset!("/tasks.js", "tasks.js", SCRIPT),
    asset!("/learning_curve.js", "learning_curve.js", SCRIPT),
    asset!("/compensation_slider.js", "compensation_slider.js", SCRIPT),
    asset!("/scrub.js", "scrub.js", SCRIPT),
    asset!("/slider.js", "slider.js", SCRIPT),
    asset!("/body.js", "body.js", SCRIPT),
    asset!("/bytes.js", "bytes.js", SCRIPT),
    asset!("/headset.js", "headset.js", SCRIPT),
    asset!("/picture.js", "picture.js", SCRIPT),
    asset!("/limb_shapes.js", "limb_shapes.js", SCRIPT),
    asset!("/limb_webgl.js", "limb_webgl.js", SCRIPT),
    asset!("/limb_webgpu.js", "limb_webgpu.js", SCRIPT),
    asset!("/tissue3d.js", "tissue3d.js", SCRIPT),
    asset!("/ultrasound.js", "ultrasound.js", SCRIPT),
    // A build product: `cargo xtask wasm`.
    asset!("/picture.wasm", "picture.wasm", "application/wasm"),
];
