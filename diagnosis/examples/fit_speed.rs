//! Fits inertia, friction and offset of a rig to a recording by what its free run is off, and
//! prints the time and the values: `cargo run --release -p diagnosis --example fit_speed --
//! rig.toml fit.csv`. `cargo xtask bench parameter_fit_s` runs it by turns with SciPy's
//! `least_squares` on the same error.

use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use diagnosis::simulation::value_fit;
use std::path::PathBuf;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let [rig, recording] = &paths[..] else { return Err("two files are needed: rig.toml fit.csv".into()) };
    let (rig, recording) = (Rig::read(rig)?, Recording::read(recording)?);
    let begin = Instant::now();
    let fitted = value_fit::fit(&rig, std::slice::from_ref(&recording));
    println!("parameter_fit_s={:.4}", begin.elapsed().as_secs_f64());
    let model = &fitted.model;
    let values = [Some(model.inertia), model.viscous, model.coulomb, model.offset];
    for (name, value) in ["inertia", "viscous", "coulomb", "offset"].into_iter().zip(values) {
        if let Some(value) = value {
            println!("{name}={value:e}");
        }
    }
    Ok(())
}
