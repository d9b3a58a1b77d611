//! Forces of any form over the motion, as columns: they represent physics without a name.

use super::laws::Columns;
use super::sight::Sight;
use crate::effects::Effect;
use crate::effects::definition::FREE;
use crate::estimation::nominal::Nominal;
use crate::selection::free_form::{Basis, Inputs, Warps, points};

/// The forms that are tried: those of the command hold the very disturbance that is to be
/// explained.
const FORMS: [Inputs; 5] =
    [Inputs::Speed, Inputs::Travel, Inputs::TravelSpeed, Inputs::SinceReversalSpeed, Inputs::TimeSpeed];

/// Returns the columns of forms; each coefficient is about `sd`, N·m or N. `instead` is the effect
/// that they replace, `fits` how many of the recordings are fitted.
pub(crate) fn forms<'a>(
    sights: &'a [Sight],
    fits: usize,
    nominal: &'a Nominal,
    instead: &'a Effect,
    sd: f64,
) -> impl Iterator<Item = Columns> + 'a {
    let all: Vec<_> = sights.iter().map(|sight| points(sight.track)).collect();
    let warps = Warps::of(&all[..fits], nominal.rig.turn());
    FORMS.into_iter().map(move |inputs| {
        let basis = Basis::new(inputs, &warps);
        let see = |(sight, points): (&Sight, &Vec<_>)| -> Vec<Vec<f64>> {
            basis.columns(sight.track, points, 1.0).iter().map(|input| sight.see_input(input)).collect()
        };
        let of: Vec<_> = sights.iter().zip(&all).map(see).collect();
        let bounds = vec![FREE; of[0].len()];
        Columns { effect: instead.clone(), of, own: false, bounds, sd }
    })
}
