use super::*;
use crate::decide::rivals::leader;
use crate::evidence::effect_evidence::Rival;
use crate::laws::{Effect, EffectName};

fn gain(sum: f64, low: f64, z: f64) -> Gain {
    Gain { sum, low, high: 2.0 * sum, z, clipped_z: z }
}

/// An effect that is sure everywhere.
fn found() -> EffectEvidence {
    EffectEvidence {
        effect: Effect::shaped(EffectName::QuadraticDrag, &[]),
        score_z: 0.0,
        rivals: Vec::new(),
        holdout: gain(500.0, 300.0, 8.0),
        fit: gain(900.0, 600.0, 9.0),
        force: gain(0.9, 0.6, 5.0),
        off_force: 0.5,
        share: 0.9,
        at_bound: false,
        is_comb: true,
        sizes: vec![1.0, 1.02, 0.95],
    }
}

fn may_be_named(change: impl FnOnce(&mut EffectEvidence)) -> bool {
    let mut found = found();
    change(&mut found);
    found.rejection().is_none()
}

#[test]
fn a_gain_from_few_moments_must_be_large_everywhere() {
    let rare = |found: &mut EffectEvidence| {
        found.holdout = gain(500.0, -60.0, 1.6);
        found.force.low = -1e-6;
        found.share = 0.95;
    };
    assert!(may_be_named(rare));
    assert!(!may_be_named(|found| {
        rare(found);
        found.share = 0.8;
    }));
    assert!(!may_be_named(|found| {
        rare(found);
        found.sizes[2] = 0.5;
    }));
    let fitted = |z: f64| {
        may_be_named(|found| {
            rare(found);
            found.fit = gain(900.0, 100.0, z);
        })
    };
    assert!(fitted(2.6) && !fitted(2.0));
}

#[test]
fn a_rejection_is_the_requirement_that_is_not_met() {
    let rejection = |change: fn(&mut EffectEvidence)| {
        let mut found = EffectEvidence { sizes: vec![1.0, 2.0], ..found() };
        change(&mut found);
        found.rejection().expect("it is rejected")
    };
    let less_likely = rejection(|found| found.holdout = gain(-12.0, -50.0, -1.0));
    assert_eq!(less_likely, Rejection::LessLikely { nats: 12.0 });
    let unlikely = rejection(|found| found.holdout = gain(661.0, 10.0, 1.4));
    assert_eq!(unlikely, Rejection::UnlikelyGain { z: 1.4 });
    let none = rejection(|found| found.holdout = gain(661.0, -10.0, 2.4));
    assert_eq!(none, Rejection::MayGainNothing { gain: gain(661.0, -10.0, 2.4) });
    let hardly = rejection(|found| {
        found.fit = gain(90.0, 10.0, 2.5);
        found.share = 0.4;
    });
    assert_eq!(hardly, Rejection::NotSure { fit_z: 2.5, holdout_z: 8.0, share: 0.4 });
    let little = rejection(|found| (found.share, found.fit) = (0.03, gain(90.0, 10.0, 4.0)));
    assert_eq!(little, Rejection::SmallAndUnsure { share: 0.03, least: SHARE, z: 4.0 });
    assert_eq!(rejection(|found| found.share = 0.002), Rejection::TooSmall { share: 0.002 });
    let searched = EffectEvidence { holdout: gain(661.0, 10.0, 1.4), sizes: vec![1.0, 2.0], ..found() };
    let unsure = Rejection::NotSureInSearch { fit_z: 9.0, filter_z: 1.4, share: 0.9 };
    assert_eq!(searched.rejection_in_search(), Some(unsure));
}

#[test]
fn a_rare_effect_is_sure_by_its_score_and_bristles_are_not() {
    let rare = |name| {
        may_be_named(|found| {
            found.effect = Effect::shaped(name, &[]);
            (found.fit, found.holdout) = (gain(60.0, -5.0, 1.2), gain(40.0, -5.0, 1.3));
            (found.share, found.score_z) = (0.3, 7.0);
        })
    };
    assert!(rare(EffectName::CommandSaturation) && !rare(EffectName::PreslidingFriction));
    assert!(!may_be_named(|found| {
        (found.fit, found.holdout) = (gain(60.0, -5.0, 1.2), gain(40.0, -5.0, 1.3));
        (found.share, found.score_z) = (0.3, 2.0);
    }));
}

#[test]
fn what_is_rare_where_it_was_fitted_must_recur() {
    let rare = |found: &mut EffectEvidence| {
        found.fit = gain(900.0, 100.0, 1.8);
        found.holdout = gain(1400.0, 500.0, 2.7);
    };
    assert!(may_be_named(rare));
    assert!(!may_be_named(|found| {
        rare(found);
        found.sizes[1] = 2.0;
    }));
    assert!(!may_be_named(|found| {
        rare(found);
        found.force.low = -0.1;
    }));
}

