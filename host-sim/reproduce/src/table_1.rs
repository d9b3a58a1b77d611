//! Paper 000's Table 1 in motion: what pushing to 5 mm does to each configuration of the tissue,
//! and the force where depth counts from the deformed surface.

use super::measure::{Trace, is_puncture_of};
use device_sim::error::Error;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use html_report::chart::{Chart, Curve};
use html_report::{Cell, Sheet, decimal};
use serde_json::{Value, json};
use server::virtual_run;
use std::path::Path;
use std::time::Instant;
use tissue::push::{BESIDE_MM, Division, Pushed, configurations, push};

/// The distance that the needle pushes, mm.
const DEPTH_MM: f32 = 5.0;
/// Substeps of a step with which the energy is within a percent of the least.
const FINE: u32 = 16;
/// So many particles are quickly computed.
const FEW: usize = 2_000;
/// The tissue whose state other programs can check.
const CHECKED: &str = "all three, tied";

/// A configuration under the needle.
struct Row {
    name: &'static str,
    particles: usize,
    pushed: Pushed,
    /// The bodies of Table 1 alone: the limb has too many particles to wait for.
    fine: Option<Pushed>,
    /// Time that the picture's way took, s.
    seconds: f64,
}

/// Pushes each configuration, and writes the state of [`CHECKED`] next to the page.
fn rows(dir: &Path) -> Result<Vec<Row>, Error> {
    let failed = |refusal: tissue::Refusal| Error::failed(format_args!("Table 1 cannot be built: {refusal}"));
    let mut rows = Vec::new();
    for (name, configuration) in configurations() {
        let begin = Instant::now();
        let pushed = push(&configuration, DEPTH_MM, Division::Picture).map_err(failed)?;
        let seconds = begin.elapsed().as_secs_f64();
        let is_fine = pushed.tissue.points().len() < FEW;
        let fine = is_fine
            .then(|| push(&configuration, DEPTH_MM, Division::Substeps(FINE)).map_err(failed))
            .transpose()?;
        if let Some(fine) = fine.as_ref().filter(|_| name == CHECKED) {
            let file = dir.join("paper-000-push.json");
            std::fs::write(&file, state(fine).to_string()).map_err(|cause| {
                Error::failed(format_args!(
                    "{}: cannot be written ({cause}); choose another --out",
                    file.display()
                ))
            })?;
        }
        rows.push(Row { name, particles: pushed.tissue.points().len(), pushed, fine, seconds });
    }
    Ok(rows)
}

/// Particles, constraints and what holds them, in mm, g and µN, for other programs.
fn state(pushed: &Pushed) -> Value {
    let (solver, held) = (pushed.tissue.solver(), pushed.tissue.touched());
    let distances = solver.distances().iter().map(|c| json!([c.ends, c.rest, c.compliance]));
    let volumes = solver.volumes().iter().map(|c| json!([c.corners, c.rest, c.compliance]));
    let bendings = solver.bendings().iter().map(|c| json!([c.corners, c.rest, c.compliance]));
    let ties = solver
        .ties()
        .iter()
        .map(|c| json!([c.particle, c.anchor.corners, c.anchor.weights, c.offset, c.compliance]));
    json!({
        "depth_mm": DEPTH_MM,
        "points": solver.points(),
        "built": pushed.tissue.rest(),
        "distances": distances.collect::<Value>(),
        "volumes": volumes.collect::<Value>(),
        "bendings": bendings.collect::<Value>(),
        "ties": ties.collect::<Value>(),
        "held": held.map(|anchor| json!([anchor.corners, anchor.weights])),
        "residual": pushed.residual,
        "energy_mj": solver.energy() * 1e-6,
        "beside_mm": pushed.beside_mm,
    })
}

/// The table.
pub(super) fn pushes(sheet: &mut Sheet, dir: &Path) -> Result<(), Error> {
    let rows = rows(dir)?;
    let limb_s = rows.last().map_or(1.0, |row| row.seconds);
    sheet.heading("Pushing to 5 mm with each configuration");
    sheet.paragraph(&format!(
        "A needle pushes the surface straight down by {DEPTH_MM} mm and pierces nothing; each layer of Table 1 by itself, all three tied, and this project's limb. \
         Surface: how far it goes down {BESIDE_MM} mm beside the needle (at the edge of the limb's block, 10.4 mm). Residual: the force that is left on particles \
         which nothing holds, over the force on the needle. A picture has two substeps: with two, constraints are softer or stiffer than their compliance says, \
         which the residual tells; with {FINE}, the energy of Table 1 is within a percent of the least that there is. Stiffnesses are ours, and no hand gets this force."
    ));
    let cells: Vec<Vec<Cell>> = rows.iter().map(|row| cells(row, limb_s)).collect();
    sheet.table(
        &[
            "configuration",
            "particles",
            "surface beside, mm: picture, fine",
            "volume, %: picture, fine",
            "energy, mJ: picture, fine",
            "residual: picture, fine",
            "time over the limb's",
        ],
        &cells,
    );
    Ok(())
}

fn cells(row: &Row, limb_s: f64) -> Vec<Cell> {
    let both = |value: fn(&Pushed) -> f64, digits: usize| {
        let of = |pushed: &Pushed| decimal(value(pushed), digits);
        Cell::Number(format!("{}, {}", of(&row.pushed), row.fine.as_ref().map_or("–".into(), of)))
    };
    vec![
        Cell::text(row.name),
        Cell::Number(row.particles.to_string()),
        both(|p| f64::from(p.beside_mm), 2),
        both(|p| f64::from(p.volume_change) * 100.0, 2),
        both(|p| p.energy_mj, 2),
        both(|p| p.residual, 2),
        Cell::Number(decimal(row.seconds / limb_s, 1)),
    ]
}

/// The same insertion with depth from the surface at rest and from the deformed one.
pub(super) fn side_by_side(dir: &Path) -> Result<(String, String), Error> {
    let profile = Profile::find("phantom")?;
    let procedure = || Procedure::find("insertion-5mms-60deg", &profile);
    let rigid = virtual_run::record(&profile, procedure()?, &dir.join("paper-000-rigid.mcap"))?;
    let deformed =
        virtual_run::record_deformed(&profile, procedure()?, &dir.join("paper-000-deformed.mcap"))?;
    let traces = [Trace::of(&rigid)?, Trace::of(&deformed)?];
    let names = ["depth from the surface at rest", "depth from the deformed surface"];
    let curves = traces.iter().zip(names).zip(0..).map(|((trace, name), colour)| Curve {
        name: name.into(),
        colour,
        dashed: false,
        points: trace.force_over_depth(0..trace.deepest()),
    });
    let svg = Chart {
        title: "5 mm/s, 60°: rigid and deformed".into(),
        x_label: "depth along the needle, mm".into(),
        y_label: "force, N".into(),
        curves: curves.collect(),
        ..Chart::default()
    }
    .svg();
    let at = |trace: &Trace| trace.event(0, is_puncture_of(0)).map(|index| trace.depth_mm(index));
    let shift = traces.iter().map(at).collect::<Option<Vec<_>>>().map_or(0.0, |at| at[1] - at[0]);
    let words = format!(
        "By choice (run --deformed, the virtual device): the force function gets the depth past the surface of Table 1's tissue, as it is dented around the \
         needle. The skin gives way {} mm later along the needle.",
        decimal(shift, 2)
    );
    Ok((svg, words))
}
