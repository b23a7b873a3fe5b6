//! Whole controllers in virtual time against simulated drives: interpolated position on YZ-AIMs, every mode of operation
//! of an eRob, what comes on the wire, and what happens when the controller falls silent.

mod world;

mod arrival;
mod interpolation;
mod quirks;
mod silence;
