//! A controller in virtual time, commanded by the same handles as one in real time.

use std::ops::Deref;
use std::sync::Arc;
use std::time::Duration;

use takt_rt::StopCategory;

use super::callbacks::Callbacks;
use super::life::Life;
use super::pace::{Pace, VirtualLog, VirtualPace};
use super::start_failure::StartFailure;
use super::trajectories::Trajectories;
use super::{Handle, OwnProcess};
use crate::channels::{LogSide, MotionEnd};
use crate::config::Config;
use crate::controller::assemble::{self, AssembleError};
use crate::controller::outcome::Outcome;
use crate::controller::port::Port;
use crate::controller::supervisor::AfterBringUp;
use crate::controller::virtual_time::VirtualRun;
use crate::journal::RunJournal;
use crate::link::trace::Trace;
use crate::telemetry::{EachCycle, Logger, Machine, shown_timing};

/// A controller of simulated drives in virtual time, with the commands of a [`Controller`](super::Controller).
///
/// Its time is not that of the computer: it passes only in [`VirtualController::step`], and in each call of a [`Handle`] that waits, by
/// as many cycles as the wait takes. So hours of motion take seconds, and the same calls give the same motion bit for bit. With calls
/// from several threads at once, time passes for all of them.
///
/// ```
/// use std::time::Duration;
/// use takt::{Config, VirtualController};
///
/// fn main() -> takt::Result {
///     let config = Config::load("configs/first.toml".as_ref())?;
///     let arm = VirtualController::start(&config, None)?;
///     let motion = arm.move_to(&[0.5])?;
///     arm.wait(motion, Duration::from_secs(10))?;
///     assert!((arm.state().axes()[0].position - 0.5).abs() < 1e-3);
///     Ok(())
/// }
/// ```
pub struct VirtualController {
    handle: Handle,
}

impl VirtualController {
    /// Brings simulated drives up and enables them, whatever interfaces the buses of the configuration have. `each_cycle` gets the record
    /// of each cycle, in the thread that runs the cycle.
    ///
    /// # Errors
    /// See [`StartFailure`].
    pub fn start(config: &Config, each_cycle: Option<EachCycle>) -> Result<Self, StartFailure> {
        Self::begin(config, AfterBringUp::Enable, each_cycle)
    }

    /// As [`VirtualController::start`], but leaves the drives disabled, as [`Controller::start_disabled`](super::Controller::start_disabled)
    /// does.
    ///
    /// # Errors
    /// See [`StartFailure`].
    pub fn start_disabled(config: &Config, each_cycle: Option<EachCycle>) -> Result<Self, StartFailure> {
        Self::begin(config, AfterBringUp::StayDisabled, each_cycle)
    }

    /// As [`VirtualController::start`], with a logger that gets the frames of the buses and the journal as well.
    pub fn start_logged(
        config: &Config,
        logger: impl FnOnce(LogSide, Vec<Trace>, RunJournal) -> Logger,
    ) -> Result<Self, StartFailure> {
        config.validate().map_err(AssembleError::from)?;
        let traced = (0..).zip(&config.buses).map(|(bus, of)| simulated(config, bus).traced(&of.name));
        let (ports, traces) = traced.unzip();
        let log = |log, run: &mut VirtualRun<Port>| {
            VirtualLog::Logger(Box::new(logger(log, traces, run.journal())))
        };
        Self::begin_on(config, AfterBringUp::Enable, ports, log)
    }

    fn begin(
        config: &Config,
        after_bring_up: AfterBringUp,
        each_cycle: Option<EachCycle>,
    ) -> Result<Self, StartFailure> {
        config.validate().map_err(AssembleError::from)?;
        let ports = (0..config.buses.len()).map(|bus| simulated(config, bus)).collect();
        Self::begin_on(config, after_bring_up, ports, |log, _| VirtualLog::EachCycle(log, each_cycle))
    }

