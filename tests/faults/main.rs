//! Faults on purpose: the wrapper, the files, and what the controller does about each kind, in virtual time.

mod arm;
mod command;
mod drives;
mod files;
mod gantry;
mod late_drives;
mod lost_heartbeat;
mod pdo_unreachable;
mod reactions;
mod rearming;
mod repeatability;
mod unreachable;
mod wrapper;
