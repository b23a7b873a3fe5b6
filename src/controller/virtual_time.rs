//! A controller in virtual time: the same engine, cycle, channels, life cycle and logger as in real time, but in one thread
//! and on a clock that jumps. Hours of motion take seconds, and the same configuration gives the same run bit for bit.

use std::sync::Arc;

use takt_rt::{BusPort, Clock, Cycle, Engine, Flow, Grid, Nanoseconds, Snapshot, Wake};

use super::assemble::{self, AssembleError};
use super::lines::{Lines, SharedLine};
use super::outcome::{Interrupt, Outcome};
use super::port::Port;
use super::supervisor::{AfterBringUp, Supervisor};
use super::time_of_day::TimeOfDayKeeper;
use crate::channels;
use crate::channels::{CallbackClock, ChannelSizes, HostSide, LogSide, RtSide, channels};
use crate::config::Config;
use crate::faults::FaultInjector;
use crate::journal::JournaledClock;
use crate::journal::{RunJournal, clock_journal};
use crate::telemetry::WallClock;
use takt_sim::SimulatedBus;

/// Zero of virtual time: 2000-01-01 00:00:00 UTC, in ns since 1970-01-01.
const VIRTUAL_EPOCH_NS: u64 = 946_684_800_000_000_000;

/// A clock that is always on time, unless [`VirtualClock::stall`] makes it late.
#[derive(Clone, Copy, Debug, Default)]
pub struct VirtualClock {
    now_ns: u64,
    stall_ns: u64,
    /// By how much every wait is late.
    lateness_ns: u64,
    /// What passes unseen: between the next wake-up of a slot and its SYNC, and while the next cycle is computed.
    before_sync_ns: u64,
    computing_ns: u64,
    /// What passes before the next look at the clock, and right after it.
    before_look_ns: u64,
    after_look_ns: u64,
    /// How long the computer was suspended before the next wake-up.
    suspended_ns: u64,
}

impl VirtualClock {
    /// Makes the next wait end later by `ns`.
    pub fn stall(&mut self, ns: u64) {
        self.stall_ns += ns;
    }

    /// From now on every wait ends this much later than asked for.
    pub fn be_late(&mut self, ns: u64) {
        self.lateness_ns = ns;
    }

    /// The thread is held up between its next wake-up for a slot and the SYNC of that slot.
    pub fn hold_up_sync(&mut self, ns: u64) {
        self.before_sync_ns = ns;
    }

    /// The next cycle takes this long to compute.
    pub fn compute_for(&mut self, ns: u64) {
        self.computing_ns = ns;
    }

    /// The computer has been suspended for so long: this clock stood still.
    pub fn suspend(&mut self, ns: u64) {
        self.suspended_ns = ns;
    }
}

impl Clock for VirtualClock {
    fn now_ns(&mut self) -> u64 {
        let seen_ns = self.now_ns + std::mem::take(&mut self.before_look_ns);
        self.now_ns = seen_ns + std::mem::take(&mut self.after_look_ns);
        seen_ns
    }

    /// In a cycle this is the wait for the command phase, after which the clock is looked at, and computing begins.
    fn wait_until(&mut self, deadline_ns: u64) -> Wake {
        let wake = self.wake(deadline_ns);
        self.after_look_ns = std::mem::take(&mut self.computing_ns);
        wake
    }

    fn wait_to_send(&mut self, deadline_ns: u64) -> Wake {
        let wake = self.wake(deadline_ns);
        self.before_look_ns = std::mem::take(&mut self.before_sync_ns);
        wake
    }
}

impl VirtualClock {
    fn wake(&mut self, deadline_ns: u64) -> Wake {
        let timer_latency_ns = self.lateness_ns + std::mem::take(&mut self.stall_ns);
        self.now_ns = self.now_ns.max(deadline_ns) + timer_latency_ns;
        Wake { now_ns: self.now_ns, timer_latency_ns, suspended_ns: std::mem::take(&mut self.suspended_ns) }
    }
}

