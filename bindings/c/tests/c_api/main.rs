//! takt as a user installs it, and programs compiled against it.

mod header;
mod latency;
mod library;
mod programs;
mod ros2_control;
mod served;
