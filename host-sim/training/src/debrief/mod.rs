//! A trainee's insertions on a page to print: the gesture over the anatomy, force against depth,
//! the figures, two attempts compared, and what they say in words. It takes its figures from
//! [`crate::score`] and computes none of its own.

mod figures;

use crate::score::gesture::{Gesture, RATE_HZ};
use crate::score::target::Reached;
use crate::score::{Insertion, Judge, Span, each};
use control_core::TICK_HZ;
use device_sim::error::Error;
use device_sim::profile::Profile;
use device_sim::session::{Scene, SceneNeedle, SceneOutline, SceneVessel, Source};
use html_report::chart::{Chart, Curve};
use html_report::section::{Band, Needle, Outline, Section, Tube, Way};
use html_report::{Sheet, decimal};
use link::frames::EventKind;
use recording::read::Recording;
use std::rc::Rc;

/// One insertion with all that is drawn of it.
#[derive(Clone, Debug)]
pub struct Attempt {
    /// The file, and the number of the insertion in it.
    pub name: String,
    /// Its figures.
    pub figures: Insertion,
    patient: Rc<Profile>,
    gesture: Gesture,
    /// Depth along the needle, mm, and force, N, at [`RATE_HZ`].
    force: Vec<(f64, f64)>,
    /// Walls that gave way: where in the section, mm, and whose they were.
    punctures: Vec<((f64, f64), String)>,
}

/// All insertions of a recording, judged by one profile or each by the one that it was recorded
/// with.
pub fn attempts(recording: &Recording, by: Option<&Profile>) -> Result<Vec<Attempt>, Error> {
    let mut attempts = Vec::new();
    each(recording, by, |span, judge, profile| {
        attempts.push(attempt(recording, profile, judge, attempts.len(), span));
    })?;
    Ok(attempts)
}

fn attempt(
    recording: &Recording,
    profile: &Rc<Profile>,
    judge: &Judge,
    index: usize,
    span: Span<'_>,
) -> Attempt {
    let gesture = judge.gesture(span);
    let hello = &span.stretch.hello;
    let every = (f64::from(TICK_HZ) / RATE_HZ) as usize;
    let force = span.samples().chunks_exact(every).map(|part| {
        let mean = |value: &dyn Fn(&control_core::controller::Sample) -> f64| {
            part.iter().map(value).sum::<f64>() / part.len() as f64
        };
        (mean(&|s| f64::from(s.count) * hello.mm_per_count), mean(&|s| hello.force_n(s.dac)))
    });
    let layers = &profile.config.patient.layers;
    let punctures = span.events().filter_map(|event| match event.kind {
        EventKind::Puncture { layer } => {
            let at = ((event.tick - span.begin) as f64 / f64::from(TICK_HZ) * RATE_HZ) as usize;
            let name = layers.get(usize::from(layer)).map(|l| device_sim::session::tissue_name(l.tissue))?;
            Some((gesture.places.get(at)?.in_section(), name.to_owned()))
        }
        _ => None,
    });
    Attempt {
        name: format!("{}, insertion {}", recording.file, index + 1),
        figures: judge.insertion(span),
        force: force.collect(),
        punctures: punctures.collect(),
        patient: profile.clone(),
        gesture,
    }
}

