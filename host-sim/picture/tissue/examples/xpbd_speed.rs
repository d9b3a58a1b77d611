//! Time of a step of the tissue picture on one core, for `cargo xtask bench`: at least 5,000
//! particles, a needle that goes in and out. Prints `xpbd_step_ms=…`, the median over all steps,
//! and the time of a step on meshes of about one, ten and a hundred times as many particles. Where
//! `XPBD_MESH` names a file, the mesh is written there for the peer `xtask/peers/soft_body.py`.

use std::path::Path;
use std::time::Instant;
use tissue::{Configuration, Needle, Tissue};

const STEPS: usize = 600;
const STEP_S: f32 = 1.0 / 60.0;

/// Particles of meshes of about one, ten and a hundred times as many, at least, and the steps of
/// each; 20,000 are the most that are possible.
const WORK: [(usize, usize); 3] = [(180, 400), (1_800, 100), (18_000, 20)];

fn main() {
    let mut configuration = Configuration::default();
    // The picture's own limb, with enough rows for 5,000 particles.
    while particles(&configuration) < 5_000 {
        if let Some(last) = configuration.layers.last_mut() {
            last.rows += 1;
        }
    }
    let mut tissue = Tissue::new(&configuration).expect("the default limb can be built");
    if let Some(path) = std::env::var_os("XPBD_MESH") {
        write_mesh(&tissue, configuration.substeps, Path::new(&path));
    }
    let times = sorted_ms(&mut tissue, STEPS);
    let [distances, volumes, bendings, ties] = tissue.solver().counts();
    println!(
        "particles={} distances={distances} volumes={volumes} bendings={bendings} ties={ties} substeps={} longest_ms={:.3}",
        tissue.points().len(),
        configuration.substeps,
        times[STEPS - 1]
    );
    println!("xpbd_step_ms={:.4}", times[STEPS / 2]);
    for (least, steps) in WORK {
        // Without the vessel, whose mesh is the same in all.
        let mut configuration = Configuration { vessel: None, ..Configuration::default() };
        // One row of cells in each layer, so that the coarsest mesh is small enough.
        configuration
            .layers
            .iter_mut()
            .for_each(|layer| (layer.rows, layer.spacing_mm) = (1, 8.0 * layer.spacing_mm));
        while particles(&configuration) < least {
            configuration.layers.iter_mut().for_each(|layer| layer.spacing_mm *= 0.97);
        }
        let mut tissue = Tissue::new(&configuration).expect("a finer or coarser limb can be built");
        let ms = sorted_ms(&mut tissue, steps)[steps / 2];
        println!("work.xpbd.particles.{}={:.7}", tissue.points().len(), 1e-3 * ms);
    }
}

/// Writes as JSON: the particles at rest, mm, each with its inverse mass, 1/g; the distances and
/// the volumes, each as corners, rest value (mm, mm³) and compliance; the substeps of a picture.
fn write_mesh(tissue: &Tissue, substeps: u32, path: &Path) {
    let list = |items: Vec<String>| format!("[{}]", items.join(","));
    let points = tissue.rest().iter().map(|point| format!("{point:?}")).collect();
    let distances = tissue.solver().distances().iter();
    let distances =
        distances.map(|one| format!("[{:?},{:?},{:?}]", one.ends, one.rest, one.compliance)).collect();
    let volumes = tissue.solver().volumes().iter();
    let volumes =
        volumes.map(|one| format!("[{:?},{:?},{:?}]", one.corners, one.rest, one.compliance)).collect();
    let text = format!(
        "{{\"substeps\":{substeps},\"points\":{},\"distances\":{},\"volumes\":{}}}",
        list(points),
        list(distances),
        list(volumes)
    );
    std::fs::write(path, text).expect("the mesh's file can be written");
}

/// Times of steps with a needle that goes in and out, from the shortest, in ms.
fn sorted_ms(tissue: &mut Tissue, steps: usize) -> Vec<f64> {
    let mut times: Vec<f64> = (0..steps)
        .map(|step| {
            let depth = 7.0 - 9.0 * (step as f32 * STEP_S).cos();
            let begin = Instant::now();
            tissue.step(&Needle::entering(depth, 30_f32.to_radians(), 0.0), STEP_S);
            begin.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times
}

fn particles(configuration: &Configuration) -> usize {
    Tissue::new(configuration).map_or(usize::MAX, |tissue| tissue.points().len())
}
