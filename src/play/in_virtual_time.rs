//! A performance in virtual time, on simulated drives: bit for bit the same each time.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use takt_rt::{ExecutionStart, MAX_AXES, Move, Request, RequestId, Snapshot};

use super::performance::{APPROACH_SCALE, Stage};
use super::set_points::SetPointLog;
use crate::config::Config;
use crate::controller::assemble::AssembleError;
use crate::controller::channels::{GivenTrajectory, LogSide};
use crate::controller::{Interrupt, Outcome, VirtualRun};
use crate::sim::SimulatedBus;
use crate::trajectory::Trajectory;

/// An arm of simulated drives in virtual time.
pub struct VirtualStage<'a> {
    run: VirtualRun<SimulatedBus>,
    log: LogSide,
    set_points: SetPointLog,
    interrupted: &'a AtomicBool,
    was_interrupted: bool,
}

impl<'a> VirtualStage<'a> {
    /// An arm of this configuration, whatever interfaces its buses have. It ends in control once `interrupted` is set.
    ///
    /// # Errors
    /// A configuration that cannot be executed.
    pub fn new(
        config: &Config,
        set_points: SetPointLog,
        interrupted: &'a AtomicBool,
    ) -> Result<Self, AssembleError> {
        config.validate()?;
        let ports = (0..config.buses.len()).map(|bus| SimulatedBus::new(config, bus)).collect();
        let (run, log) = VirtualRun::serving(config, ports)?;
        Ok(Self { run, log, set_points, interrupted, was_interrupted: false })
    }

    fn step(&mut self) -> bool {
        if self.interrupted.swap(false, Ordering::Relaxed) {
            self.was_interrupted = true;
            self.run.interrupt(Interrupt::Controlled);
        }
        let goes_on = self.run.step();
        while self.log.next_record(|record| self.set_points.add(record)).is_some() {}
        while self.log.take_event().is_some() {}
        goes_on
    }

    /// Brings the arm to rest, disables and shuts down the drives. Returns how the run ended, unless it was by this, and its
    /// set-points.
    pub fn finish(mut self) -> (Option<Outcome>, Snapshot, SetPointLog) {
        // The last set-points at rest.
        for _ in 0..4 {
            self.step();
        }
        let by_itself = self.was_interrupted || self.run.supervisor().outcome().is_some();
        self.run.interrupt(Interrupt::Controlled);
        while self.step() {}
        let outcome = self.run.supervisor().outcome().filter(|_| by_itself).cloned();
        let snapshot = self.run.snapshot();
        (outcome, snapshot, self.set_points)
    }

    fn request(&mut self, request: Request) -> Option<RequestId> {
        self.run.host().request(request).ok()
    }
}

impl Stage for VirtualStage<'_> {
    fn snapshot(&mut self) -> Snapshot {
        self.run.snapshot()
    }

    fn pass(&mut self) -> bool {
        self.step() && !self.was_interrupted
    }

    fn move_to(&mut self, target: &[f64]) -> Option<RequestId> {
        let mut all = [0.0; MAX_AXES];
        all.iter_mut().zip(target).for_each(|(to, from)| *to = *from);
        self.request(Request::Move(Move {
            target: all,
            target_velocity: [0.0; MAX_AXES],
            velocity_scale: APPROACH_SCALE,
            acceleration_scale: APPROACH_SCALE,
            minimum_duration_s: 0.0,
        }))
    }

    fn execute(&mut self, trajectory: Trajectory) -> Option<RequestId> {
        let given = Arc::new(GivenTrajectory::new(trajectory));
        self.run.host().execute(&given, ExecutionStart::Now).ok()
    }
}
