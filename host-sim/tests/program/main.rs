//! The tests of the program and of the crates behind it, in one program: one link instead of
//! twenty-four.

mod acceptance;
mod audit;
mod axes;
mod bone;
mod cannulation;
mod characterise;
#[cfg(all(unix, feature = "class"))]
mod class;
#[cfg(all(target_os = "linux", feature = "class"))]
mod class_hostile;
mod command_line;
mod commission;
mod common;
mod compensate;
mod demo;
mod export_into;
mod fit_force;
mod force_depth;
mod glossary;
mod guide;
mod guide_page;
mod hand;
mod hostile;
mod import;
mod import_refused;
mod link_faults;
mod model;
mod papers_page;
mod patients;
mod plant;
mod recordings;
mod relaxation;
mod safety_page;
#[cfg(unix)]
mod serial;
mod settle;
mod simulate;
mod strangers;
mod strangers_faults;
mod strangers_kept;
mod streams;
mod training;
