//! The choice between the model of what the regression names and the one that the filter found.

use crate::decide::assess::{self, Assessment};
use crate::decide::by_regression::by_regression;
use crate::decide::diagnosis::Reason;
use crate::decide::elimination::Found;
use crate::decide::thresholds::CLEARLY_LESS;
use crate::evidence::prepared::Prepared;
use crate::evidence::residuals::above;
use regression::Hypothesis;

/// Assesses what the regression names and what the filter found, and takes one of the two.
pub(crate) fn assessed(
    prepared: &Prepared,
    found: Found,
    rounds: &[Vec<Hypothesis>],
) -> Result<Assessment, Reason> {
    let by_regression = by_regression(prepared, &found, rounds);
    let by_regression = by_regression.and_then(|found| assess::assess(prepared, found).ok());
    let by_filter = assess::assess(prepared, found);
    let by_regression = by_regression.filter(|one| !one.weighed.named().is_empty() && lowers_error(one));
    match (by_regression, by_filter) {
        (Some(one), Ok(other)) if !is_taken(&one, &other) => Ok(other),
        (Some(mut one), Ok(other)) => {
            one.weighed.is_beside(&other.weighed);
            Ok(one)
        }
        (Some(one), Err(_)) => Ok(one),
        (None, by_filter) => by_filter,
    }
}

/// True if the model of the regression's names is taken and not what the filter found: it is unless
/// the other leaves clearly less of the force error of the fitted recordings, above the noise of
/// reading whole counts. Held-out recordings choose nothing.
fn is_taken(by_regression: &Assessment, by_filter: &Assessment) -> bool {
    let part_left = |one: &Assessment| {
        let table = one.table();
        let above_noise = |rms: f64| above(rms, one.weighed.floor, 0.0);
        above_noise(table.patched.fit) / above_noise(table.refit.fit).max(1e-300)
    };
    match &by_filter.foreign {
        // Physics without a name that is sure is kept where it leaves as little.
        Some(foreign) => 1.0 - foreign.share >= part_left(by_regression),
        None if by_filter.weighed.named().is_empty() => true,
        None => part_left(by_filter) >= CLEARLY_LESS.powi(2) * part_left(by_regression),
    }
}

/// True if the named effects together take a material part off the held-out force error.
fn lowers_error(one: &Assessment) -> bool {
    assess::is_material(one.table())
}
