//! From the first frame to enabled drives.

use takt_rt::{Phase, Request, Snapshot};

use super::phases::{fault_stop, is_any, is_in_operation, is_off, stuck_phase};
use super::{AfterBringUp, Stage, Supervisor, service_sender};
use crate::channels::HostSide;
use crate::controller::outcome::Outcome;
use crate::family::bring_up::AxisFacts;

impl Supervisor {
    pub(super) fn configure(&mut self, now_ns: u64, host: &mut HostSide) {
        self.bring_up.poll(now_ns, &mut service_sender(host));
        match self.bring_up.outcome() {
            None => {}
            Some(Err(error)) => self.end(now_ns, Outcome::BringUpFailed(error)),
            Some(Ok(facts)) => {
                self.facts = facts;
                self.tell_facts(&self.all_axes());
                // The first part of the bring-up has succeeded, so the second part can begin.
                let _ = self.bring_up.start();
                self.enter(Stage::Start, now_ns);
            }
        }
    }

    pub(super) fn start(&mut self, now_ns: u64, host: &mut HostSide) {
        self.bring_up.poll(now_ns, &mut service_sender(host));
        match self.bring_up.outcome() {
            None => {}
            Some(Err(error)) => self.end(now_ns, Outcome::BringUpFailed(error)),
            Some(Ok(facts)) => {
                self.tell_positions(&self.all_axes(), &facts);
                // Every node is operational now. Each answers the first SYNC, or is a drive that always answers late.
                self.request(Request::Sync(true));
                self.request(Request::Activate);
                self.enter(Stage::Activate, now_ns);
            }
        }
    }

    fn all_axes(&self) -> Vec<usize> {
        (0..self.axes).collect()
    }

    /// Tells the engine the process data and the torque that the drives of these axes have reported.
    pub(super) fn tell_facts(&mut self, axes: &[usize]) {
        let of_axis = |axis: &usize| Some((u8::try_from(*axis).ok()?, self.facts.get(*axis)?));
        let mut requests = vec![];
        for (axis, facts) in axes.iter().filter_map(of_axis) {
            requests.extend(facts.process_data.as_ref().map(|data| data.request(axis)));
            requests.extend(facts.rated_torque.map(|torque| Request::RatedTorque {
                axis,
                torque,
                limit_per_mille: facts.max_torque_per_mille,
            }));
        }
        requests.into_iter().for_each(|request| self.request(request));
    }

    /// Tells the engine where the drives with process data are: some send feedback only after they have received a target.
    pub(super) fn tell_positions(&mut self, axes: &[usize], facts: &[AxisFacts]) {
        let has_pdos = |axis: &&usize| self.has_pdos.get(**axis) == Some(&true);
        for axis in axes.iter().filter(has_pdos).copied().collect::<Vec<_>>() {
            if let (Ok(number), Some(facts)) = (u8::try_from(axis), facts.get(axis)) {
                self.request(Request::Position { axis: number, counts: facts.position_counts });
            }
        }
    }

    pub(super) fn wait_for_reports(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        let silent = self.axes_of(snapshot).iter().position(|axis| !axis.is_heard);
        match silent {
            // A client may have begun to enable the group before this poll.
            None if self.after_bring_up == AfterBringUp::StayDisabled
                && is_any(snapshot, |phase| !is_off(phase)) =>
            {
                self.enter(Stage::Run, now_ns);
            }
            None if !is_any(snapshot, |phase| phase != Phase::Disabled) => {
                match (self.faulted(snapshot), fault_stop(snapshot)) {
                    // A reset of the drive would hide what has stopped the group.
                    (Some(_), Some(stop)) => self.end(now_ns, Outcome::Stopped(stop)),
                    (Some(_), None) => {
                        self.request(Request::ResetFaults);
                        self.enter(Stage::ResetFaults, now_ns);
                    }
                    (None, _) => self.go_on_without_faults(now_ns),
                }
            }
            Some(axis) if elapsed_ns > self.stage_timeout_ns => self.end(now_ns, Outcome::NotHeard { axis }),
            _ if elapsed_ns > self.stage_timeout_ns => {
                let phase = stuck_phase(snapshot, |phase| phase != Phase::Disabled);
                self.end(now_ns, Outcome::Stuck { phase });
            }
            _ => {}
        }
    }

    pub(super) fn reset_faults(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        match self.faulted(snapshot) {
            None => self.go_on_without_faults(now_ns),
            Some((axis, code)) if elapsed_ns > self.stage_timeout_ns / 4 => {
                self.end(now_ns, Outcome::FaultPersists { axis, code });
            }
            Some(_) => {}
        }
    }

    fn go_on_without_faults(&mut self, now_ns: u64) {
        match self.after_bring_up {
            AfterBringUp::Enable => {
                self.request(Request::Enable);
                self.enter(Stage::Enable, now_ns);
            }
            AfterBringUp::StayDisabled => self.enter(Stage::Run, now_ns),
        }
    }

    pub(super) fn enable(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        // A client may already have moved the group before this poll.
        let is_enabled = !is_any(snapshot, |phase| !is_in_operation(phase));
        if let Some(stop) = fault_stop(snapshot).filter(|_| !(self.is_serving && is_enabled)) {
            self.end(now_ns, Outcome::Stopped(stop));
        } else if is_enabled {
            self.deadline_ns = self.duration_ns.map(|duration_ns| now_ns + duration_ns);
            self.enter(Stage::Run, now_ns);
        } else if elapsed_ns > self.stage_timeout_ns {
            let phase = stuck_phase(snapshot, |phase| !is_in_operation(phase));
            self.end(now_ns, Outcome::Stuck { phase });
        }
    }
}
