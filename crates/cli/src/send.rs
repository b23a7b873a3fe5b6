//! `takt send`: any frame, once or periodically.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::Duration;

use clap::Args;
use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, BusState, Clock, Frame, Nanoseconds, ReceiveBatch, Received};
use takt_wire::bus_log::Direction;
use takt_wire::bus_log::frame_text::{self, FrameTextError};
use takt_wire::printable::printable;

use takt::config::{Config, Interface, Quantity};
use takt::link::ownership::{BusClaim, ClaimError, IfOwned, MasterTraffic, Ownership};
use takt::link::{InterfaceSettings, LinkPort, RealInterface, SocketCanOptions, open_interface};
use takt::telemetry::WallClock;
use takt_tools::monitor::{BusDecoder, Decoded};

use super::configuration;
use super::exit::Exit;
use super::interruption;
use super::monitor::{Line, LineStyle, TimeStyle, bit_rate};
use super::print::Collected;
use super::usage_error::UsageError;

/// The time in milliseconds after which the kernel restarts a controller that is bus-off.
const RESTART_MS: u32 = 100;
/// How long drives are listened to before the first frame. A drive sends its state in every cycle, or with its heartbeat.
const LISTENING_NS: Nanoseconds = 300_000_000;
/// The pause between two looks at the bus.
const POLL_NS: Nanoseconds = 1_000_000;
/// How long a frame may wait for the bus.
const SENDING_NS: Nanoseconds = 500_000_000;

/// Send a frame: classic, CAN FD, with 29 bits, remote
///
/// 181#3712 is a classic frame with an 11-bit identifier, 00000181#3712 one with 29 bits, 701#R a remote frame, 123##1DEADBEEF one of
/// CAN FD, whose first digit is 1 for bit-rate switching. Dots may separate the bytes.
///
/// Nothing is sent where another master is active, a running takt or another one, or where a drive is heard that has torque.
#[derive(Args, Debug)]
pub struct Arguments {
    /// The frame; several are sent one behind the other
    #[arg(value_name = "FRAME", required = true)]
    frames: Vec<String>,
    /// The interface: can0, vcan0 …, slcan:/dev/ttyACM0; with a configuration also NAME=INTERFACE, or the name of a bus
    #[arg(long, value_name = "INTERFACE")]
    bus: String,
    /// The configuration (TOML): then the drives and what they obey are known, and answers have its names and units
    #[arg(long, value_name = "FILE.toml")]
    config: Option<PathBuf>,
    /// Send so many times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..))]
    count: u64,
    /// The time from one to the next
    #[arg(long, value_name = "TIME", value_parser = period, default_value = "100 ms")]
    period: Nanoseconds,
    /// Show for so many seconds what comes back
    #[arg(long, value_name = "S", allow_negative_numbers = true, value_parser = configuration::seconds)]
    wait: Option<Duration>,
    /// Send even if a master is active or a drive has torque. The drives may move
    #[arg(long)]
    force: bool,
    /// The bit rate of the bus without a configuration
    #[arg(long, value_name = "RATE", value_parser = bit_rate, default_value = "1 Mbit/s")]
    bit_rate: u32,
    /// The bit rate of the data phase of CAN FD without a configuration
    #[arg(long, value_name = "RATE", value_parser = bit_rate)]
    data_bit_rate: Option<u32>,
    /// Print each frame as one JSON object in a line
    #[arg(long)]
    json: bool,
}

