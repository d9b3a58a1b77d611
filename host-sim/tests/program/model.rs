//! A limb to be printed: `host-sim model`.

use crate::common::{folder, refused, run, run_well, text};
use std::path::Path;

/// Read as the format says: 80 bytes, the number of facets, and 50 bytes for each; the smallest and
/// the largest corner, mm.
fn extent(file: &Path) -> [[f32; 3]; 2] {
    let bytes = std::fs::read(file).expect("it was written");
    let facets = u32::from_le_bytes(bytes[80..84].try_into().expect("four bytes")) as usize;
    assert!(facets > 1_000 && bytes.len() == 84 + 50 * facets, "{facets} facets, {} bytes", bytes.len());
    let mut extent = [[f32::MAX; 3], [f32::MIN; 3]];
    for facet in bytes[84..].chunks_exact(50) {
        let number =
            |at: usize| f32::from_le_bytes(facet[4 * at..4 * at + 4].try_into().expect("four bytes"));
        for (place, axis) in (3..12).map(|at| (number(at), at % 3)) {
            extent[0][axis] = extent[0][axis].min(place);
            extent[1][axis] = extent[1][axis].max(place);
        }
    }
    extent
}

/// The forearm of docs/design/anatomy.md with 8 mm of fat: half axes of 34 + 8 + 2 and 26 + 8 + 2
/// mm; its vein is 6.3 mm under the skin, 3 mm wide, and bends by less than its depth.
#[test]
fn a_forearm_and_its_vein_have_the_sizes_of_their_figures() {
    let dir = folder("model");
    let (skin, vein) = (dir.join("skin.stl"), dir.join("vein.stl"));
    run_well(&["model", "--profile", "forearm", "--out", text(&skin)]);
    run_well(&["model", "--profile", "forearm", "--structure", "vein", "--out", text(&vein)]);
    let [low, high] = extent(&skin);
    for (found, wanted) in low.iter().chain(&high).zip([-60.0, -44.0, -36.0, 80.0, 44.0, 36.0]) {
        assert!((found - wanted).abs() < 0.05, "{low:?} to {high:?}");
    }
    let [low, high] = extent(&vein);
    assert!((low[2] - (-36.0 + 6.3 - 1.5)).abs() < 0.2 && high[2] < 0.0, "{low:?} to {high:?}");
    assert!(low[0] >= -61.5 && high[0] <= 81.5, "{low:?} to {high:?}");
}

#[test]
fn what_cannot_be_printed_is_refused() {
    let file = folder("model-refused").join("a.stl");
    let tried = |rest: &[&str], hints: &[&str]| {
        let whole = [&["model", "--out", text(&file)], rest].concat();
        refused(&run(&whole), 2, hints);
    };
    tried(&["--profile", "adult"], &["level layers"]);
    tried(&["--profile", "forearm", "--structure", "bone"], &["skin", "vein"]);
    assert!(!file.exists());
}
