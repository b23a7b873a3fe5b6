//! Somebody whose callbacks lead the group anywhere within reason, take too long now and then, and panic.

use takt::VirtualRun;
use takt::channels::GivenCallback;
use takt::config::{Axis, Compliance, Config, Control};
use takt::link::trace::TracedPort;
use takt::{CallbackCommand, CallbackCycle, CallbackState};
use takt_rt::{AxisLimits, CallbackId, CallbackRun, Follow, Phase, Snapshot};

use crate::dice::Dice;
use crate::tap::Tap;

const BUDGET_NS: u64 = 50_000;
/// A callback is over after this time at the latest.
const LONGEST_S: f64 = 3.0;

pub struct CallbackClient {
    dice: Dice,
}

impl CallbackClient {
    pub fn new(dice: Dice) -> Self {
        Self { dice }
    }

    /// Asks for a callback now and then, mostly when it can begin, and says how long calls take in the next cycle.
    pub fn act(&mut self, config: &Config, snapshot: &Snapshot, run: &mut VirtualRun<TracedPort<Tap>>) {
        let spent_ns = if self.dice.chance(0.002) { 2 * BUDGET_NS } else { BUDGET_NS };
        run.take_for_callbacks(spent_ns);
        let group = self.dice.below(snapshot.groups().len());
        let chance = if snapshot.groups()[group].phase == Phase::Holding { 0.1 } else { 0.003 };
        if !self.dice.chance(chance) {
            return;
        }
        let axes = config.axes_of_group(group);
        let limits: Vec<(usize, AxisLimits)> =
            axes.iter().map(|axis| (*axis, config.axes[*axis].limits)).collect();
        let led = axes.iter().map(|axis| Led::of(&config.axes[*axis])).collect();
        let body = body(self.dice.split(snapshot.slot), led);
        let parameters = CallbackRun {
            callback: CallbackId(0),
            budget_ns: BUDGET_NS,
            overruns_allowed: self.dice.pick(&[0, 0, 1]),
            follow: self.dice.pick(&[None, Some(Follow::Smooth)]),
        };
        // Without room the callback is freed.
        let _ = run.host().run_callback(GivenCallback::new(group as u8, &limits, Box::new(body)), parameters);
    }
}

/// An axis as a callback leads it.
struct Led {
    limits: AxisLimits,
    /// The highest gains of an impedance, in cyclic torque; no other mode takes a torque.
    gains: Option<(f64, f64)>,
    wish: Wish,
}

#[derive(Clone, Copy)]
enum Wish {
    Nothing,
    Position(f64),
    Velocity(f64),
    Torque(f64),
    Impedance { position: f64, stiffness: f64, damping: f64, torque: f64 },
}

impl Led {
    fn of(axis: &Axis) -> Self {
        let Compliance { stiffness_max, damping_max, .. } = axis.compliance;
        let has_torque = matches!(axis.control, Control::Torque { .. });
        Self {
            limits: axis.limits,
            gains: has_torque.then_some((stiffness_max, damping_max)),
            wish: Wish::Nothing,
        }
    }

    /// Anything that its mode allows, beyond the limits of its motion too.
    fn any_wish(&self, dice: &mut Dice) -> Wish {
        let limits = &self.limits;
        let position = dice.between(1.2 * limits.position_min, 1.2 * limits.position_max);
        let velocity = dice.between(-1.5, 1.5) * limits.velocity;
        let of_motion = [Wish::Nothing, Wish::Position(position), Wish::Velocity(velocity)];
        let Some((stiffness, damping)) = self.gains.filter(|_| dice.chance(0.5)) else {
            return dice.pick(&of_motion);
        };
        let torque = dice.between(-0.2, 0.2) * limits.torque;
        let [stiffness, damping] = [stiffness, damping].map(|most| dice.between(0.0, 1.0) * most);
        dice.pick(&[Wish::Torque(torque), Wish::Impedance { position, stiffness, damping, torque }])
    }
}

fn body(
    mut dice: Dice,
    mut axes: Vec<Led>,
) -> impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send {
    let mut elapsed_s = 0.0;
    move |_, cycle, command| {
        elapsed_s += cycle.dt_s;
        assert!(!dice.chance(0.001), "a storm");
        if dice.chance(0.002) || elapsed_s > LONGEST_S {
            command.finish();
        }
        for (axis, led) in axes.iter_mut().enumerate() {
            if dice.chance(0.02) {
                led.wish = led.any_wish(&mut dice);
            }
            match led.wish {
                Wish::Nothing => command.hold(axis),
                Wish::Position(position) => command.position(axis, position),
                Wish::Velocity(velocity) => command.velocity(axis, velocity),
                Wish::Torque(torque) => command.torque(axis, torque),
                Wish::Impedance { position, stiffness, damping, torque } => {
                    command.impedance(axis, position, stiffness, damping, torque);
                }
            }
        }
    }
}
