//! Paper 001, the roller device for venepuncture: Fig. 5 (the profile of an intravenous injection)
//! and the hold of eq. 2.

use super::measure::{Trace, is_puncture_of};
use super::{Row, Whose, numbers, row};
use control_core::TICK_HZ;
use control_core::config::Tissue;
use device_sim::device::device_config::DeviceConfig;
use device_sim::error::Error;
use device_sim::named_files::Text;
use device_sim::plant::hand::Grip;
use device_sim::plant::motor::Motor;
use device_sim::plant::{Plant, PlantConfig};
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use html_report::chart::{Chart, Curve};
use html_report::{Sheet, decimal};
use server::virtual_run;
use std::path::Path;

/// Eq. 2 as printed, in the place of the cone.
const AS_PRINTED: &str = "[friction]\nlaw = \"paper\"\nlevel_length_mm = 23.0\nlevel_cap = 3.5\nanchor_ms = 50\nstiffness_n_per_mm = 0.25\nlimit_n = 0.3\n\n[[layer]]";
/// The time for which the procedure holds the needle still, s.
const HELD_S: f64 = 2.0;

pub(super) fn sheet(dir: &Path) -> Result<Sheet, Error> {
    let cone = Profile::find("adult")?;
    let printed = Profile::parse(Text {
        origin: "profile adult with eq. 2 as printed".into(),
        text: cone.source.text.replacen("[[layer]]", AS_PRINTED, 1),
    })?;
    let run = |profile: &Profile, procedure: &str, file: &str| -> Result<Trace, Error> {
        let procedure = Procedure::find(procedure, profile)?;
        Trace::of(&virtual_run::record(profile, procedure, &dir.join(file))?)
    };
    let injection = run(&cone, "injection", "paper-001-injection.mcap")?;
    let with_cone = run(&cone, "hold", "paper-001-hold-cone.mcap")?;
    let as_printed = run(&printed, "hold", "paper-001-hold-printed.mcap")?;

    let mut sheet = Sheet::new(
        "Needle Insertion Simulator with Haptic Feedback (paper 001)",
        "The paper prints the motor's and the encoder's figures and no force: its Fig. 5 is a shape, and its two equations have no values. \
         What it does not print is ours, from the sources in the patient's file.",
    );
    sheet.heading("Numbers");
    numbers(&mut sheet, &rows(&cone, &injection, &with_cone, &as_printed)?);
    sheet.heading("Fig. 5 and the hold of eq. 2");
    sheet.figures(&[
        (profile_chart(&cone, &injection), "Fig. 5: elasticity of the skin, friction in the tissue between (the paper's muscle), elasticity of the vessel. Way in and way out; the paper's axes have no numbers.".into()),
        (hold_chart(&with_cone, &as_printed), "A needle held still between skin and vessel. Eq. 2 as printed lets go of it within a tenth of a second; a friction cone holds it, as paper 002 asks (its need 4).".into()),
    ]);
    sheet.heading("What the paper leaves open");
    for words in [
        "24 V, 0.6 A and 28.8 mN·m belong together in a motor of 48 mN·m for each ampere: run --device-config paper-001 has it, the RE25's copper wound with \
         about twice the turns (an assumption). The 24 V winding of the RE25 as it is sold makes 14 mN·m at 0.6 A; the built-in device has it, gives the \
         paper's torque, and takes the current that follows.",
        "P_curr_f is called the current position. Taken so, eq. 2 has no state; we read it as an anchor that follows the needle, and P_pre as the \
         anchor of the tick before, as the equation's last line sets it.",
        "S_f1 and S_f2 have no values, and from position to torque a factor is missing. Ours: S_f1 23 mm, S_f2 from a time constant of 50 ms, 0.25 N/mm.",
        "The effect of the penetration is called the difference between two effects. Ours: a wall rises along one parabola until it gives way, and falls \
         along another; that it has given way lasts until the tip has left the layer.",
    ] {
        sheet.paragraph(words);
    }
    Ok(sheet)
}

fn number(profile: &Profile, tissue: Tissue) -> Option<u8> {
    profile.config.patient.layers.iter().position(|l| l.tissue == tissue).map(|at| at as u8)
}

