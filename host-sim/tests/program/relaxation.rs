//! Tissue that relaxes under a needle whose hand has stopped.

use crate::common::{folder, run_well, text};
use control_core::event::State;
use recording::read::Recording;
use recording::stretches::stretches;

/// Into the shoulder's muscle at 3 mm/s by a hand of a stiffness in N/mm, and a rest of 4 s; the
/// task marks the moment at which the hand stops.
const PROCEDURE: &str = "format = 1\nname = \"rest\"\npurpose = \"injection\"\nstart_mm = -2.0\n\
     [hand]\nstiffness_n_per_mm = HAND\ndamping_n_s_per_mm = 0.02\ntremor_mm = 0.0\nseed = 1\n\
     [[step]]\nname = \"in\"\npast = \"muscle\"\nby_mm = 8.0\nspeed_mm_s = 3.0\n\
     [[step]]\nname = \"rest\"\nseconds = 4.0\ntask = \"aspirate\"\n\
     [[step]]\nname = \"out\"\nto_mm = -2.0\nseconds = 3.0\n";

/// A tracking wall of 0.8 N/mm at a scale of 0.65 and a hand of k N/mm in series relax with
/// 300 ms · (1 + 0.52/k), worked by hand: 316, 331 and 456 ms.
#[test]
fn tissue_relaxes_from_the_moment_that_the_hand_stops() {
    for (hand, wanted_ms) in [("10.0", 316.0), ("5.0", 331.0), ("1.0", 456.0)] {
        let dir = folder(&format!("relaxation-{hand}"));
        let (procedure, recorded) = (dir.join("rest.toml"), dir.join("a.mcap"));
        std::fs::write(&procedure, PROCEDURE.replace("HAND", hand)).expect("it can be written");
        let (procedure, recorded) = (text(&procedure), text(&recorded));
        run_well(&[
            "run",
            "--headless",
            "--fast",
            "--profile",
            "shoulder",
            "--seconds",
            "20",
            "--procedure",
            procedure,
            "--record",
            recorded,
        ]);
        let stretch = stretches(&Recording::read(recorded.as_ref()).expect("it was recorded")).remove(0);
        let stop = stretch.tasks.iter().find(|done| done.name == "aspirate").expect("it is done").tick;
        let begin = (stop - stretch.first_tick) as usize;
        let rest = &stretch.samples[begin..begin + 39_000];
        let force = |at: usize| stretch.hello.force_n(rest[at].dac);
        let (first, last) = (force(0), force(rest.len() - 1));
        assert!(first > 1.3 && last < 0.7 * first, "{hand} N/mm: from {first:.3} to {last:.3} N");
        let left = |at: &usize| force(*at) - last <= (first - last) / std::f64::consts::E;
        let found_ms = (0..rest.len()).find(left).expect("it relaxes") as f64 * 0.1;
        assert!((found_ms / wanted_ms - 1.0).abs() < 0.1, "{hand} N/mm: {found_ms} ms, not {wanted_ms}");
        let punctures = rest[500..].iter().filter(|sample| sample.state == State::Puncture as u8).count();
        assert_eq!(punctures, 0, "{hand} N/mm: at rest it reads as a puncture");
    }
}
