//! Frames from interfaces of this machine.

use std::thread;
use std::time::{Duration, Instant};

use takt_rt::linux::MonotonicClock;
use takt_rt::{BusPort, BusState, Clock, Frame, Nanoseconds, ReceiveBatch};

use super::drives::DriveOptions;
use super::session::Session;
use crate::ownership;
use crate::usage_error::UsageError;
use takt::config::Interface;
use takt::link::{InterfaceSettings, LinkPort, RealInterface, SocketCanOptions, open_to_listen};
use takt::telemetry::WallClock;

/// Frames that the kernel keeps until they are read: half a second of a full bus.
const RECEIVE_FRAMES: usize = 1 << 12;
/// The pause between two looks at the buses.
const POLL: Duration = Duration::from_millis(2);
/// Batches that are read from a bus before the next one has its turn.
const BATCHES: usize = 16;
/// The time in milliseconds after which the kernel restarts a controller that is bus-off. It is not set here.
const RESTART_MS: u32 = 100;

/// A bus that is open.
pub struct OpenBus {
    number: usize,
    port: LinkPort,
    state: BusState,
}

/// Opens the interfaces: those that are named, or those of the configuration.
pub fn open(
    wishes: &[String],
    options: &DriveOptions,
    session: &mut Session,
) -> Result<Vec<OpenBus>, UsageError> {
    let mut buses = vec![];
    for (name, interface, number) in interfaces(wishes, session)? {
        let real = RealInterface::of(&interface).ok_or_else(|| {
            format!(
                "the bus `{name}` is simulated, within the process that simulates it: say what it is connected to, \
                 --bus {name}=can0, or watch a log"
            )
        })?;
        let of_config = session.config().zip(number).and_then(|(config, number)| config.buses.get(number));
        let settings = of_config.map_or(
            InterfaceSettings {
                bit_rate: options.bit_rate,
                data_bit_rate: options.data_bit_rate,
                restart_ms: RESTART_MS,
            },
            InterfaceSettings::of,
        );
        let socket = SocketCanOptions {
            bit_rate: settings.bit_rate,
            data_bit_rate: settings.data_bit_rate,
            receive_frames: RECEIVE_FRAMES,
            ..SocketCanOptions::default()
        };
        let port =
            open_to_listen(&name, &real, &settings, &socket).map_err(|error| ownership::not_heard(&error))?;
        let number = session.add_bus(&name, number);
        buses.push(OpenBus { number, port, state: BusState::default() });
    }
    Ok(buses)
}

/// The interfaces with their names, and their numbers in the configuration.
fn interfaces(
    wishes: &[String],
    session: &Session,
) -> Result<Vec<(String, Interface, Option<usize>)>, UsageError> {
    let config = session.config();
    let parse = |text: &str| {
        text.parse::<Interface>().map_err(|error| format!("--bus {text}: {error}: {}", error.help()))
    };
    if wishes.is_empty() {
        let buses = config.map_or(&[][..], |config| &config.buses);
        let all = buses.iter().enumerate();
        return Ok(all.map(|(at, bus)| (bus.name.clone(), bus.interface.clone(), Some(at))).collect());
    }
    let mut found: Vec<(String, Interface, Option<usize>)> = vec![];
    for wish in wishes {
        let (bus, text) = wish.split_once('=').map_or((None, wish.as_str()), |(bus, text)| (Some(bus), text));
        let interface = parse(text)?;
        let number = match (bus, config) {
            (None, None) => None,
            (None, Some(config)) if config.buses.len() == 1 => Some(0),
            (None, Some(config)) => {
                let is_it = |interface: &Interface| interface.to_string() == text;
                let place = config.buses.iter().position(|bus| is_it(&bus.interface));
                let known: Vec<&str> = config.buses.iter().map(|bus| bus.name.as_str()).collect();
                Some(place.ok_or_else(|| {
                    format!(
                        "--bus {wish}: say which bus it is, as NAME={text}; they are: {}",
                        known.join(", ")
                    )
                })?)
            }
            (Some(name), Some(config)) => {
                let known: Vec<&str> = config.buses.iter().map(|bus| bus.name.as_str()).collect();
                let place = known.iter().position(|known| *known == name);
                Some(place.ok_or_else(|| {
                    format!("--bus {wish}: there is no bus {name:?}; they are: {}", known.join(", "))
                })?)
            }
            (Some(_), None) => {
                return Err(format!(
                    "--bus {wish}: a configuration names the buses; without one, say --bus {text}"
                )
                .into());
            }
        };
        if found.iter().any(|(_, known, at)| *known == interface || (number.is_some() && *at == number)) {
            return Err(format!("--bus {wish}: this bus has been named already").into());
        }
        found.push((text.to_owned(), interface, number));
    }
    Ok(found)
}

/// Watches the buses until somebody ends it.
pub fn watch(mut buses: Vec<OpenBus>, session: &mut Session, is_stopped: impl Fn() -> bool) {
    let mut clock = MonotonicClock::default();
    let wall_clock = WallClock::starting_now(clock.now_ns());
    let end = session.duration().and_then(|duration| Instant::now().checked_add(duration));
    let mut frames: Vec<(Nanoseconds, usize, Frame)> = vec![];
    while session.wants_more() && !is_stopped() && end.is_none_or(|end| Instant::now() < end) {
        let now_ns = clock.now_ns();
        for bus in &mut buses {
            receive(bus, now_ns, &mut frames);
        }
        // Where there are several buses, their frames are shown in the order of time.
        frames.sort_by_key(|(at_ns, ..)| *at_ns);
        let is_idle = frames.is_empty();
        for (at_ns, bus, frame) in frames.drain(..) {
            if !session.take(bus, wall_clock.unix_ns(at_ns), None, &frame) {
                break;
            }
        }
        for bus in &mut buses {
            let health = bus.port.health();
            if health.state != bus.state {
                bus.state = health.state;
                session.tell_state(bus.number, health.state, health.errors);
            }
        }
        session.print();
        if is_idle {
            thread::sleep(POLL);
        }
    }
    for bus in &mut buses {
        let health = bus.port.health();
        if matches!(health.state, BusState::BusOff | BusState::Down) {
            session.lose_bus(bus.number, health.state);
        }
        let name = session.buses().get(bus.number).map_or("", |bus| &bus.name).to_owned();
        if health.rx_overruns > 0 {
            session.remark(format!(
                "bus `{name}`: {} frames were lost before they were read",
                health.rx_overruns
            ));
        }
        if health.errors > 0 {
            session.remark(format!("bus `{name}`: {} errors", health.errors));
        }
    }
}

fn receive(bus: &mut OpenBus, now_ns: Nanoseconds, frames: &mut Vec<(Nanoseconds, usize, Frame)>) {
    for _ in 0..BATCHES {
        let mut batch = ReceiveBatch::new();
        bus.port.receive(now_ns, &mut batch);
        frames.extend(batch.iter().map(|received| (received.at_ns, bus.number, received.frame)));
        if !batch.is_full() {
            return;
        }
    }
}
