//! `diagnose RIG FIT[,FIT…] HELD[,HELD…] [DIR]`: the ten lines for the terminal, with the time it
//! took.

use diagnosis::{Request, diagnose};
use std::path::PathBuf;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.len() < 3 {
        eprintln!("diagnose RIG FIT[,FIT…] HELD[,HELD…] [DIR]");
        std::process::exit(2);
    }
    let list = |text: &str| text.split(',').map(PathBuf::from).collect();
    let request = Request {
        rig: PathBuf::from(&arguments[0]),
        fit: list(&arguments[1]),
        holdout: list(&arguments[2]),
        ..Request::default()
    };
    let start = std::time::Instant::now();
    match diagnose(&request, &|_, _| ()) {
        Ok(outcome) => {
            print!("{}", outcome.summary());
            println!("  took {:.2} s", start.elapsed().as_secs_f64());
            if let Some(dir) = arguments.get(3) {
                outcome.write(&PathBuf::from(dir)).expect("the folder can be written");
            }
        }
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(2);
        }
    }
}
