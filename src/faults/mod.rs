//! ScenarioFault injection: faults of a bus or a drive, played from a scenario file. They show how a machine reacts
//! (`takt run CONFIG --faults FILE`), and serve tests in virtual time.
//!
//! ```text
//! scenario file ── read ──▶ Scenario ──▶ FaultInjector ── wrap ──▶ FaultyPort(FaultyPort(… the real or simulated
//! port))
//!                                            ▲  │                       one fault each: window, selection, effect
//!                                   triggers │  │ fault events
//!                                            │  ▼
//!                        the state of the group; which faults have begun and ended
//! ```
//!
//! A serial line has no frames. Its requests and replies pass through `LineFaults`, between its master and its port.
//!
//! Every fault is one wrapper around a port, so faults compose. A wrapper allocates no memory after its construction
//! and reads no clock. The same seed gives the same faults in every run. Frames can be changed on any port, drives only
//! where they are simulated.

mod effect;
mod foreign;
mod injectable;
mod injector;
mod line;
mod port;
mod read;
mod scenario;
mod selection;
mod trigger;
mod window;

pub use effect::{DelayPlace, Effect, ForeignFrames, FrameEffect, InterfaceEffect, LineEffect, Part};
pub(crate) use injectable::inject_on_line;
pub use injectable::{Delivery, DriveEffect, InjectError, Injectable};
pub use injector::{FaultEvent, FaultEvents, FaultInjector, Transition};
pub use line::LineFaults;
pub use port::FaultyPort;
pub use read::ScenarioError;
pub use scenario::{Scenario, ScenarioFault};
pub use selection::{Direction, DriveIdentifiers, FrameFunction, Selection};
pub use trigger::{Trigger, TriggerTimes};
pub use window::{FaultProgress, Window};
