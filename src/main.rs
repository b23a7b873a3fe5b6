//! The program `takt`: its command line is in the library, whose private parts it uses.

use std::process::ExitCode;

fn main() -> ExitCode {
    takt::program()
}
