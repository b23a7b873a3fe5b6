//! What holds where a file says nothing. `configs/reference.toml` shows every one of these values, and a test
//! compares it with them.

use super::drive_family::DriveFacts;
use super::model::{Axis, Compliance, Control, Feedback, Limits, PdoMapping, Travel};
use super::ranges;

/// `[cycle] period`
pub const PERIOD_NS: u64 = 1_000_000;
/// `[cycle] command_phase`, as a fraction of the period.
pub const COMMAND_PHASE: f64 = 0.55;

/// `[cycle.missed_slots] warning`
pub const MISSED_SLOTS_WARNING: u32 = 10;
/// `[cycle.missed_slots] degraded`
pub const MISSED_SLOTS_DEGRADED: u32 = 50;
/// `[cycle.missed_slots] stop`
pub const MISSED_SLOTS_STOP: u32 = 250;
/// `[cycle.missed_slots] leak_slots`
pub const MISSED_SLOTS_LEAK_SLOTS: u32 = 10;

/// `[realtime] priority`
pub const PRIORITY: u8 = 80;
/// `[realtime] lock_memory`
pub const LOCK_MEMORY: bool = true;
/// `[realtime] hold_dma_latency`
pub const HOLD_DMA_LATENCY: bool = true;

/// `[master] node`, a node ID
pub const MASTER_NODE: u8 = 127;
/// `[master] heartbeat` where every drive holds a position by itself.
pub const MASTER_HEARTBEAT_NS: u64 = 100_000_000;
/// `[master] heartbeat` where a drive would go on moving without the controller (CSV, CST, PP, PV, PT): the shortest for which
/// five heartbeats outlast a short stall of the controller. It costs a bus of 1 Mbit/s 0.4 % of its time.
pub const URGENT_HEARTBEAT_NS: u64 = 20_000_000;
/// `[master] heartbeat_timeout`, in heartbeats: some may be late or lost.
pub const HEARTBEATS_IN_TIMEOUT: u64 = 5;
/// `[master] heartbeat_timeout` without a heartbeat.
pub const HEARTBEAT_TIMEOUT_NS: u64 = 500_000_000;

/// `[[bus]] bit_rate`
pub const BIT_RATE: u32 = 1_000_000;
/// `[[bus]] bit_rate` of a serial line
pub const LINE_BIT_RATE: u32 = 115_200;
/// `[[bus]] restart_ms`
pub const RESTART_MS: u32 = 100;
/// `[[bus]] service_frames_per_cycle`
pub const SERVICE_FRAMES_PER_CYCLE: usize = 1;
/// `[[bus]] sdo_while_enabled`
pub const SDO_WHILE_ENABLED: bool = false;

/// `[[axis]] answers_sync`
pub const ANSWERS_SYNC: bool = true;
/// `[[axis]] counts_per_turn` of a drive that is configured in code, where its family does not know them.
pub const COUNTS_PER_TURN: f64 = 65_536.0;
/// `[[axis]] gear_ratio`
pub const GEAR_RATIO: f64 = 1.0;
/// `[[axis]] missed_feedback_cycles`
pub const MISSED_FEEDBACK_CYCLES: u16 = 5;
/// `[[axis]] transmission_type`
pub const TRANSMISSION_TYPE: u8 = 1;
/// `[[axis]] feedback_delay`
pub const FEEDBACK_DELAY_NS: u64 = 20_000;
/// `[axis.torque_loop] torque_rise`
pub const TORQUE_RISE_NS: u64 = 100_000_000;
/// `[[axis]] start_tolerance` of a rotary axis in rad.
pub const START_TOLERANCE_RAD: f64 = 0.02;
/// `[[axis]] start_tolerance` of a linear axis in m.
pub const START_TOLERANCE_M: f64 = 0.002;
/// `[axis.following_error] limit` of a rotary axis in rad.
pub const FOLLOWING_ERROR_RAD: f64 = 0.1;
/// `[axis.following_error] limit` of a linear axis in m.
pub const FOLLOWING_ERROR_M: f64 = 0.01;
/// `[axis.following_error] time`
pub const FOLLOWING_ERROR_TIME_NS: u64 = 50_000_000;

/// `[[axis]] target_tolerance` of a rotary axis in rad.
pub const TARGET_TOLERANCE_RAD: f64 = 0.01;
/// `[[axis]] target_tolerance` of a linear axis in m.
pub const TARGET_TOLERANCE_M: f64 = 0.001;
/// In CST static friction holds the joint off its target by friction / stiffness at most. The default tolerance allows for
/// this much of that.
pub const TARGET_TOLERANCE_PER_FRICTION: f64 = 1.5;

/// `[axis.velocity_loop] position_gain` in 1/s: a tenth of the bandwidth that a drive's velocity loop has at least, and less
/// at periods above 12.5 ms, where a loop over the bus is too slow for it.
pub fn position_gain(period_s: f64) -> f64 {
    (0.25 / period_s).min(20.0)
}

/// `[axis.torque_loop] bandwidth` in 1/s, from which stiffness (inertia · bandwidth²) and damping (2 · inertia · bandwidth:
/// critical) follow. It is less at periods above 3.75 ms, where two periods of delay would cost more than 35° of phase.
pub fn torque_loop_bandwidth(period_s: f64) -> f64 {
    (0.15 / period_s).min(40.0)
}

