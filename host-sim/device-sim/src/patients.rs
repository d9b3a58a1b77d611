//! A patient as a picture in the terminal: who it is, and its layers to scale, with the forces at
//! which they give way.

use crate::profile::Profile;
use crate::session::{Scene, SceneLayer, Source};
use std::fmt::Write as _;

/// The smallest and the largest number of lines in a picture.
const LINES: (f64, f64) = (8.0, 26.0);
/// The depth of a line, mm, unless that makes too few lines or too many.
const MM_PER_LINE: f64 = 0.5;
/// Columns of tissue.
const COLUMNS: usize = 18;

/// Returns a description of the patient of `profile` and a picture of the layers.
pub fn picture(profile: &Profile) -> String {
    let scene = profile.scene(Source::Virtual, None);
    let mut out = format!("{}\n", profile.name);
    for line in about(profile) {
        let _ = writeln!(out, "  {line}");
    }
    draw(&mut out, &scene);
    out
}

/// Returns the file's statements about the patient apart from the tissue: its single values, and
/// those of its tables without layers.
fn about(profile: &Profile) -> Vec<String> {
    let table: toml::Table = profile.source.text.parse().unwrap_or_default();
    let words = |table: &toml::Table| {
        let single = table.iter().filter_map(|(key, value)| {
            let text = match value {
                toml::Value::String(text) => text.clone(),
                toml::Value::Integer(number) => number.to_string(),
                toml::Value::Float(number) => number.to_string(),
                _ => return None,
            };
            let is_known = matches!(key.as_str(), "format" | "name");
            (!is_known).then(|| format!("{} {text}", key.replace('_', " ")))
        });
        single.collect::<Vec<_>>().join(", ")
    };
    let about = ["about", "patient"].iter().filter_map(|key| table.get(*key)?.as_table()).map(words);
    std::iter::once(words(&table)).chain(about).filter(|line| !line.is_empty()).collect()
}

/// Layers from the skin down, a line for every half mm: the beginning of each is next to its first
/// line.
fn draw(out: &mut String, scene: &Scene) {
    let deepest = scene.layers.iter().map(|l| l.depth_mm).fold(0.0, f64::max) + 1.5;
    let lines = (deepest / MM_PER_LINE).clamp(LINES.0, LINES.1).ceil();
    let mm_per_line = deepest / lines;
    let line_of = |mm: f64| (mm / mm_per_line).round() as usize;
    let mut told = 0;
    for line in 0..lines as usize {
        let inside = scene.layers.iter().rposition(|l| line_of(l.depth_mm) <= line).unwrap_or(0);
        let Some(layer) = scene.layers.get(inside) else { return };
        let begins = scene.layers.get(told..=inside).unwrap_or_default();
        let texture: String = fill(&layer.name).to_string().repeat(COLUMNS);
        match begins {
            [] => {
                let _ = writeln!(out, "         │{texture}│");
            }
            _ => {
                let words: Vec<String> = begins.iter().map(|l| describe(l, scene)).collect();
                let _ = writeln!(out, "{:5.1} mm ┼{texture}┤ {}", layer.depth_mm, words.join("; "));
                told = inside + 1;
            }
        }
    }
}

fn fill(name: &str) -> char {
    match name {
        "skin" => '▓',
        "fat" => '░',
        "muscle" | "far wall" => '▒',
        "vessel" => ' ',
        "bursa" => '∙',
        "tendon" => '=',
        "cartilage" => '█',
        _ => '·',
    }
}

fn describe(layer: &SceneLayer, scene: &Scene) -> String {
    let mut words = layer.name.clone();
    if let Some(vessel) = scene.vessel.as_ref().filter(|_| layer.is_vessel) {
        let _ = write!(words, ", {:.1} × {:.1} mm", vessel.height_mm, vessel.width_mm);
    }
    if let Some(force) = layer.puncture_force_n {
        let _ = write!(words, ", gives way at {force:.2} N");
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::BUILT_IN;

    #[test]
    fn every_layer_of_every_patient_is_named_once_and_in_its_order() {
        for (name, _) in BUILT_IN {
            let profile = Profile::find(name).expect("it is built in");
            let scene = profile.scene(Source::Virtual, None);
            let drawn = picture(&profile);
            let rows: Vec<&str> = drawn.lines().filter(|line| line.contains('┼')).collect();
            let named: Vec<&str> = rows
                .iter()
                .flat_map(|row| row.split('┤').nth(1).into_iter().flat_map(|w| w.split(';')))
                .collect();
            assert_eq!(named.len(), scene.layers.len(), "{drawn}");
            for (words, layer) in named.iter().zip(&scene.layers) {
                assert!(words.trim().starts_with(&layer.name), "{words} is not {}: {drawn}", layer.name);
            }
            assert!(drawn.lines().all(|line| line.chars().count() < 110), "{drawn}");
        }
    }

    #[test]
    fn depths_are_to_scale() {
        let drawn = picture(&Profile::find("adult").expect("it is built in"));
        let row = |words: &str| drawn.lines().position(|line| line.contains(words)).expect(words);
        let (skin, vessel, far) = (row("skin,"), row("vessel,"), row("far wall,"));
        // 4.8 mm and 3.0 mm at half a mm a line.
        assert!((9..=11).contains(&(vessel - skin)) && (5..=7).contains(&(far - vessel)), "{drawn}");
    }
}
