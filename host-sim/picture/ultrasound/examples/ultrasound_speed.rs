//! Time of an image of 256 lines × 1,024 samples on one core, for `cargo xtask bench`: three
//! layers, a vessel, a needle, the probe moving. Prints `ultrasound_frame_ms=…`, the median.

use std::time::Instant;
use ultrasound::medium::{BLOOD, FAT, MUSCLE, SKIN};
use ultrasound::{Imager, Look, Mesh, Probe, Scene, Shaft};

const FRAMES: usize = 200;
/// Cells of each interface along and across, as many as the tissue picture has.
const CELLS: [usize; 2] = [27, 16];

fn main() {
    let tops: Vec<_> = [2.0, 4.0].map(surface).into();
    let vessel = tube();
    let meshes = [
        Mesh { points: &tops[0].0, triangles: &tops[0].1, behind: FAT, wall_mm: None },
        Mesh { points: &tops[1].0, triangles: &tops[1].1, behind: MUSCLE, wall_mm: None },
        Mesh { points: &vessel.0, triangles: &vessel.1, behind: BLOOD, wall_mm: Some(0.4) },
    ];
    let (sine, cosine) = 30_f32.to_radians().sin_cos();
    let shaft = Shaft {
        tip_mm: [10.0 * cosine, 0.0, 10.0 * sine],
        direction: [cosine, 0.0, sine],
        radius_mm: 0.41,
        inserted_mm: 10.0,
    };
    let scene = Scene { first: SKIN, meshes: &meshes, shaft: Some(shaft) };
    let mut imager = Imager::default();
    let mut times: Vec<f64> = (0..FRAMES)
        .map(|number| {
            let probe = Probe { centre_mm: [8.0, 0.01 * number as f32 - 1.0, 0.0], ..Probe::default() };
            let begin = Instant::now();
            imager.frame(&probe, &scene, &Look::default());
            begin.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    println!("longest_ms={:.3}", times[FRAMES - 1]);
    println!("ultrasound_frame_ms={:.4}", times[FRAMES / 2]);
}

type Surface = (Vec<[f32; 4]>, Vec<[u32; 3]>);

fn surface(depth: f32) -> Surface {
    grid(|x, y| [35.0 * x - 9.0, 21.0 * y - 10.5, depth])
}

/// A vein of 3.0 × 4.5 mm whose near wall is 4.8 mm deep, along the needle.
fn tube() -> Surface {
    grid(|x, y| {
        let (sine, cosine) = (std::f32::consts::TAU * y).sin_cos();
        [35.0 * x - 9.0, 2.25 * cosine, 6.3 + 1.5 * sine]
    })
}

fn grid(place: impl Fn(f32, f32) -> [f32; 3]) -> Surface {
    let [nx, ny] = CELLS;
    let mut points = vec![];
    let mut triangles = vec![];
    for j in 0..=ny {
        for i in 0..=nx {
            let [x, y, z] = place(i as f32 / nx as f32, j as f32 / ny as f32);
            points.push([x, y, z, 0.0]);
            if i < nx && j < ny {
                let a = (j * (nx + 1) + i) as u32;
                let below = a + nx as u32 + 1;
                triangles.extend([[a, a + 1, below], [a + 1, below + 1, below]]);
            }
        }
    }
    (points, triangles)
}
