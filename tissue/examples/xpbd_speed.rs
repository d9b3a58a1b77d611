//! Time of a step of the tissue picture on one core, for `cargo xtask bench`: at least 5,000 particles, a needle that goes in
//! and out. Prints `xpbd_step_ms=…`, the median over all steps.

use std::time::Instant;
use tissue::{Configuration, Needle, Tissue};

const STEPS: usize = 600;
const STEP_S: f32 = 1.0 / 60.0;

fn main() {
    let mut configuration = Configuration::default();
    // The picture's own limb, with enough rows for 5,000 particles.
    while particles(&configuration) < 5_000 {
        if let Some(last) = configuration.layers.last_mut() {
            last.rows += 1;
        }
    }
    let mut tissue = Tissue::new(&configuration).expect("the default limb can be built");
    let mut times: Vec<f64> = (0..STEPS)
        .map(|step| {
            let depth = 7.0 - 9.0 * (step as f32 * STEP_S).cos();
            let begin = Instant::now();
            tissue.step(&Needle::entering(depth, 30_f32.to_radians(), 0.0), STEP_S);
            begin.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    let [distances, volumes, bendings, ties] = tissue.solver().counts();
    println!(
        "particles={} distances={distances} volumes={volumes} bendings={bendings} ties={ties} substeps={} longest_ms={:.3}",
        tissue.points().len(),
        configuration.substeps,
        times[STEPS - 1]
    );
    println!("xpbd_step_ms={:.4}", times[STEPS / 2]);
}

fn particles(configuration: &Configuration) -> usize {
    Tissue::new(configuration).map_or(usize::MAX, |tissue| tissue.points().len())
}
