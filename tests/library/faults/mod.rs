//! Fault injection: the wrapper, the files, and the controller's reaction to each kind, in virtual time.

mod arm;
mod disobedience;
mod drives;
mod files;
mod gantry;
mod late_drives;
mod line_effects;
mod lost_heartbeat;
mod on_a_line;
mod pdo_unreachable;
mod reactions;
mod rearming;
mod repeatability;
mod unreachable;
mod unreached;
mod without_canopen;
mod wrapper;
