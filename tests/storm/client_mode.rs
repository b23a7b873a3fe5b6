//! Somebody who changes the modes of axes, mostly when that is possible: while the group is disabled.

use takt::VirtualRun;
use takt::config::{Axis, Config, Control};
use takt::link::trace::TracedPort;
use takt_rt::{MAX_AXES, ModeChange, OperationMode, Phase, Request, RequestTarget, Snapshot};

use crate::dice::Dice;
use crate::tap::Tap;

/// The axes that follow set-points in a cyclic synchronous mode may be changed to each of the others, where the buses carry that.
pub fn let_modes_change(config: &mut Config) {
    let before = config.clone();
    for axis in config.axes.iter_mut().filter(|axis| axis.drive.mode_changes.condition().is_some()) {
        if axis.control.is_cyclic_synchronous() {
            let others = [Control::Position, Control::Velocity { position_gain: 10.0 }, torque_loop(axis)];
            let own = axis.control.operation_mode();
            let others = others.into_iter().filter(|law| law.operation_mode() != own).collect();
            *axis = axis.clone().with_other_modes(others);
        }
    }
    let fits = takt::schedule::analyse(config).iter().all(takt::schedule::BusSchedule::fits);
    if !fits || config.validate().is_err() {
        *config = before;
    }
}

fn torque_loop(axis: &Axis) -> Control {
    let inertia = axis.joint.inertia();
    Control::Torque {
        stiffness: 900.0 * inertia,
        damping: 60.0 * inertia,
        inertia,
        viscous_friction: axis.joint.viscous_friction(),
        coulomb_friction: axis.joint.coulomb_friction(),
    }
}

pub struct ModeClient {
    dice: Dice,
}

impl ModeClient {
    pub fn new(dice: Dice) -> Self {
        Self { dice }
    }

    pub fn act(&mut self, config: &Config, snapshot: &Snapshot, run: &mut VirtualRun<TracedPort<Tap>>) {
        let group = self.dice.below(config.groups.len().max(1));
        let target =
            if config.groups.is_empty() { RequestTarget::All } else { RequestTarget::Group(group as u8) };
        let phase = snapshot.groups().get(group).map(|group| group.phase);
        let chance = if phase == Some(Phase::Disabled) { 0.1 } else { 0.003 };
        if self.dice.chance(chance) {
            let modes = self.modes(config);
            // Without room it is not asked for.
            let _ = run.host().request_of(target, Request::ChangeMode(ModeChange { modes }));
        }
        if phase == Some(Phase::Holding) && self.dice.chance(0.005) {
            let _ = run.host().request_of(target, Request::Disable);
        }
    }

    fn modes(&mut self, config: &Config) -> [Option<OperationMode>; MAX_AXES] {
        let mut modes = [None; MAX_AXES];
        let is_strange = self.dice.chance(0.03);
        for (mode, axis) in modes.iter_mut().zip(&config.axes) {
            let controls: Vec<&Control> = axis.controls().collect();
            let control = controls[self.dice.below(controls.len())];
            *mode = self.dice.chance(0.7).then_some(control.operation_mode());
            if is_strange && self.dice.chance(0.5) {
                *mode = Some(self.dice.pick(&OperationMode::ALL));
            }
        }
        modes
    }
}
