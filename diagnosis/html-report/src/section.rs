//! The anatomy in section, true to scale, with the ways that a needle's tip took through it, as
//! SVG.

use super::{decimal, safe};
use std::fmt::Write as _;

const WIDE: f64 = 520.0;
/// Air over the skin, as a share of what is drawn below it.
const AIR: f64 = 0.22;
const LINE: f64 = 20.0;
/// Room for names at the right, as a share of how deep the drawing reaches.
const NAMES_MM: f64 = 0.45;
/// Tallest drawing.
const HIGHEST: f64 = 460.0;

/// A layer: it reaches down to the next.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Its name, which sets its colour.
    pub name: String,
    /// Depth of its upper face, perpendicular to the skin, mm.
    pub top_mm: f64,
    /// From where to where along the skin it reaches, mm, if it ends: beside it is the band above.
    pub reach_mm: Option<[f64; 2]>,
}

/// A vessel that runs along the section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    /// Depth of its near wall, perpendicular to the skin, mm.
    pub near_mm: f64,
    /// From near to far wall, mm.
    pub high_mm: f64,
}

/// A structure of a body, cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// Its name.
    pub name: String,
    /// The tissue that sets its colour.
    pub tissue: String,
    /// A closed line, along the section and below the point of entry, mm.
    pub points_mm: Vec<[f64; 2]>,
}

/// A way of the tip.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Its name in the legend.
    pub name: String,
    /// Its colour: 0 to 5.
    pub colour: u8,
    /// Along the skin and below it, mm.
    pub points: Vec<(f64, f64)>,
    /// Places on it that have a name.
    pub marks: Vec<((f64, f64), String)>,
}

/// A needle, bevel up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Needle {
    /// Its tip, along the skin and below it, mm.
    pub tip_mm: (f64, f64),
    /// Its angle to the skin, rad.
    pub angle_rad: f64,
    /// Length, diameter and ground face of its cannula, mm.
    pub cannula_mm: [f64; 3],
}

/// The drawing of a section.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// Over it.
    pub title: String,
    /// Outermost first.
    pub bands: Vec<Band>,
    /// The vessel, if there is one.
    pub vessel: Option<Tube>,
    /// The structures of a body, each painted over those before it, instead of level layers.
    pub outlines: Vec<Outline>,
    /// The last on top.
    pub ways: Vec<Way>,
    /// The needle, if there is one, as far as the picture reaches.
    pub needle: Option<Needle>,
}

/// The field of view, mm.
struct View {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    scale: f64,
    head: f64,
}

impl View {
    fn x(&self, mm: f64) -> f64 {
        (mm - self.left) * self.scale
    }

    fn y(&self, mm: f64) -> f64 {
        self.head + (mm - self.top) * self.scale
    }
}

impl Section {
    /// The drawing.
    pub fn svg(&self) -> String {
        let view = self.view();
        let total = view.y(view.bottom);
        let mut out =
            format!("<svg viewBox=\"0 0 {WIDE} {total:.1}\" role=img><title>{}</title>", safe(&self.title));
        let _ = write!(out, "<text class=title x=0 y=16>{}</text>", safe(&self.title));
        for (index, way) in self.ways.iter().enumerate() {
            let y = 36.0 + LINE * index as f64;
            let _ = write!(
                out,
                "<path class=\"s s{}\" d=\"M0 {:.1}h24\"/><text x=30 y={y:.1}>{}</text>",
                way.colour,
                y - 5.0,
                safe(&way.name)
            );
        }
        if self.outlines.is_empty() {
            self.draw_tissue(&mut out, &view)
        } else {
            self.draw_body(&mut out, &view)
        }
        if let Some(needle) = &self.needle {
            draw_needle(&mut out, needle, &view);
        }
        for way in &self.ways {
            draw_way(&mut out, way, &view);
        }
        let (x, y) = (8.0, total - 12.0);
        let _ = write!(
            out,
            "<path d=\"M{x} {:.1}v5h{:.1}v-5\" fill=none stroke=\"var(--on-tissue)\" stroke-width=2 /><text x={:.1} y={:.1} style=\"fill:var(--on-tissue)\">5 mm</text></svg>",
            y - 5.0,
            5.0 * view.scale,
            x + 6.0,
            y - 7.0
        );
        out
    }

