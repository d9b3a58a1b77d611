//! The image against the physics that it is made of.

use ultrasound::medium::{BLOOD, BONE, FAT, MUSCLE, SKIN};
use ultrasound::{Imager, InPlane, InPlaneScore, LINES, Look, Medium, Mesh, Probe, SAMPLES, Scene, Shaft};

/// A level interface at `depth` mm, larger than any image.
fn level(depth: f32) -> ([[f32; 4]; 4], [[u32; 3]; 2]) {
    let far = 300.0;
    let corner = |x: f32, y: f32| [x * far, y * far, depth, 0.0];
    ([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)], [[0, 2, 1], [0, 3, 2]])
}

/// Mean intensity in dB of every sample's depth, over all lines.
fn by_depth(imager: &Imager) -> Vec<f32> {
    let mut sums = vec![0.0; SAMPLES];
    for (number, db) in imager.power_db().enumerate() {
        sums[number % SAMPLES] += 10_f32.powf(0.1 * db) / LINES as f32;
    }
    sums.into_iter().map(|power| 10.0 * power.log10()).collect()
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

fn homogeneous(medium: Medium, probe: &Probe) -> Imager {
    let mut imager = Imager::default();
    imager.frame(probe, &Scene { first: medium, meshes: &[], shaft: None }, &Look::default());
    imager
}

fn two_layers(above: Medium, below: Medium, depth: f32) -> Imager {
    let (points, triangles) = level(depth);
    let meshes = [Mesh { points: &points, triangles: &triangles, behind: below, wall_mm: None }];
    let mut imager = Imager::default();
    imager.frame(&Probe::default(), &Scene { first: above, meshes: &meshes, shaft: None }, &Look::default());
    imager
}

#[test]
fn interfaces_reflect_what_the_table_says() {
    // By hand: ((1.70 − 1.38)/(1.70 + 1.38))² and ((7.80 − 1.70)/(7.80 + 1.70))².
    assert!((FAT.reflection(&MUSCLE) - 0.010_794).abs() < 1e-5);
    assert!((MUSCLE.reflection(&BONE) - 0.412_299).abs() < 1e-5);
    assert_eq!(FAT.reflection(&MUSCLE), MUSCLE.reflection(&FAT));
    // 1.09 dB/cm/MHz over 20 mm at 5 MHz: 10.9 dB.
    assert!((20.0 * MUSCLE.attenuated(5.0, 20.0).log10() + 10.9).abs() < 1e-3);
}

#[test]
fn brightness_falls_with_two_way_attenuation() {
    for (medium, mhz) in [(MUSCLE, 5.0), (FAT, 8.0), (BLOOD, 10.0)] {
        let probe = Probe { depth_mm: 30.0, mhz, ..Probe::default() };
        let profile = by_depth(&homogeneous(medium, &probe));
        // Least squares over the whole depth; the machine's cm are those of 1540 m/s.
        let count = SAMPLES as f32;
        let centre = 0.5 * (count - 1.0);
        let (mut top, mut bottom) = (0.0, 0.0);
        for (sample, db) in profile.iter().enumerate() {
            let offset = sample as f32 - centre;
            top += offset * db;
            bottom += offset * offset;
        }
        let slope = top / bottom * count / (0.1 * probe.depth_mm);
        let expected = -2.0 * medium.attenuation * mhz * medium.speed / 1540.0;
        assert!((slope - expected).abs() < 0.03 * expected.abs() + 0.1, "{slope} dB/cm, expected {expected}");
    }
}

#[test]
fn speckle_is_fully_developed() {
    // The envelope of many scatterers follows Rayleigh: mean over standard deviation is 1.91.
    let probe = Probe { mhz: 5.0, ..Probe::default() };
    let imager = homogeneous(BLOOD, &probe);
    let envelope: Vec<f32> = imager.power_db().map(|db| 10_f32.powf(0.05 * db)).collect();
    let ratios: Vec<f32> = (200..900)
        .step_by(50)
        .map(|sample| {
            let row: Vec<f32> = (0..LINES).map(|line| envelope[line * SAMPLES + sample]).collect();
            let mean = mean(&row);
            mean / (row.iter().map(|e| (e - mean).powi(2)).sum::<f32>() / LINES as f32).sqrt()
        })
        .collect();
    assert!((mean(&ratios) - 1.91).abs() < 0.25, "{}", mean(&ratios));
}

#[test]
fn echoes_brighten_with_the_reflection_coefficient() {
    let peak = |below: Medium| {
        let profile = by_depth(&two_layers(FAT, below, 5.0));
        profile.into_iter().fold(f32::MIN, f32::max)
    };
    let hard = Medium { impedance: 7.8, ..FAT };
    let soft = Medium { impedance: 2.5, ..FAT };
    let expected = 10.0 * (FAT.reflection(&hard) / FAT.reflection(&soft)).log10();
    let found = peak(hard) - peak(soft);
    assert!((found - expected).abs() < 1.0, "{found} dB against {expected} dB");
}

#[test]
fn an_interface_is_shown_where_the_machine_believes_it() {
    // 6 mm of fat at 1450 m/s look like 6.37 mm.
    let profile = by_depth(&two_layers(FAT, BONE, 6.0));
    let (at, _) = profile.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1)).expect("there are samples");
    let shown = at as f32 * Probe::default().depth_mm / SAMPLES as f32;
    assert!((shown - 6.0 * 1540.0 / 1450.0).abs() < 0.1, "{shown} mm");
}

