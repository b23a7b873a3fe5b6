//! The controller's heartbeat as each drive can have heard it. A machine that is late withholds it, and a drive that misses it
//! stops by itself: an eRob by its fault reaction, with error 8130 and its node stopped (object 1029), a YZ-AIM with alarm 20h
//! and 04h in its own heartbeat.

use takt::config::{Axis, Config};
use takt::sim::Observation;
use takt_rt::{DriveState, Frame};

/// For so many cycles after its fault is gone, reports of it may still be under way.
const REPORTED_CYCLES: u64 = 12;
const HEARTBEAT: u32 = 0x700;

/// Whether a drive has missed the heartbeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum MissedHeartbeat {
    /// It cannot have.
    #[default]
    No,
    /// The heartbeat has stayed away for the time after which the drive stops by itself.
    Possibly,
    /// The drive has stopped by itself for that. Its power is taken even if its alarm ends with the next heartbeat.
    Shown,
}

/// When the heartbeat has left on each bus, and which drives may have missed it.
pub struct Heartbeats {
    id: u32,
    timeout_ns: u64,
    period_ns: u64,
    /// The last one, an entry a bus; `None` before the first one, from which on drives wait for the next.
    sent_ns: Vec<Option<u64>>,
    drives: Vec<Drive>,
}

struct Drive {
    bus: usize,
    /// What it calls the loss of the controller.
    error_code: u16,
    missed: MissedHeartbeat,
    /// Cycles since that was so last.
    since_missed: u64,
    /// True if it has shown that it missed the heartbeat, and has not been enabled since.
    has_cut_itself: bool,
}

impl Heartbeats {
    pub fn new(config: &Config) -> Self {
        let drive = |axis: &Axis| Drive {
            bus: axis.bus,
            error_code: match axis.drive.word {
                "yz-aim" => 0x20,
                _ => 0x8130,
            },
            missed: MissedHeartbeat::No,
            since_missed: 0,
            has_cut_itself: false,
        };
        Self {
            id: HEARTBEAT + u32::from(config.master.node),
            timeout_ns: config.master.heartbeat_timeout_ns,
            period_ns: config.cycle.period_ns,
            sent_ns: vec![None; config.buses.len()],
            drives: config.axes.iter().map(drive).collect(),
        }
    }

    /// Takes what was sent in a cycle that ended then, an entry a bus, and what is true of the drives, an entry an axis.
    pub fn observe(&mut self, sent: &[Vec<Frame>], now_ns: u64, truth: &[Observation]) {
        // One that is sent may reach the drive some frames later than the one before did.
        let may_be_missed = |last_ns: u64| now_ns - last_ns + self.period_ns >= self.timeout_ns;
        let missed: Vec<bool> =
            self.sent_ns.iter().map(|last_ns| last_ns.is_some_and(may_be_missed)).collect();
        for (drive, truth) in self.drives.iter_mut().zip(truth) {
            if missed[drive.bus] {
                (drive.missed, drive.since_missed) = (drive.missed.max(MissedHeartbeat::Possibly), 0);
            }
            if drive.missed != MissedHeartbeat::No && truth.error_code == drive.error_code {
                (drive.missed, drive.since_missed) = (MissedHeartbeat::Shown, 0);
            }
            if drive.since_missed > REPORTED_CYCLES {
                drive.missed = MissedHeartbeat::No;
            }
            drive.since_missed += 1;
            drive.has_cut_itself = drive.missed == MissedHeartbeat::Shown
                || drive.has_cut_itself && truth.state != DriveState::OperationEnabled;
        }
        for (last_ns, frames) in self.sent_ns.iter_mut().zip(sent) {
            if frames.iter().any(|frame| frame.id().value() == self.id && !frame.id().is_extended()) {
                *last_ns = Some(now_ns);
            }
        }
    }

    /// Which drives have missed the heartbeat and may still say so, an entry an axis.
    pub fn missed(&self) -> impl Iterator<Item = MissedHeartbeat> {
        self.drives.iter().map(|drive| drive.missed)
    }

    /// Which drives have taken their power after they missed the heartbeat and have not been enabled since, an entry an axis.
    pub fn cut_themselves(&self) -> impl Iterator<Item = bool> {
        self.drives.iter().map(|drive| drive.has_cut_itself)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::load;
    use takt::sim::NodeState;
    use takt_rt::Id;

    const MILLISECOND_NS: u64 = 1_000_000;

    fn truth(error_code: u16) -> Observation {
        Observation {
            position: 0.0,
            velocity: 0.0,
            torque: 0.0,
            position_counts: 0,
            state: DriveState::OperationEnabled,
            statusword: 0,
            error_code,
            operation_mode: 8,
            nmt: NodeState::Operational,
            is_braked: false,
        }
    }

    #[test]
    fn a_drive_may_miss_a_heartbeat_that_stays_away_for_its_time_and_says_so_for_some_cycles_after_its_fault()
    {
        let config = load("gantry-yz-aim");
        let mut heartbeats = Heartbeats::new(&config);
        let mut now_ns = 0;
        let mut cycles_of = |count: u64, is_sent: bool, error_code: u16| {
            let frame = Frame::of(Id::canopen(0x700, config.master.node), [5]);
            let sent = vec![if is_sent { vec![frame] } else { vec![] }; config.buses.len()];
            let truth = vec![truth(error_code); config.axes.len()];
            for _ in 0..count {
                now_ns += config.cycle.period_ns;
                heartbeats.observe(&sent, now_ns, &truth);
            }
            assert!(
                heartbeats.missed().is_sorted()
                    && heartbeats.missed().is_sorted_by(|one, other| one >= other)
            );
            heartbeats.missed().next().unwrap()
        };
        let timeout_cycles = config.master.heartbeat_timeout_ns / config.cycle.period_ns;
        assert!(timeout_cycles > 10 && config.cycle.period_ns >= MILLISECOND_NS);
        assert_eq!(
            cycles_of(10 * timeout_cycles, false, 0),
            MissedHeartbeat::No,
            "none waits before the first one"
        );
        assert_eq!(cycles_of(1, true, 0x20), MissedHeartbeat::No, "what is wrong has another cause");
        assert_eq!(cycles_of(timeout_cycles - 2, false, 0), MissedHeartbeat::No);
        assert_eq!(cycles_of(1, false, 0), MissedHeartbeat::Possibly);
        assert_eq!(cycles_of(1000, true, 0x20), MissedHeartbeat::Shown);
        assert_eq!(cycles_of(REPORTED_CYCLES, true, 0), MissedHeartbeat::Shown);
        assert_eq!(cycles_of(1, true, 0), MissedHeartbeat::No);
    }
}