    fn view(&self) -> View {
        let points = || self.ways.iter().flat_map(|w| w.points.iter());
        let deepest = points().map(|p| p.1).fold(0.0, f64::max);
        let lowest_top = self.bands.iter().map(|b| b.top_mm).fold(0.0, f64::max);
        let vessel = self.vessel.map_or(0.0, |v| v.near_mm + v.high_mm);
        let bottom = 1.15 * deepest.max(lowest_top + 1.0).max(vessel + 1.0);
        let top = -AIR * bottom;
        let (low, high) = points().fold((0.0_f64, 1.0_f64), |(a, b), p| (a.min(p.0), b.max(p.0)));
        let head = 30.0 + LINE * self.ways.len() as f64;
        let scale = (HIGHEST / (bottom - top)).min(WIDE / (1.2 * (high - low) + NAMES_MM * bottom));
        // Names are on the right: the ways keep to the left of them.
        let middle = f64::midpoint(low, high);
        let half = WIDE / scale / 2.0;
        let shift = 0.5 * NAMES_MM * bottom;
        View { left: middle - half + shift, right: middle + half + shift, top, bottom, scale, head }
    }

    fn draw_tissue(&self, out: &mut String, view: &View) {
        let rect_in = |out: &mut String, [left, right]: [f64; 2], from: f64, to: f64, fill: &str| {
            let _ = write!(
                out,
                "<rect x={left:.1} y={:.1} width={:.1} height={:.1} style=\"fill:var(--{fill},var(--other))\"/>",
                view.y(from),
                right - left,
                ((to - from) * view.scale).max(0.0)
            );
        };
        let rect =
            |out: &mut String, from: f64, to: f64, fill: &str| rect_in(out, [0.0, WIDE], from, to, fill);
        let plain = |band: &Band| band.name.chars().filter(char::is_ascii_lowercase).collect::<String>();
        rect(out, view.top, 0.0, "sky");
        for (index, band) in self.bands.iter().enumerate() {
            let end = self.bands.get(index + 1).map_or(view.bottom, |next| next.top_mm);
            let Some(reach_mm) = band.reach_mm else {
                rect(out, band.top_mm, end, &plain(band));
                continue;
            };
            if let Some(above) = index.checked_sub(1).and_then(|above| self.bands.get(above)) {
                rect(out, band.top_mm, end, &plain(above));
            }
            let ends = reach_mm.map(|mm| view.x(mm).clamp(0.0, WIDE));
            rect_in(out, ends, band.top_mm, end, &plain(band));
        }
        if let Some(vessel) = self.vessel {
            rect(out, vessel.near_mm, vessel.near_mm + vessel.high_mm, "lumen");
            for wall in [vessel.near_mm, vessel.near_mm + vessel.high_mm] {
                let y = view.y(wall);
                let _ = write!(
                    out,
                    "<line x1=0 x2={WIDE} y1={y:.1} y2={y:.1} stroke=\"var(--wall)\" stroke-width=3 />"
                );
            }
        }
        let mut free = f64::NEG_INFINITY;
        let vessel = self.vessel.map(|v| ("vessel".to_owned(), v.near_mm));
        let mut names: Vec<(String, f64)> =
            self.bands.iter().map(|b| (b.name.clone(), b.top_mm)).chain(vessel).collect();
        names.sort_by(|a, b| a.1.total_cmp(&b.1));
        for (name, top_mm) in names {
            let y = (view.y(top_mm) + 16.0).max(free + 16.0);
            free = y;
            let _ = write!(
                out,
                "<text x={:.1} y={y:.1} text-anchor=end style=\"fill:var(--on-tissue)\">{}, {} mm</text>",
                WIDE - 6.0,
                safe(&name),
                decimal(top_mm, 1)
            );
        }
        debug_assert!(view.right > view.left);
    }
}

impl Section {
    fn draw_body(&self, out: &mut String, view: &View) {
        let high = (view.bottom - view.top) * view.scale;
        let frame = |fill: &str| format!("x=0 y={:.1} width={WIDE} height={high:.1} {fill}/>", view.head);
        let _ = write!(out, "<clipPath id=frame><rect {}</clipPath>", frame(""));
        let _ = write!(out, "<rect {}", frame("style=\"fill:var(--sky)\""));
        let mut free = f64::NEG_INFINITY;
        let mut names = String::new();
        for outline in &self.outlines {
            let mut line = String::new();
            for (number, [x, y]) in outline.points_mm.iter().enumerate() {
                let pen = if number == 0 { 'M' } else { 'L' };
                let _ = write!(line, "{pen}{:.1} {:.1}", view.x(*x), view.y(*y));
            }
            let fill = if ["vessel", "other"].contains(&outline.tissue.as_str()) {
                "lumen"
            } else {
                &outline.tissue
            };
            let _ = write!(
                out,
                "<path d=\"{line}Z\" clip-path=\"url(#frame)\" style=\"fill:var(--{fill},var(--other));stroke:var(--on-tissue);stroke-width:.5\"/>"
            );
            // At the right, where its highest point in the picture is.
            let is_seen = |[x, y]: &&[f64; 2]| {
                (view.left..view.right).contains(x) && (view.top..view.bottom).contains(y)
            };
            let highest = outline.points_mm.iter().filter(is_seen).map(|[_, y]| view.y(*y)).reduce(f64::min);
            let Some(highest) = highest else { continue };
            let y = (highest + 16.0).max(free + 16.0);
            free = y;
            let _ = write!(
                names,
                "<text x={:.1} y={y:.1} text-anchor=end style=\"fill:var(--on-tissue)\">{}</text>",
                WIDE - 6.0,
                safe(&outline.name)
            );
        }
        out.push_str(&names);
    }
}