#[test]
fn bone_throws_a_shadow() {
    let with = by_depth(&two_layers(MUSCLE, BONE, 6.0));
    let without = by_depth(&two_layers(MUSCLE, MUSCLE, 6.0));
    let under = |profile: &[f32]| mean(&profile[500..900]);
    assert!(under(&without) - under(&with) > 20.0, "{} dB", under(&without) - under(&with));
}

#[test]
fn a_vessel_is_dark_inside_and_the_medium_returns_below() {
    // A closed box from 4 to 7 mm.
    let (top, triangles) = level(4.0);
    let (bottom, _) = level(7.0);
    let points: Vec<[f32; 4]> = top.into_iter().chain(bottom).collect();
    let triangles: Vec<[u32; 3]> =
        triangles.into_iter().chain(triangles.map(|triangle| triangle.map(|index| index + 4))).collect();
    let meshes = [Mesh { points: &points, triangles: &triangles, behind: BLOOD, wall_mm: Some(0.3) }];
    let mut imager = Imager::default();
    imager.frame(&Probe::default(), &Scene { first: MUSCLE, meshes: &meshes, shaft: None }, &Look::default());
    let profile = by_depth(&imager);
    let band = |from: f32, to: f32| {
        let at = |mm: f32| (mm / Probe::default().depth_mm * SAMPLES as f32) as usize;
        mean(&profile[at(from)..at(to)])
    };
    assert!(band(2.0, 3.5) - band(4.6, 6.2) > 20.0, "the lumen is dark");
    assert!(band(7.4, 8.4) - band(4.6, 6.2) > 12.0, "below it is bright again");
}

fn needle(beside: f32) -> Shaft {
    let (sine, cosine) = 30_f32.to_radians().sin_cos();
    Shaft {
        tip_mm: [12.0 * cosine, beside, 12.0 * sine],
        direction: [cosine, 0.0, sine],
        radius_mm: 0.41,
        inserted_mm: 12.0,
    }
}

