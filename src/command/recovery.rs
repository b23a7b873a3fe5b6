//! Taking a controller out of what has stopped it.

use std::time::Duration;

use takt_rt::{Answer, Phase, RequestId, RequestTarget, Rule, Snapshot};

use super::backend::Backend;
use super::error::{CommandError, RecoveryError, Stopped, WaitError};
use super::handle::{Handle, groups_in};
use super::requests::{Command, Reply};

/// Drives that have not reported within this time are brought up again. It covers several reports of the slowest drive.
const REPORTS_WITHIN: Duration = Duration::from_secs(1);

impl<B: Backend + ?Sized> Handle<B> {
    /// Brings the drives up again, which must be disabled: after one has lost its power or was reset, or after its interface was down. Returns
    /// when they report. The axes stay disabled, and a latched fault stays. Other groups may be in motion, but for those with axes of the same
    /// drives: they must be disabled, and are brought up with it.
    ///
    /// # Errors
    /// [`RecoveryError::Command`] unless the axes are disabled, [`RecoveryError::NotBroughtUp`], [`RecoveryError::Wait`] after `at_most`. A
    /// bring-up that takes longer continues. After one that has failed, enabling is refused
    /// ([`RejectReason::NotBroughtUp`](takt_rt::RejectReason::NotBroughtUp)) until a bring-up has succeeded.
    pub fn bring_up(&self, at_most: Duration) -> Result<(), RecoveryError> {
        self.begin_bring_up()?;
        self.wait_until(at_most, |state| self.bring_up_result(state))?
    }

    /// Begins to bring the drives up again, which must be disabled.
    ///
    /// # Errors
    /// [`CommandError::Refused`] unless they are disabled, and as [`Handle::enable`].
    pub fn begin_bring_up(&self) -> Result<(), CommandError> {
        self.done(Command::BringUp(self.target()))
    }

    /// Returns the result of the bring-up that was begun before a state; `None` while it is under way. Does not wait.
    pub fn bring_up_result(&self, state: &Snapshot) -> Option<Result<(), RecoveryError>> {
        let target = self.target();
        if groups_in(state, target).iter().any(|group| group.phase == Phase::Passive) {
            return None;
        }
        match self.backend().submit(Command::BringUpFailure(target)) {
            Ok(Reply::BringUpFailure(Some(words))) => {
                return Some(Err(RecoveryError::NotBroughtUp { words }));
            }
            Ok(_) => {}
            Err(error) => return Some(Err(error.into())),
        }
        let is_confirmed = groups_in(state, target).iter().all(|group| !group.needs_bring_up);
        is_confirmed.then_some(Ok(()))
    }

    /// Takes the axes out of what has stopped them, one group after the other: waits until they are still, clears the fault, brings drives up
    /// that do not report any more or whose last bring-up has failed, and enables. Returns when the axes hold their position; at once where
    /// they are in operation without a fault.
    ///
    /// # Errors
    /// As [`Handle::bring_up`]; [`RecoveryError::Stopped`] where a fault stops the axes again. A stop that comes meanwhile ends the call with
    /// [`CommandError::Overtaken`], and the axes are not enabled. The groups that come after that one are as they were.
    pub fn recover(&self, at_most: Duration) -> Result<(), RecoveryError> {
        let until_ns = self.now_ns().saturating_add(u64::try_from(at_most.as_nanos()).unwrap_or(u64::MAX));
        let groups = u8::try_from(self.machine().groups.len()).unwrap_or(u8::MAX);
        let targets: Vec<RequestTarget> = match self.target() {
            RequestTarget::All if groups > 1 => (0..groups).map(RequestTarget::Group).collect(),
            target => vec![target],
        };
        // A stop that comes while one group recovers ends the recovery of those that follow, too.
        let groups: Vec<Self> = targets.into_iter().map(|target| self.of(target)).collect();
        let stops: Vec<RequestId> = groups.iter().map(Self::newest_stop).collect();
        groups.iter().zip(stops).try_for_each(|(group, stop)| {
            group.recover_group(stop, Duration::from_nanos(until_ns.saturating_sub(self.now_ns())))
        })
    }