/// The page in English; none of no attempt. The first and the last are compared, or an expert's
/// best and the last, over the anatomy of the last one's patient.
pub fn html(attempts: &[Attempt], expert: &[Attempt]) -> Option<String> {
    let patient = &attempts.last()?.patient;
    let scene = patient.scene(Source::Virtual, None);
    let model = best(expert).map(|one| Attempt { name: format!("expert: {}", one.name), ..one.clone() });
    let compared: Vec<&Attempt> = match (&model, attempts) {
        (_, []) => Vec::new(),
        (Some(model), [.., last]) => vec![model, last],
        (None, [only]) => vec![only],
        (None, [first, .., last]) => vec![first, last],
    };
    let lead = format!(
        "Patient {}. {} insertion{}{}",
        patient.name,
        attempts.len(),
        if attempts.len() == 1 { "" } else { "s" },
        match (compared.len(), expert.is_empty()) {
            (2, true) => "; the first and the last are compared.",
            (2, false) => "; the last is compared with the expert's best.",
            _ => ".",
        }
    );
    let mut sheet = Sheet::new("Debrief", &lead);
    for one in &compared {
        sheet.paragraph(&format!("{}: {}.", one.name, one.figures.verdict.goal));
        in_words(&one.figures).iter().for_each(|words| sheet.paragraph(words));
    }
    sheet.heading("The gesture and what was felt");
    sheet.figures(&pictures(&compared, &scene));
    sheet.heading("Figures");
    figures::compare(&mut sheet, &compared);
    if attempts.len() > 2 {
        sheet.heading("All insertions");
        figures::list(&mut sheet, attempts);
    }
    sheet.note(
        "Angles are to the skin. Smoothness is the spectral arc length of the tip's speed on the way in: about −1.4 for one smooth \
         movement, more negative for one that stops and starts. Path counts the way in, out and sideways.",
    );
    Some(sheet.finish())
}

/// Returns the quickest attempt that passed, else the quickest.
fn best(attempts: &[Attempt]) -> Option<&Attempt> {
    attempts.iter().min_by(|a, b| {
        let (a, b) = (&a.figures, &b.figures);
        b.verdict.passed.cmp(&a.verdict.passed).then(a.time_s.total_cmp(&b.time_s))
    })
}

/// Layers and vessel of a scene as they are drawn on paper.
pub fn anatomy(scene: &Scene) -> (Vec<Band>, Option<Tube>) {
    let bands = scene.layers.iter().filter(|layer| !layer.is_vessel && !layer.is_far_wall);
    let bands = bands.map(|layer| Band {
        name: layer.name.clone(),
        top_mm: layer.depth_mm,
        reach_mm: layer.reach_mm,
    });
    (bands.collect(), scene.vessel.as_ref().map(tube))
}

/// The structures of the scene's body as they are drawn on paper; none of level layers.
fn outlines(scene: &Scene) -> Vec<Outline> {
    let all = scene.body.iter().flat_map(|body| &body.outlines);
    let drawn = |one: &SceneOutline| Outline {
        name: one.name.clone(),
        tissue: one.tissue.clone(),
        points_mm: one.points_mm.clone(),
    };
    all.map(drawn).collect()
}

/// The needle of the scene where an attempt was deepest.
fn needle(attempt: &Attempt, scene: &Scene) -> Option<Needle> {
    let places = attempt.gesture.places.iter();
    let deepest = places.max_by(|a, b| a.depth_mm.total_cmp(&b.depth_mm))?;
    let SceneNeedle { length_mm, diameter_mm, bevel_mm, .. } = scene.needle;
    Some(Needle {
        tip_mm: deepest.in_section(),
        angle_rad: deepest.angle_rad,
        cannula_mm: [length_mm, diameter_mm, bevel_mm],
    })
}

fn tube(vessel: &SceneVessel) -> Tube {
    Tube { near_mm: vessel.axis_mm - vessel.height_mm / 2.0, high_mm: vessel.height_mm }
}

