//! A callback that leads a group: it wants anything of the axes, takes too long, panics, or is over.

use takt::config::Config;
use takt_rt::{
    AxisTarget, CallbackId, CallbackOutcome, CallbackReturn, CallbackRun, Follow, MAX_AXES, Request,
    plan::State,
};

use super::super::input::Input;

/// How long a call may take.
const BUDGET_NS: u64 = 50_000;

/// What the callback does when it is called.
pub struct Leading {
    wanted: [Option<AxisTarget>; MAX_AXES],
    /// How the next call ends; those after it command what is wanted.
    next: CallbackReturn,
    /// Calls so far.
    pub calls: u64,
    /// True if a torque or an impedance was ever wanted: a joint need not be on its set-point then.
    pub has_driven: bool,
}

const COMMANDED: CallbackReturn = CallbackReturn { outcome: CallbackOutcome::Commanded, spent_ns: 1_000 };

impl Default for Leading {
    fn default() -> Self {
        Self { wanted: [None; MAX_AXES], next: COMMANDED, calls: 0, has_driven: false }
    }
}

impl Leading {
    /// A call.
    pub fn call(&mut self, targets: &mut [Option<AxisTarget>; MAX_AXES]) -> CallbackReturn {
        self.calls += 1;
        *targets = self.wanted;
        std::mem::replace(&mut self.next, COMMANDED)
    }

    /// Changes what it does, or asks for it.
    pub fn change(&mut self, config: &Config, input: &mut Input<'_>) -> Option<Request> {
        match input.byte() % 4 {
            0 => {
                let how = input.byte();
                return Some(Request::RunCallback(CallbackRun {
                    callback: CallbackId(1),
                    budget_ns: BUDGET_NS,
                    overruns_allowed: u32::from(how % 2),
                    follow: [None, Some(Follow::Smooth), Some(Follow::Exact)][usize::from(how / 2 % 3)],
                }));
            }
            1 | 2 => {
                let axis = usize::from(input.byte()) % config.axes.len();
                self.wanted[axis] = self.any_target(config, axis, input);
            }
            _ => {
                self.next = match input.byte() % 4 {
                    0 => CallbackReturn { outcome: CallbackOutcome::Panicked, ..COMMANDED },
                    1 => CallbackReturn { outcome: CallbackOutcome::Finished, ..COMMANDED },
                    2 => CallbackReturn { outcome: CallbackOutcome::Missing, ..COMMANDED },
                    _ => CallbackReturn { spent_ns: u64::from(input.word()), ..COMMANDED },
                };
            }
        }
        None
    }

    /// Mostly within reason, which the other numbers show.
    fn any_target(&mut self, config: &Config, axis: usize, input: &mut Input<'_>) -> Option<AxisTarget> {
        let limits = &config.axes[axis].limits;
        let kind = input.byte();
        let share = f64::from(input.byte() as i8) / 100.0;
        let value = |most: f64, input: &mut Input<'_>| if kind < 200 { share * most } else { input.number() };
        match kind % 5 {
            0 => None,
            1 => Some(State::rest(value(limits.position_max, input)).into()),
            2 => Some(AxisTarget::Velocity { velocity: value(limits.velocity, input), acceleration: 0.0 }),
            3 => {
                self.has_driven = true;
                Some(AxisTarget::Torque(value(0.1 * limits.torque, input)))
            }
            _ => {
                self.has_driven = true;
                let state = State::rest(value(limits.position_max, input));
                let compliance = &config.axes[axis].compliance;
                let stiffness = value(compliance.stiffness_max, input).abs();
                let damping = value(compliance.damping_max, input).abs();
                Some(AxisTarget::Impedance { state, stiffness, damping, torque: input.number() })
            }
        }
    }
}
