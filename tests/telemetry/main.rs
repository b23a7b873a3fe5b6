//! The logger over a run in virtual time: what it writes, what it reckons, and what it does when it cannot write.

mod black_box;
mod failures;
mod reader;
mod recording;
mod report;
mod run;
mod thread;
