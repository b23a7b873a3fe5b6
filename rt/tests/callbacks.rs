//! Callbacks: the owner's function leads a group, once a slot, behind the same guard as everything else.

mod fixture;
mod callbacks {
    pub mod any;
    pub mod commands;
    pub mod lifetime;
    pub mod rig;
    pub mod stops;
    pub mod torques;
}
