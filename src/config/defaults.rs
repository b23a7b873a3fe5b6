//! What holds where a file says nothing. `configs/reference.toml` shows every one of these values, and a test
//! compares it with them.

use super::drive_family::DriveFacts;
use super::keys;
use super::model::{Axis, Compliance, Control, Feedback, Limits, MissedSlots, PdoMapping, Realtime, Travel};

/// `[cycle] period`
pub const PERIOD_NS: u64 = keys::cycle::PERIOD.default_ns();
/// `[cycle] command_phase`, as a fraction of the period.
const COMMAND_PHASE: f64 = 0.55;

/// `[master] node`, a node ID
pub const MASTER_NODE: u8 = keys::master::NODE.default_number() as u8;
/// `[program] repeat`
pub const REPEAT: u32 = keys::program::REPEAT.default_number() as u32;
/// `[simulation] seed`
pub const SEED: u64 = keys::simulation::SEED.default_number() as u64;

/// `[cycle.missed_slots]`
pub const MISSED_SLOTS: MissedSlots = {
    use keys::missed_slots::{DEGRADED, LEAK_SLOTS, STOP, WARNING};

    MissedSlots {
        warning: WARNING.default_number() as u32,
        degraded: DEGRADED.default_number() as u32,
        stop: STOP.default_number() as u32,
        leak_slots: LEAK_SLOTS.default_number() as u32,
    }
};

/// `[realtime]`
pub const REALTIME: Realtime = {
    use keys::realtime::{HOLD_DMA_LATENCY, LOCK_MEMORY, PRIORITY};

    Realtime {
        priority: Some(PRIORITY.default_number() as u8),
        cpu: None,
        lock_memory: LOCK_MEMORY.default_boolean(),
        hold_dma_latency: HOLD_DMA_LATENCY.default_boolean(),
        spin_guard_ns: None,
    }
};

/// `[master] heartbeat` where every drive holds a position by itself.
pub const MASTER_HEARTBEAT_NS: u64 = 100_000_000;
/// `[master] heartbeat` where a drive would go on moving without the controller (CSV, CST, PP, PV, PT): the shortest for which
/// five heartbeats outlast a short stall of the controller. It costs a bus of 1 Mbit/s 0.4 % of its time.
pub const URGENT_HEARTBEAT_NS: u64 = 20_000_000;
/// `[master] heartbeat_timeout`, in heartbeats: some may be late or lost.
pub const HEARTBEATS_IN_TIMEOUT: u64 = 5;
/// `[master] heartbeat_timeout` without a heartbeat.
pub const HEARTBEAT_TIMEOUT_NS: u64 = 500_000_000;

/// `[[bus]] bit_rate` of a serial line
pub const LINE_BIT_RATE: u32 = 115_200;
/// `[[axis]] counts_per_turn` of a drive that is configured in code, where its family does not know them.
pub const COUNTS_PER_TURN: f64 = 65_536.0;
/// `[[axis]] start_tolerance` of a rotary axis in rad.
pub const START_TOLERANCE_RAD: f64 = 0.02;
/// `[[axis]] start_tolerance` of a linear axis in m.
pub const START_TOLERANCE_M: f64 = 0.002;
/// `[axis.following_error] limit` of a rotary axis in rad.
pub const FOLLOWING_ERROR_RAD: f64 = 0.1;
/// `[axis.following_error] limit` of a linear axis in m.
pub const FOLLOWING_ERROR_M: f64 = 0.01;
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
/// `[simulation] longest_gap`; two periods of the cycle where that is more
pub const LONGEST_GAP_NS: u64 = 2_000_000;
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
    // Object 1016 has 16 bits, in ms.
    const AT_MOST_NS: u64 = u16::MAX as u64 * 1_000_000;
    heartbeat_ns.map_or(HEARTBEAT_TIMEOUT_NS, |heartbeat_ns| {
        heartbeat_ns.saturating_mul(HEARTBEATS_IN_TIMEOUT).min(AT_MOST_NS)
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
    Compliance {
        stiffness_max,
        damping_max,
        torque_rise_ns: const { keys::torque_loop::TORQUE_RISE.default_ns() },
    }
}

/// `[axis.simulated] initial_position`: 0, or the limit nearest to it.
pub fn initial_position(limits: &Limits) -> f64 {
    0.0_f64.max(limits.position_min).min(limits.position_max)
}
