//! A whole controller in virtual time: the same engine, cycle, channels, life cycle and logger as in the real-time
//! thread, but in one thread and on a clock that jumps, so that hours of motion take seconds and the same
//! configuration gives the same run bit for bit.

use std::sync::Arc;

use takt_rt::{BusPort, Clock, Cycle, Engine, Flow, Grid, Snapshot, Wake};

use super::assemble::{self, AssembleError};
use super::channels::{ChannelSizes, HostSide, LogSide, RtSide, channels};
use super::outcome::{Interrupt, Outcome};
use super::supervisor::Supervisor;
use super::time_of_day::TimeOfDayKeeper;
use crate::bus::port::Port;
use crate::config::Config;
use crate::faults::Rehearsal;
use crate::sim::SimulatedBus;
use crate::telemetry::WallClock;

/// Zero of virtual time: 2000-01-01 00:00:00 UTC, in ns since 1970-01-01.
const VIRTUAL_EPOCH_NS: u64 = 946_684_800_000_000_000;

/// A clock that is always on time, unless it is told to be late.
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
}

impl VirtualClock {
    /// The next wait ends this much later than asked for.
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
        Wake { now_ns: self.now_ns, timer_latency_ns }
    }
}

/// A controller in virtual time on any kind of port.
pub struct VirtualRun<P> {
    engine: Box<Engine>,
    cycle: Cycle,
    clock: VirtualClock,
    ports: Vec<P>,
    rt: RtSide,
    host: HostSide,
    supervisor: Supervisor,
    time_of_day: TimeOfDayKeeper,
    rehearsal: Option<Arc<Rehearsal>>,
    /// Cycles from one look of the life cycle to the next, and since the last one.
    neglect: u64,
    neglected: u64,
    is_over: bool,
}

impl VirtualRun<SimulatedBus> {
    /// A controller of this configuration on simulated buses, and the side for its logger.
    ///
    /// # Errors
    /// See [`assemble::engine`].
    pub fn simulated(config: &Config) -> Result<(Self, LogSide), AssembleError> {
        let ports = (0..config.buses.len()).map(|bus| SimulatedBus::new(config, bus)).collect();
        Self::new(config, ports)
    }
}

impl VirtualRun<Port> {
    /// A controller of this configuration on simulated buses on which a scenario is played, and the side for its logger.
    ///
    /// # Errors
    /// See [`assemble::engine`].
    pub fn rehearsed(config: &Config, rehearsal: Arc<Rehearsal>) -> Result<(Self, LogSide), AssembleError> {
        let simulated = |bus| Port::Simulated(Box::new(SimulatedBus::new(config, bus)));
        let ports = (0..config.buses.len()).map(|bus| rehearsal.wrap(bus, simulated(bus))).collect();
        let (run, log) = Self::new(config, ports)?;
        Ok((Self { rehearsal: Some(rehearsal), ..run }, log))
    }
}

impl<P: BusPort> VirtualRun<P> {
    /// A controller of this configuration on these ports, and the side for its logger.
    ///
    /// # Errors
    /// See [`assemble::engine`].
    pub fn new(config: &Config, ports: Vec<P>) -> Result<(Self, LogSide), AssembleError> {
        Self::led_by(Supervisor::new(config, None), config, ports)
    }

    /// As [`VirtualRun::new`], for a group that is brought up and enabled and then left to whoever commands it through
    /// [`VirtualRun::host`], until it is interrupted.
    ///
    /// # Errors
    /// See [`assemble::engine`].
    pub fn serving(config: &Config, ports: Vec<P>) -> Result<(Self, LogSide), AssembleError> {
        Self::led_by(Supervisor::serving(config), config, ports)
    }

    fn led_by(
        supervisor: Supervisor,
        config: &Config,
        ports: Vec<P>,
    ) -> Result<(Self, LogSide), AssembleError> {
        let engine = Box::new(assemble::engine(config)?);
        let (rt, host, log) = channels(&ChannelSizes::of(config));
        let period_ns = config.cycle.period_ns.max(1);
        let grid =
            Grid::new(period_ns, period_ns).unwrap_or_else(|| unreachable!("the period is at least 1 ns"));
        let run = Self {
            engine,
            cycle: Cycle::new(grid, assemble::slot_plan(config)),
            clock: VirtualClock::default(),
            ports,
            rt,
            host,
            supervisor,
            time_of_day: TimeOfDayKeeper::of(config),
            rehearsal: None,
            neglect: 1,
            neglected: 0,
            is_over: false,
        };
        Ok((run, log))
    }

    /// One cycle and what the life cycle has to do after it. Returns `false` once the loop has ended.
    pub fn step(&mut self) -> bool {
        if self.is_over {
            return false;
        }
        let flow = self.cycle.run(&mut self.engine, &mut self.clock, &mut self.ports, &mut self.rt);
        self.neglected += 1;
        if self.neglected >= self.neglect {
            self.neglected = 0;
            self.supervisor.poll(self.clock.now_ns, &mut self.host);
        }
        if let Some(time) = self.time_of_day.poll(self.clock.now_ns, || WallClock::fixed(VIRTUAL_EPOCH_NS)) {
            // One that finds the queue full is told again in a minute.
            let _ = self.host.request(time);
        }
        if let Some(rehearsal) = &self.rehearsal {
            rehearsal.observe(&self.host.snapshot());
        }
        self.is_over = flow == Flow::Shutdown;
        !self.is_over
    }

    /// Runs to the end of the life cycle, or for `at_most` cycles. Calls `each` after every cycle.
    pub fn run(&mut self, at_most: u64, mut each: impl FnMut(&mut Self)) -> Option<Outcome> {
        for _ in 0..at_most {
            let goes_on = self.step();
            each(self);
            if !goes_on {
                break;
            }
        }
        self.supervisor.outcome().cloned()
    }

    /// From now on the life cycle is looked after only once in so many cycles, as on a machine that has no time for it: what
    /// leads it is no real-time thread.
    pub fn neglect_life_cycle(&mut self, cycles: u64) {
        self.neglect = cycles;
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

    /// The clock, to make it late.
    pub fn clock(&mut self) -> &mut VirtualClock {
        &mut self.clock
    }

    /// The ports, to look at the simulated drives or to break something.
    pub fn ports(&mut self) -> &mut [P] {
        &mut self.ports
    }
}