fn period(text: &str) -> Result<Nanoseconds, String> {
    let seconds = Quantity::DURATION.parse(text).ok().filter(|seconds| (0.0001..=3600.0).contains(seconds));
    let period = seconds.map(|seconds| (seconds * 1e9).round() as Nanoseconds);
    period.ok_or_else(|| "write it as \"10 ms\", 0.1 ms to 3600 s".to_owned())
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Exit {
    match send(arguments) {
        Ok(exit) => exit,
        Err(error) => error.print(arguments.json),
    }
}

/// The bus that frames are sent on.
struct Bus {
    name: String,
    claim: BusClaim,
    settings: InterfaceSettings,
    decoder: BusDecoder,
}

fn send(arguments: &Arguments) -> Result<Exit, UsageError> {
    let frames =
        arguments.frames.iter().map(|text| frame_text::parse(text).map_err(|error| wrong(text, error)));
    let frames: Vec<Frame> = frames.collect::<Result<_, _>>()?;
    let mut bus = bus(arguments)?;
    let is_fd = frames.iter().any(Frame::is_fd);
    if is_fd && bus.settings.data_bit_rate.is_none() && matches!(bus.claim.interface, RealInterface::Slcan(_))
    {
        return Err(
            "an adapter needs the bit rate of the data phase for CAN FD: --data-bit-rate \"5 Mbit/s\"".into(),
        );
    }
    let stopped = interruption::watch().map_err(|error| format!("cannot watch for Ctrl-C: {error}"))?;
    let is_stopped = || stopped.load(Ordering::Relaxed);
    // It is held until the end, so that no other master begins in between.
    let _ownership = match arguments.force {
        true => None,
        false => {
            let claimed = Ownership::claim(vec![bus.claim.clone()], IfOwned::Refuse);
            Some(claimed.map_err(|error| refused(&error))?)
        }
    };
    let mut port = open(&bus)?;
    let mut clock = MonotonicClock::default();
    if !arguments.force
        && let Some(enabled) = enabled_drive(&mut port, &mut clock, &mut bus.decoder, is_stopped)
    {
        return Err(format!(
            "bus `{}`: {enabled} has torque. Nothing was sent. Disable it first (`takt drive … disable`), or add --force: it may \
             move then",
            bus.name
        )
        .into());
    }
    if is_stopped() {
        return Ok(Exit::Interrupted);
    }
    let mut shown = Shown::new(&mut clock, arguments.json, bus.name.clone());
    let sent = send_all(arguments, &frames, &mut port, &mut clock, &mut bus.decoder, &mut shown, &is_stopped);
    shown.printed.print();
    if let Err(words) = sent {
        say!("takt: {words}");
        return Ok(Exit::Stopped);
    }
    Ok(shown.exit(is_stopped()))
}

/// Why nothing is sent. Only another master is overruled by --force.
fn refused(error: &ClaimError) -> String {
    match error {
        ClaimError::Held { .. } | ClaimError::OtherMaster { .. } => {
            format!("{error}, or add --force: the drives may move then")
        }
        _ => error.to_string(),
    }
}

/// Names what is wrong with the text of a frame, and points at it.
fn wrong(text: &str, error: FrameTextError) -> String {
    let before = text.get(..error.at).unwrap_or(text).chars().count();
    format!("{error}\n  {}\n  {}^", printable(text).replace(['\n', '\t'], " "), " ".repeat(before))
}

fn bus(arguments: &Arguments) -> Result<Bus, UsageError> {
    let wish = &arguments.bus;
    let parse = |text: &str| {
        text.parse::<Interface>().map_err(|error| format!("--bus {wish}: {error}: {}", error.help()))
    };
    let simulated = || {
        format!(
            "--bus {wish}: a simulated bus is within the process that simulates it; `takt sim … --pty` puts one behind an adapter"
        )
    };
    let Some(path) = &arguments.config else {
        let interface = RealInterface::of(&parse(wish)?).ok_or_else(simulated)?;
        let settings = InterfaceSettings {
            bit_rate: arguments.bit_rate,
            data_bit_rate: arguments.data_bit_rate,
            restart_ms: RESTART_MS,
        };
        let name = interface.to_string();
        let traffic = MasterTraffic::of_any_node();
        let claim = BusClaim { bus: name.clone(), interface, settings, traffic };
        return Ok(Bus { name, claim, settings, decoder: BusDecoder::with_drives(&[]) });
    };
    let mut config = configuration::load(path, &[])?;
    let number = number(&mut config, wish, parse)?;
    let claim = BusClaim::of(&config, number).ok_or_else(simulated)?;
    let (name, settings) = (claim.bus.clone(), claim.settings);
    Ok(Bus { name, claim, settings, decoder: BusDecoder::of(&config, number) })
}

/// The number of the bus, with the interface that is wished for.
fn number(
    config: &mut Config,
    wish: &str,
    parse: impl Fn(&str) -> Result<Interface, String>,
) -> Result<usize, UsageError> {
    let known: Vec<String> = config.buses.iter().map(|bus| bus.name.clone()).collect();
    let place = |name: &str| known.iter().position(|known| known == name);
    if let Some(place) = place(wish) {
        return Ok(place);
    }
    let (name, text) = match wish.split_once('=') {
        Some((name, text)) => (name, text),
        None => match known.as_slice() {
            [only] => (only.as_str(), wish),
            _ => {
                let known = known.join(", ");
                return Err(
                    format!("--bus {wish}: say which bus it is, as NAME={wish}; they are: {known}").into()
                );
            }
        },
    };
    let Some(place) = place(name) else {
        return Err(format!("--bus {wish}: there is no bus {name:?}; they are: {}", known.join(", ")).into());
    };
    parse(text)?;
    config.override_interface(name, text).map_err(|error| format!("--bus {wish}: {error}"))?;
    Ok(place)
}

fn open(bus: &Bus) -> Result<LinkPort, UsageError> {
    let options = SocketCanOptions {
        bit_rate: bus.settings.bit_rate,
        data_bit_rate: bus.settings.data_bit_rate,
        ..SocketCanOptions::default()
    };
    open_interface(&bus.name, &bus.claim.interface, &bus.settings, &options)
        .map_err(|error| error.to_string().into())
}

/// Listens for a drive that has torque, and names it.
fn enabled_drive(
    port: &mut LinkPort,
    clock: &mut MonotonicClock,
    decoder: &mut BusDecoder,
    is_stopped: impl Fn() -> bool,
) -> Option<String> {
    let end_ns = clock.now_ns().saturating_add(LISTENING_NS);
    while clock.now_ns() < end_ns && !is_stopped() {
        let now_ns = clock.now_ns();
        let mut batch = ReceiveBatch::new();
        port.receive(now_ns, &mut batch);
        for received in &batch {
            let decoded = decoder.decode(&received.frame);
            if decoded.shows_torque == Some(true) {
                return Some(decoded.who);
            }
        }
        clock.wait_until(now_ns + POLL_NS);
    }
    None
}

fn send_all(
    arguments: &Arguments,
    frames: &[Frame],
    port: &mut LinkPort,
    clock: &mut MonotonicClock,
    decoder: &mut BusDecoder,
    shown: &mut Shown,
    is_stopped: &impl Fn() -> bool,
) -> Result<(), String> {
    let mut due_ns = clock.now_ns();
    for time in 0..arguments.count {
        if time > 0 {
            due_ns = due_ns.saturating_add(arguments.period);
            listen(port, clock, decoder, shown, due_ns, is_stopped);
        }
        if is_stopped() || shown.printed.has_no_reader() {
            return Ok(());
        }
        for frame in frames {
            hand_over(port, clock, frame, is_stopped)?;
            shown.add(clock.now_ns(), Direction::Sent, frame, &decoder.decode(frame));
        }
        shown.printed.print();
    }
    // Whoever closes a socket at once takes away what still waits in it.
    let heard = confirm(port, clock, is_stopped)?;
    if let Some(wait) = arguments.wait {
        let wait_ns = Nanoseconds::try_from(wait.as_nanos()).unwrap_or(Nanoseconds::MAX);
        let end_ns = clock.now_ns().saturating_add(wait_ns);
        heard.iter().for_each(|received| shown.add_received(received, decoder));
        listen(port, clock, decoder, shown, end_ns, is_stopped);
    }
    Ok(())
}

/// Hands a frame to the interface.
fn hand_over(
    port: &mut LinkPort,
    clock: &mut MonotonicClock,
    frame: &Frame,
    is_stopped: &impl Fn() -> bool,
) -> Result<(), String> {
    let end_ns = clock.now_ns().saturating_add(SENDING_NS);
    loop {
        let now_ns = clock.now_ns();
        if port.send(now_ns, &[*frame]) == 1 {
            return Ok(());
        }
        if now_ns >= end_ns || is_stopped() {
            return Err(format!("{frame:?} was not taken by the interface: {}", cure(port)));
        }
        thread::sleep(Duration::from_nanos(POLL_NS));
    }
}

/// Waits until every frame was on the bus, which a port tells of what it has read. Returns what was received meanwhile.
fn confirm(
    port: &mut LinkPort,
    clock: &mut MonotonicClock,
    is_stopped: &impl Fn() -> bool,
) -> Result<Vec<Received>, String> {
    let end_ns = clock.now_ns().saturating_add(SENDING_NS);
    let mut heard = vec![];
    loop {
        let now_ns = clock.now_ns();
        let mut batch = ReceiveBatch::new();
        port.receive(now_ns, &mut batch);
        heard.extend(batch.iter().copied());
        let waiting = port.unconfirmed(now_ns);
        if waiting == 0 || is_stopped() {
            return Ok(heard);
        }
        if now_ns >= end_ns {
            return Err(match waiting {
                1 => format!("a frame was not seen on the bus: {}", cure(port)),
                _ => format!("{waiting} frames were not seen on the bus: {}", cure(port)),
            });
        }
        thread::sleep(Duration::from_nanos(POLL_NS));
    }
}

fn cure(port: &mut LinkPort) -> &'static str {
    match port.health().state {
        BusState::Down => "the interface is down",
        BusState::BusOff => "the controller is off the bus; check wiring, termination and bit rate",
        BusState::ErrorPassive => {
            "nobody acknowledges it; check wiring, termination, bit rate, and whether a drive is on"
        }
        BusState::ErrorActive => {
            "it has no room, or cannot carry such frames (CAN FD needs `ip link set … mtu 72`)"
        }
    }
}

