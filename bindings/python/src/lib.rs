//! The Python package `takt`: the library's controller, commanded from Python.
//!
//! The real-time thread and all others of a controller are those of the library: they know nothing of Python, and never hold or wait for
//! the interpreter's lock. Every call that can take long releases it ([`waiting`]), so that other threads of the program go on, and looks
//! for signals, so that Ctrl-C works.
//!
//! Arrays come and go as bytes, by two functions of numpy ([`array`]). So one extension module serves every Python from 3.10 on and every
//! numpy, and nothing is compiled against either.
//!
//! | file | subject |
//! | --- | --- |
//! | [`arm`] | `Arm`: starts and owns a controller in real time, or connects to one |
//! | [`simulation`] | `Simulation`: the same in virtual time |
//! | [`group`] | what an arm, or a group of its axes, can be told |
//! | [`motion`], [`stream`] | a motion under way; points of a stream |
//! | [`server`] | lets other processes observe and command |
//! | [`state`], [`events`], [`recording`] | what is seen |
//! | [`config`], [`array`], [`error`] | what goes in and comes out: configurations, numpy, exceptions |
//! | [`link`], [`owner`], [`waiting`] | the way to the controller, its life, and waiting without the lock |
//!
//! `python/takt/_takt.pyi` has the types.
#![allow(unnameable_types, missing_copy_implementations, reason = "nobody but Python uses this crate")]

mod arm;
mod array;
mod config;
mod error;
mod events;
mod group;
mod link;
mod motion;
mod owner;
mod recording;
mod server;
mod simulation;
mod state;
mod stream;
mod waiting;

/// The compiled part of the package `takt`.
#[pyo3::pymodule]
mod _takt {
    /// The version of the package.
    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python calls it so")]
    const __version__: &str = env!("CARGO_PKG_VERSION");

    #[pymodule_export]
    use crate::arm::{Arm, connect};
    #[pymodule_export]
    use crate::events::{Event, Events};
    #[pymodule_export]
    use crate::group::{Axis, Group};
    #[pymodule_export]
    use crate::link::after_fork;
    #[pymodule_export]
    use crate::motion::Motion;
    #[pymodule_export]
    use crate::owner::close_all;
    #[pymodule_export]
    use crate::recording::Recording;
    #[pymodule_export]
    use crate::server::Server;
    #[pymodule_export]
    use crate::simulation::{Simulation, simulate};
    #[pymodule_export]
    use crate::state::State;
    #[pymodule_export]
    use crate::stream::Stream;
}
