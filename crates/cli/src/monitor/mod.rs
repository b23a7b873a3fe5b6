//! `takt monitor`: every frame of a bus with its meaning.

mod drives;
mod line;
mod live;
mod log_file;
mod session;
mod statistics;
mod watched_bus;

use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::Duration;

use clap::Args;
use takt_wire::bus_log::{LogFormat, LogWriter};

use takt::config::Config;
use takt_tools::monitor::{FrameFilter, IdFilter, ServiceKind};

use super::configuration;
use super::exit::Exit;
use super::interruption;
use super::usage_error::UsageError;
use drives::DriveOptions;
pub use drives::bit_rate;
pub use line::{Line, LineStyle, TimeStyle};
use session::{Session, SessionOptions};

/// Show every frame of a bus with its meaning, live or from a file
///
/// Live: `takt monitor --bus can0`, or `takt monitor arm.toml` for every bus of a configuration. It listens beside a running controller and
/// sends nothing. From a file: a log of candump (`-l`, or what it prints), pcapng, CSV, or a black box of takt; `-` is standard input.
/// With a configuration, axes have their names and process data their units; without one, the mapping of PDOs is learnt from the SDO
/// traffic that is seen. `>` goes to the drives, `<` comes from them.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The log, and behind it the configuration (TOML) of its buses; or the configuration alone
    #[arg(value_name = "FILE")]
    files: Vec<PathBuf>,
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0; with a configuration also NAME=INTERFACE (repeatable)
    #[arg(long = "bus", value_name = "INTERFACE")]
    buses: Vec<String>,
    #[command(flatten)]
    drives: DriveOptions,
    #[command(flatten)]
    filter: Filter,
    /// Show rates and the load of the bus at the end, and no frames
    #[arg(long)]
    stats: bool,
    /// End after this many seconds (a log: of its own time)
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    duration: Option<Duration>,
    /// End after this many frames
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    count: Option<u64>,
    /// What the time of a frame is counted from
    #[arg(long, value_enum, default_value_t = TimeStyle::Start)]
    time: TimeStyle,
    /// Write the frames to this file, too; its end says how: .log (candump -l), .txt (candump), .pcapng (Wireshark), .csv
    #[arg(long, short, value_name = "FILE")]
    write: Option<PathBuf>,
    /// Show no frames
    #[arg(long, short)]
    quiet: bool,
    /// Print each frame as one JSON object in a line
    #[arg(long)]
    json: bool,
}

/// Which frames are shown.
#[derive(Args, Debug)]
struct Filter {
    /// Only these identifiers: 181, 180:780 (ID:MASK), 080~7FF (all others), 00000181 with 29 bits (repeatable)
    #[arg(long = "id", value_name = "ID", help_heading = "Which frames", value_parser = id_filter)]
    ids: Vec<IdFilter>,
    /// Only from and to this node (repeatable)
    #[arg(long = "node", value_name = "N", help_heading = "Which frames")]
    nodes: Vec<u8>,
    /// Only those that concern this axis (repeatable)
    #[arg(long = "axis", value_name = "NAME", help_heading = "Which frames")]
    axes: Vec<String>,
    /// Only of these kinds: nmt, sync, time, emcy, heartbeat, sdo, pdo, lss, drive, other
    #[arg(long = "kind", value_name = "KIND", help_heading = "Which frames", value_delimiter = ',')]
    kinds: Vec<ServiceKind>,
}

fn id_filter(text: &str) -> Result<IdFilter, String> {
    text.parse().map_err(|error: takt_tools::monitor::IdFilterError| error.to_string())
}

