//! The force–depth curve of every profile, recomputed in floating point from the profile's own
//! TOML, against the torque in an exported CSV: within one step of the converter, sample by sample.

use crate::common::{figure, folder, run_well, text};
use std::path::Path;

/// The default device, which the built-in profiles leave as it is.
const ROLLER_MM: f64 = 10.0;
const SLEW_MNM_PER_TICK: f64 = 1.0;
const FADE_TICKS: f64 = 3_000.0;
const HOLD_N_PER_MM: f64 = 1.0;
const HEAL_MM: f64 = 0.2;
/// The tilt is reported in mrad: 30° is 524 mrad.
const ANGLE_RAD: f64 = 0.524;

struct Row {
    command: f64,
    depth_mm: f64,
    powered: bool,
}

fn rows(csv: &Path, mm_per_count: f64) -> Vec<Row> {
    let text = std::fs::read_to_string(csv).expect("it was exported");
    let mut lines = text.lines();
    assert_eq!(lines.next(), Some("time_s,command,position_counts,tilt_rad,state"));
    let row = |(index, line): (usize, &str)| {
        let fields: Vec<f64> = line.split(',').map(|field| field.parse().expect("a number")).collect();
        assert!((fields[0] - index as f64 * 1e-4).abs() < 1e-9, "row {index} at {} s", fields[0]);
        assert!((fields[3] - 30_f64.to_radians()).abs() < 1e-3);
        Row { command: fields[1], depth_mm: fields[2] * mm_per_count, powered: fields[4] != 0.0 }
    };
    lines.enumerate().map(row).collect()
}

fn number(value: &toml::Value, keys: &[&str]) -> f64 {
    let found = keys.iter().fold(value, |value, key| &value[*key]);
    found.as_float().expect("a number with a decimal point")
}

/// `f(T) = (T − n)²/a + b`.
fn jog(parabola: &toml::Value, travel_mm: f64) -> f64 {
    let from_vertex = travel_mm - number(parabola, &["vertex_mm"]);
    from_vertex * from_vertex / number(parabola, &["compliance_mm2_per_n"]) + number(parabola, &["base_n"])
}

/// Returns the depth of a layer along the needle, mm.
fn top_mm(layer: &toml::Value) -> f64 {
    number(layer, &["depth_mm"]) / ANGLE_RAD.sin()
}

/// The tissue of a profile, as the README of any such device would describe it. Every wall has
/// given way long before the next one is met.
struct Twin {
    layers: Vec<toml::Value>,
    given: Vec<Option<f64>>,
    anchor_mm: f64,
}

impl Twin {
    fn force_n(&mut self, depth_mm: f64) -> f64 {
        let mut force = 0.0;
        for (layer, given) in self.layers.iter().zip(&mut self.given) {
            let travel = depth_mm - top_mm(layer);
            if travel < -HEAL_MM {
                *given = None;
            }
            let Some(wall) = layer.get("wall") else { continue };
            if travel >= number(wall, &["puncture_mm"]) {
                *given = Some(given.unwrap_or(travel).max(travel));
            }
            match *given {
                Some(deepest) => {
                    let cut = jog(&wall["relief"], deepest.min(number(&wall["relief"], &["vertex_mm"])));
                    force += (cut - (deepest - travel) * number(wall, &["unload_n_per_mm"])).max(0.0);
                }
                None if travel >= 0.0 => force += jog(&wall["elastic"], travel),
                None => {}
            }
        }
        force + self.friction_n(depth_mm)
    }

    fn friction_n(&mut self, depth_mm: f64) -> f64 {
        if self.given[0].is_none() || depth_mm <= 0.0 {
            self.anchor_mm = depth_mm;
            return 0.0;
        }
        let mut limit = 0.0;
        for (index, layer) in self.layers.iter().enumerate() {
            let top = top_mm(layer);
            let end = self.layers.get(index + 1).map_or(f64::INFINITY, top_mm);
            limit += (depth_mm.min(end) - top).max(0.0) * number(layer, &["friction_n_per_mm"]);
        }
        let reach = limit / HOLD_N_PER_MM;
        self.anchor_mm = self.anchor_mm.clamp(depth_mm - reach, depth_mm + reach);
        HOLD_N_PER_MM * (depth_mm - self.anchor_mm)
    }
}

#[test]
fn exported_torque_follows_the_profile_within_a_dac_step() {
    for name in ["adult", "thin-elderly", "high-body-mass", "firm-skin"] {
        let dir = folder(&format!("force-depth-{name}"));
        let mcap = dir.join("a.mcap");
        let out =
            ["run", "--headless", "--fast", "--seconds", "12", "--profile", name, "--record", text(&mcap)];
        let stdout = run_well(&out);
        assert_eq!(figure(&stdout, "punctures"), 4.0, "{name}: two insertions of two punctures: {stdout}");
        run_well(&["export", text(&mcap), "--out", text(&dir)]);

        let profile = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("profiles/{name}.toml"));
        let profile: toml::Value =
            toml::from_str(&std::fs::read_to_string(profile).expect("it is there")).expect("TOML");
        let rig = std::fs::read_to_string(dir.join("rig.toml")).expect("it was exported");
        let rig: toml::Value = toml::from_str(&rig).expect("TOML");
        let gain = number(&rig, &["actuator", "gain"]);
        let mm_per_count = ROLLER_MM / number(&rig, &["encoder", "counts_per_unit"]);

        let layers = profile["layer"].as_array().expect("layers").clone();
        let mut twin = Twin { given: vec![None; layers.len()], layers, anchor_mm: 0.0 };
        let (mut torque_mnm, mut powered_ticks, mut compared, mut largest, mut worst) =
            (0.0, 0.0, 0, 0.0_f64, 0.0_f64);
        for (index, row) in rows(&dir.join("recording.csv"), mm_per_count).iter().enumerate() {
            let force = twin.force_n(row.depth_mm);
            if !row.powered {
                assert_eq!(row.command, 0.0, "{name}, row {index}: torque while off");
                continue;
            }
            powered_ticks += 1.0;
            let wanted: f64 = -force * ROLLER_MM * (powered_ticks / FADE_TICKS).min(1.0);
            torque_mnm = wanted.clamp(torque_mnm - SLEW_MNM_PER_TICK, torque_mnm + SLEW_MNM_PER_TICK);
            let error = (torque_mnm * 1e-3 / gain - row.command).abs();
            assert!(
                error <= 1.0,
                "{name}, row {index}: {} mm, {torque_mnm} mN·m, command {}",
                row.depth_mm,
                row.command
            );
            compared += 1;
            worst = worst.max(error);
            largest = largest.max(force);
        }
        assert!(compared > 119_000, "{name}: {compared} rows");
        let skin_n = jog(
            &profile["layer"][0]["wall"]["elastic"],
            number(&profile["layer"][0]["wall"], &["puncture_mm"]),
        );
        assert!((largest / skin_n - 1.0).abs() < 0.02, "{name}: {largest} N of {skin_n} N were felt");
        assert!(worst > 0.0, "{name}: a comparison that cannot differ compares nothing");
    }
}
