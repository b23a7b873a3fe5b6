//! Commissioning procedures against the simulated drives, in virtual time.

mod bench;
mod erob;
mod yz_aim;
