//! Is this machine fit for the loop? `takt doctor`.
//!
//! Only [`Source`] reads files and runs programs. The checks take texts, so that any machine can be judged from a copy of
//! its files. Scheduling and memory locking are tried out in a separate thread by [`attempt`]. [`self_test`](SelfTest)
//! runs the loop.
//!
//! ```text
//! Source ──▶ kernel, isolation, processor, memory, rights, threads, can, serial ──▶ Finding ─┐
//! attempt ─▶ rights                                                                          ├─▶ Examination ─▶ JSON, text
//! jitter ──▶ SelfTest ───────────────────────────────────────────────────────────────────────┘
//! ```

mod attempt;
mod boot;
mod can;
mod cpu_list;
mod distribution;
mod examination;
mod finding;
mod isolation;
mod kernel;
mod memory;
mod processor;
mod render;
mod rights;
mod self_test;
mod serial;
mod source;
mod subject;
mod threads;

pub use attempt::attempt;
pub use examination::{Examination, examine};
pub use finding::{Finding, Group, Verdict};
pub use self_test::{Grade, SelfTest};
pub use source::{CommandFailure, Source};
pub use subject::{Subject, WantedBus};
