//! Runs the loop without any motion and measures its timing.

use std::sync::Arc;
use std::time::Duration;

use takt_rt::{BusHealth, Request, SlotPlan};

use takt::channels::{ChannelSizes, LogSide, channels};
use takt::config::{Config, ConfigError, Interface, Realtime};
use takt::controller::assemble::{self, AssembleError};
use takt::controller::port::Port;
use takt::controller::realtime_thread::{self, Begun, LoopParts, StartError, ThreadSetup};
use takt::family;
use takt::link::OpenError;
use takt::link::interface_status;
use takt::link::ownership::{ClaimError, IfOwned, Ownership};
use takt::sleep_alignment;
use takt::telemetry::Statistics;

/// The pause between two polls of the loop; the ring of cycle records holds many times as much.
const PAUSE: Duration = Duration::from_millis(5);

/// One axis, because a loop needs at least one, of any family that needs no more than its name. It is never activated.
fn passive() -> String {
    let any = family::all().into_iter().find(|family| family.unconfigured().is_some());
    let word = any.map_or("", |family| family.word());
    format!(
        r#"
name = "jitter"
master = {{ heartbeat = "off" }}

[[bus]]
name = "bus"

[[axis]]
name = "passive"
bus = "bus"
node = 1
drive = "{word}"
limits = {{ position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }}
"#
    )
}

/// What to measure.
#[derive(Clone, Debug, PartialEq)]
pub struct JitterOptions {
    /// The period of the cycle.
    pub period_ns: u64,
    /// How many cycles.
    pub cycles: u64,
    /// The interface that SYNC is sent to; `None` leaves it out.
    pub interface: Option<Interface>,
    /// What is asked of the operating system. Its spin guard counts for [`Pacing::SleepThenSpin`] only.
    pub realtime: Realtime,
}

impl Default for JitterOptions {
    /// Ten thousand cycles of 1 ms without a bus, under the real-time set-up that a configuration asks for when it
    /// says nothing else.
    fn default() -> Self {
        Self {
            period_ns: 1_000_000,
            cycles: 10_000,
            interface: None,
            realtime: Realtime {
                priority: Some(80),
                cpu: None,
                lock_memory: true,
                hold_dma_latency: true,
                spin_guard_ns: None,
            },
        }
    }
}

/// How the loop waits for a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pacing {
    /// By an absolute sleep until the slot.
    Sleep,
    /// By an absolute sleep that ends before it, and a spin for the rest.
    SleepThenSpin,
}

/// The result of a measurement.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// How the loop waited.
    pub pacing: Pacing,
    /// What the operating system granted.
    pub begun: Begun,
    /// How long before a slot the thread stopped sleeping and spun, at the end.
    pub spin_guard_ns: u64,
    /// Wake-up latency and SYNC release error of every cycle, and the slots that passed unused.
    pub statistics: Statistics,
    /// Cycles that ran and are not among the statistics.
    pub records_dropped: u64,
    /// Page faults of the loop.
    pub page_faults: u64,
    /// The counters of the interface at the end.
    pub bus: Option<BusHealth>,
    /// True if all cycles asked for are there; not when it was interrupted.
    pub is_whole: bool,
}

