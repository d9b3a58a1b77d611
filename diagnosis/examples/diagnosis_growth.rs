//! The time of a diagnosis of ten seconds at 1 kHz to fit and as many to hold out, of a hundred,
//! and of a thousand: `cargo run --release -p diagnosis --example diagnosis_growth`. Prints
//! `work.diagnose.rows.…=…` for each, in s.

#[path = "../tests/behaviour/common.rs"]
mod common;

use common::{Setup, record, rig};
use std::time::Instant;

const SECONDS: [f64; 3] = [10.0, 100.0, 1_000.0];

fn main() {
    let rig = rig([0.1, 0.2, -0.2, 0.05], "offset = 0.0");
    for seconds in SECONDS {
        let effect = "stribeck_friction";
        let setup =
            Setup { effect, size: 1.0, closed: false, rate: 1_000.0, seconds, disturbance: 0.05, seed: 9 };
        let (fit, held) = (record(&setup, 1), record(&setup, 2));
        let rows = fit.len() + held.len();
        let begin = Instant::now();
        let outcome = diagnosis::diagnose_recordings(&rig, &[fit], &[held], &|_, _| {});
        println!("work.diagnose.rows.{rows}={:.4}", begin.elapsed().as_secs_f64());
        assert!(outcome.is_ok(), "the recording can be diagnosed");
    }
}
