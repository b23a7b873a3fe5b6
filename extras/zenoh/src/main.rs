//! `takt-zenoh NAME`: the controller that `takt run CONFIG --serve NAME` serves, in the graph of ROS 2.

use clap::Parser;
use takt_zenoh::{Bridge, BridgeError, Options};

/// Publish the joint states of a takt controller, and carry out joint trajectories with --command, as a node of ROS 2 under rmw_zenoh
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// The name by which the controller is served: takt run CONFIG --serve NAME
    name: String,
    /// The domain of ROS 2
    #[arg(long, env = "ROS_DOMAIN_ID", default_value_t = 0)]
    domain: u32,
    /// The name of the node
    #[arg(long, default_value = "takt")]
    node: String,
    /// The topic of the joint states
    #[arg(long, default_value = "/joint_states")]
    states: String,
    /// Carry out joint trajectories. WARNING: everyone who reaches the endpoints of zenoh commands the axes; there is no password
    #[arg(long)]
    command: bool,
    /// The topic of the joint trajectories
    #[arg(long, requires = "command", default_value = "/joint_trajectory_controller/joint_trajectory")]
    trajectories: String,
    /// Joint states a second
    #[arg(long, value_name = "HZ", default_value_t = 100.0)]
    rate: f64,
    /// An endpoint of zenoh to connect to, as often as wanted; by default the router of rmw_zenoh on this computer
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/localhost:7447")]
    connect: Vec<String>,
    /// An endpoint of zenoh to listen at
    #[arg(long, value_name = "ENDPOINT", default_value = "tcp/localhost:0")]
    listen: Vec<String>,
    /// The other computers have ROS 2 Humble
    #[arg(long)]
    humble: bool,
}

fn main() -> std::process::ExitCode {
    let Arguments { name, domain, node, states, command, trajectories, rate, connect, listen, humble } =
        Arguments::parse();
    let options = Options {
        controller: name,
        domain,
        node,
        states,
        trajectories: command.then_some(trajectories),
        rate_hz: rate,
        connect,
        listen,
        is_humble: humble,
    };
    match run(options) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("takt-zenoh: {error}");
            std::process::ExitCode::FAILURE
        }
    }
}

/// Until the controller ends. Ctrl-C ends this process, and with it its place in the graph; what the controller does goes on.
fn run(options: Options) -> Result<(), BridgeError> {
    let (controller, states, trajectories) =
        (options.controller.clone(), options.states.clone(), options.trajectories.clone());
    let lost = || eprintln!("takt-zenoh: the oldest trajectory was lost: too many wait to be carried out");
    let bridge = Bridge::open(options, lost)?;
    match trajectories {
        None => {
            eprintln!(
                "takt-zenoh: {controller} publishes {states}, and takes no commands (--command lets it)"
            )
        }
        Some(topic) => {
            eprintln!("takt-zenoh: warning: everyone who reaches the endpoints of zenoh commands the axes");
            eprintln!("takt-zenoh: {controller} publishes {states} and takes {topic}");
        }
    }
    bridge.run(|| false, |words| eprintln!("takt-zenoh: {words}"))
}
