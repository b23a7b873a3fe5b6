//! Nodes of drives that are known by their data sheets: how they are supervised, and several axes of one.

mod guarding;
mod listening_bus;
mod machine;
mod shared_commands;
mod two_axes;
