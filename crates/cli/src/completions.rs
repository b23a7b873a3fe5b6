//! `takt completions`: the subcommands and options of takt for a shell that completes words.

use clap::Args;
use clap_complete::Shell;

use super::exit::Exit;
use super::print;

/// Print what a shell needs to complete the words of takt
///
/// bash: `takt completions bash > ~/.local/share/bash-completion/completions/takt`;
/// zsh: `takt completions zsh > FOLDER/_takt`, where FOLDER is one of those in `$fpath`;
/// fish: `takt completions fish > ~/.config/fish/completions/takt.fish`.
#[derive(Args, Clone, Copy, Debug)]
pub struct Arguments {
    /// The shell
    shell: Shell,
}

/// Prints the script for the shell. `takt` is the whole command line.
pub fn run(arguments: Arguments, takt: &mut clap::Command) -> Exit {
    let mut script = vec![];
    clap_complete::generate(arguments.shell, takt, "takt", &mut script);
    print::text(&String::from_utf8_lossy(&script), Exit::Done)
}