    /// As [`Handle::recover`], for one group, unless a stop has come after `stop`.
    fn recover_group(&self, stop: RequestId, at_most: Duration) -> Result<(), RecoveryError> {
        let until_ns = self.now_ns().saturating_add(u64::try_from(at_most.as_nanos()).unwrap_or(u64::MAX));
        let rest = || Duration::from_nanos(until_ns.saturating_sub(self.now_ns()));
        let is = |state: &Snapshot, phases: &[Phase]| {
            groups_in(state, self.target()).iter().all(|group| phases.contains(&group.phase))
        };
        let fault = self.fault();
        let not_overtaken = || match self.newest_stop() == stop {
            true => Ok(()),
            false => Err(CommandError::Overtaken),
        };
        if fault.is_none()
            && self.look_at_state(|state| is(state, &[Phase::Holding, Phase::Moving, Phase::Streaming]))
        {
            return Ok(());
        }
        self.wait_until(rest(), |state| is(state, &[Phase::Holding, Phase::Disabled]).then_some(()))?;
        // A drive that has started anew may report, and is not configured.
        let has_restarted = fault.is_some_and(|stopped| {
            matches!(
                stopped.reason.rule(),
                Rule::UnexpectedBootUp | Rule::NodeLost | Rule::NodeNotOperational
            )
        });
        not_overtaken()?;
        self.reset_faults()?;
        if !self.look_at_state(|state| is(state, &[Phase::Disabled])) {
            return self.enabled(rest());
        }
        let needs_bring_up = has_restarted
            || self.look_at_state(|state| {
                groups_in(state, self.target()).iter().any(|group| group.needs_bring_up)
            });
        let axes = self.axis_numbers();
        let is_reporting = |state: &Snapshot| {
            axes.iter().all(|axis| state.axes().get(*axis).is_some_and(|axis| !axis.is_stale()))
        };
        // One report may be missing on a bus that works.
        let are_reporting =
            || self.wait_until(rest().min(REPORTS_WITHIN), |state| is_reporting(state).then_some(())).is_ok();
        if needs_bring_up || !are_reporting() {
            not_overtaken()?;
            self.bring_up(rest())?;
        }
        self.reset_faults()?;
        not_overtaken()?;
        self.enable()?;
        self.enabled(rest())
    }

    /// Waits until every group holds its position, or a fault keeps one from it.
    fn enabled(&self, at_most: Duration) -> Result<(), RecoveryError> {
        let fault = self.wait_until(at_most, |state| {
            let groups = groups_in(state, self.target());
            let stops = groups.iter().filter_map(|group| group.stop).filter(|stop| !stop.is_requested());
            let fault = stops.min_by_key(|stop| stop.slot);
            let are_holding = groups.iter().all(|group| group.phase == Phase::Holding);
            (fault.is_some() || are_holding).then_some(fault)
        })?;
        fault.map_or(Ok(()), |stop| Err(Stopped::new(stop, self.machine()).into()))
    }

    /// Waits until a stop that came after `before` has been taken, and every group holds or is off. `before` is the
    /// [`newest_stop`](Handle::newest_stop) before the stop was asked for.
    ///
    /// # Errors
    /// [`WaitError::NotInTime`] after `at_most`, [`WaitError::Ended`].
    pub fn wait_until_still(&self, before: RequestId, at_most: Duration) -> Result<(), WaitError> {
        let is_still = |phase| matches!(phase, Phase::Holding | Phase::Disabled | Phase::Passive);
        self.wait_until(at_most, |state| {
            let stop = self.newest_stop();
            let is_shown = state.answers.of(stop) != Answer::None || state.answers.have_forgotten(stop);
            let mut groups = groups_in(state, self.target()).iter();
            (stop > before && is_shown && groups.all(|group| is_still(group.phase))).then_some(())
        })
    }
}