fn rows(profile: &Profile, injection: &Trace, cone: &Trace, printed: &Trace) -> Result<Vec<Row>, Error> {
    let device = &profile.config.device;
    let motor = Motor::re25(device.full_scale_torque.0.to_num::<f64>() * 1e-3);
    let newtons = |n: f64| format!("{} N", decimal(n, 2));
    let mut rows = vec![
        row(
            "torque of the motor",
            "28.8 mN",
            format!("{} mN·m", decimal(device.full_scale_torque.0.to_num(), 1)),
            Whose::Papers,
        ),
        row("counts in a turn of the roller", "4000", device.counts_per_turn.to_string(), Whose::Papers),
        row("rate of the control loop", "10 kHz", format!("{} kHz", TICK_HZ / 1000), Whose::Papers),
        row("supply of the motor", "24 V", format!("{} V", decimal(motor.supply, 0)), Whose::Papers),
        row("current of the motor at that torque", "0.6 A", currents(profile)?, Whose::Papers),
        row(
            "radius of the roller",
            "“an acceptable range of encoder resolution”",
            format!("{} mm", decimal(device.roller_radius.0.to_num(), 0)),
            Whose::Ours,
        ),
        row(
            "largest force at the needle",
            "–",
            newtons(profile.plan.largest_force().0.to_num()),
            Whose::NoneGiven,
        ),
    ];
    for (tissue, what) in [(Tissue::Skin, "skin"), (Tissue::Vessel, "vessel")] {
        let Some(layer) = number(profile, tissue) else { continue };
        let wall = profile.config.patient.layers[usize::from(layer)].wall;
        let a = wall.map_or(0.0, |w| w.elastic.compliance.0.to_num::<f64>());
        let said = if tissue == Tissue::Vessel { "smaller than the skin's" } else { "–" };
        rows.push(row(&format!("a of eq. 1, {what}"), said, format!("{} mm²/N", decimal(a, 1)), Whose::Ours));
        if let Some(at) = injection.event(0, is_puncture_of(layer)) {
            let (before, after) = injection.fall_n(at);
            rows.push(row(
                &format!("force when the {what} gives way"),
                "–",
                newtons(before),
                Whose::NoneGiven,
            ));
            rows.push(row("force just after it", "falls", newtons(after), Whose::NoneGiven));
        }
    }
    for (trace, law) in [(cone, "friction cone"), (printed, "eq. 2 as printed")] {
        let (begin, end) = held(trace);
        let tenth = TICK_HZ as usize / 10;
        let at = |from: usize| newtons(trace.mean_n(from..from + tenth).unwrap_or(0.0));
        let rested_s = (end - begin) as f64 / f64::from(TICK_HZ);
        let said = format!("{} at first, {} after {} s", at(begin), at(end - tenth), decimal(rested_s, 1));
        rows.push(row(&format!("force on a needle held still, {law}"), "–", said, Whose::NoneGiven));
    }
    Ok(rows)
}

/// The current that the plant takes for the torque at full scale while a hand holds the needle:
/// with the paper's motor and with the built-in device's.
fn currents(profile: &Profile) -> Result<String, Error> {
    let device = &profile.config.device;
    let paper = DeviceConfig::read(Path::new("paper-001"))?;
    let full_scale = device.full_scale_torque.0.to_num::<f64>() * 1e-3;
    let radius_m = device.roller_radius.0.to_num::<f64>() * 1e-3;
    let usual = PlantConfig::new(radius_m, device.counts_per_turn, full_scale);
    let motors = [paper.winding.map_or(usual.motor, |winding| winding.motor(full_scale)), usual.motor];
    let [papers, built_in] = motors.map(|motor| {
        let grip = Grip { stiffness_n_per_m: 4_000.0, damping_n_s_per_m: 20.0, tremor_rms_m: 0.0, seed: 0 };
        let mut plant = Plant::new(PlantConfig { motor, ..usual }, grip, 0.0);
        for _ in 0..TICK_HZ {
            plant.tick(1.0, true, Some((0.0, 0.0)));
        }
        let constant = decimal(motor.torque_constant * 1e3, 1);
        format!(
            "{} A for {} mN·m with {constant} mN·m/A",
            decimal(plant.current(), 2),
            decimal(plant.torque() * 1e3, 1)
        )
    });
    Ok(format!("{papers} (the device paper-001); {built_in} (the built-in device: the RE25's 24 V winding)"))
}

/// When the needle is held still: from when it has come to rest until it is drawn back.
fn held(trace: &Trace) -> (usize, usize) {
    let end = trace.index(0.5 + 1.5 + HELD_S);
    // Friction lets the needle go on a little after the hand has stopped.
    (trace.at_rest(trace.index(0.5 + 1.5)).min(end), end)
}

fn profile_chart(profile: &Profile, trace: &Trace) -> String {
    let deepest = trace.deepest();
    let marks = [(Tissue::Skin, "skin gives way"), (Tissue::Vessel, "vessel gives way")];
    let mark = |(tissue, name): (Tissue, &str)| {
        let at = trace.event(0, is_puncture_of(number(profile, tissue)?))?;
        Some((trace.depth_mm(at), name.to_owned()))
    };
    let curve = |name: &str, colour, points| Curve { name: name.into(), colour, points, dashed: false };
    Chart {
        title: "Force against depth, adult, 30°".into(),
        x_label: "depth along the needle, mm".into(),
        y_label: "force, N".into(),
        curves: vec![
            curve("way out", 5, trace.force_over_depth(deepest..trace.len())),
            curve("way in", 0, trace.force_over_depth(0..deepest)),
        ],
        marks: marks.into_iter().filter_map(mark).collect(),
        ..Chart::default()
    }
    .svg()
}

fn hold_chart(cone: &Trace, printed: &Trace) -> String {
    let from = cone.index(1.0);
    let rests_s = (held(cone).0 - from) as f64 / f64::from(TICK_HZ);
    let curve = |name: &str, colour, trace: &Trace| Curve {
        name: name.into(),
        colour,
        points: trace.force_over_time(from..held(trace).1),
        dashed: false,
    };
    Chart {
        title: "Between skin and vessel, held still".into(),
        x_label: "time, s".into(),
        y_label: "force, N".into(),
        curves: vec![curve("friction cone", 0, cone), curve("eq. 2 as printed", 1, printed)],
        marks: vec![(rests_s, "at rest from here".into())],
        ..Chart::default()
    }
    .svg()
}