fn pictures(compared: &[&Attempt], scene: &Scene) -> Vec<(String, String)> {
    let (bands, vessel) = anatomy(scene);
    let colour = |index: usize| (index % 6) as u8;
    let ways = compared.iter().enumerate().map(|(index, one)| Way {
        name: one.name.clone(),
        colour: colour(index),
        points: one.gesture.places.iter().map(|p| p.in_section()).collect(),
        marks: one.punctures.clone(),
    });
    let needle = compared.last().and_then(|one| needle(one, scene));
    let title = "Way of the tip".into();
    let section = Section { title, bands, vessel, outlines: outlines(scene), ways: ways.collect(), needle };
    let curves = |points: &dyn Fn(&Attempt) -> Vec<(f64, f64)>| -> Vec<Curve> {
        let each = compared.iter().enumerate();
        each.map(|(index, one)| Curve {
            name: one.name.clone(),
            colour: colour(index),
            dashed: false,
            points: points(one),
        })
        .collect()
    };
    let seconds = |values: Vec<f64>| -> Vec<(f64, f64)> {
        values.into_iter().enumerate().map(|(n, v)| (n as f64 / RATE_HZ, v)).collect()
    };
    let chart = |title: &str, x_label: &str, y_label: &str, curves: Vec<Curve>| {
        let (title, x_label, y_label) = (title.into(), x_label.into(), y_label.into());
        Chart { title, x_label, y_label, curves, ..Chart::default() }.svg()
    };
    let depth = curves(&|a| seconds(a.gesture.places.iter().map(|p| p.depth_mm).collect()));
    let angle = curves(&|a| seconds(a.gesture.places.iter().map(|p| p.angle_rad.to_degrees()).collect()));
    let caption = |words: &str| words.to_owned();
    vec![
        (
            section.svg(),
            caption(
                "Circles: walls that gave way. The needle is drawn where the last attempt was deepest. The picture is to scale.",
            ),
        ),
        (
            chart(
                "Force against depth",
                "depth along the needle, mm",
                "force, N",
                curves(&|a| a.force.clone()),
            ),
            caption(
                "Positive resists insertion; below zero the tissue holds the needle back on its way out.",
            ),
        ),
        (
            chart("Depth", "time, s", "depth along the needle, mm", depth),
            caption("From the first touch of the skin."),
        ),
        (chart("Angle", "time, s", "angle to the skin, °", angle), caption("")),
    ]
}

/// Returns a teacher's comments.
fn in_words(one: &Insertion) -> Vec<String> {
    let mut words = vec![one.verdict.in_words()];
    match &one.target {
        Some(target) if target.name != "lumen" => words.push(of_target(target)),
        _ if one.vessel => {
            words.push(format!("The needle was in the vein for {} s.", decimal(one.in_lumen_s, 1)));
        }
        _ => {}
    }
    if !one.spared.is_empty() {
        words.push(format!("Spared: {}.", one.spared.join(", ")));
    }
    if one.redirections > 0 {
        words.push(format!("The needle was redirected {}.", times(one.redirections)));
    }
    if one.barriers > 0 {
        words.push(format!("It was turned further than the tissue allows {}.", times(one.barriers)));
    }
    words
}

/// Says in a sentence how long the needle was in a target.
fn of_target(target: &Reached) -> String {
    let beside = match target.passed_beside {
        0 => String::new(),
        count => format!(" The needle passed beside it {}.", times(count)),
    };
    format!("The needle was in the {} for {} s.{beside}", target.name, decimal(target.time_s, 1))
}

fn times(count: u32) -> String {
    match count {
        1 => "once".into(),
        2 => "twice".into(),
        n => format!("{n} times"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::{Reason, Verdict};

    #[test]
    fn what_a_teacher_would_say_follows_from_the_figures() {
        let verdict = Verdict { passed: true, ..Verdict::default() };
        let good = Insertion { vessel: true, in_lumen_s: 1.25, verdict, ..Insertion::default() };
        assert_eq!(in_words(&good), ["Passed.", "The needle was in the vein for 1.2 s."]);
        let reason = |words: &str| Reason { key: String::new(), words: words.into(), critical: true };
        let reasons = vec![reason("it went through the far wall"), reason("the tourniquet was left on")];
        let bad = Insertion {
            verdict: Verdict { reasons, ..Verdict::default() },
            spared: vec!["cartilage".into()],
            redirections: 3,
            barriers: 1,
            ..good
        };
        let said = in_words(&bad).join(" ");
        for words in [
            "Not passed: it went through the far wall; the tourniquet was left on.",
            "Spared: cartilage.",
            "redirected 3 times",
            "tissue allows once",
        ] {
            assert!(said.contains(words), "{said}");
        }
        assert_eq!(in_words(&Insertion::default()), ["Not finished."]);
        let target = Reached { name: "bursa".into(), time_s: 0.74, passed_beside: 2, ..Reached::default() };
        let one = Insertion { target: Some(target), ..Insertion::default() };
        let said = "The needle was in the bursa for 0.7 s. The needle passed beside it twice.";
        assert_eq!(in_words(&one)[1], said);
    }
}
