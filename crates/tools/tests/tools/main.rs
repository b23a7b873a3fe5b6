//! Commissioning and scans.

mod canopen_lss;
mod commission;
mod scan;