    fn begin_on(
        config: &Config,
        after_bring_up: AfterBringUp,
        ports: Vec<Port>,
        log: impl FnOnce(LogSide, &mut VirtualRun<Port>) -> VirtualLog,
    ) -> Result<Self, StartFailure> {
        let (mut run, records) = VirtualRun::serving(config, ports, after_bring_up)?;
        let log = log(records, &mut run);
        let host = run.host();
        let shared = OwnProcess {
            axes: config.axes.clone(),
            groups: config.groups.clone(),
            machine: Machine::of(config),
            #[cfg(target_os = "linux")]
            realtime: takt_rt::linux::ThreadReport::of_ordinary_thread(),
            // Nothing is ever counted: no time passes within a virtual cycle.
            timing: shown_timing().1,
            clients: host.clients(),
            observer: host.observer(),
            events: host.events(),
            streamer: host.streamer(),
            trajectories: Trajectories::new(host.trajectories()),
            callbacks: Callbacks::new(host.callbacks(), &assemble::slot_plan(config)),
            questions: host.questions(),
            bring_up_failures: host.bring_up_failures(),
            messages: Arc::default(),
            life: Arc::<Life>::default(),
            pace: Pace::Virtual(Box::new(VirtualPace::new(run, log))),
        };
        let controller = Self { handle: Handle::new(Arc::new(shared)) };
        match controller.wait_until_brought_up(after_bring_up) {
            Ok(()) => Ok(controller),
            Err(_) => {
                let words = controller.end().words(controller.machine());
                Err(StartFailure::NotEnabledVirtually { words })
            }
        }
    }

    /// Hands the ports out, to break something.
    pub fn with_ports<T>(&self, with: impl FnOnce(&mut [Port]) -> T) -> Option<T> {
        self.handle.backend().virtual_pace().map(|pace| pace.with_ports(with))
    }

    /// Lets this many cycles pass, or fewer up to the end of the run. Returns how many.
    pub fn step(&self, cycles: u64) -> u64 {
        self.handle.backend().virtual_pace().map_or(0, |pace| pace.step(cycles, &self.handle.backend().life))
    }

    /// Lets a time pass, rounded up to whole cycles. Returns the number of cycles.
    pub fn pass(&self, time: Duration) -> u64 {
        let period_ns = u128::from(self.handle.machine().cycle_ns.max(1));
        self.step(u64::try_from(time.as_nanos().div_ceil(period_ns)).unwrap_or(u64::MAX))
    }

    /// A handle, for another thread too.
    pub fn handle(&self) -> Handle {
        self.handle.clone()
    }

    /// Brings the axes to rest, disables and shuts down the drives, and returns how the run has ended.
    pub fn finish(self) -> Outcome {
        self.finish_with_unreached().0
    }

    /// As [`VirtualController::finish`], with the axes whose drives did not confirm that they have no torque: see
    /// [`Session::unreached`](crate::Session::unreached).
    pub fn finish_with_unreached(self) -> (Outcome, Vec<usize>) {
        let outcome = match self.end() {
            // An interrupt is the regular end of this run.
            Outcome::Interrupted => Outcome::Finished,
            outcome => outcome,
        };
        (outcome, self.handle.backend().virtual_pace().map_or(vec![], |pace| pace.unreached()))
    }

    fn end(&self) -> Outcome {
        let shared = self.handle.backend();
        shared.life.begin_end();
        shared.clients.stop(MotionEnd::Stop(StopCategory::Two));
        let Some(pace) = self.handle.backend().virtual_pace() else {
            return Outcome::ThreadDied { told: vec![] };
        };
        pace.interrupt();
        // Each stage of the end has a time-out, so that it ends.
        while pace.step(1, &shared.life) > 0 {}
        pace.outcome().unwrap_or(Outcome::ThreadDied { told: vec![] })
    }
}

/// The port of a bus of a configuration that has been checked.
fn simulated(config: &Config, bus: usize) -> Port {
    Port::Simulated(Box::new(crate::family::simulated_bus(config, bus)))
}

impl Deref for VirtualController {
    type Target = Handle;

    fn deref(&self) -> &Handle {
        &self.handle
    }
}
