//! What is asked of the group, and what of it is possible now.

use super::obstacle::{Obstacle, check_profile_target, check_scales, check_target};
use super::{Engine, FAULT_RESET_CYCLES};
use crate::axis::Axis;
use crate::cia402::Goal;
use crate::door::{Asked, Door, Move, ProfileMove, Request};
use crate::motion::Leg;
use crate::plan::State;
use crate::profile::ProfileTarget;
use crate::record::EventKind;
use crate::refusal::{Objection, Refusal};
use crate::stop::{Origin, Phase, Rule, StopCategory};
use crate::time::Nanoseconds;
use crate::watch::TimingLevel;

/// Done, or what stands in the way; nothing has changed then.
type Answered = Result<(), Obstacle>;

impl Engine {
    pub(super) fn take(&mut self, asked: &Asked, now_ns: Nanoseconds, door: &mut impl Door) {
        let obstacle = self.answer(&asked.request, now_ns, door).err();
        let refusal = obstacle.map(|Obstacle { objection, axis, value, limit }| Refusal {
            request: asked.request.kind(),
            objection,
            axis,
            value,
            limit,
            phase: self.phase,
        });
        self.snapshot.answers.note(asked.id, refusal);
        if let Some(refusal) = refusal {
            self.snapshot.refused += 1;
            self.happened(now_ns, EventKind::Refused(refusal), door);
        }
    }

    fn answer(&mut self, request: &Request, now_ns: Nanoseconds, door: &mut impl Door) -> Answered {
        match request {
            Request::Sync(on) => {
                if *on && !self.is_sync_on {
                    self.axes.iter_mut().for_each(Axis::begin_sync);
                }
                self.is_sync_on = *on;
            }
            Request::TimeOfDay { at_zero_ns } => {
                self.time.as_mut().ok_or(Objection::NoTime)?.set(*at_zero_ns);
            }
            Request::RatedTorque { axis, torque } => {
                // What is commanded in per mille of it would leap.
                self.require_phase(&[Phase::Passive, Phase::Disabled])?;
                if !self.axis_mut(*axis)?.set_rated_torque(*torque) {
                    return Err(Obstacle::from(Objection::RatedTorque)
                        .of_axis((*axis).into())
                        .with(*torque, 0.0));
                }
            }
            Request::ProcessData(data) => self.set_process_data(data)?,
            Request::Position { axis, counts } => self.axis_mut(*axis)?.set_reported_position(*counts),
            Request::Activate => self.activate(now_ns, door)?,
            Request::Enable => self.begin_enable(now_ns, door)?,
            Request::Move(parameters) => self.begin_move(parameters, now_ns, door)?,
            Request::SetProfileTarget(target) => self.set_profile_target(target, now_ns, door)?,
            Request::Stream => self.begin_stream(now_ns, door)?,
            Request::Stop(category) => {
                self.begin_stop(Rule::Requested, Some(*category), Origin::Group, 0.0, 0.0, now_ns, door);
            }
            Request::Disable => self.begin_disable(now_ns, door)?,
            Request::ResetFaults => self.reset_faults()?,
            Request::Retire => self.is_retired = true,
            Request::Leave => self.is_leaving = true,
        }
        Ok(())
    }

    pub(super) fn require_phase(&self, possible: &[Phase]) -> Answered {
        if possible.contains(&self.phase) { Ok(()) } else { Err(Objection::Phase.into()) }
    }

    /// A fault that has stopped the group must be reset before anything moves.
    fn require_no_fault(&self) -> Answered {
        match self.stop.filter(|stop| stop.rule != Rule::Requested) {
            Some(stop) => {
                let latched = Obstacle::from(Objection::StopLatched);
                Err(Obstacle { axis: stop.axis(), ..latched }.with(f64::from(stop.rule as u8), 0.0))
            }
            None => Ok(()),
        }
    }

    pub(super) fn axis_mut(&mut self, number: u8) -> Result<&mut Axis, Obstacle> {
        let unknown = Obstacle::from(Objection::UnknownAxis).with(f64::from(number), self.axes.len() as f64);
        self.axes.get_mut(usize::from(number)).ok_or(unknown)
    }

    fn begin_enable(&mut self, now_ns: Nanoseconds, door: &mut impl Door) -> Answered {
        if self.is_retired {
            return Err(Objection::Retired.into());
        }
        self.require_phase(&[Phase::Disabled])?;
        self.require_no_fault()?;
        self.stop = None;
        self.begin_watch();
        self.goal = Goal::Enabled;
        self.hasten_heartbeats();
        self.enter(Phase::Enabling, now_ns, door);
        Ok(())
    }