/// A controller in virtual time on any kind of port.
pub struct VirtualRun<P> {
    engine: Box<Engine>,
    cycle: Cycle,
    clock: JournaledClock<VirtualClock>,
    ports: Vec<P>,
    rt: RtSide,
    host: HostSide,
    supervisor: Supervisor,
    time_of_day: TimeOfDayKeeper,
    fault_injector: Option<Arc<FaultInjector>>,
    /// Cycles from one poll of the life cycle to the next, and since the last poll.
    poll_interval: u64,
    cycles_since_poll: u64,
    is_over: bool,
}

impl VirtualRun<SimulatedBus> {
    /// A controller of this configuration on simulated buses, and the side for its logger.
    ///
    /// # Errors
    /// See [`AssembleError`].
    pub fn simulated(config: &Config) -> Result<(Self, LogSide), AssembleError> {
        // The simulated drives take the values as they are.
        config.validate()?;
        let ports = (0..config.buses.len()).map(|bus| crate::family::simulated_bus(config, bus)).collect();
        Self::new(config, ports)
    }
}

impl VirtualRun<Port> {
    /// A controller of this configuration on simulated buses with injected faults, and the side for its logger.
    ///
    /// # Errors
    /// See [`AssembleError`].
    pub fn with_faults(
        config: &Config,
        fault_injector: Arc<FaultInjector>,
    ) -> Result<(Self, LogSide), AssembleError> {
        let supervisor = Supervisor::new(config, None);
        let (run, log) = Self::faulty(config, &fault_injector, supervisor, |port| port)?;
        Ok((Self { fault_injector: Some(fault_injector), ..run }, log))
    }
}

impl<P: BusPort> VirtualRun<P> {
    /// A controller of this life cycle on simulated buses and lines with injected faults. `outermost` makes of each port the one that it
    /// is given. Whoever calls this shows the snapshots to the injector.
    ///
    /// # Errors
    /// See [`AssembleError`].
    pub fn faulty(
        config: &Config,
        fault_injector: &FaultInjector,
        supervisor: Supervisor,
        outermost: impl Fn(Port) -> P,
    ) -> Result<(Self, LogSide), AssembleError> {
        config.validate()?;
        let lines = Lines::simulated(config, Some(fault_injector));
        let simulated = |bus| match lines.port(bus) {
            Some(line) => Port::Line(Box::new(line)),
            None => Port::Simulated(Box::new(crate::family::simulated_bus(config, bus))),
        };
        let ports =
            (0..config.buses.len()).map(|bus| outermost(fault_injector.wrap(bus, simulated(bus)))).collect();
        Self::with_supervisor(supervisor.with_lines(lines), config, ports)
    }

    /// A controller of this configuration on these ports, and the side for its logger.
    ///
    /// # Errors
    /// See [`AssembleError`].
    pub fn new(config: &Config, ports: Vec<P>) -> Result<(Self, LogSide), AssembleError> {
        Self::with_supervisor(Supervisor::new(config, None), config, ports)
    }

    /// The same as [`VirtualRun::new`], without a program: after bring-up the group executes the requests of
    /// its host, until it is interrupted.
    ///
    /// # Errors
    /// See [`AssembleError`].
    pub fn serving(
        config: &Config,
        ports: Vec<P>,
        after_bring_up: AfterBringUp,
    ) -> Result<(Self, LogSide), AssembleError> {
        Self::with_supervisor(Supervisor::serving(config, after_bring_up), config, ports)
    }

    fn with_supervisor(
        supervisor: Supervisor,
        config: &Config,
        ports: Vec<P>,
    ) -> Result<(Self, LogSide), AssembleError> {
        let engine = assemble::engine(config)?;
        let (mut rt, host, log) = channels(&ChannelSizes::of(config));
        rt.measure_callbacks_by(CallbackClock::Virtual(0));
        let period_ns = config.cycle.period_ns.max(1);
        let grid =
            Grid::new(period_ns, period_ns).unwrap_or_else(|| unreachable!("the period is at least 1 ns"));
        let run = Self {
            engine,
            cycle: Cycle::new(grid, assemble::slot_plan(config)),
            clock: JournaledClock::new(VirtualClock::default()),
            ports,
            rt,
            host,
            supervisor,
            time_of_day: TimeOfDayKeeper::of(config),
            fault_injector: None,
            poll_interval: 1,
            cycles_since_poll: 0,
            is_over: false,
        };
        Ok((run, log))
    }

