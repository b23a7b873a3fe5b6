//! Drives on buses whose service channel carries two frames per millisecond in each direction, and a configuration.

use std::path::PathBuf;

use takt::config::*;
use takt::family::bring_up::stages::{BringUp, Shutdown};
use takt::family::bring_up::{AxisFacts, BringUpError};
use takt_rt::Frame;

use super::scripted_drive::ScriptedDrive;

const STEP_NS: u64 = 1_000_000;
const FRAMES_PER_STEP: usize = 2;

pub struct World {
    pub now_ns: u64,
    pub drives: Vec<(usize, ScriptedDrive)>,
    queues: Vec<Vec<Frame>>,
}

/// The common interface of a [`BringUp`] and a [`Shutdown`].
pub trait Procedure {
    fn poll(&mut self, now_ns: u64, send: &mut impl FnMut(usize, Frame));
    fn receive(&mut self, bus: usize, frame: &Frame);
    fn outcome(&self) -> Option<Result<Vec<AxisFacts>, BringUpError>>;
}

macro_rules! procedure {
    ($name:ty) => {
        impl Procedure for $name {
            fn poll(&mut self, now_ns: u64, send: &mut impl FnMut(usize, Frame)) {
                <$name>::poll(self, now_ns, send);
            }
            fn receive(&mut self, bus: usize, frame: &Frame) {
                <$name>::receive(self, bus, frame);
            }
            fn outcome(&self) -> Option<Result<Vec<AxisFacts>, BringUpError>> {
                <$name>::outcome(self)
            }
        }
    };
}
procedure!(BringUp);
procedure!(Shutdown);

impl World {
    /// One eRob with factory settings per axis.
    pub fn of(config: &Config) -> Self {
        let drives = config.axes.iter().map(|axis| (axis.bus, ScriptedDrive::erob(axis.node))).collect();
        Self { now_ns: 5_000_000_000, drives, queues: vec![vec![]; config.buses.len()] }
    }

    /// The drive of the first axis.
    pub fn drive(&mut self) -> &mut ScriptedDrive {
        &mut self.drives[0].1
    }

    pub fn step(&mut self, procedure: &mut impl Procedure) {
        let queues = &mut self.queues;
        procedure.poll(self.now_ns, &mut |bus, frame| queues[bus].push(frame));
        for (bus, queue) in self.queues.iter_mut().enumerate() {
            let leaving = queue.len().min(FRAMES_PER_STEP);
            for frame in queue.drain(..leaving) {
                for (_, drive) in self.drives.iter_mut().filter(|(of, _)| *of == bus) {
                    drive.receive(self.now_ns, &frame);
                }
            }
        }
        self.now_ns += STEP_NS;
        for (bus, drive) in &mut self.drives {
            for frame in drive.poll(self.now_ns) {
                procedure.receive(*bus, &frame);
            }
        }
    }

    /// Runs a procedure to its end and checks that the master has obeyed the standard.
    pub fn run(&mut self, procedure: &mut impl Procedure) -> Result<Vec<AxisFacts>, BringUpError> {
        for _ in 0..100_000 {
            if let Some(outcome) = procedure.outcome() {
                for (_, drive) in &self.drives {
                    assert_eq!(drive.violations, [""; 0]);
                }
                return outcome;
            }
            self.step(procedure);
        }
        panic!("no end after 100 s");
    }
}

/// Axes as pairs of bus and node ID, in cyclic synchronous position mode.
pub fn config(axes: &[(usize, u8)]) -> Config {
    let buses = axes.iter().map(|(bus, _)| bus + 1).max().unwrap_or(0);
    Config {
        stream_delay: Default::default(),
        name: "test".into(),
        cycle: Cycle { period_ns: 1_000_000, command_phase_ns: 550_000 },
        missed_slots: MissedSlots { warning: 10, degraded: 100, stop: 500, leak_slots: 10 },
        stops: Default::default(),
        realtime: Realtime {
            priority: None,
            cpu: None,
            lock_memory: false,
            hold_dma_latency: false,
            spin_guard_ns: Some(0),
        },
        master: Master {
            node: 127,
            heartbeat_ns: Some(20_000_000),
            heartbeat_timeout_ns: 100_000_000,
            time_ns: None,
        },
        buses: (0..buses).map(bus).collect(),
        axes: axes.iter().enumerate().map(|(number, (bus, node))| axis(number, *bus, *node)).collect(),
        groups: vec![],
        program: Program { repeat: 1, moves: vec![] },
        telemetry: Telemetry {
            directory: PathBuf::from("runs"),
            is_recorded: false,
            is_candump_written: false,
            black_box_ns: None,
            ring_records: 16,
        },
        simulation: Simulation { seed: 1, longest_gap_ns: 1_000_000, stops_for_missed_slots: false },
    }
}

fn bus(number: usize) -> Bus {
    Bus {
        name: format!("bus{number}"),
        interface: Interface::Simulated,
        divider: 1,
        bit_rate: 1_000_000,
        data_bit_rate: None,
        restart_ms: 100,
        service_frames_per_cycle: FRAMES_PER_STEP,
        sdo_while_enabled: false,
        command_frames: CommandFrames::OnePerAxis,
    }
}

fn axis(number: usize, bus: usize, node: u8) -> Axis {
    Axis {
        urdf: None,
        name: format!("joint{}", number + 1),
        bus,
        node,
        drive: takt::family::EROB_CANOPEN,
        control: Control::Position,
        other_modes: vec![],
        travel: Travel::Rotary,
        counts_per_turn: 524_288.0,
        gear_ratio: 1.0,
        reversed: false,
        zero_counts: 0,
        shown_in: PositionUnit::Radian,
        limits: Limits {
            position_min: -3.0,
            position_max: 3.0,
            velocity: 2.0,
            acceleration: 4.0,
            deceleration: 5.0,
            jerk: f64::INFINITY,
            torque: 80.0,
        },
        following_error: FollowingError { limit: 0.05, time_ns: 20_000_000 },
        missed_feedback_cycles: 3,
        transmission_type: 1,
        feedback: vec![Feedback::Torque],
        mapping: PdoMapping::Written,
        answers_sync: true,
        target_tolerance: 0.01,
        compliance: Compliance { stiffness_max: 0.0, damping_max: 0.0, torque_rise_ns: 100_000_000 },
        feed_forward: FeedForward::None,
        start_tolerance: 0.02,
        follow: Default::default(),
        feedback_delay_ns: 20_000,
        heartbeat_ns: Some(50_000_000),
        identity: Identity::default(),
        dcf: None,
        power_up_ns: 0,
        joint: Joint {
            inertia: Some(0.1),
            viscous_friction: Some(0.1),
            coulomb_friction: Some(0.1),
            rated_torque: Some(31.0),
        },
        simulated: SimulatedJoint {
            gravity: 0.0,
            friction: FrictionShape::Constant,
            peak_torque: 60.0,
            initial_position: 0.0,
            power_up: PowerUpState::PreOperational,
        },
    }
}
