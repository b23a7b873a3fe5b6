//! The end of a run, from any stage: it settles, is disabled, and the drives are shut down; or the power is removed at once.

use takt_rt::{Phase, Request, Snapshot, StopCategory};

use super::phases::{fault_stop, is_any, is_every_group_off, is_off, stuck_phase, unreleased_stop};
use super::{Stage, Supervisor, service_sender};
use crate::channels::HostSide;
use crate::controller::arrival::ARRIVAL_NS;
use crate::controller::outcome::{Interrupt, Outcome};

/// Drives without PDOs have this time for the last requests, of which a silent one on a serial line gets one every 500 ms.
const WITHOUT_PDOS_NS: u64 = 1_000_000_000;
/// The drives settle on their last set-point for this time, before they are disabled and the brakes engage.
const SETTLE_NS: u64 = 300_000_000;

impl Supervisor {
    pub(super) fn handle_interrupt(&mut self, now_ns: u64) {
        match (self.interrupt, self.stage) {
            (None, _) | (_, Stage::Done | Stage::RemovePower) => {}
            (Some(Interrupt::Immediate), _) => {
                self.end_bring_up_again();
                self.request(Request::InhibitEnable);
                self.request(Request::Stop(StopCategory::Zero));
                self.make_active_for_the_end();
                self.outcome.get_or_insert(Outcome::Interrupted);
                self.enter(Stage::RemovePower, now_ns);
            }
            (Some(Interrupt::Controlled), Stage::Settle { .. } | Stage::Disable | Stage::ShutDown) => {}
            (Some(Interrupt::Controlled), Stage::Run) => {
                self.request(Request::Stop(StopCategory::Two));
                self.end(now_ns, Outcome::Interrupted);
            }
            (Some(Interrupt::Controlled), _) => self.end(now_ns, Outcome::Interrupted),
        }
    }

    /// The loop does not run any more: no drive has confirmed anything.
    pub fn abandon(&mut self) {
        self.unreached = (0..self.axes).collect();
    }

    /// Begins the end of the run, from any stage.
    pub(super) fn end(&mut self, now_ns: u64, outcome: Outcome) {
        let was_running = matches!(self.stage, Stage::Run);
        let is_active = !matches!(self.stage, Stage::Configure | Stage::Start);
        self.outcome.get_or_insert(outcome);
        if was_running && !matches!(self.outcome, Some(Outcome::Stopped(_))) {
            self.enter(Stage::Settle { until_ns: now_ns + SETTLE_NS }, now_ns);
        } else if is_active {
            self.begin_disable(now_ns);
        } else {
            self.request(Request::InhibitEnable);
            self.make_active_for_the_end();
            self.begin_shut_down(now_ns);
        }
    }

    /// Has drives without process data told that they have no torque, although the bring-up has not come to an end: they may have it
    /// from an earlier run. The others are told by their shut-down.
    fn make_active_for_the_end(&mut self) {
        if matches!(self.stage, Stage::Configure | Stage::Start) && self.has_pdos.contains(&false) {
            self.request(Request::Activate);
        }
    }

    /// Waits until the joints rest on their last set-points.
    pub(super) fn settle(&mut self, now_ns: u64, elapsed_ns: u64, until_ns: u64, snapshot: &Snapshot) {
        let is_moving =
            is_any(snapshot, |phase| matches!(phase, Phase::Moving | Phase::Streaming | Phase::Stopping));
        let missed = self.missed_target(snapshot);
        let is_waited_for = (is_moving && elapsed_ns <= self.stage_timeout_ns)
            || (missed.is_some() && elapsed_ns <= ARRIVAL_NS);
        if let Some(stop) = fault_stop(snapshot) {
            self.end(now_ns, Outcome::Stopped(stop));
        } else if is_waited_for {
            self.stage = Stage::Settle { until_ns: now_ns + SETTLE_NS };
        } else if is_moving || missed.is_some() || now_ns >= until_ns {
            self.outcome = missed.or(self.outcome.take());
            // A client may still be moving the group: disabling stops it first.
            self.begin_disable(now_ns);
        }
    }

    /// The joint that the finished program has left off its target, if there is one. A program that was cut off by its
    /// duration has no target that counts.
    fn missed_target(&self, snapshot: &Snapshot) -> Option<Outcome> {
        let has_finished = self.outcome == Some(Outcome::Finished) && self.duration_ns.is_none();
        if has_finished { self.arrival.missed(&self.targets(), snapshot) } else { None }
    }

    fn begin_disable(&mut self, now_ns: u64) {
        self.end_bring_up_again();
        // In this order, so that no client can enable the group after it has been disabled.
        self.request(Request::InhibitEnable);
        self.request(Request::Disable);
        self.enter(Stage::Disable, now_ns);
    }

    pub(super) fn disable(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        if is_every_group_off(snapshot) {
            self.note_latched_fault(snapshot);
            self.note_unreleased(snapshot);
            self.begin_shut_down(now_ns);
        } else if elapsed_ns > self.stage_timeout_ns {
            let phase = stuck_phase(snapshot, |phase| !is_off(phase));
            self.outcome.get_or_insert(Outcome::Stuck { phase });
            self.begin_shut_down(now_ns);
        }
    }

