//! The bounds of the bus arithmetic against the simulated bus, whose frames are as long as their bits and stuff bits
//! are: no simulated response is ever later than its bound, and constructed cases come close.

mod frames;
mod responses;
mod slots;
mod traffic;
