//! Faults on purpose: the wrapper, the files, and what the controller does about each kind, in virtual time.

mod arm;
mod command;
mod deaf_drives;
mod drives;
mod files;
mod gantry;
mod late_drives;
mod lost_heartbeat;
mod reactions;
mod rearming;
mod repeatability;
mod unreachable;
mod wrapper;
