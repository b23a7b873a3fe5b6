//! `takt panel`, and the options of the panel that `takt run` has too.

use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;

use crate::panel::{self, Listening, PanelOptions};
use crate::remote;

use super::exit::Exit;
use super::interruption;
use super::usage_error::UsageError;

/// How often it is looked whether the panel is to end.
const LOOK: Duration = Duration::from_millis(50);

/// Who may open the panel.
#[derive(Args, Debug)]
pub struct AccessArguments {
    /// A file with the token that pages of the panel must give; needed where it listens elsewhere than on loopback
    #[arg(long = "panel-token", value_name = "FILE")]
    token: Option<PathBuf>,
    /// Where a reverse proxy shows the panel, as https://robot.example
    #[arg(long = "panel-origin", value_name = "ORIGIN")]
    origins: Vec<String>,
}

impl AccessArguments {
    /// Begins to listen.
    pub fn listen(&self, address: SocketAddr) -> Result<Listening, UsageError> {
        let token = self.token.as_deref().map(token).transpose()?;
        let options = PanelOptions { address, token, origins: self.origins.clone() };
        Listening::begin(&options).map_err(|error| error.to_string().into())
    }
}

/// The first line of a file.
fn token(path: &Path) -> Result<String, UsageError> {
    let text = fs::read_to_string(path).map_err(|error| {
        UsageError::from(format!("the token cannot be read from {}: {error}", path.display()))
    })?;
    Ok(text.lines().next().unwrap_or_default().trim().to_owned())
}

/// Says where a panel is to be opened.
pub fn greeting(address: SocketAddr) -> String {
    format!("the panel is at http://{address}/, until Ctrl-C")
}

/// Show and command a controller of another process (`takt run --serve NAME`) in the browser.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The name that the controller is served by
    name: String,
    /// Where the panel listens: a host and a port, or a port on loopback
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", value_parser = panel::address)]
    address: SocketAddr,
    #[command(flatten)]
    access: AccessArguments,
}

/// Shows it until Ctrl-C, or until the controller ends.
pub fn run(arguments: &Arguments) -> Exit {
    let interrupted = match interruption::watch() {
        Ok(interrupted) => interrupted,
        Err(error) => {
            say!("takt: cannot watch for Ctrl-C: {error}");
            return Exit::Stopped;
        }
    };
    let client = match remote::connect(&arguments.name) {
        Ok(client) => client,
        Err(error) => return UsageError::from(error.to_string()).print(false),
    };
    let listening = match arguments.access.listen(arguments.address) {
        Ok(listening) => listening,
        Err(error) => return error.print(false),
    };
    let lease = client.clone();
    let take_lease: panel::TakeLease = Box::new(move || lease.take_over());
    let panel = match listening.show(client.clone(), Some(take_lease)) {
        Ok(panel) => panel,
        Err(error) => {
            say!("takt: {error}");
            return Exit::Stopped;
        }
    };
    say!("takt: {}", greeting(panel.address()));
    while !interrupted.load(Ordering::Relaxed) {
        std::thread::sleep(LOOK);
        if client.has_ended() {
            say!("takt: the controller has ended");
            return Exit::Done;
        }
    }
    Exit::Interrupted
}
