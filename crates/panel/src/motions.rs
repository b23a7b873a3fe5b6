//! What pages have set in motion, and its end when its page is lost.
//!
//! Each group has one motion of a page at most. A thread looks at it every 10 ms: it renews a velocity or a torque, turns a reciprocating
//! axis around, and brings the group to rest when the page is not there any more or a held key is not renewed. The stream and the profile
//! modes have an end of their own in the real-time thread: what this thread does not renew there comes to rest as well. All times are those of
//! the controller, whose clock may be a virtual one.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use takt_rt::{Nanoseconds, Phase, RequestTarget, StopCategory};

use super::command::{
    Command, CommandRefusal, Lasts, Quantity, begin_move, change_mode, positions_with, target_of,
    target_of_axis,
};
use super::motion::{Kind, Motion, Route, Step, is_meant};
use super::pages::PageNumber;
use takt::command::{AnyHandle, MoveOptions, WaitError};

/// A held key that is not renewed for so long is released.
pub const HELD_FOR: Duration = Duration::from_millis(250);
/// How often motions are looked at.
pub const LOOK: Duration = Duration::from_millis(10);
/// How long a motion that follows another one waits for its end.
const AT_REST_WITHIN: Duration = Duration::from_secs(1);

/// A problem of a motion that its page has not asked about.
#[derive(Clone, Debug)]
pub struct Problem {
    /// The page.
    pub page: PageNumber,
    /// What it is.
    pub refusal: CommandRefusal,
}

/// What pages have set in motion.
pub struct Motions {
    controller: AnyHandle,
    /// Held while the controller is asked, which may take its time.
    kept: Mutex<Kept>,
    changed: Condvar,
    /// Whose motions these are, to stop them without waiting. The values of profile modes are not among them: a stop of category 2 may
    /// disable such a drive, and the thread lets them go to zero.
    moving: Mutex<Vec<(PageNumber, RequestTarget)>>,
    /// Stops that came through the panel.
    stops: AtomicU64,
}

#[derive(Default)]
struct Kept {
    motions: Vec<Motion>,
    /// The bring-ups that are under way, whose failure their pages are told.
    bring_ups: Vec<(PageNumber, RequestTarget)>,
    has_ended: bool,
}