/// Shows what comes until this time.
fn listen(
    port: &mut LinkPort,
    clock: &mut MonotonicClock,
    decoder: &mut BusDecoder,
    shown: &mut Shown,
    end_ns: Nanoseconds,
    is_stopped: &impl Fn() -> bool,
) {
    loop {
        let now_ns = clock.now_ns();
        let mut batch = ReceiveBatch::new();
        port.receive(now_ns, &mut batch);
        batch.iter().for_each(|received| shown.add_received(received, decoder));
        shown.printed.print();
        if now_ns >= end_ns || is_stopped() || shown.printed.has_no_reader() {
            return;
        }
        clock.wait_until((now_ns + POLL_NS).min(end_ns));
    }
}

/// What was sent and received, as it is printed.
struct Shown {
    style: LineStyle,
    is_json: bool,
    bus: String,
    wall_clock: WallClock,
    begin_ns: Nanoseconds,
    printed: Collected,
}

impl Shown {
    fn new(clock: &mut MonotonicClock, is_json: bool, bus: String) -> Self {
        let begin_ns = clock.now_ns();
        Self {
            style: LineStyle::new(TimeStyle::Start),
            is_json,
            bus,
            wall_clock: WallClock::starting_now(begin_ns),
            begin_ns,
            printed: Collected::default(),
        }
    }

    fn add(&mut self, at_ns: Nanoseconds, direction: Direction, frame: &Frame, decoded: &Decoded) {
        let line = Line {
            since_ns: at_ns.saturating_sub(self.begin_ns),
            unix_ns: self.wall_clock.unix_ns(at_ns),
            bus: &self.bus,
            direction: Some(direction),
            frame,
            decoded,
        };
        match self.is_json {
            true => line.json(&mut self.printed.text),
            false => self.style.line(&line, &mut self.printed.text),
        }
    }

    fn add_received(&mut self, received: &Received, decoder: &mut BusDecoder) {
        let frame = &received.frame;
        self.add(received.at_ns, Direction::Received, frame, &decoder.decode(frame));
    }

    fn exit(&self, is_interrupted: bool) -> Exit {
        match self.printed.failed() {
            Some(failed) => failed,
            None if is_interrupted => Exit::Interrupted,
            None => Exit::Done,
        }
    }
}
