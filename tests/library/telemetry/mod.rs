//! The logger of a run in virtual time: its files, its statistics, and its behaviour when it cannot write.

mod black_box;
mod failures;
mod groups;
mod reader;
mod recording;
mod report;
mod run;
mod thread;
