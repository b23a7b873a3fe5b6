//! Nodes of drives that are known by their data sheets: how they are supervised.

mod guarding;
mod listening_bus;
mod machine;
