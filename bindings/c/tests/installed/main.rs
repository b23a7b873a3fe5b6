//! takt as a user installs it, and programs compiled against it.

mod library;
mod programs;
mod served;