/// Why there is no measurement.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JitterError {
    /// The period is outside the range of a cycle.
    #[error("{0}")]
    Config(#[from] ConfigError),
    /// The cycle cannot be set up.
    #[error(transparent)]
    Assemble(#[from] AssembleError),
    /// The interface may not be commanded by this process.
    #[error(transparent)]
    Claim(#[from] ClaimError),
    /// The interface cannot be opened.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// The real-time thread could not be started.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The loop ended by itself, which only a defect of takt can bring about.
    #[error("the real-time thread ended by itself; this is a defect of takt, please report it")]
    Died,
}

/// Runs the loop for the cycles asked for. `watch` is called some two hundred times a second with the number of cycles
/// done, and ends the measurement early by `false`.
///
/// # Errors
/// See [`JitterError`].
pub fn measure(
    options: &JitterOptions,
    pacing: Pacing,
    mut watch: impl FnMut(u64) -> bool,
) -> Result<Measurement, JitterError> {
    let config = config(options)?;
    let mut ownership = Ownership::of(&config, IfOwned::Refuse)?;
    let ports = match options.interface {
        Some(_) => vec![Port::open(&config, 0)?],
        None => vec![],
    };
    let has_bus = !ports.is_empty();
    let (rt, mut host, mut log) = channels(&ChannelSizes::of(&config));
    let work = LoopParts {
        engine: assemble::engine(&config)?,
        plan: SlotPlan::usual(config.cycle.period_ns, config.cycle.command_phase_ns),
        ports,
        host: rt,
        spin_guard_ns: match pacing {
            Pacing::Sleep => Some(0),
            Pacing::SleepThenSpin => options.realtime.spin_guard_ns,
        },
        is_realtime_required: false,
        clock_journal: None,
        watch: Arc::default(),
    };
    // The ring of requests is empty: there is room for this request, and later for the one to shut down.
    let _ = host.request(Request::Sync(has_bus));
    let running = realtime_thread::start(ThreadSetup::of(&options.realtime), work)?;
    let begun = running.begun();
    let mut statistics = Statistics::new(vec![]);
    while !running.is_finished() {
        collect(&mut log, &mut statistics, options.cycles);
        let done = statistics.cycles + log.records_dropped();
        if done >= options.cycles || !watch(done) || ownership.poll_release_request().is_some() {
            let _ = host.request(Request::Shutdown);
        }
        sleep_alignment::sleep(PAUSE, options.period_ns);
    }
    let ended = running.join().ok_or(JitterError::Died)?;
    collect(&mut log, &mut statistics, options.cycles);
    let done = statistics.cycles + log.records_dropped();
    Ok(Measurement {
        pacing,
        begun,
        spin_guard_ns: ended.spin_guard_ns,
        records_dropped: log.records_dropped(),
        page_faults: ended.page_faults.minor + ended.page_faults.major,
        bus: has_bus.then(|| host.snapshot().buses[0]),
        is_whole: done >= options.cycles,
        statistics,
    })
}

/// Takes the records that are waiting, up to the number asked for. The loop runs a little longer than that.
fn collect(log: &mut LogSide, statistics: &mut Statistics, cycles: u64) {
    let is_wanted = |statistics: &Statistics| statistics.cycles < cycles;
    while is_wanted(statistics) && log.next_record(|record| statistics.add(record)).is_some() {}
    while log.take_event().is_some() {}
}

/// The passive machine with the period and the interface of the options.
fn config(options: &JitterOptions) -> Result<Config, ConfigError> {
    let period_us = options.period_ns / 1_000;
    let text = format!("{}\n[cycle]\nperiod = \"{period_us} us\"\n", passive());
    let mut config = Config::parse("takt jitter", &text)?;
    if let (Some(bus), Some(interface)) = (config.buses.first_mut(), &options.interface) {
        bus.interface = interface.clone();
        // The path of an adapter is no name.
        bus.name = match interface {
            Interface::Slcan(_) => "slcan".to_owned(),
            Interface::Converter(_) => "converter".to_owned(),
            Interface::Serial(_) => "line".to_owned(),
            interface => interface.to_string(),
        };
        // SYNC is the same at any bit rate: a bus that is up is taken as it is.
        if let Ok(status) = interface_status(&bus.name)
            && let Some(timing) = status.timing.filter(|_| status.is_up)
        {
            bus.bit_rate = timing.bit_rate;
        }
    }
    config.realtime = options.realtime;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_passive_machine_has_the_period_and_the_interface_asked_for_and_sends_nothing_of_its_own() {
        let interface = Interface::SocketCan("vcan0".to_owned());
        let options = JitterOptions {
            period_ns: 2_000_000,
            interface: Some(interface.clone()),
            ..JitterOptions::default()
        };
        let config = config(&options).unwrap();
        assert_eq!((config.cycle.period_ns, &config.buses[0].interface), (2_000_000, &interface));
        assert_eq!(config.master.heartbeat_ns, None);
        assert_eq!(assemble::engine(&config).unwrap().bus_count(), 1);
    }

    #[test]
    fn the_passive_machine_runs_behind_an_adapter_too() {
        let interface: Interface = "slcan:/dev/ttyACM0".parse().unwrap();
        let options = JitterOptions { interface: Some(interface.clone()), ..JitterOptions::default() };
        let config = config(&options).unwrap();
        assert_eq!((config.validate().is_ok(), &config.buses[0].interface), (true, &interface));
    }

    #[test]
    fn the_defaults_are_those_of_a_configuration_that_says_nothing() {
        let config = Config::parse("test", &passive()).unwrap();
        let options = JitterOptions::default();
        assert_eq!((options.period_ns, options.realtime), (config.cycle.period_ns, config.realtime));
    }
}
