//! Somebody whose callbacks lead the group anywhere within reason, take too long now and then, and panic.

use takt::config::Config;
use takt::controller::VirtualRun;
use takt::controller::channels::GivenCallback;
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
    pub fn act(&mut self, config: &Config, snapshot: &Snapshot, run: &mut VirtualRun<Tap>) {
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
        let body = body(self.dice.split(snapshot.slot), limits.iter().map(|(_, limits)| *limits).collect());
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

#[derive(Clone, Copy)]
enum Wish {
    Nothing,
    Position(f64),
    Velocity(f64),
}

fn body(
    mut dice: Dice,
    limits: Vec<AxisLimits>,
) -> impl FnMut(&CallbackState<'_>, &CallbackCycle, &mut CallbackCommand<'_>) + Send {
    let mut wishes = vec![Wish::Nothing; limits.len()];
    let mut elapsed_s = 0.0;
    move |_, cycle, command| {
        elapsed_s += cycle.dt_s;
        assert!(!dice.chance(0.001), "a storm");
        if dice.chance(0.002) || elapsed_s > LONGEST_S {
            command.finish();
        }
        for (axis, (wish, limits)) in wishes.iter_mut().zip(&limits).enumerate() {
            if dice.chance(0.02) {
                // Beyond the limits, too.
                let position = dice.between(1.2 * limits.position_min, 1.2 * limits.position_max);
                let velocity = dice.between(-1.5, 1.5) * limits.velocity;
                *wish = dice.pick(&[Wish::Nothing, Wish::Position(position), Wish::Velocity(velocity)]);
            }
            match *wish {
                Wish::Nothing => command.hold(axis),
                Wish::Position(position) => command.position(axis, position),
                Wish::Velocity(velocity) => command.velocity(axis, velocity),
            }
        }
    }
}
