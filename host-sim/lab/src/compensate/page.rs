//! Before and after, as a page that needs no other file.

use super::CompensationOutcome;
use super::residual_force::{PARTS, ResidualForce};
use control_core::compensation::Gain;
use html_report::chart::{Chart, Curve};
use html_report::{Cell, Sheet, decimal};

/// The page.
pub fn html(outcome: &CompensationOutcome) -> String {
    let (before, after) = (&outcome.before, &outcome.after);
    let not_kept =
        if outcome.is_compensated { "" } else { " No part of it helped: the device is as it was before." };
    let lead = format!(
        "Of the mechanism's own forces a hand would have felt {} mN and feels {} mN now (root mean square over insertion, hold and \
         withdrawal at 10 mm/s; the device's servo stood in for the hand).{not_kept}",
        decimal(before.all() * 1e3, 1),
        decimal(after.all() * 1e3, 1)
    );
    let mut sheet = Sheet::new("What the hand feels beyond the law", &lead);
    sheet.table(&["", "before, mN rms", "after, mN rms", "after/before"], &ways(before, after));
    sheet.figures(&[(by_tenth(before, after).svg(), "Way in and way out together.".into())]);
    sheet.heading("What is fed forward");
    sheet.table(&["part", "found", "gain"], &parts(outcome));
    if let Some(weight) = outcome.weight_mnm {
        sheet.note(&format!(
            "The report has no weight. It was measured by the slow turn, level and tilted: {} mN·m with the needle straight down.",
            decimal(weight, 3)
        ));
    }
    if let Some(was) = &outcome.as_it_was {
        sheet.note(&format!(
            "The device fed something forward before, with which the hand felt {} mN; \"before\" is the mechanism without it.",
            decimal(was.all() * 1e3, 1)
        ));
    }
    for sentence in outcome.taken_back.iter().chain(&outcome.left_out) {
        sheet.note(sentence);
    }
    if let Some(angle) = outcome.angle {
        sheet.note(&format!(
            "The rotor's angle was found by the slow turn: zero at {} counts, agreement {}. After a restart it is found again \
             (compensate --align); until then nothing that depends on it is fed forward.",
            angle.count,
            decimal(angle.agreement, 2)
        ));
    }
    sheet.finish()
}

/// The forces by direction of motion, in mN rms.
fn ways(before: &ResidualForce, after: &ResidualForce) -> [Vec<Cell>; 4] {
    let row = |what: &str, before: f64, after: f64| {
        vec![
            Cell::text(what),
            Cell::number(Some(before * 1e3), 1),
            Cell::number(Some(after * 1e3), 1),
            Cell::number(Some(after / before.max(1e-9)), 2),
        ]
    };
    [
        row("insertion", before.insertion, after.insertion),
        row("hold", before.hold, after.hold),
        row("withdrawal", before.withdrawal, after.withdrawal),
        row("all", before.all(), after.all()),
    ]
}

/// The forces along the travel.
fn by_tenth(before: &ResidualForce, after: &ResidualForce) -> Chart {
    let steps = |values: &[f64; PARTS]| -> Vec<(f64, f64)> {
        let step = |(tenth, force): (usize, &f64)| {
            let (from, to) = (10.0 * tenth as f64, 10.0 * (tenth + 1) as f64);
            [(from, force * 1e3), (to, force * 1e3)]
        };
        values.iter().enumerate().flat_map(step).collect()
    };
    let curve = |name: &str, colour, values| Curve {
        name: name.into(),
        colour,
        points: steps(values),
        dashed: false,
    };
    Chart {
        title: "By tenth of the travel".into(),
        x_label: "travel, %".into(),
        y_label: "force, mN rms".into(),
        curves: vec![curve("before", 5, &before.by_tenth), curve("after", 0, &after.by_tenth)],
        ..Chart::default()
    }
}

fn parts(outcome: &CompensationOutcome) -> Vec<Vec<Cell>> {
    let found = &outcome.record.device.compensation;
    let mut rows = Vec::new();
    let mut put = |part: &str, value: String, gain: Gain| {
        rows.push(vec![
            Cell::text(part),
            Cell::text(value),
            Cell::number(Some(f64::from(gain.0) / 256.0), 2),
        ]);
    };
    let mnm = |torque: fixed::types::I16F16| format!("{} mN·m", decimal(torque.to_num(), 3));
    for wave in found.angle.iter().take_while(|wave| wave.order != 0) {
        put(&format!("{} times a turn", wave.order), mnm(wave.amplitude), found.gains.angle);
    }
    for (way, friction) in [("inwards", found.inwards), ("outwards", found.outwards)] {
        let value = format!(
            "{} and {} mN·s/mm",
            mnm(friction.dry.0),
            decimal(friction.viscous.0.to_num::<f64>() * 1e3, 4)
        );
        put(&format!("friction {way}"), value, found.gains.friction);
    }
    put("weight, needle down", mnm(found.weight.0), found.gains.weight);
    put("drive's offset", mnm(found.offset.0), found.gains.drive);
    put("drive's deadband, half its width", mnm(found.deadband.0), found.gains.drive);
    for wave in found.ripple.iter().take_while(|wave| wave.order != 0) {
        let share = format!("{} % of the torque", decimal(wave.amplitude.to_num::<f64>() * 100.0, 1));
        put(&format!("ripple, {} times a turn", wave.order), share, found.gains.drive);
    }
    rows
}
