//! The tests of the control core from outside, in one program.

mod anatomy;
mod compensation;
mod excitations;
mod faults;
mod laws;
mod line;
mod needle;
mod orders;
mod protections;
mod ranges;
mod refusals;
mod sequences;
mod sparte;
mod stability;
mod twin;
mod xr;
