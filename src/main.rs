//! takt.
fn main() {}
