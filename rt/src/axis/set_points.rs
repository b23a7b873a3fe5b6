//! The set-points of an axis, on their way from the source to the drive.

use super::delay::SetPointDelay;
use crate::plan::State;

/// By how much a step may be longer than the velocity limit allows, relative to it: the guard lets half of that pass.
const STEP_ROUNDING: f64 = 2e-6;

/// The newest set-points, those that wait, and those that were sent last.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "checkpoint", derive(bitcode::Encode, bitcode::Decode))]
pub(super) struct SetPoints {
    /// Of this cycle, the last, and the one before.
    newest: [State; 3],
    /// Those that wait until the axes on slower buses are as far.
    delay: SetPointDelay,
    /// Those that were sent in this cycle, in the last, and in the one before.
    sent: [State; 3],
}

/// Puts a state before the last ones, of which the oldest one goes.
#[inline]
fn shift_in(states: &mut [State; 3], newest: State) {
    states[2] = states[1];
    states[1] = states[0];
    states[0] = newest;
}

impl SetPoints {
    /// From now on set-points wait for so many cycles before they are sent.
    pub(super) fn set_delay(&mut self, cycles: u32) {
        self.delay.set(cycles);
    }

    /// None yet, with the same delay.
    pub(super) fn anew(&self) -> Self {
        Self { delay: self.delay.anew(), ..Self::default() }
    }

    /// For how many cycles set-points wait before they are sent.
    pub(super) fn delay_cycles(&self) -> f64 {
        self.delay.cycles() as f64
    }

    /// The newest set-point.
    pub(super) const fn newest(&self) -> State {
        self.newest[0]
    }

    /// The positions of this cycle, the last, and the one before.
    #[inline]
    pub(super) fn positions(&self) -> [f64; 3] {
        self.newest.map(|state| state.position)
    }

    /// How much the acceleration has changed in this cycle.
    pub(super) fn acceleration_change(&self) -> f64 {
        self.newest[0].acceleration - self.newest[1].acceleration
    }

    /// Takes the next set-point.
    pub(super) fn push(&mut self, next: State) {
        shift_in(&mut self.newest, next);
        self.delay.push(next);
    }

    /// Gives the newest set-point another velocity and acceleration.
    pub(super) fn refine_newest(&mut self, state: State) {
        self.newest[0] = state;
    }

    /// Rests at a position, as if it had always been there.
    pub(super) fn rest_at(&mut self, position: f64) {
        self.newest = [State::rest(position); 3];
        self.delay.fill(self.newest[0]);
        self.sent = self.newest;
    }

    /// Goes on evenly from where a joint is reported, as if it had always been on its way like that. The set-point that the
    /// report belongs to was sent two cycles ago.
    pub(super) fn begin_at(&mut self, position: f64, velocity: f64, period_s: f64) {
        let delayed = self.delay_cycles();
        let ahead = |cycles: f64| State {
            position: position + velocity * cycles * period_s,
            velocity,
            acceleration: 0.0,
        };
        let newest = delayed + 2.0;
        self.newest = [ahead(newest), ahead(newest - 1.0), ahead(newest - 2.0)];
        self.delay.fill_with(|ago| ahead(newest - ago as f64));
        self.sent = [ahead(1.0), ahead(0.0), ahead(-1.0)];
    }

    /// Rests where the newest set-point is. What waits to be sent is still sent: a drive that obeys although it says otherwise
    /// gets no step.
    pub(super) fn rest_here(&mut self) {
        self.newest = [State::rest(self.newest[0].position); 3];
        self.delay.push(self.newest[0]);
    }

    /// Begins a command: the set-point that is due is sent.
    pub(super) fn send(&mut self) {
        self.note_sent(self.delay.due());
    }

    /// Begins a command of a drive that follows set-points: the one that is due is sent, or one on the way to it. Where some could
    /// not leave before, the drive does not get the way of several cycles in one.
    #[inline]
    pub(super) fn send_within(&mut self, velocity_limit: f64, cycle_s: f64) {
        let due = self.delay.due();
        let way = due.position - self.sent[0].position;
        if way.abs() > velocity_limit * cycle_s * (1.0 + STEP_ROUNDING) {
            return self.send_on_way(velocity_limit.copysign(way), cycle_s);
        }
        self.note_sent(due);
    }

    /// Goes on from what was sent last for one cycle at this velocity.
    #[cold]
    fn send_on_way(&mut self, velocity: f64, cycle_s: f64) {
        let position = self.sent[0].position + velocity * cycle_s;
        self.note_sent(State { position, velocity, acceleration: 0.0 });
    }

    fn note_sent(&mut self, state: State) {
        shift_in(&mut self.sent, state);
    }

    /// The set-point that is sent in this cycle; it takes effect at the next SYNC.
    pub(super) const fn sent_now(&self) -> State {
        self.sent[0]
    }

    /// The set-point that the joint should have reached when the present feedback was taken.
    pub(super) const fn due(&self) -> State {
        self.sent[2]
    }
}