/// What is watched.
enum Source {
    /// Interfaces of this machine.
    Live,
    /// A file; `None` is standard input.
    File(Option<PathBuf>),
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Exit {
    match watch(arguments) {
        Ok(exit) => exit,
        Err(error) => error.print(arguments.json),
    }
}

fn watch(arguments: &Arguments) -> Result<Exit, UsageError> {
    let (source, config) = source(arguments)?;
    let config = config.map(|path| configuration::load(path, &[])).transpose()?;
    if config.is_some() && arguments.drives.names_some() {
        return Err("a configuration says which drives there are: leave --family and --eds out".into());
    }
    let options = session_options(arguments, config.as_ref())?;
    let mut session = Session::new(options, config, arguments.drives.named()?);
    let stopped = interruption::watch().map_err(|error| format!("cannot watch for Ctrl-C: {error}"))?;
    let is_stopped = || stopped.load(Ordering::Relaxed);
    match source {
        Source::Live => {
            let buses = live::open(&arguments.buses, &arguments.drives, &mut session)?;
            live::watch(buses, &mut session, is_stopped);
        }
        Source::File(path) => log_file::read(path.as_deref(), &mut session, is_stopped)?,
    }
    Ok(session.finish(is_stopped()))
}

/// The log and the configuration among the files.
fn source(arguments: &Arguments) -> Result<(Source, Option<&Path>), UsageError> {
    let is_config = |path: &Path| path.extension().is_some_and(|end| end == "toml");
    let mut source = if arguments.buses.is_empty() { None } else { Some(Source::Live) };
    let mut config = None;
    for path in &arguments.files {
        let shown = path.display();
        if is_config(path) {
            if config.replace(path.as_path()).is_some() {
                return Err(format!("{shown}: there is a configuration already").into());
            }
        } else if source.is_some() {
            return Err(format!(
                "{shown}: one log, or interfaces (--bus), are watched at a time; the name of a configuration ends with .toml"
            )
            .into());
        } else {
            source = Some(Source::File((path != Path::new("-")).then(|| path.clone())));
        }
    }
    match source {
        Some(source) => Ok((source, config)),
        None if config.is_some() => Ok((Source::Live, config)),
        None => Err("say what to watch: --bus can0, a configuration, or a log".into()),
    }
}

fn session_options(arguments: &Arguments, config: Option<&Config>) -> Result<SessionOptions, UsageError> {
    let names = config.map_or(&[][..], |config| &config.axes);
    let axes = arguments.filter.axes.iter().map(|name| {
        names.iter().position(|axis| axis.name == *name).ok_or_else(|| {
            let known: Vec<&str> = names.iter().map(|axis| axis.name.as_str()).collect();
            match known.as_slice() {
                [] => "--axis: a configuration names the axes; without one, say --node".to_owned(),
                known => format!("--axis: there is no axis {name:?}; the axes are: {}", known.join(", ")),
            }
        })
    });
    let filter = FrameFilter {
        ids: arguments.filter.ids.clone(),
        nodes: arguments.filter.nodes.clone(),
        axes: axes.collect::<Result<_, _>>()?,
        kinds: arguments.filter.kinds.clone(),
    };
    let log = arguments.write.as_deref().map(begin_log).transpose()?;
    Ok(SessionOptions {
        filter,
        shows_frames: !arguments.quiet && !arguments.stats,
        shows_statistics: arguments.stats,
        is_json: arguments.json,
        time: arguments.time,
        duration: arguments.duration,
        count: arguments.count,
        log,
        bit_rate: arguments.drives.bit_rate,
        data_bit_rate: arguments.drives.data_bit_rate,
    })
}

fn begin_log(path: &Path) -> Result<session::OpenLog, UsageError> {
    let shown = path.display();
    let Some(format) = LogFormat::of(path) else {
        let ends: Vec<String> = LogFormat::WORDS.iter().map(|(word, _)| format!(".{word}")).collect();
        return Err(format!(
            "--write {shown}: the end of its name says how it is written: {}",
            ends.join(", ")
        )
        .into());
    };
    let failed = |error| format!("--write {shown}: {error}");
    let file = std::fs::File::create_new(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => format!("--write {shown}: there is such a file already"),
        _ => failed(error),
    })?;
    let writer = LogWriter::begin(BufWriter::new(file), format).map_err(failed)?;
    Ok(session::OpenLog { writer, path: path.to_owned() })
}