/// A panic of another holder of a lock leaves these lists consistent.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Motions {
    /// Nothing moves.
    pub fn new(controller: AnyHandle) -> Self {
        Self {
            controller,
            kept: Mutex::default(),
            changed: Condvar::new(),
            moving: Mutex::default(),
            stops: AtomicU64::new(0),
        }
    }

    /// How many stops have come through the panel: a command that waits while it rises is not begun.
    pub fn stops(&self) -> u64 {
        self.stops.load(Ordering::Acquire)
    }

    /// Stops the axes of a target. It waits for nobody.
    ///
    /// # Errors
    /// [`CommandRefusal::Controller`] if the controller has ended.
    pub fn stop(&self, target: RequestTarget, category: StopCategory) -> Result<(), CommandRefusal> {
        self.stops.fetch_add(1, Ordering::AcqRel);
        Ok(self.controller.of(target).stop(category)?)
    }

    /// Brings everything to rest that a page has set in motion. It waits for nobody.
    pub fn end_of(&self, page: PageNumber) {
        self.end_where(|of| of == page);
    }

    /// Brings everything to rest whose page may not move any more. It waits for nobody.
    pub fn end_unless(&self, may_move: impl Fn(PageNumber) -> bool) {
        self.end_where(|page| !may_move(page));
    }

    /// The thread drops these motions at its next look, since a stop has come.
    fn end_where(&self, is_to_end: impl Fn(PageNumber) -> bool) {
        for (_, target) in locked(&self.moving).iter().filter(|(page, _)| is_to_end(*page)) {
            // Where the controller has ended, nothing moves.
            let _ = self.controller.of(*target).stop(StopCategory::Two);
        }
    }

    /// Ends the thread, and brings everything to rest.
    pub fn end(&self) {
        self.end_where(|_| true);
        locked(&self.kept).has_ended = true;
        self.changed.notify_all();
    }

    /// Carries out a command of a page, unless there was a stop since `stops`. A motion begins only if `may_begin` says that its page
    /// is there and has asked for nothing else since: a key that was let go meanwhile moves nothing.
    ///
    /// # Errors
    /// See [`CommandRefusal`].
    pub fn carry_out(
        &self,
        page: PageNumber,
        command: Command,
        stops: u64,
        may_begin: &dyn Fn() -> bool,
    ) -> Result<(), CommandRefusal> {
        let controller = &self.controller;
        let machine = controller.machine();
        let options = |velocity, acceleration| MoveOptions {
            velocity_scale: velocity,
            acceleration_scale: acceleration,
            ..MoveOptions::default()
        };
        if let Some(target) = command.moved(machine)? {
            self.end_before(target)?;
            self.await_end_of_stop(target);
            if !may_begin() {
                return Err(CommandRefusal::Discarded);
            }
        }
        if self.stops() != stops {
            return Err(CommandRefusal::Discarded);
        }
        match command {
            Command::Enable { group } => Ok(controller.of(target_of(group, machine)?).enable()?),
            Command::Disable { group } => self.disable(target_of(group, machine)?),
            Command::ClearFaults { group } => Ok(controller.of(target_of(group, machine)?).reset_faults()?),
            Command::BringUp { group } => self.bring_up(page, target_of(group, machine)?),
            Command::Move { axis, to, relative, velocity, acceleration } => {
                let target = target_of_axis(axis, machine)?;
                let from = controller.state().axes().get(axis).map_or(0.0, |axis| axis.position_set);
                let to = if relative { from + to } else { to };
                let positions = positions_with(controller, target, axis, to);
                self.move_to(page, target, &positions, options(velocity, acceleration), stops)
            }
            Command::MoveGroup { group, to, velocity, acceleration } => self.move_to(
                page,
                target_of(Some(group), machine)?,
                &to,
                options(velocity, acceleration),
                stops,
            ),
            Command::Reciprocate { axis, between, velocity, acceleration } => {
                self.reciprocate(page, axis, between, options(velocity, acceleration), stops)
            }
            Command::Drive { axis, quantity, value, lasts } => {
                self.drive(page, axis, quantity, (value, lasts), stops)
            }
            Command::Renew { axis, value } => self.renew(page, axis, value),
            Command::Release { axis } => self.release(page, axis),
            Command::ChangeMode { axis, mode } => change_mode(controller, axis, mode),
        }
    }

    /// So long from now, on the clock of the controller.
    fn until(&self, lasts: Duration) -> Nanoseconds {
        self.controller.now_ns().saturating_add(lasts.as_nanos() as u64)
    }

    /// A motion cannot begin while the one before it comes to rest, which takes a moment.
    fn await_end_of_stop(&self, target: RequestTarget) {
        let until_ns = self.until(AT_REST_WITHIN);
        loop {
            let state = self.controller.state();
            let mut phases = state.groups().iter().enumerate().filter(|(group, _)| is_meant(target, *group));
            let is_stopping = phases.any(|(_, group)| group.phase == Phase::Stopping);
            if !is_stopping
                || self.controller.now_ns() >= until_ns
                || self.controller.cycle_after(state.slot, LOOK) == Err(WaitError::Ended)
            {
                return;
            }
        }
    }

    /// What goes on until it is released ends before another motion of the same axes begins.
    fn end_before(&self, target: RequestTarget) -> Result<(), CommandRefusal> {
        self.release_where(|motion| motion.target == target && motion.repeated_axis().is_some())
    }

    fn release_where(&self, is_meant: impl Fn(&Motion) -> bool) -> Result<(), CommandRefusal> {
        let released: Vec<Motion> =
            locked(&self.kept).motions.extract_if(.., |motion| is_meant(motion)).collect();
        let ended = released.iter().try_for_each(|motion| match motion.zero(&self.controller) {
            Some(zero) => zero.map(drop),
            None => self.rest(motion.target),
        });
        self.list_moving(&locked(&self.kept));
        ended
    }

    /// What is kept is all that moves.
    fn list_moving(&self, kept: &Kept) {
        let moving = kept.motions.iter().filter(|motion| !motion.is_profile());
        *locked(&self.moving) = moving.map(|motion| (motion.page, motion.target)).collect();
    }

    /// Stops what is repeated, and waits until the real-time thread has taken that: a motion that follows begins after it.
    fn rest(&self, target: RequestTarget) -> Result<(), CommandRefusal> {
        let (before, until_ns) = (self.controller.of(target).newest_stop(), self.until(AT_REST_WITHIN));
        self.controller.of(target).stop(StopCategory::Two)?;
        while self.controller.of(target).newest_stop() == before && self.controller.now_ns() < until_ns {
            if self.controller.cycle_after(self.controller.state().slot, LOOK) == Err(WaitError::Ended) {
                break;
            }
        }
        Ok(())
    }

    fn disable(&self, target: RequestTarget) -> Result<(), CommandRefusal> {
        let mut kept = locked(&self.kept);
        kept.motions.retain(|motion| target != RequestTarget::All && motion.target != target);
        self.list_moving(&kept);
        drop(kept);
        Ok(self.controller.of(target).disable()?)
    }

    fn bring_up(&self, page: PageNumber, target: RequestTarget) -> Result<(), CommandRefusal> {
        self.controller.of(target).begin_bring_up()?;
        locked(&self.kept).bring_ups.push((page, target));
        self.changed.notify_all();
        Ok(())
    }

    /// Keeps a motion that has just begun, in place of the one before; unless a stop has come meanwhile.
    fn keep(&self, motion: Motion, stops: u64) -> Result<(), CommandRefusal> {
        let mut kept = locked(&self.kept);
        if !motion.is_profile() {
            locked(&self.moving).push((motion.page, motion.target));
        }
        if self.stops() != stops || kept.has_ended {
            let stopped = self.controller.of(motion.target).stop(StopCategory::Two);
            self.list_moving(&kept);
            return stopped.map_err(CommandRefusal::from).and(Err(CommandRefusal::Discarded));
        }
        kept.motions.retain(|other| other.target != motion.target);
        kept.motions.push(motion);
        self.changed.notify_all();
        Ok(())
    }

    fn move_to(
        &self,
        page: PageNumber,
        target: RequestTarget,
        positions: &[f64],
        options: MoveOptions,
        stops: u64,
    ) -> Result<(), CommandRefusal> {
        let newest_stop = self.controller.of(target).newest_stop();
        let motion = begin_move(&self.controller, target, positions, options)?;
        self.keep(Motion { page, target, newest_stop, kind: Kind::Move(motion) }, stops)
    }

    fn reciprocate(
        &self,
        page: PageNumber,
        axis: usize,
        between: [f64; 2],
        options: MoveOptions,
        stops: u64,
    ) -> Result<(), CommandRefusal> {
        let target = target_of_axis(axis, self.controller.machine())?;
        let newest_stop = self.controller.of(target).newest_stop();
        let ends = between.map(|position| positions_with(&self.controller, target, axis, position));
        let motion = begin_move(&self.controller, target, &ends[0], options)?;
        let kind = Kind::Reciprocate { axis, ends, options, next: 1, motion };
        self.keep(Motion { page, target, newest_stop, kind }, stops)
    }

    fn drive(
        &self,
        page: PageNumber,
        axis: usize,
        quantity: Quantity,
        (value, lasts): (f64, Lasts),
        stops: u64,
    ) -> Result<(), CommandRefusal> {
        let target = target_of_axis(axis, self.controller.machine())?;
        let newest_stop = self.controller.of(target).newest_stop();
        let by = Route::begin(&self.controller, axis, target, quantity, value)?;
        let until = (lasts == Lasts::Held).then(|| self.until(HELD_FOR));
        let kind = Kind::Drive { axis, value, until, by };
        self.keep(Motion { page, target, newest_stop, kind }, stops)
    }

    fn renew(&self, page: PageNumber, axis: usize, value: f64) -> Result<(), CommandRefusal> {
        let mut kept = locked(&self.kept);
        let mut driven = kept.motions.iter_mut().filter(|motion| motion.page == page);
        let driven = driven.find_map(|motion| match &mut motion.kind {
            Kind::Drive { axis: own, value, until, .. } if *own == axis => Some((value, until)),
            _ => None,
        });
        let (own, until) = driven.ok_or(CommandRefusal::NothingToRenew)?;
        *own = value;
        if let Some(until) = until {
            *until = self.until(HELD_FOR);
        }
        Ok(())
    }

    fn release(&self, page: PageNumber, axis: usize) -> Result<(), CommandRefusal> {
        self.release_where(|motion| motion.page == page && motion.repeated_axis() == Some(axis))
    }

    /// Leads the motions until [`Motions::end`], or until the controller ends. Of a page that is not there it ends them.
    pub fn run(&self, may_move: impl Fn(PageNumber) -> bool, tell: impl Fn(Problem)) {
        loop {
            let mut kept = locked(&self.kept);
            while kept.motions.is_empty() && kept.bring_ups.is_empty() && !kept.has_ended {
                kept = self.changed.wait(kept).unwrap_or_else(PoisonError::into_inner);
            }
            if kept.has_ended || self.controller.has_ended() {
                return;
            }
            self.step(kept, &may_move, &tell);
            std::thread::sleep(LOOK);
        }
    }

    /// Goes on with the motions once, where no thread does: to be called every [`LOOK`].
    pub fn look(&self, tell: impl Fn(Problem)) {
        if !self.controller.has_ended() {
            self.step(locked(&self.kept), &|_| true, &tell);
        }
    }

    fn step(
        &self,
        mut kept: MutexGuard<'_, Kept>,
        may_move: &impl Fn(PageNumber) -> bool,
        tell: &impl Fn(Problem),
    ) {
        kept.motions.retain_mut(|motion| {
            let step = if may_move(motion.page) { motion.step(&self.controller) } else { Step::Rest };
            self.is_kept(motion, step, tell)
        });
        self.list_moving(&kept);
        if kept.bring_ups.is_empty() {
            return;
        }
        let state = self.controller.state();
        kept.bring_ups.retain(|(page, target)| {
            let result = self.controller.of(*target).bring_up_result(&state);
            if let Some(Err(error)) = &result {
                tell(Problem { page: *page, refusal: error.clone().into() });
            }
            result.is_none()
        });
    }

    fn is_kept(&self, motion: &Motion, step: Step, tell: &impl Fn(Problem)) -> bool {
        let refusal = match step {
            Step::GoesOn => return true,
            Step::Over => return false,
            Step::Rest => None,
            Step::Failed(refusal) => Some(refusal),
        };
        let is_at_zero = matches!(motion.zero(&self.controller), Some(Ok(_)));
        if !is_at_zero {
            // Where the controller has ended, nothing moves.
            let _ = self.controller.of(motion.target).stop(StopCategory::Two);
        }
        if let Some(refusal) = refusal {
            tell(Problem { page: motion.page, refusal });
        }
        false
    }
}
