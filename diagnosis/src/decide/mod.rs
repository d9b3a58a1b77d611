//! The decision: which effects are named, how sure each is, and the verdict. Confidence is set here
//! and nowhere else, and the numbers that decide are in [`thresholds`].

pub(crate) mod acceptance_criteria;
pub(crate) mod against_forms;
pub(crate) mod assess;
pub(crate) mod by_regression;
pub(crate) mod choice;
pub(crate) mod confidence;
pub(crate) mod confidence_pass;
pub(crate) mod contenders;
pub(crate) mod decision;
pub(crate) mod decisive;
pub(crate) mod diagnosis;
pub(crate) mod elimination;
mod evidence_rows;
pub(crate) mod evidence_table;
pub(crate) mod free_form_check;
pub(crate) mod material;
pub(crate) mod out_of_library;
pub(crate) mod patched_rig;
pub(crate) mod rejection;
pub(crate) mod rivals;
pub(crate) mod thresholds;
pub(crate) mod verdict;
pub(crate) mod weighed_model;
