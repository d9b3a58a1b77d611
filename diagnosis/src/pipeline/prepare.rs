//! The first stage: recordings cut into blocks, the nominal model refitted, and what both need
//! before any effect is looked for.

use super::Progress;
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::prepared::Prepared;
use crate::evidence::residuals::{drive_force, forces};
use crate::fit::blocked_recording::{BlockedRecording, Jumps};
use crate::fit::filter::Noise;
use crate::fit::force_residual::Estimator;
use crate::fit::linear_fit::Fit;
use crate::fit::lost_counts::{self, JumpPrior};
use crate::fit::model::Model;
use crate::fit::noise::{self, Colour};
use crate::fit::nominal::Nominal;
use crate::fit::{quasi_static, refit, skew};
use crate::laws::{Effect, EffectName};
use crate::propose::candidates::span_of;
use crate::propose::context::FittedModel;
use crate::repair::Checked;

/// Cuts recordings into blocks, refits the nominal model, and looks for lost counts; `skew_rows`
/// are the rows by which commands act late, where that is known.
pub(crate) fn prepare(rig: &Rig, checked: &Checked, skew_rows: Option<f64>, progress: Progress) -> Prepared {
    let (fit, holdout) = (&*checked.fit, &*checked.holdout);
    let cut = |all: &[Recording]| all.iter().map(|r| BlockedRecording::moving(r, rig)).collect::<Vec<_>>();
    let (mut tracks, mut judging) = (cut(fit), cut(holdout));
    let mut nominal = Nominal { one_way: checked.is_one_way, ..Nominal::of(rig) };
    quasi_static::add_inertia(&mut nominal, &mut tracks, &mut judging);
    progress("refitting the nominal model", 0.1);
    let (mut noise, mut refit) = refit::settle(&mut nominal, &mut tracks);
    if let Some(rows) = skew_rows {
        skew::delay_commands(&mut tracks, rows);
        nominal.skew_rows = skew_rows;
    } else if nominal.virtual_inertia == 0.0 {
        let scale = refit::acceleration_scale(&nominal, &tracks);
        skew::settle(&mut nominal, &mut tracks, &noise, scale);
    }
    if let Some(rows) = nominal.skew_rows {
        skew::delay_commands(&mut judging, rows);
        (noise, refit) = refit::settle(&mut nominal, &mut tracks);
    }
    let scale = refit::acceleration_scale(&nominal, &tracks);
    nominal.is_balanced = is_balanced(&refit, &nominal, &tracks, &noise, scale);
    let span = span_of(&tracks, &nominal);
    let search = JumpSearch { nominal: &nominal, count: span.count, noise: &noise, scale };
    let spread = search.find(&mut tracks, JumpPrior::UNKNOWN, None);
    let asked = if spread.is_some() { JumpPrior::KNOWN } else { JumpPrior::UNKNOWN };
    let first = Fit::new(&Model::default(), &nominal, &tracks, &noise);
    let first = FittedModel { model: Model::default(), noise, fit: first, log_score: 0.0 };
    let mut holdout = HoldoutSet::new(judging);
    holdout.follow(&first, &nominal, &span, scale);
    search.find(&mut holdout.filtered, asked, spread);
    holdout.share_jumps();
    for (r, track) in tracks.iter_mut().enumerate() {
        (track.place, track.bias) = (Some(r), first.fit.bias(r));
    }
    let unsought = Vec::new();
    Prepared { given: rig.clone(), nominal, fit: tracks, holdout, span, scale, noise, unsought }
}

/// Part of the force that a refit may leave for the forces to be in balance.
const BALANCED: f64 = 0.5;

/// True if a refit explains most of the force.
fn is_balanced(
    refit: &Fit,
    nominal: &Nominal,
    tracks: &[BlockedRecording],
    noise: &Noise,
    scale: f64,
) -> bool {
    let estimator = Estimator::new(tracks, noise, scale);
    let left = forces(&estimator, tracks, &refit.totals(tracks), nominal.rig.model.inertia);
    let force = drive_force(nominal, &estimator, tracks);
    estimator.rms(&left, tracks) < BALANCED * estimator.rms(&force, tracks)
}

/// The context of a search for lost counts.
struct JumpSearch<'a> {
    nominal: &'a Nominal,
    /// One count, rad or m.
    count: f64,
    noise: &'a Noise,
    scale: f64,
}

impl JumpSearch<'_> {
    /// Looks for lost counts in every recording under the null, and again with the noise that is
    /// left without them and with the knowledge that counts get lost; gives how many are lost at a
    /// time, as travel. Held-out recordings take that, `spread`, from the fitted ones.
    fn find(
        &self,
        tracks: &mut [BlockedRecording],
        mut asked: JumpPrior,
        spread: Option<f64>,
    ) -> Option<f64> {
        let nominal = self.nominal;
        let mut noise = *self.noise;
        let mut sizes = Vec::new();
        for _ in 0..2 {
            sizes.clear();
            for track in tracks.iter_mut() {
                let alone = std::slice::from_ref(&*track);
                let fit = Fit::new(&Model::default(), nominal, alone, &noise);
                let found = lost_counts::find(track, &fit, self.count, asked, spread);
                track.jumps = Jumps { lost: found.lost, price: found.price };
                sizes.extend(found.sizes);
            }
            if sizes.is_empty() {
                return None;
            }
            asked = JumpPrior::KNOWN;
            let of_jumps = EffectName::ALL.iter().filter(|name| name.definition().is_of_jumps());
            let effects = of_jumps.map(|name| Effect::shaped(*name, &[])).collect();
            let model = Model { effects, ..Model::default() };
            let totals = Fit::new(&model, nominal, tracks, &noise).totals(tracks);
            noise = noise::estimate(tracks, &totals, &noise, self.scale, Colour::White);
        }
        Some(lost_counts::spread_of(&sizes, self.count))
    }
}
