//! Faults on purpose: what can go wrong on a bus or in a drive, played from a scenario file, so that a machine's reaction
//! can be rehearsed (`takt run CONFIG --faults FILE`) and tested in virtual time.
//!
//! ```text
//!  scenario file ── read ──▶ Scenario ──▶ Rehearsal ── wrap ──▶ FaultyPort(FaultyPort(… the real or simulated port))
//!                                            │  ▲                   each one fault: window, selection, effect
//!                                 cues, tidings │
//!                                            ▼  │
//!                                    what the group does, what has begun and ended
//! ```
//!
//! Every fault is one wrapper around a port, so they compose. A wrapper takes no heap memory after its construction, asks
//! no clock, and is the same in every run with the same seed. Frames can be broken on any port; drives only where they
//! are simulated.

mod breakable;
mod cue;
mod effect;
mod foreign;
mod port;
mod read;
mod rehearsal;
mod scenario;
mod selection;
mod window;

pub use breakable::{Breakable, CannotBreak, DriveTrouble, Heard};
pub use cue::{Cue, Cues};
pub use effect::{DelayPlace, Effect, ForeignFrames, FrameEffect, InterfaceEffect, Part};
pub use port::FaultyPort;
pub use read::ScenarioError;
pub use rehearsal::{Rehearsal, Tiding, Tidings, Turn};
pub use scenario::{Fault, Scenario};
pub use selection::{Direction, FrameFunction, Selection};
pub use window::{Course, Window};