/// Returns how much brighter the needle makes its surroundings, dB.
fn contrast(shaft: Shaft) -> f32 {
    let probe = Probe::default();
    let bright = |shaft: Option<Shaft>| {
        let mut imager = Imager::default();
        imager.frame(&probe, &Scene { first: MUSCLE, meshes: &[], shaft }, &Look::default());
        // Along the needle, from 3 to 10 mm of its path, the brightest sample near it.
        let db: Vec<f32> = imager.power_db().collect();
        let places: Vec<f32> = (3..10)
            .map(|path| {
                let (x, z) = (path as f32 * 0.866, path as f32 * 0.5 - 0.41);
                let line = (((x - 8.0) / 30.0 + 0.5) * LINES as f32) as usize;
                let sample = (z * 1540.0 / 1580.0 / 16.0 * SAMPLES as f32) as usize;
                (sample - 20..sample + 20).map(|at| db[line * SAMPLES + at]).fold(f32::MIN, f32::max)
            })
            .collect();
        mean(&places)
    };
    bright(Some(shaft)) - bright(None)
}

#[test]
fn the_needle_fades_with_its_distance_from_the_plane() {
    let [on, near, off] = [0.0, 0.8, 4.0].map(|beside| contrast(needle(beside)));
    assert!(on > 15.0, "in the plane {on} dB");
    assert!(near < on - 2.0, "0.8 mm beside it {near} dB");
    assert!(off.abs() < 1.0, "4 mm beside it {off} dB");
}

#[test]
fn under_the_needle_there_is_a_shadow() {
    let probe = Probe::default();
    let below = |shaft: Option<Shaft>| {
        let mut imager = Imager::default();
        imager.frame(&probe, &Scene { first: MUSCLE, meshes: &[], shaft }, &Look::default());
        let db: Vec<f32> = imager.power_db().collect();
        let line = ((5.0 - 8.0) / 30.0 + 0.5) * LINES as f32;
        mean(&db[line as usize * SAMPLES + 500..line as usize * SAMPLES + 900])
    };
    assert!(below(None) - below(Some(needle(0.0))) > 8.0);
}

#[test]
fn the_share_in_plane_is_that_of_the_geometry() {
    let probe = Probe::default();
    let all = InPlane::of(&probe, &needle(0.0));
    assert!(all.share > 0.95 && all.tip, "{all:?}");
    let none = InPlane::of(&probe, &needle(4.0));
    assert!(none.share == 0.0 && !none.tip && (none.tip_beside_mm - 4.0).abs() < 1e-4, "{none:?}");
    // Turned about the entry it is seen near the entry only.
    let turned = InPlane::of(&Probe { centre_mm: [0.0; 3], azimuth: 0.3, ..probe }, &needle(0.0));
    assert!(turned.share > 0.05 && turned.share < 0.6 && !turned.tip, "{turned:?}");
    let mut score = InPlaneScore::default();
    score.take(all, &needle(0.0), 3.0);
    score.take(none, &needle(4.0), 1.0);
    assert!((score.tip_share() - 0.75).abs() < 1e-6 && score.inserted_s == 4.0);
}

#[test]
fn nonsense_makes_an_image_all_the_same() {
    let nan = f32::NAN;
    let probe = Probe {
        centre_mm: [nan; 3],
        azimuth: nan,
        width_mm: 0.0,
        depth_mm: -1.0,
        mhz: nan,
        ..Probe::default()
    };
    let points = [[nan; 4], [0.0; 4], [1e30, -1e30, 1e30, 0.0], [5.0, 5.0, 5.0, 0.0]];
    let triangles = [[0, 1, 2], [1, 2, 3], [7, 8, 9]];
    let meshes = [Mesh { points: &points, triangles: &triangles, behind: SKIN, wall_mm: Some(nan) }];
    let shaft = Shaft { tip_mm: [nan; 3], direction: [nan; 3], radius_mm: nan, inserted_mm: 1e30 };
    let mut imager = Imager::default();
    let look = Look { gain_db: nan, tgc_db_per_cm: f32::INFINITY, range_db: nan };
    let image = imager.frame(&probe, &Scene { first: SKIN, meshes: &meshes, shaft: Some(shaft) }, &look);
    assert_eq!(image.len(), LINES * SAMPLES);
}
