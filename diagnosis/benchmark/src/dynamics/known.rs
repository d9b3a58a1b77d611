//! The fit of somebody who is given the whole structure: nominal values, coefficients and shapes of
//! the hidden effects together, least squares over the fit recordings in the oracle's band, as one
//! would write it with SciPy or MuJoCo's system identification. It names nothing; its held-out gain
//! is the reference for a tool that names.

use super::band::{Band, NOMINAL, prior};
use super::laws::{effective_command, forces};
use super::motion::Motion;
use super::patched;
use super::rig::{Entry, Numbers, Rig};
use crate::key::Key;
use crate::signal::Normal;

/// Shapes tried along each axis before the search, and steps of the search.
const GRID: usize = 5;
const STEPS: usize = 24;

/// The search range of a shape's parameter: (name, lowest, highest), both positive, even in the
/// logarithm.
type Axis = (&'static str, f64, f64);

/// The form of an effect to fit.
struct Form {
    entry: Entry,
    axes: Vec<Axis>,
    coefficients: Vec<String>,
}

/// The largest of a signal over the recordings.
fn largest(bands: &[Band], signal: impl Fn(&Motion, usize) -> f64) -> f64 {
    let all = bands
        .iter()
        .flat_map(|b| (0..b.motion.len()).map(|i| signal(&b.motion, i).abs()).collect::<Vec<_>>());
    all.fold(1e-300, f64::max)
}

/// The form of a hidden effect, where the judge has a law with few enough numbers for it.
fn form(name: &str, rig: &Rig, key: &Key, bands: &[Band]) -> Result<Form, String> {
    let speed = largest(bands, |m, i| m.speed[i]);
    let command = largest(bands, |m, i| m.command[i]);
    let travel = largest(bands, |m, i| m.place[i]);
    let seconds = bands.iter().map(|b| b.motion.time[b.motion.len() - 1]).fold(0.0, f64::max);
    let (mut shape, mut axes, mut coefficients) = (Numbers::new(), Vec::<Axis>::new(), Vec::<String>::new());
    let mut linear = |names: &[&str]| coefficients.extend(names.iter().map(|n| (*n).to_string()));
    match name {
        "viscous_friction" => linear(&["viscous"]),
        "coulomb_friction" => linear(&["coulomb"]),
        "asymmetric_friction" => linear(&["viscous_difference", "coulomb_difference"]),
        "quadratic_drag" | "load_dependent_friction" => linear(&["coefficient"]),
        "tilt_gravity" => linear(&["weight"]),
        "stribeck_friction" => {
            axes.extend([("speed", 0.003 * speed, 0.3 * speed), ("exponent", 0.7, 2.5)]);
            linear(&["peak"]);
        }
        "presliding_friction" => {
            axes.push(("deflection", 1e-5 * travel, 0.1 * travel));
            linear(&["coulomb", "damping"]);
        }
        "friction_drift" => {
            axes.push(("time_constant", 0.05 * seconds, 2.0 * seconds));
            linear(&["coulomb", "viscous"]);
        }
        "gain_drift" => {
            axes.push(("time_constant", 0.05 * seconds, 2.0 * seconds));
            linear(&["change"]);
        }
        "command_deadband" => {
            shape.insert("shift".into(), 1.0);
            axes.push(("half_width", 1e-3 * command, 0.5 * command));
        }
        "command_saturation" => axes.push(("limit", 0.1 * command, command)),
        "command_delay" => axes.push(("delay", 1e-5, 0.05)),
        "electrical_lag" => axes.push(("time_constant", 1e-5, 0.05)),
        "position_spring" => {
            shape.insert("preload".into(), 1.0);
            linear(&["stiffness", "preload"]);
        }
        "position_dependent_friction" | "position_dependent_damping" => {
            shape.extend([("low".into(), -travel), ("high".into(), travel), ("degree".into(), 6.0)]);
            coefficients.extend((1..=6).map(|k| format!("legendre_{k}")));
        }
        "cogging" | "torque_ripple" | "mass_imbalance" | "encoder_eccentricity" => {
            shape.insert("turn".into(), rig.turn.ok_or("the rig does not give the turn")?);
            for (i, order) in orders(name, key)?.iter().enumerate() {
                shape.insert(format!("order_{i}"), *order);
                coefficients.extend([format!("cos_{i}"), format!("sin_{i}")]);
            }
        }
        other => return Err(format!("nothing is fitted to {other}")),
    }
    Ok(Form {
        entry: Entry { name: name.into(), shape, coefficients: Numbers::new(), table: None },
        axes,
        coefficients,
    })
}

/// The orders of an effect that is periodic in the turn: the key's, or the first where there can be
/// no other.
fn orders(name: &str, key: &Key) -> Result<Vec<f64>, String> {
    let told = key.parameters.iter().filter(|p| p.effect == name);
    let orders: Vec<f64> = told.filter_map(|p| p.name.strip_prefix("order_")?.parse().ok()).collect();
    if !orders.is_empty() {
        return Ok(orders);
    }
    if matches!(name, "cogging" | "torque_ripple") {
        return Err("the key does not tell the orders".into());
    }
    Ok(vec![1.0])
}

/// The rig with the fitted values and effects, and what it leaves of the fit recordings in mean
/// square.
struct Fitted {
    rig: Rig,
    cost: f64,
}

/// Returns the residual of the fit with the whole structure on the held-out recording, and its
/// inertia.
///
/// # Errors
/// An effect that nothing is fitted to.
pub(super) fn left(
    rig: &Rig,
    key: &Key,
    fits: &[Band],
    held: &Band,
    floor: f64,
) -> Result<(f64, f64), String> {
    let forms: Vec<Form> =
        key.effects.iter().map(|name| form(name, rig, key, fits)).collect::<Result<_, _>>()?;
    let axes: Vec<(usize, Axis)> =
        forms.iter().enumerate().flat_map(|(i, f)| f.axes.iter().map(move |a| (i, *a))).collect();
    let at = |point: &[f64]| fit_at(rig, &forms, &axes, point, fits, floor);
    // Every axis on a grid in turn, the others in their middle, then a search from the best.
    let mut point: Vec<f64> = axes.iter().map(|_| 0.5).collect();
    for k in 0..axes.len() {
        let tried = (0..GRID).map(|i| {
            let mut p = point.clone();
            p[k] = (i as f64 + 0.5) / GRID as f64;
            (at(&p).map_or(f64::INFINITY, |f| f.cost), p)
        });
        if let Some((_, p)) = tried.min_by(|a, b| a.0.total_cmp(&b.0)) {
            point = p;
        }
    }
    if !axes.is_empty() {
        point = nelder_mead(point, |p| at(p).map_or(f64::INFINITY, |f| f.cost));
    }
    let best = at(&point)?;
    Ok((patched::left(rig, &best.rig, held)?, best.rig.inertia))
}

/// The linear values at given shapes.
fn fit_at(
    rig: &Rig,
    forms: &[Form],
    axes: &[(usize, Axis)],
    point: &[f64],
    fits: &[Band],
    floor: f64,
) -> Result<Fitted, String> {
    let mut entries: Vec<Entry> = forms.iter().map(|f| f.entry.clone()).collect();
    for ((i, (name, low, high)), x) in axes.iter().zip(point) {
        let x = x.clamp(0.0, 1.0);
        entries[*i].shape.insert((*name).into(), low * (high / low).powf(x));
    }
    let shaped = Rig { effects: entries, ..rig.clone() };
    let own: usize = forms.iter().map(|f| f.coefficients.len()).sum();
    let width = NOMINAL + own + fits.len();
    let (means, sds) = prior(rig);
    let mut normal = Normal::new(width);
    let mut seconds = 0.0;
    for (r, band) in fits.iter().enumerate() {
        add_recording(&mut normal, &shaped, forms, &means, band, NOMINAL + own + r)?;
        seconds += band.seconds();
    }
    let weight = Band::dependence(fits, normal.rows, seconds);
    let mut penalty: Vec<f64> = sds.iter().map(|sd| weight * floor * floor / (sd * sd).max(1e-300)).collect();
    penalty.resize(width, 0.0);
    let mut active: Vec<usize> = (0..NOMINAL).filter(|&k| sds[k] > 0.0).collect();
    active.extend(NOMINAL..NOMINAL + own);
    if rig.offset.is_some() {
        active.extend(NOMINAL + own..width);
    }
    let moved = normal.solve(&active, &penalty);
    let mut fitted = Rig {
        inertia: means[0] + moved[0],
        viscous: rig.viscous.map(|_| means[1] + moved[1]),
        coulomb: rig.coulomb.map(|_| means[2] + moved[2]),
        weight: rig.weight.map(|_| means[3] + moved[3]),
        ..shaped
    };
    let mut k = NOMINAL;
    for (entry, form) in fitted.effects.iter_mut().zip(forms) {
        for coefficient in &form.coefficients {
            entry.coefficients.insert(coefficient.clone(), moved[k]);
            k += 1;
        }
    }
    Ok(Fitted { rig: fitted, cost: normal.residual(&moved) / normal.rows.max(1) as f64 })
}

/// Adds a recording's rows to the normal equations: drive force less that of the nominal values,
/// against the nominal terms, the effects' coefficients and the recording's offset in column
/// `offset`.
fn add_recording(
    normal: &mut Normal,
    rig: &Rig,
    forms: &[Form],
    means: &[f64],
    band: &Band,
    offset: usize,
) -> Result<(), String> {
    let command = effective_command(rig, &band.motion);
    let drive = band.see(|i| rig.gain * command[i]);
    let mut columns = band.nominal_columns();
    for (i, form) in forms.iter().enumerate() {
        for coefficient in &form.coefficients {
            columns.push(column(rig, i, coefficient, band, &command)?);
        }
    }
    for (j, drive) in drive.iter().enumerate() {
        let mut row = vec![0.0; normal.width()];
        let mut left = *drive;
        for (k, column) in columns.iter().enumerate() {
            row[k] = column[j];
            left -= if k < NOMINAL { means[k] * row[k] } else { 0.0 };
        }
        row[offset] = -1.0;
        normal.add(&row, left);
    }
    Ok(())
}

/// Returns what one unit of a coefficient adds to the left-hand side of the equation, in the band.
fn column(
    rig: &Rig,
    effect: usize,
    coefficient: &str,
    band: &Band,
    command: &[f64],
) -> Result<Vec<f64>, String> {
    let mut entry = rig.effects[effect].clone();
    entry.coefficients.insert(coefficient.into(), 1.0);
    let with = Rig { effects: vec![entry], ..rig.clone() };
    let without = Rig { effects: Vec::new(), ..rig.clone() };
    let base = forces(&without, &band.motion, command, 0.0)?;
    let more = forces(&with, &band.motion, command, 0.0)?;
    let waves = |i: usize| -> f64 {
        more.waves.iter().map(|w| w.coefficients[0] * w.cos[i] + w.coefficients[1] * w.sin[i]).sum()
    };
    Ok(band.see(|i| base.sum[i] - more.sum[i] - waves(i)))
}

/// Nelder and Mead's simplex in the unit cube; points outside are taken at its faces.
fn nelder_mead(start: Vec<f64>, cost: impl Fn(&[f64]) -> f64) -> Vec<f64> {
    let n = start.len();
    let mut simplex: Vec<(f64, Vec<f64>)> = vec![(cost(&start), start.clone())];
    for k in 0..n {
        let mut p = start.clone();
        p[k] += if p[k] < 0.5 { 0.1 } else { -0.1 };
        simplex.push((cost(&p), p));
    }
    for _ in 0..STEPS {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (worst, last) = (simplex[n].clone(), simplex[n - 1].0);
        let centre: Vec<f64> =
            (0..n).map(|k| simplex[..n].iter().map(|s| s.1[k]).sum::<f64>() / n as f64).collect();
        let along = |t: f64| -> (f64, Vec<f64>) {
            let p: Vec<f64> = centre.iter().zip(&worst.1).map(|(c, w)| c + t * (w - c)).collect();
            (cost(&p), p)
        };
        let reflected = along(-1.0);
        simplex[n] = if reflected.0 < simplex[0].0 {
            let expanded = along(-2.0);
            if expanded.0 < reflected.0 { expanded } else { reflected }
        } else if reflected.0 < last {
            reflected
        } else {
            let contracted = along(0.5);
            if contracted.0 < worst.0 {
                contracted
            } else {
                let best = simplex[0].1.clone();
                for s in simplex.iter_mut().skip(1) {
                    s.1.iter_mut().zip(&best).for_each(|(x, b)| *x = 0.5 * (*x + b));
                    s.0 = cost(&s.1);
                }
                continue;
            }
        };
    }
    simplex.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)).map_or(start, |s| s.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simplex_finds_the_bottom_of_a_bent_valley() {
        let cost = |p: &[f64]| (p[0] - 0.3).powi(2) + 10.0 * (p[1] - p[0] * p[0] - 0.5).powi(2);
        let found = nelder_mead(vec![0.7, 0.2], cost);
        assert!(cost(&found) < 2e-3, "{found:?}");
    }
}
