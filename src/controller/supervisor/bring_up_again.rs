//! Groups that a client has let go back to passive are brought up again, beside what the others do.

use takt_rt::{Request, RequestId, RequestTarget, Snapshot};
use tracing::{error, info};

use super::again::{BringUpAgain, Step};
use super::{Supervisor, service_sender};
use crate::channels::HostSide;
use crate::controller::outcome::Outcome;
use crate::telemetry::Machine;

impl Supervisor {
    /// Continues the bring-up of groups that have gone back to passive, or begins it.
    pub(super) fn bring_up_again(&mut self, now_ns: u64, snapshot: &Snapshot, host: &mut HostSide) {
        let config = self.bring_up.config();
        let Some(mut again) = self.again.take().or_else(|| {
            let begun = BringUpAgain::of_passive(config, &self.bring_up, snapshot)?;
            host.bring_up_failures().forget(&begun.groups);
            self.off_cycle.begin_again(config, &begun.axes);
            info!(target: "takt::run", groups = ?begun.groups, "drives are brought up again");
            Some(begun)
        }) else {
            return;
        };
        let is_over = match again.step {
            Step::Configure | Step::Start => {
                self.go_on_with(&mut again, now_ns, host);
                false
            }
            Step::Report { since_ns } => {
                let elapsed_ns = now_ns.saturating_sub(since_ns);
                // A client may ask anew before the supervisor has seen the groups active.
                again.is_activated(snapshot)
                    && (again.is_any_passive(snapshot)
                        || self.confirm_reports(&again, elapsed_ns, snapshot, host))
            }
            Step::Failed => again.is_activated(snapshot),
        };
        self.again = (!is_over).then_some(again);
    }

    fn go_on_with(&mut self, again: &mut BringUpAgain, now_ns: u64, host: &mut HostSide) {
        again.bring_up.poll(now_ns, &mut service_sender(host));
        match (again.bring_up.outcome(), again.step) {
            (None, _) => {}
            (Some(Err(error)), _) => {
                note_failure(again, error.to_string(), host);
                again.activations = self.request_of_each(again, Request::Activate);
                again.step = Step::Failed;
            }
            (Some(Ok(facts)), Step::Configure) => {
                for axis in &again.axes {
                    if let (Some(known), Some(facts)) = (self.facts.get_mut(*axis), facts.get(*axis)) {
                        known.clone_from(facts);
                    }
                }
                self.tell_facts(&again.axes);
                // The first part has succeeded, so the second one can begin.
                let _ = again.bring_up.start();
                again.step = Step::Start;
            }
            (Some(Ok(facts)), _) => {
                self.tell_positions(&again.axes, &facts);
                again.activations = self.request_of_each(again, Request::Activate);
                again.step = Step::Report { since_ns: now_ns };
            }
        }
    }

    /// Ends the bring-up. Its groups are active again, so that their drives are told what those of the others are.
    pub(super) fn end_bring_up_again(&mut self) {
        if let Some(again) = self.again.take() {
            self.request_of_each(&again, Request::Activate);
        }
    }

    fn request_of_each(&mut self, again: &BringUpAgain, request: Request) -> Vec<RequestId> {
        let targets = again.groups.iter().map(|group| RequestTarget::Group(*group));
        targets.map(|target| self.request_of(target, request)).collect()
    }

    /// Confirms the bring-up if all drives report. It has failed if one has not reported in time. Returns `true` if either is the case.
    fn confirm_reports(
        &mut self,
        again: &BringUpAgain,
        elapsed_ns: u64,
        snapshot: &Snapshot,
        host: &HostSide,
    ) -> bool {
        let is_silent = |axis: &&usize| snapshot.axes.get(**axis).is_some_and(|axis| !axis.is_heard);
        match again.axes.iter().find(is_silent) {
            None => {
                self.request_of_each(again, Request::ConfirmBringUp);
                true
            }
            Some(_) if elapsed_ns <= self.stage_timeout_ns => false,
            Some(axis) => {
                let machine = Machine::of(self.bring_up.config());
                note_failure(again, Outcome::NotHeard { axis: *axis }.words(&machine), host);
                true
            }
        }
    }
}

fn note_failure(again: &BringUpAgain, words: String, host: &HostSide) {
    error!(target: "takt::run", groups = ?again.groups, "drives were not brought up: {words}");
    host.bring_up_failures().note(&again.groups, &words);
}