    fn begin_stream(&mut self, now_ns: Nanoseconds, door: &mut impl Door) -> Answered {
        self.require_phase(&[Phase::Holding])?;
        self.require_no_fault()?;
        if self.timing_level >= TimingLevel::Degraded {
            let (missed, limit) = (self.missed.filled(), self.ladder.degraded);
            return Err(Obstacle::from(Objection::MissedSlots).with(missed.into(), limit.into()));
        }
        self.stop = None;
        self.stream = None;
        self.is_stream_begun = false;
        self.axes.iter_mut().for_each(Axis::begin_stream);
        self.enter(Phase::Streaming, now_ns, door);
        Ok(())
    }

    /// Forgets what was seen while nothing could move.
    fn begin_watch(&mut self) {
        self.axes.iter_mut().for_each(Axis::begin_watch);
        self.foreign_id = None;
        self.missed.empty();
    }

    fn activate(&mut self, now_ns: Nanoseconds, door: &mut impl Door) -> Answered {
        self.require_phase(&[Phase::Passive])?;
        self.goal = Goal::Disabled;
        self.axes.iter_mut().for_each(Axis::start_from_actual);
        self.enter(Phase::Disabled, now_ns, door);
        Ok(())
    }

    fn begin_move(&mut self, parameters: &Move, now_ns: Nanoseconds, door: &mut impl Door) -> Answered {
        self.require_phase(&[Phase::Holding, Phase::Moving])?;
        self.require_no_fault()?;
        check_scales(parameters)?;
        let targets = || parameters.target.into_iter().zip(parameters.target_velocity);
        for (index, (axis, (position, velocity))) in self.axes.iter().zip(targets()).enumerate() {
            check_target(axis, position, velocity, self.period_s)
                .map_err(|obstacle| obstacle.of_axis(index))?;
        }
        let legs = self.axes.iter().zip(targets()).map(|(axis, (position, velocity))| {
            let start = axis.set_point();
            let target = State { position, velocity, acceleration: 0.0 };
            let limits = &axis.parameters().limits;
            // A drive in a profile mode makes its own way: nothing is planned for it.
            if axis.is_profile() {
                Leg::standing(start.position, limits)
            } else {
                Leg { start, target, limits }
            }
        });
        let minimum_duration_s = parameters.minimum_duration_s;
        self.motion
            .move_to(legs, parameters.velocity_scale, parameters.acceleration_scale, minimum_duration_s)
            .map_err(|error| Obstacle::of_plan(error, minimum_duration_s))?;
        for (axis, position) in self.axes.iter_mut().zip(parameters.target) {
            if axis.accepts(ProfileTarget::Position(position)) {
                axis.set_profile_target(ProfileTarget::Position(position), Nanoseconds::MAX);
            }
        }
        self.stop = None;
        self.move_id = parameters.id;
        self.enter(Phase::Moving, now_ns, door);
        Ok(())
    }

    fn set_profile_target(
        &mut self,
        wanted: &ProfileMove,
        now_ns: Nanoseconds,
        door: &mut impl Door,
    ) -> Answered {
        let index = usize::from(wanted.axis);
        self.require_phase(&[Phase::Holding, Phase::Moving])?;
        self.require_no_fault()?;
        check_profile_target(self.axis_mut(wanted.axis)?, wanted.target)
            .map_err(|obstacle| obstacle.of_axis(index))?;
        // The other axes stay where they are, not where the last trajectory ended.
        if self.phase == Phase::Holding {
            self.plan_standstill().map_err(|error| Obstacle::of_plan(error, 0.0))?;
        }
        self.axis_mut(wanted.axis)?.set_profile_target(wanted.target, wanted.valid_until_ns);
        self.stop = None;
        self.move_id = wanted.id;
        self.enter(Phase::Moving, now_ns, door);
        Ok(())
    }

    fn begin_disable(&mut self, now_ns: Nanoseconds, door: &mut impl Door) -> Answered {
        match self.phase {
            Phase::Passive => return Err(Objection::Phase.into()),
            Phase::Disabled | Phase::Disabling => {}
            _ if self.must_come_to_rest() || self.phase == Phase::Stopping => {
                self.begin_stop(
                    Rule::Requested,
                    Some(StopCategory::One),
                    Origin::Group,
                    0.0,
                    0.0,
                    now_ns,
                    door,
                );
            }
            _ => {
                self.goal = Goal::Disabled;
                self.enter(Phase::Disabling, now_ns, door);
            }
        }
        Ok(())
    }

    fn reset_faults(&mut self) -> Answered {
        self.require_phase(&[Phase::Disabled, Phase::Holding])?;
        if self.phase == Phase::Disabled {
            self.fault_reset = 3 * FAULT_RESET_CYCLES;
            self.axes.iter_mut().for_each(Axis::begin_fault_reset);
        }
        self.stop = None;
        Ok(())
    }
}