    /// Runs one cycle, and polls the life cycle after it. Returns `false` once the loop has ended.
    pub fn step(&mut self) -> bool {
        if self.is_over {
            return false;
        }
        let flow = self.cycle.run(&mut self.engine, &mut self.clock, &mut self.ports, &mut self.rt);
        self.clock.end_cycle();
        self.cycles_since_poll += 1;
        if self.cycles_since_poll >= self.poll_interval {
            self.cycles_since_poll = 0;
            self.supervisor.poll(self.clock.clock.now_ns, &mut self.host);
            self.host.free_callbacks();
        }
        if let Some(time) =
            self.time_of_day.poll(self.clock.clock.now_ns, || WallClock::fixed(VIRTUAL_EPOCH_NS))
        {
            // If the queue is full, the next one follows in a minute.
            let _ = self.host.request(time);
        }
        if let Some(fault_injector) = &self.fault_injector {
            fault_injector.observe(&self.host.snapshot());
        }
        self.is_over = flow == Flow::Shutdown;
        !self.is_over
    }

    /// Runs to the end of the life cycle, or for `at_most` cycles. Calls `each` after every cycle.
    pub fn run(&mut self, at_most: u64, mut each: impl FnMut(&mut Self)) -> Option<Outcome> {
        for _ in 0..at_most {
            let is_running = self.step();
            each(self);
            if !is_running {
                break;
            }
        }
        self.supervisor.outcome().cloned()
    }

    /// From now on the life cycle is polled only once in so many cycles, as on a busy computer: its thread is not real-time.
    pub fn poll_life_cycle_every(&mut self, cycles: u64) {
        self.poll_interval = cycles;
    }

    /// From now on each call of a callback takes so long, of which the clock sees nothing: see [`VirtualClock::compute_for`].
    pub fn take_for_callbacks(&mut self, ns: u64) {
        self.rt.measure_callbacks_by(CallbackClock::Virtual(ns));
    }

    /// Notes from now on everything that the cycle is told from outside but for what its ports do, which a
    /// [`TracedPort`](crate::link::trace::TracedPort) notes. Call it before the first cycle.
    pub fn journal(&mut self) -> RunJournal {
        let (answers, clock) = clock_journal();
        self.clock = JournaledClock::noted_in(self.clock.clock, Some(answers));
        let period_ns = self.engine.period_ns().max(1);
        self.clock.note_epoch(period_ns);
        RunJournal { clock, host: channels::journal(&mut self.rt, &mut self.host) }
    }

    /// Asks the run to end.
    pub fn interrupt(&mut self, interrupt: Interrupt) {
        self.supervisor.interrupt(interrupt);
    }

    /// The state after the last cycle.
    pub fn snapshot(&self) -> Snapshot {
        self.host.snapshot()
    }

    /// The life cycle.
    pub fn supervisor(&self) -> &Supervisor {
        &self.supervisor
    }

    /// The host's side of the host interface, to command the group directly.
    pub fn host(&mut self) -> &mut HostSide {
        &mut self.host
    }

    /// The present time.
    pub(crate) const fn now_ns(&self) -> Nanoseconds {
        self.clock.clock.now_ns
    }

    /// The simulated devices of a serial line, to observe its drives or to disturb them; `None` if the bus is none.
    pub fn line(&self, bus: usize) -> Option<SharedLine> {
        self.supervisor.lines().devices(bus)
    }

    /// The clock, to make it late.
    pub fn clock(&mut self) -> &mut VirtualClock {
        &mut self.clock.clock
    }

    /// The ports, to observe the simulated drives or to inject faults.
    pub fn ports(&mut self) -> &mut [P] {
        &mut self.ports
    }
}
