//! Callbacks: the owner's function leads a group, once a slot, behind the same guard as everything else.

mod any;
mod commands;
mod lifetime;
mod rig;
mod stops;
mod torques;
