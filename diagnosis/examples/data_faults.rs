//! `data_faults RIG FIT[,FIT…] HELD[,HELD…]`: the faults of recordings, without a search.

use diagnosis::data_faults;
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use std::path::Path;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [rig, fit, holdout] = &arguments[..] else {
        eprintln!("data_faults RIG FIT[,FIT…] HELD[,HELD…]");
        std::process::exit(2);
    };
    let read = |list: &str| -> Vec<Recording> {
        list.split(',').map(|path| Recording::read(Path::new(path)).expect("it can be read")).collect()
    };
    let rig = Rig::read(Path::new(rig)).expect("it can be read");
    for fault in data_faults(&rig, &read(fit), &read(holdout)) {
        println!("{}: {:?} {:.4} {}", fault.file, fault.kind, fault.value, fault.unit);
    }
}
