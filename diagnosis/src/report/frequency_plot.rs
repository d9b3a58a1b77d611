//! The frequency response of a recording and its simulations: magnitude, phase and coherence.

use crate::report::motion_picture::{class, legend, words};
use crate::simulation::comparison::Comparison;
use html_report::drawing::path;
use html_report::plot::{close, log_frame};
use html_report::safe;
use numerics::spectrum::Band;
use std::fmt::Write as _;

/// Coherence from which a magnitude and a phase are drawn.
const COHERENT: f64 = 0.5;

/// A quantity of a band, where it is drawn.
type Quantity = fn(&Band) -> Option<f64>;
/// A quantity, its label, and its range where that is known.
type Plotted<'a> = (Quantity, &'a str, Option<(f64, f64)>);

fn magnitude(band: &Band) -> Option<f64> {
    let [re, im] = band.response;
    (band.coherence >= COHERENT && re.hypot(im) > 0.0).then(|| 20.0 * re.hypot(im).log10())
}

/// Degrees, from -270 to 90: a speed follows a command or lags behind it.
fn phase(band: &Band) -> Option<f64> {
    let [re, im] = band.response;
    let degrees = im.atan2(re).to_degrees();
    (band.coherence >= COHERENT).then_some(if degrees > 90.0 { degrees - 360.0 } else { degrees })
}

fn coherence(band: &Band) -> Option<f64> {
    Some(band.coherence)
}

/// Draws the responses of the recording and of the models that are `wanted`; nothing where the
/// recording is too short for one.
pub(super) fn draw(out: &mut String, compared: &Comparison, wanted: &[&str], command_unit: &str) {
    let Some(found) = &compared.response else { return };
    let ends = (found.recorded[0].hertz, found.recorded[found.recorded.len() - 1].hertz);
    if ends.1 <= ends.0 {
        return;
    }
    let models: Vec<_> = found
        .models
        .iter()
        .filter(|(name, bands)| wanted.contains(&name.as_str()) && !bands.is_empty())
        .collect();
    let _ = write!(
        out,
        "<section><h2>Frequency response: {}</h2><p class=note>Speed over command by Welch's method, recorded and in a free run under the \
         recorded command, where the command has at least a ten-thousandth of its strongest power and the encoder sees the motion; magnitude and phase where the coherence is at least {COHERENT}. \
         Low coherence means noise, dry friction or another nonlinear force. If a controller ran, the recorded response is that of the closed loop.</p>",
        safe(&compared.file)
    );
    legend(out, &models.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>());
    let per = format!("magnitude, dB of 1 {}/s per {command_unit}", compared.kind.length());
    let quantities: [Plotted; 3] = [
        (magnitude, &per, None),
        (phase, "phase, degrees", None),
        (coherence, "coherence", Some((0.0, 1.05))),
    ];
    for (quantity, label, range) in quantities {
        let values =
            || found.recorded.iter().chain(models.iter().flat_map(|(_, bands)| bands)).filter_map(quantity);
        let (low, high) = values().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
        if low > high {
            continue;
        }
        let room = (0.1 * (high - low)).max(1.0);
        let at = log_frame(out, ends, range.unwrap_or((low - room, high + room)), "frequency, Hz", label);
        let mut curve = |class: &str, name: &str, bands: &[Band]| {
            let _ = write!(out, "<path class=\"motion {class}\" data-name=\"{}\" d=\"", safe(name));
            path(out, bands.iter().map(|band| quantity(band).map(|x| at(band.hertz, x))));
            out.push_str("\"/>");
        };
        for (name, bands) in &models {
            curve(class(name), words(name), bands);
        }
        curve("r", "recorded", &found.recorded);
        close(out, "frequency, Hz");
    }
    out.push_str("</section>");
}