fn draw_needle(out: &mut String, needle: &Needle, view: &View) {
    let [length, diameter, bevel] = needle.cannula_mm;
    let (sin, cos) = needle.angle_rad.sin_cos();
    // Not over the words above the picture.
    let length = length.min((needle.tip_mm.1 - view.top - diameter) / sin.max(1e-3)).max(bevel);
    let corners = [(0.0, 0.0), (bevel, diameter), (length, diameter), (length, 0.0)];
    let points = corners.map(|(back, up)| {
        let (x, y) = (needle.tip_mm.0 - back * cos + up * sin, needle.tip_mm.1 - back * sin - up * cos);
        format!("{:.1},{:.1}", view.x(x), view.y(y))
    });
    let _ = write!(
        out,
        "<polygon points=\"{}\" style=\"fill:var(--muted);fill-opacity:.55;stroke:var(--muted)\"/>",
        points.join(" ")
    );
}

fn draw_way(out: &mut String, way: &Way, view: &View) {
    let _ = write!(out, "<path class=\"s s{}\" d=\"", way.colour);
    let mut pen = 'M';
    for (x, y) in way.points.iter().filter(|p| p.0.is_finite() && p.1.is_finite()) {
        let _ = write!(out, "{pen}{:.1} {:.1}", view.x(*x), view.y(*y));
        pen = 'L';
    }
    out.push_str("\"/>");
    for ((x, y), name) in &way.marks {
        let (x, y) = (view.x(*x), view.y(*y));
        let _ = write!(
            out,
            "<circle cx={x:.1} cy={y:.1} r=4 class=\"s s{}\" style=\"fill:var(--page)\"/><text x={:.1} y={:.1} text-anchor=end style=\"fill:var(--on-tissue)\">{}</text>",
            way.colour,
            x - 9.0,
            y + 11.0,
            safe(name)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_drawn_to_scale_both_ways_and_holds_all_ways() {
        let way = Way {
            name: "a".into(),
            colour: 0,
            points: vec![(0.0, 0.0), (8.0, 6.0)],
            marks: vec![((8.0, 6.0), "end".into())],
        };
        let band = |name: &str, top_mm| Band { name: name.into(), top_mm, reach_mm: None };
        let section = Section {
            title: "t".into(),
            bands: vec![band("skin", 0.0), band("fat", 2.0)],
            vessel: Some(Tube { near_mm: 4.8, high_mm: 3.0 }),
            outlines: Vec::new(),
            ways: vec![way],
            needle: Some(Needle { tip_mm: (8.0, 6.0), angle_rad: 0.5, cannula_mm: [25.0, 0.8, 2.1] }),
        };
        let view = section.view();
        // 8 mm along and 6 mm down are as long as each other's scale says.
        assert!(((view.x(8.0) - view.x(0.0)) / 8.0 - (view.y(6.0) - view.y(0.0)) / 6.0).abs() < 1e-9);
        assert!(view.x(0.0) >= 0.0 && view.x(8.0) <= WIDE && view.bottom > 7.8);
        let svg = section.svg();
        // Its tip is where the way ends.
        let tip = format!("<polygon points=\"{:.1},{:.1} ", view.x(8.0), view.y(6.0));
        assert!(svg.contains(&tip), "{svg}");
        assert!(svg.contains("4.8 mm") && svg.contains("var(--lumen") && !svg.contains("NaN"));
        // A bursa from 2 to 5 mm along the skin: muscle is beside it.
        let bursa = Band { reach_mm: Some([2.0, 5.0]), ..band("bursa", 3.0) };
        let bands = vec![band("muscle", 0.0), bursa, band("tendon", 5.0)];
        let ending = Section { bands, ways: section.ways.clone(), ..Section::default() };
        let (view, svg) = (ending.view(), ending.svg());
        let bursa = format!(
            "<rect x={:.1} y={:.1} width={:.1} height={:.1} style=\"fill:var(--bursa",
            view.x(2.0),
            view.y(3.0),
            3.0 * view.scale,
            2.0 * view.scale
        );
        assert!(svg.contains(&bursa) && svg.matches("fill:var(--muscle").count() == 2, "{bursa}: {svg}");
        assert!(Section::default().svg().ends_with("</svg>"), "nothing at all is a drawing too");
    }
}
