//! `takt completions`: the subcommands and options of takt for a shell that completes words.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::exit::Exit;
use super::{CommandLine, print};

/// Print what a shell needs to complete the words of takt
///
/// For bash: `takt completions bash > ~/.local/share/bash-completion/completions/takt`.
#[derive(Args, Clone, Copy, Debug)]
pub struct Arguments {
    /// The shell
    shell: Shell,
}

/// Prints the script for the shell.
pub fn run(arguments: Arguments) -> Exit {
    let mut script = vec![];
    clap_complete::generate(arguments.shell, &mut CommandLine::command(), "takt", &mut script);
    print::text(&String::from_utf8_lossy(&script), Exit::Done)
}