#[test]
fn one_moment_suffices_if_the_effect_harms_nowhere() {
    let once = |found: &mut EffectEvidence| {
        found.fit = gain(900.0, 100.0, 1.4);
        found.holdout = gain(300.0, -5.0, 1.0);
        found.force = gain(0.2, -1e-4, 1.0);
        found.share = 0.93;
    };
    assert!(may_be_named(once));
    assert!(may_be_named(|found| {
        once(found);
        found.share = 0.6;
    }));
    let harms: [fn(&mut EffectEvidence); 4] = [
        |found| found.holdout.low = -60.0,
        |found| found.force.low = -0.05,
        |found| (found.share, found.sizes[2]) = (0.85, 0.8),
        |found| found.sizes[2] = 0.6,
    ];
    for change in harms {
        assert!(!may_be_named(|found| {
            once(found);
            change(found);
        }));
    }
}

#[test]
fn readings_that_jump_need_not_explain_most() {
    let few = |name| {
        may_be_named(|found| {
            found.effect = Effect::shaped(name, &[]);
            found.holdout = gain(650.0, 230.0, 2.4);
            found.share = 0.16;
        })
    };
    assert!(few(EffectName::MissedCounts) && !few(EffectName::PreslidingFriction));
}

#[test]
fn what_is_hardly_sure_must_explain_most() {
    let hardly = |share: f64| {
        may_be_named(|found| {
            found.fit = gain(130.0, 30.0, 2.2);
            found.sizes[1] = 1.25;
            found.share = share;
        })
    };
    assert!(hardly(0.8) && !hardly(0.6));
    assert!(may_be_named(|found| found.share = 0.6));
}

#[test]
fn a_right_law_leaves_little_and_is_as_large_everywhere() {
    assert!(found().fits_everywhere());
    assert!(!EffectEvidence { share: 0.6, ..found() }.fits_everywhere());
    assert!(!EffectEvidence { sizes: vec![1.0, 1.5], ..found() }.fits_everywhere());
    assert!(!EffectEvidence { force: gain(0.3, 0.1, 3.0), ..found() }.fits_everywhere());
}

#[test]
fn a_small_part_must_be_certain() {
    assert!(may_be_named(|found| found.share = 0.04));
    assert!(!may_be_named(|found| (found.share, found.force.sum) = (0.005, 0.4)));
    assert!(may_be_named(|found| found.share = 0.005), "it takes most of what the others leave");
    assert!(!may_be_named(|found| {
        found.share = 0.04;
        found.holdout = gain(50.0, 20.0, 4.0);
    }));
    let beside_more = |found: &mut EffectEvidence| {
        found.share = 0.02;
        (found.holdout.z, found.holdout.clipped_z) = (5.0, 20.0);
    };
    assert!(may_be_named(beside_more), "it takes most of what the others leave");
    assert!(!may_be_named(|found| {
        beside_more(found);
        found.force.sum = 0.4;
    }));
}

#[test]
fn a_promising_effect_gains_where_fitted_and_harms_nowhere() {
    let mut half = found();
    half.holdout = gain(300.0, -20.0, 1.5);
    half.force.low = -0.1;
    half.share = 0.3;
    assert!(half.rejection().is_some() && half.is_provisional());
    half.holdout = gain(-10.0, -50.0, -0.5);
    assert!(half.is_provisional());
    half.holdout = gain(-50.0, -90.0, -1.5);
    assert!(!half.is_provisional());
}

#[test]
fn an_effect_that_takes_less_than_a_twentieth_is_not_named() {
    let part = |off_force| EffectEvidence { off_force, ..found() };
    assert_eq!(part(0.04).immaterial(), Some(Rejection::Immaterial { part: 0.04 }));
    assert_eq!(part(0.06).immaterial(), None);
}

#[test]
fn no_rival_leads_by_held_out_recordings() {
    let rival = |name, fit_z, z| {
        let effect = Effect::shaped(name, &[]);
        Rival { name, effect, z, fit_z, lead: -40.0, held_out_lead: -60.0, is_absent: false }
    };
    let leads = |rivals| leader(&[EffectEvidence { rivals, ..found() }], &[]).map(|(_, one)| one.name);
    let ahead_held_out = rival(EffectName::Cogging, 0.5, -6.0);
    assert_eq!(leads(vec![ahead_held_out.clone()]), None);
    let ahead = rival(EffectName::Backlash, -1.5, 3.0);
    assert_eq!(leads(vec![ahead_held_out, ahead]), Some(EffectName::Backlash));
}
