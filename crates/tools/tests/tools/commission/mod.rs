//! Commissioning procedures against the simulated drives, in virtual time.

mod bench;
mod cia402;
mod erob;
mod yz_aim;
