//! The simulated bus and the simulated eRob joint, as a master sees them.

mod bench;
mod motion;
mod vectors;