    /// A fault that nobody has reset is the outcome of a run that ended well otherwise.
    fn note_latched_fault(&mut self, snapshot: &Snapshot) {
        if let (Some(stop), Some(Outcome::Finished | Outcome::Interrupted)) =
            (fault_stop(snapshot), &self.outcome)
        {
            self.outcome = Some(Outcome::Stopped(stop));
        }
    }

    /// A drive that has torque although it should have none is the outcome of every run that has got as far as to enable it.
    fn note_unreleased(&mut self, snapshot: &Snapshot) {
        let has_run = matches!(
            self.outcome,
            Some(Outcome::Finished | Outcome::Interrupted | Outcome::TakenOver { .. } | Outcome::Stopped(_))
        );
        if let Some(stop) = unreleased_stop(snapshot).filter(|_| has_run) {
            self.outcome = Some(Outcome::Stopped(stop));
        }
    }

    fn begin_shut_down(&mut self, now_ns: u64) {
        self.enter(Stage::ShutDown, now_ns);
    }

    pub(super) fn shut_down(
        &mut self,
        now_ns: u64,
        elapsed_ns: u64,
        snapshot: &Snapshot,
        host: &mut HostSide,
    ) {
        self.shutdown.poll(now_ns, &mut service_sender(host));
        let outcome = self.shutdown.outcome();
        let unsettled = self.off_cycle.lines().unsettled();
        let is_awaited = !unsettled.is_empty() && elapsed_ns <= WITHOUT_PDOS_NS;
        let not_shut_down = [self.shutdown.not_done(), unsettled].concat();
        let unconfirmed = self.unconfirmed(snapshot, Some(&not_shut_down));
        let is_over =
            outcome.is_some() && !is_awaited && self.are_told_to_stop(elapsed_ns, snapshot, &unconfirmed);
        if is_over || elapsed_ns > self.stage_timeout_ns {
            if let Some(Ok(facts)) = outcome {
                let codes = facts.iter().map(|facts| facts.error_code.0).enumerate();
                self.drive_errors = codes.filter(|(_, code)| *code != 0).collect();
            }
            self.note_unreleased(snapshot);
            self.unreached = unconfirmed;
            self.request(Request::Sync(false));
            self.request(Request::Shutdown);
            self.enter(Stage::Done, now_ns);
        }
    }

    pub(super) fn remove_power(&mut self, now_ns: u64, elapsed_ns: u64, snapshot: &Snapshot) {
        // The last controlwords take effect at the next SYNC, and may wait for the bus. So the loop goes on until the
        // group is disabled.
        let is_off = is_every_group_off(snapshot) && elapsed_ns > 0;
        let unconfirmed = self.unconfirmed(snapshot, None);
        if is_off && self.are_told_to_stop(elapsed_ns, snapshot, &unconfirmed)
            || elapsed_ns > self.stage_timeout_ns
        {
            self.note_unreleased(snapshot);
            self.unreached = unconfirmed;
            self.request(Request::Shutdown);
            self.enter(Stage::Done, now_ns);
        }
    }

    /// The axes whose drives have not confirmed that they have no torque, in their order. A drive with PDOs confirms it by its part of the
    /// shut-down, which ends its reports, and every drive by its newest report, if that is not old. `not_shut_down` are those that have not carried out their part, where there is a shut-down.
    fn unconfirmed(&self, snapshot: &Snapshot, not_shut_down: Option<&[usize]>) -> Vec<usize> {
        let is_unconfirmed = |axis: &usize| match not_shut_down {
            Some(axes) if axes.contains(axis) => true,
            Some(_) if self.has_pdos.get(*axis) == Some(&true) => false,
            _ => snapshot.axes.get(*axis).is_some_and(|own| !own.is_confirmed_off),
        };
        (0..self.axes).filter(is_unconfirmed).collect()
    }

    /// Returns `true` if every drive has been told to stop for long enough. One that does not stop by itself is told until its last report
    /// shows no torque, however old it is. What a drive with PDOs confirms is no misheard reply.
    fn are_told_to_stop(&self, elapsed_ns: u64, snapshot: &Snapshot, unconfirmed: &[usize]) -> bool {
        let axes = self.axes_of(snapshot).iter().zip(&self.has_pdos).zip(&self.least_shut_down_ns);
        axes.enumerate().all(|(index, ((axis, has_pdos), least_ns))| {
            let is_confirmed = !unconfirmed.contains(&index);
            let may_have_torque = !is_confirmed && axis.drive_state.has_torque();
            match (has_pdos, *least_ns) {
                (true, 0) => true,
                (false, 0) => is_confirmed || elapsed_ns >= WITHOUT_PDOS_NS,
                (_, least_ns) => is_confirmed && *has_pdos || elapsed_ns >= least_ns && !may_have_torque,
            }
        })
    }
}