/// `[axis.joint] inertia` in kg·m² (kg).
pub const INERTIA: f64 = 1.0;
/// `[axis.joint] viscous_friction` in N·m·s/rad (N·s/m).
pub const VISCOUS_FRICTION: f64 = 1.0;
/// `[axis.joint] coulomb_friction` in N·m (N).
pub const COULOMB_FRICTION: f64 = 0.5;
/// `[axis.simulated] peak_torque` in rated torques: ±3000 per mille in object 60B2.
pub const PEAK_TO_RATED_TORQUE: f64 = 3.0;
/// `[[axis]] power_up`. A real drive may ask for 8 s.
pub const POWER_UP_NS: u64 = 200_000_000;

/// `[program] repeat`
pub const REPEAT: u32 = 1;

/// `[telemetry] directory`
pub const DIRECTORY: &str = "runs";
/// `[telemetry] black_box`
pub const BLACK_BOX_NS: u64 = 5_000_000_000;
/// `[telemetry] ring_records`
pub const RING_RECORDS: usize = 4096;

/// `[simulation] seed`
pub const SEED: u64 = 1;
/// `[simulation] longest_gap`; two periods of the cycle where that is more
pub const LONGEST_GAP_NS: u64 = 2_000_000;
/// `[simulation] stops_for_missed_slots`
pub const STOPS_FOR_MISSED_SLOTS: bool = false;

/// `[cycle] command_phase`
pub fn command_phase_ns(period_ns: u64) -> u64 {
    (COMMAND_PHASE * period_ns as f64).round() as u64
}

/// `[simulation] longest_gap`
pub fn longest_gap_ns(period_ns: u64) -> u64 {
    LONGEST_GAP_NS.max(period_ns.saturating_mul(2))
}

/// `[master] heartbeat`. A drive that would go on moving without the controller is to notice soon that it is gone.
pub fn master_heartbeat_ns(axes: &[Axis], period_ns: u64) -> u64 {
    if axes.iter().flat_map(Axis::controls).any(goes_on_alone) {
        // The heartbeat leaves in a cycle, in whole milliseconds.
        URGENT_HEARTBEAT_NS.max(period_ns.next_multiple_of(1_000_000))
    } else {
        MASTER_HEARTBEAT_NS
    }
}

/// Returns true for a mode in which a drive without its controller keeps a speed or a torque, or moves to its target.
fn goes_on_alone(control: &Control) -> bool {
    matches!(
        control,
        Control::Velocity { .. }
            | Control::Torque { .. }
            | Control::ProfilePosition
            | Control::ProfileVelocity
            | Control::ProfileTorque
    )
}

/// `[master] heartbeat_timeout`
pub fn heartbeat_timeout_ns(heartbeat_ns: Option<u64>) -> u64 {
    let at_most_ns = (ranges::HEARTBEAT_TIMEOUT_S.end() * 1e9) as u64;
    heartbeat_ns.map_or(HEARTBEAT_TIMEOUT_NS, |heartbeat_ns| {
        heartbeat_ns.saturating_mul(HEARTBEATS_IN_TIMEOUT).min(at_most_ns)
    })
}

/// `[[axis]] mapping`
pub const fn mapping(drive: &DriveFacts) -> PdoMapping {
    if drive.has_fixed_process_data { PdoMapping::AsStored } else { PdoMapping::Written }
}

/// `[[axis]] feedback`. A drive whose PDOs are written reports its mode of operation (object 6061), if it can. Nothing else shows
/// that another master has changed the mode.
pub fn feedback(drive: &DriveFacts, mapping: PdoMapping) -> Vec<Feedback> {
    match mapping {
        PdoMapping::Written if drive.reports_mode => vec![Feedback::OperationMode],
        _ => vec![],
    }
}

/// `[[axis]] start_tolerance`
pub const fn start_tolerance(travel: Travel) -> f64 {
    match travel {
        Travel::Rotary => START_TOLERANCE_RAD,
        Travel::Linear { .. } => START_TOLERANCE_M,
    }
}

/// `[axis.following_error] limit`
pub const fn following_error(travel: Travel) -> f64 {
    match travel {
        Travel::Rotary => FOLLOWING_ERROR_RAD,
        Travel::Linear { .. } => FOLLOWING_ERROR_M,
    }
}

/// `[[axis]] target_tolerance`. In CST the loop has no integral part: static friction holds the joint off its target by
/// friction / stiffness at most. With several modes, it is the largest.
pub fn target_tolerance(travel: Travel, controls: &[Control]) -> f64 {
    let own = match travel {
        Travel::Rotary => TARGET_TOLERANCE_RAD,
        Travel::Linear { .. } => TARGET_TOLERANCE_M,
    };
    controls.iter().fold(own, |own, control| match control {
        Control::Torque { stiffness, coulomb_friction, .. } => {
            own.max(TARGET_TOLERANCE_PER_FRICTION * coulomb_friction / stiffness)
        }
        _ => own,
    })
}

/// `[axis.torque_loop] stiffness_max`, `damping_max` and `torque_rise`: no more than the axis' own loop.
pub fn compliance(controls: &[Control]) -> Compliance {
    let gains = controls.iter().find_map(|control| match *control {
        Control::Torque { stiffness, damping, .. } => Some((stiffness, damping)),
        _ => None,
    });
    let (stiffness_max, damping_max) = gains.unwrap_or_default();
    Compliance { stiffness_max, damping_max, torque_rise_ns: TORQUE_RISE_NS }
}

/// `[axis.simulated] initial_position`: 0, or the limit nearest to it.
pub fn initial_position(limits: &Limits) -> f64 {
    0.0_f64.max(limits.position_min).min(limits.position_max)
}
