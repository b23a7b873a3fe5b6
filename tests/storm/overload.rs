//! A machine that has too little time for the loop: cycles that take long to compute, SYNC that is held up, queues of
//! interfaces that do not drain.

use takt::VirtualRun;
use takt::config::Config;
use takt::link::trace::TracedPort;

use crate::concern::Concerns;
use crate::dice::Dice;
use crate::tap::Tap;

/// A queue that never drains again.
const FOR_EVER: u64 = u64::MAX;

/// What a machine has too little time for.
#[derive(Clone, Debug, Default)]
pub struct Overload {
    /// How long a cycle may take to compute.
    computing: Delay,
    /// By how much SYNC may be held up after the wake-up for its slot.
    sync: Delay,
    clogs: Vec<Clog>,
    /// From this cycle on every wake-up is so many nanoseconds too late.
    lateness: Option<(u64, u64)>,
}

/// A delay that comes in some cycles: how likely, and how long at most in ns.
#[derive(Clone, Copy, Debug, Default)]
struct Delay {
    chance: f64,
    most_ns: f64,
}

impl Delay {
    fn draw(self, dice: &mut Dice) -> Option<u64> {
        dice.chance(self.chance).then(|| dice.between(0.0, self.most_ns) as u64)
    }
}

/// The queue of an interface takes frames and sends none, for a time; then all of them at once.
#[derive(Clone, Copy, Debug)]
struct Clog {
    bus: usize,
    from_cycle: u64,
    cycles: u64,
}

impl Clog {
    /// Returns `true` if the queue is stuck in this cycle.
    fn is_on(self, cycle: u64) -> bool {
        (self.from_cycle..self.from_cycle.saturating_add(self.cycles)).contains(&cycle)
    }
}

#[derive(Clone, Copy)]
enum Kind {
    SlowComputing,
    LateSync,
    Clog,
    LateForEver,
}

/// What a storm may have.
const KINDS: [Kind; 4] = [Kind::SlowComputing, Kind::LateSync, Kind::Clog, Kind::LateForEver];

impl Overload {
    /// One or two kinds, in a storm of so many cycles.
    pub fn of(dice: &mut Dice, config: &Config, length: u64) -> Self {
        let mut overload = Self::default();
        for _ in 0..dice.pick(&[1, 1, 2]) {
            overload.add(dice, config, length);
        }
        overload
    }

    fn add(&mut self, dice: &mut Dice, config: &Config, length: u64) {
        let period_ns = config.cycle.period_ns as f64;
        let from_cycle = dice.below(length as usize + 600) as u64;
        match dice.pick(&KINDS) {
            Kind::SlowComputing => {
                let most_ns = dice.pick(&[0.2 * period_ns, 0.5 * period_ns, period_ns, 5e6]);
                self.computing = Delay { chance: dice.pick(&[0.002, 0.05, 0.5, 1.0]), most_ns };
            }
            Kind::LateSync => {
                let most_ns = dice.between(0.05, 0.35) * period_ns;
                self.sync = Delay { chance: dice.pick(&[0.002, 0.05, 0.5]), most_ns };
            }
            Kind::Clog => {
                let bus = dice.below(config.buses.len());
                let cycles = dice.pick(&[2, 5, 20, 100, 500, FOR_EVER]);
                self.clogs.push(Clog { bus, from_cycle, cycles });
            }
            Kind::LateForEver => {
                self.lateness = Some((from_cycle, (dice.between(0.15, 3.0) * period_ns) as u64));
            }
        }
    }

    /// Returns `true` if there is any.
    pub fn is_present(&self) -> bool {
        self.computing.chance > 0.0
            || self.sync.chance > 0.0
            || !self.clogs.is_empty()
            || self.lateness.is_some()
    }

    /// What lies ahead of the next cycle.
    pub fn act(
        &self,
        cycle: u64,
        dice: &mut Dice,
        run: &mut VirtualRun<TracedPort<Tap>>,
        concerns: &mut Concerns,
    ) {
        if let Some(ns) = self.computing.draw(dice) {
            run.clock().compute_for(ns);
        }
        if let Some(ns) = self.sync.draw(dice) {
            run.clock().hold_up_sync(ns);
        }
        if self.computing.chance > 0.0 || self.sync.chance > 0.0 {
            concerns.crowd();
        }
        let now_ns = run.snapshot().at_ns;
        if let Some((_, ns)) = self.lateness.filter(|(from_cycle, _)| *from_cycle == cycle) {
            run.clock().be_late(ns);
            concerns.miss_every_slot(now_ns);
        }
        for clog in self.clogs.iter().filter(|clog| cycle == clog.from_cycle) {
            concerns.clog(clog.bus, now_ns, clog.cycles == FOR_EVER);
        }
        for (bus, port) in run.ports().iter_mut().enumerate() {
            port.inner_mut().is_clogged = self.clogs.iter().any(|clog| clog.bus == bus && clog.is_on(cycle));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use takt::Outcome;

    use crate::machine::load;
    use crate::run::World;

    #[test]
    fn a_joint_in_a_profile_mode_is_not_too_fast_because_sync_is_late() {
        for name in ["erob-modes/erob-pp", "erob-modes/erob-pv"] {
            for most in [0.1, 0.3, 0.4] {
                let config = load(name);
                let mut world = World::new(&config, &takt::faults::Scenario::default());
                let mut dice = Dice::new(1);
                let sync = Delay { chance: 0.5, most_ns: most * config.cycle.period_ns as f64 };
                while world.step(&config) {
                    while world.log.next_record(|_| ()).is_some() {}
                    world.run.clock().hold_up_sync(sync.draw(&mut dice).unwrap_or(0));
                }
                let outcome = world.run.supervisor().outcome();
                assert!(matches!(outcome, Some(Outcome::Finished)), "{name}, {most}: {outcome:?}");
            }
        }
    }
}
