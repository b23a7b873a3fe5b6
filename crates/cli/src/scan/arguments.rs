//! What is asked of a scan on the command line.

use std::path::PathBuf;

use clap::Args;
use takt_rt::Nanoseconds;

use crate::columns::paragraph;
use takt::config::{Interface, Quantity};
use takt::family;

/// Find what is on a bus, and which configuration would drive it
///
/// CANopen nodes are asked what they are (objects 1000, 1018, 1008, 100A), drives with a protocol of their vendor for their version and model,
/// Modbus slaves for registers; devices without a node ID are found by LSS. Nodes that only send are heard. Only reads are sent:
/// nothing moves, and nothing is written to a drive.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0, rs485-canfd:/dev/ttyUSB0; serial:/dev/ttyUSB0[@RATE] for Modbus (may be given
    /// again)
    #[arg(long = "bus", value_name = "INTERFACE", required = true)]
    pub buses: Vec<Interface>,
    /// The lowest node ID, motor ID or slave address to ask
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=247))]
    pub from: u8,
    /// The highest one: up to 127 on a CAN bus, 247 on a serial line
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u8).range(1..=247))]
    pub to: u8,
    /// The bit rate of a CAN bus
    #[arg(long, value_name = "RATE", value_parser = bit_rate, default_value = "1 Mbit/s")]
    pub bit_rate: u32,
    /// The bit rate of the data phase of CAN FD, where the bus carries such frames
    #[arg(long, value_name = "RATE", value_parser = data_bit_rate)]
    pub data_bit_rate: Option<u32>,
    /// The bit rates of a serial line to try, one after the other; without it, that behind @, or 115200 bit/s
    #[arg(long, value_name = "RATE,…", value_delimiter = ',', value_parser = line_rate)]
    pub line_rate: Vec<u32>,
    /// The time to wait for an answer
    #[arg(long, value_name = "TIME", value_parser = wait, default_value = "100 ms")]
    pub wait: Nanoseconds,
    /// Listen to a CAN bus for so long at the least: a heartbeat usually comes once a second
    #[arg(long, value_name = "TIME", value_parser = listening, default_value = "1.2 s")]
    pub listen_for: Nanoseconds,
    /// Send nothing, and show who is heard: on a CAN interface of the kernel also beside a running controller
    #[arg(long, conflicts_with = "stop_motors")]
    pub listen: bool,
    /// Ask motors that answer nothing but commands, too, by the command that stops them: A MOTOR THAT HOLDS A LOAD LETS IT GO
    #[arg(long)]
    pub stop_motors: bool,
    /// Do not look for devices without a node ID (LSS fastscan)
    #[arg(long)]
    pub no_lss: bool,
    /// Print a configuration to start with, in place of the table; what only you can know is marked in it
    #[arg(long, conflicts_with = "json")]
    pub config: bool,
    /// A data sheet (EDS or DCF), which belongs to the nodes with its vendor and product (may be given again)
    #[arg(long, value_name = "FILE")]
    pub eds: Vec<PathBuf>,
    /// Show every frame on standard error
    #[arg(short, long)]
    pub verbose: bool,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
}

/// The command with the end of its help: what is asked with the consent of a person alone. The descriptions of all drives are read for it.
pub fn with_end_of_help(command: clap::Command) -> clap::Command {
    command.after_help(only_with_consent())
}

fn only_with_consent() -> String {
    let protocols = family::all().into_iter().flat_map(|family| family.own_protocols());
    let asked: Vec<String> = protocols
        .filter_map(|protocol| Some(format!("  {}: {}", protocol.name(), protocol.consequence()?)))
        .map(|line| paragraph(&line, 4))
        .collect();
    let before = "Motors of these protocols are only listened for without --stop-motors, because each request changes what they do:";
    let behind = "Such a motor answers its master alone, so that nothing is heard of it on a silent bus.";
    format!("{}\n{}\n{}", paragraph(before, 0), asked.join("\n"), paragraph(behind, 0))
}

fn bit_rate(text: &str) -> Result<u32, String> {
    rate(text, 10_000.0, 1e6).ok_or_else(|| "write it as \"500 kbit/s\", at most 1 Mbit/s".to_owned())
}

fn data_bit_rate(text: &str) -> Result<u32, String> {
    rate(text, 1e5, 8e6).ok_or_else(|| "write it as \"5 Mbit/s\", at most 8 Mbit/s".to_owned())
}

fn line_rate(text: &str) -> Result<u32, String> {
    let plain = text.trim().parse().ok().filter(|rate| (1_200..=4_000_000).contains(rate));
    plain
        .or_else(|| rate(text, 1_200.0, 4e6))
        .ok_or_else(|| "write it as 19200, or \"19200 bit/s\"; several are parted by commas".to_owned())
}

fn rate(text: &str, lowest: f64, highest: f64) -> Option<u32> {
    let rate = Quantity::BIT_RATE.parse(text).ok().filter(|rate| (lowest..=highest).contains(rate));
    rate.map(|rate| rate as u32)
}

fn duration(text: &str, lowest_s: f64, highest_s: f64) -> Option<Nanoseconds> {
    let seconds =
        Quantity::DURATION.parse(text).ok().filter(|seconds| (lowest_s..=highest_s).contains(seconds));
    seconds.map(|seconds| (seconds * 1e9).round() as Nanoseconds)
}

fn wait(text: &str) -> Result<Nanoseconds, String> {
    duration(text, 0.001, 10.0).ok_or_else(|| "write it as \"100 ms\", 1 ms to 10 s".to_owned())
}

fn listening(text: &str) -> Result<Nanoseconds, String> {
    duration(text, 0.0, 3600.0).ok_or_else(|| "write it as \"2 s\", 0 s to 3600 s".to_owned())
}
