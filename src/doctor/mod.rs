//! Is this machine fit for the loop? `takt doctor`.
//!
//! [`Source`] reads files and asks programs, and nothing else does; everything that judges takes texts, so that any
//! machine can be judged from a copy of its files. What only an attempt can tell (scheduling, locking of memory) is
//! attempted in a thread of its own by [`attempt`], and [`self_test`](SelfTest) runs the loop.
//!
//! ```text
//! Source ──▶ kernel, isolation, processor, memory, rights, threads, can ──▶ Finding ─┐
//! attempt ─▶ rights                                                                  ├─▶ Examination ─▶ JSON, picture
//! jitter ──▶ SelfTest ───────────────────────────────────────────────────────────────┘
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
mod picture;
mod processor;
mod rights;
mod self_test;
mod source;
mod subject;
mod threads;

pub use attempt::attempt;
pub use examination::{Examination, examine};
pub use finding::{Finding, Group, Verdict};
pub use self_test::{Grade, SelfTest};
pub use source::{CommandFailure, Source};
pub use subject::{Subject, WantedBus};
