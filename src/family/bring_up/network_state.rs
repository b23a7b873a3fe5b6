//! The NMT states of a drive in bring-up and shutdown: commands, confirmation by boot-up and heartbeat, restarts.

use takt_rt::{DriveState, Nanoseconds};
use takt_wire::canopen::nmt::{NmtCommand, NmtState};
use takt_wire::canopen::objects::{DEVICE_TYPE, STATUSWORD};
use takt_wire::canopen::sdo::{SdoError, Transfer};

use super::axis_session::{AxisSession, StepResult, object_of};
use super::failure::{FailureCause, ProbeResult};
use super::timing::BringUpTiming;
use crate::config::Supervision;
use crate::family;
use crate::procedure::Access;

/// The first step of every bring-up.
pub const RESTART_STEP: &str = "restart of its communication";
/// A state is not waited for when the drive reports it less often than this: Ctrl-C would take as long.
const LONGEST_AWAITED_HEARTBEAT_NS: Nanoseconds = 1_000_000_000;

/// A state to command and to wait for.
#[derive(Clone, Copy)]
struct StateChange {
    command: NmtCommand,
    awaited: NmtState,
    within_ns: Nanoseconds,
    /// When to repeat the command, because a booting node may have missed it.
    repeat_ns: Nanoseconds,
}

impl AxisSession<'_> {
    /// Resets the drive and waits for its boot-up. A drive that has restarted does not need it again.
    pub async fn restart_communication(&self) -> StepResult {
        if self.bus.watches_restarts() {
            return self.settled(Ok(()));
        }
        let command = self.reset().await;
        let boot_ups = self.bus.boot_ups();
        let reset = StateChange {
            command,
            awaited: NmtState::BootUp,
            within_ns: self.timing.boot_up_timeout_ns,
            repeat_ns: self.timing.reset_repeat_ns,
        };
        let restarted = self.reach(reset).await;
        self.bus.watch_restarts(boot_ups.saturating_add(1));
        self.settled(restarted)
    }

    /// The command that resets the node: its communication, as the manuals say.
    ///
    /// That takes the heartbeat consumer (1016) from it. A drive that has kept its torque and does not obey would then have nothing that
    /// stops it. So a node that is brought up again restarts as a whole, which ends the torque, unless each of its axes shows that it
    /// has none.
    async fn reset(&self) -> NmtCommand {
        if self.is_again {
            for axis in self.siblings() {
                let object = object_of(axis, STATUSWORD).address;
                let read = self.bus.read_bytes(object).await;
                let statusword = read.ok().and_then(|uploaded| uploaded.number(STATUSWORD.data_type));
                let state = statusword.map(|statusword| axis.drive.codec.state(statusword as u16));
                if state.is_none_or(DriveState::has_torque) {
                    return NmtCommand::ResetNode;
                }
            }
        }
        NmtCommand::ResetCommunication
    }

    /// Commands a state. The drive's heartbeat must report it, if it has one that comes soon.
    pub async fn command(&self, command: NmtCommand, awaited: NmtState) -> StepResult {
        let supervision = self.axis.supervision(&self.config.master);
        let reached = match confirmation_ns(supervision, &self.timing) {
            Some(within_ns) => {
                self.reach(StateChange { command, awaited, within_ns, repeat_ns: within_ns / 3 }).await
            }
            None => {
                self.bus.command(command);
                Ok(())
            }
        };
        self.bus.watch_restarts(self.bus.boot_ups());
        self.settled(reached)
    }

    /// Repeats an NMT command and an SDO upload of object 1000 until the node answers. The node may have been absent,
    /// and a node in NMT stopped has no SDO server before the command.
    pub(crate) async fn wake_up(&self, command: NmtCommand) -> StepResult {
        let woken = if self.is_dry_run() {
            Ok(())
        } else {
            match self.bus.read_bytes_after_command(command, DEVICE_TYPE.address).await {
                Ok(_) | Err(SdoError::Aborted(_)) => Ok(()),
                Err(error) => {
                    Err(FailureCause::Transfer { object: DEVICE_TYPE, access: Access::Read, error })
                }
            }
        };
        self.bus.watch_restarts(self.bus.boot_ups());
        self.settled(woken)
    }

    async fn reach(&self, change: StateChange) -> StepResult {
        if self.is_dry_run() {
            return Ok(());
        }
        let StateChange { command, awaited, within_ns, repeat_ns } = change;
        let repeat_ns = repeat_ns.max(1);
        let began_ns = self.bus.now_ns();
        let end_ns = began_ns.saturating_add(within_ns);
        self.bus.command(command);
        let mut commanded_ns = began_ns;
        while !self.bus.reports(awaited, end_ns.min(commanded_ns.saturating_add(repeat_ns))).await {
            commanded_ns = self.bus.now_ns();
            if commanded_ns >= end_ns {
                return self.probe(awaited, commanded_ns.saturating_sub(began_ns)).await;
            }
            self.bus.repeat_command(command);
        }
        Ok(())
    }

    /// Probes the node by SDO and by the vendor's own protocol, because it has not reported the awaited state. It may
    /// still report it meanwhile.
    async fn probe(&self, awaited: NmtState, waited_ns: Nanoseconds) -> StepResult {
        let other = family::of(&self.axis.drive).other_protocol(&self.axis.drive, self.axis.node);
        if let Some(other) = other {
            self.bus.send(other.request);
        }
        self.bus.begin_collecting();
        let question = self.bus.exchange(Transfer::Upload { object: DEVICE_TYPE.address });
        let answer = self.bus.unless_over(|| self.bus.has_reported(awaited), question).await;
        let frames = self.bus.end_collecting();
        let Some(answer) = answer else {
            self.bus.reset_transfer();
            return Ok(());
        };
        let other = other.filter(|other| frames.iter().any(|frame| frame.id() == other.answer));
        let probe_result = match (answer, other) {
            (Ok(_) | Err(SdoError::Aborted(_)), _) => ProbeResult::Sdo,
            (_, Some(other)) => ProbeResult::OtherProtocol(other.name),
            _ => ProbeResult::Nothing,
        };
        let reported = self.bus.nmt_state();
        Err(FailureCause::StateNotReached { awaited, reported, waited_ns, probe_result })
    }
}

/// How long to wait until the drive's heartbeat confirms a state; `None` when it has no heartbeat that comes soon.
fn confirmation_ns(supervision: Supervision, timing: &BringUpTiming) -> Option<Nanoseconds> {
    match supervision {
        Supervision::Heartbeat { period_ns } if period_ns <= LONGEST_AWAITED_HEARTBEAT_NS => {
            Some(timing.confirm_timeout_ns.saturating_add(period_ns.saturating_mul(3)))
        }
        Supervision::Heartbeat { .. } | Supervision::Guarding { .. } | Supervision::Feedback => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_is_waited_for_unless_its_drive_reports_it_once_in_a_minute() {
        let within_ns = |supervision| confirmation_ns(supervision, &BringUpTiming::default());
        let heartbeat = |period_ns| Supervision::Heartbeat { period_ns };
        assert!(within_ns(heartbeat(100_000_000)).is_some_and(|within_ns| within_ns > 300_000_000));
        assert_eq!(within_ns(Supervision::Feedback), None);
        assert_eq!(within_ns(heartbeat(60_000_000_000)), None);
    }
}
