//! The nominal, refitted and patched rig run forward and compared with the held-out recordings:
//! this is the usual meaning of a simulation that fits.

use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::data::schema::{ByModel, Simulation, WindowsOff};
use crate::simulation::comparison::{Comparison, Figures};

/// Windows for which the report gives errors, s.
const WINDOWS_S: [f64; 3] = [0.1, 0.5, 2.0];

/// The models compared with every held-out recording; the patched one only where something was
/// found.
pub(crate) fn simulated(nominal: &Rig, refit: &Rig, patched: &Rig, holdout: &[Recording]) -> Vec<Comparison> {
    let mut models = vec![("nominal".to_owned(), nominal.clone()), ("refit".to_owned(), refit.clone())];
    if patched.effects.len() > nominal.effects.len() {
        models.push(("patched".to_owned(), patched.clone()));
    }
    holdout.iter().map(|recording| Comparison::new(recording, &models, &WINDOWS_S)).collect()
}

/// Root mean square of a figure of a model over the time of all recordings that have it.
fn rms_over_time(all: &[Comparison], model: &str, figure: &dyn Fn(&Figures) -> Option<f64>) -> Option<f64> {
    let (mut sum, mut seconds) = (0.0, 0.0);
    for one in all {
        let Some(x) = one.figures(model).and_then(figure) else { continue };
        let long = one.motion.seconds();
        sum += long * x * x;
        seconds += long;
    }
    (seconds > 0.0).then(|| (sum / seconds).sqrt())
}

/// Root mean square over all held-out recordings.
pub(crate) fn pooled(simulated: &[Comparison]) -> Option<Simulation> {
    let first = simulated.first()?;
    let by_model = |of: &dyn Fn(&Figures) -> Option<f64>| ByModel {
        nominal: rms_over_time(simulated, "nominal", of),
        refit: rms_over_time(simulated, "refit", of),
        patched: rms_over_time(simulated, "patched", of),
    };
    let windows = WINDOWS_S
        .into_iter()
        .map(|seconds| WindowsOff {
            seconds,
            position: by_model(&|f| {
                f.windows.iter().find(|w| w.seconds == seconds).map(|w| w.off.position_rms)
            }),
        })
        .filter(|w| w.position.nominal.is_some())
        .collect();
    Some(Simulation {
        unit: first.kind.length().into(),
        free_run: by_model(&|f| Some(f.free_run.position_rms)),
        windows,
        worse: simulated.iter().find_map(Comparison::worse_for_less_force),
    })
}
