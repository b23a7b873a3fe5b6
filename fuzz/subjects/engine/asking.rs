//! Requests and streams from the bytes that a fuzzer makes.

use takt::config::Config;
use takt::family::bring_up::ProcessData;
use takt_rt::plan;
use takt_rt::{
    AxisPoint, AxisTarget, Engine, Id, MAX_AXES, MappedObject, Move, PointRole, ProfileMove, ProfileTarget,
    Request, StopCategory, StreamPoint, StreamWish,
};

use super::super::input::Input;

/// The smallest bound of a streamed step: rad.
const STREAM_STEP: f64 = 2e-8;

/// Any request.
pub fn request(config: &Config, now_ns: u64, input: &mut Input<'_>) -> Request {
    let categories = [StopCategory::Zero, StopCategory::One, StopCategory::Two];
    match input.byte() % 20 {
        0 => Request::Sync(input.byte() & 1 == 1),
        1 => Request::RatedTorque { axis: input.byte(), torque: input.number(), limit_per_mille: None },
        2 => Request::Activate,
        3 | 4 => Request::Enable,
        5 => Request::Move(any_move(config, input)),
        6 => Request::Stream,
        7 => Request::Stop(categories[usize::from(input.byte()) % 3]),
        8 => Request::Disable,
        9 | 10 => Request::ResetFaults,
        11 => Request::Shutdown,
        12 => process_data(config, input),
        13 => Request::Position { axis: input.byte(), counts: input.word() as i32 },
        14 => Request::TimeOfDay { at_zero_ns: u64::from_le_bytes(input.bytes()) },
        18 => Request::BringUp,
        19 => Request::ConfirmBringUp,
        15 | 16 => Request::SetProfileTarget(profile_move(config, now_ns, input)),
        _ => Request::InhibitEnable,
    }
}

/// The process data of an axis with something changed in it, or not.
fn process_data(config: &Config, input: &mut Input<'_>) -> Request {
    let number = input.byte();
    let axis = &config.axes[usize::from(number) % config.axes.len()];
    let mut data = ProcessData::of(axis, config);
    let change = input.byte();
    let plans = if change & 8 == 0 { &mut data.commands } else { &mut data.feedback };
    match change % 8 {
        0 => plans.clear(),
        1 => plans.iter_mut().for_each(|plan| plan.objects.clear()),
        2 => plans.iter_mut().for_each(|plan| plan.id = Id::canopen(u16::from(change >> 4) << 7, number)),
        3 => plans.iter_mut().for_each(|plan| {
            plan.objects.push(MappedObject::from_parameter(input.word()));
        }),
        4 => data.unused.extend(data.feedback.clone()),
        _ => {}
    }
    data.request(number % 40)
}

/// A target that fits the axis, or any.
fn profile_move(config: &Config, now_ns: u64, input: &mut Input<'_>) -> ProfileMove {
    let (_, axis, kind) = (input.word(), input.byte() % 40, input.byte());
    let limits = config.axes.get(usize::from(axis)).map_or(&config.axes[0].limits, |axis| &axis.limits);
    let share = f64::from(input.byte() as i8) / 128.0;
    let value =
        |highest: f64, input: &mut Input<'_>| if kind & 4 == 0 { share * highest } else { input.number() };
    let target = match kind % 4 {
        0 => ProfileTarget::Position(value(limits.position_max, input)),
        1 => ProfileTarget::Velocity(value(limits.velocity, input)),
        2 => ProfileTarget::Torque(value(limits.torque, input)),
        _ => ProfileTarget::Velocity(0.0),
    };
    ProfileMove { axis, target, valid_until_ns: now_ns + 10_000_000 * u64::from(input.byte()) }
}

/// A move that begins and ends at rest, to somewhere within the limits.
pub fn possible_move(config: &Config, input: &mut Input<'_>) -> Move {
    // Kept inputs have a word here that is not used any more.
    input.word();
    let mut asked = nowhere();
    for (axis, target) in config.axes.iter().zip(&mut asked.target) {
        let share = f64::from(input.byte()) / 255.0;
        let range = axis.limits.position_max - axis.limits.position_min;
        *target = axis.limits.position_min + share * range;
    }
    asked
}

/// A move to anywhere, with any speed there.
fn any_move(config: &Config, input: &mut Input<'_>) -> Move {
    // Kept inputs have a word here that is not used any more.
    input.word();
    let mut asked = nowhere();
    for (_, target) in config.axes.iter().zip(&mut asked.target) {
        input.byte();
        *target = input.number();
    }
    asked.target_velocity[usize::from(input.byte()) % config.axes.len()] = input.number();
    asked.velocity_scale = input.number();
    asked.acceleration_scale = input.number();
    asked.minimum_duration_s = input.number();
    asked
}

fn nowhere() -> Move {
    Move {
        target: [0.0; MAX_AXES],
        target_velocity: [0.0; MAX_AXES],
        velocity_scale: 1.0,
        acceleration_scale: 1.0,
        minimum_duration_s: 0.0,
    }
}

/// A point of a stream near the present set-points, or anywhere, meant for any time.
pub fn point(engine: &Engine, now_ns: u64, input: &mut Input<'_>) -> StreamPoint {
    let is_near = input.byte() > 32;
    let at_ns = match input.byte() {
        255 => u64::from_le_bytes(input.bytes()),
        late_ms @ 200..=254 => now_ns.saturating_sub(1_000_000 * u64::from(late_ms - 200)),
        early_ms => now_ns + 1_000_000 * u64::from(early_ms),
    };
    // From steps that the jerk limits allow from rest to ones that nothing allows.
    let scale = input.byte();
    let largest_step = STREAM_STEP * f64::from(1u32 << (scale % 20));
    let role = match scale / 64 {
        0 => PointRole::Chunk { is_first: scale.is_multiple_of(2), is_last: scale.is_multiple_of(5) },
        _ => PointRole::Single,
    };
    let mut axes = [AxisPoint::default(); MAX_AXES];
    for (axis, point) in engine.axes().iter().zip(&mut axes) {
        *point = if is_near {
            let step = f64::from(input.byte() as i8) / 128.0 * largest_step;
            AxisPoint::position(axis.set_point().position + step)
        } else {
            let (position, velocity, acceleration) = (input.number(), input.number(), input.number());
            AxisPoint::from(plan::State { position, velocity, acceleration })
        };
    }
    StreamPoint { at_ns, role, axes }
}

/// A smooth way of every axis from where it is, in so many cycles: within the limits, or up to four times beyond them.
pub struct Sweep {
    from: [f64; MAX_AXES],
    by: [f64; MAX_AXES],
    cycles: u32,
}

impl Sweep {
    pub fn new(engine: &Engine, period_s: f64, input: &mut Input<'_>) -> Self {
        let cycles = u32::from(input.byte()) + 2;
        let duration_s = f64::from(cycles) * period_s;
        let mut sweep = Self { from: [0.0; MAX_AXES], by: [0.0; MAX_AXES], cycles };
        // Kept inputs have a byte here that is not used any more.
        input.byte();
        let strength = f64::from(input.byte()) / 64.0;
        for ((axis, from), by) in engine.axes().iter().zip(&mut sweep.from).zip(&mut sweep.by) {
            let limits = &axis.parameters().limits;
            // The extremes of the polynomial below: 15/8, 10/√3 and 60 of the way, by the powers of the duration.
            let by_jerk = limits.jerk * duration_s.powi(3) / 60.0;
            let by_acceleration = limits.acceleration.min(limits.deceleration) * duration_s.powi(2) / 5.8;
            let largest = by_jerk.min(by_acceleration).min(limits.velocity * duration_s / 1.9);
            *from = axis.set_point().position;
            *by = strength * largest * f64::from(input.byte() as i8) / 128.0;
        }
        sweep
    }

    /// Every cycle of it.
    pub fn cycles(&self) -> std::ops::RangeInclusive<u32> {
        1..=self.cycles
    }

    pub fn wish(&self, cycle: u32) -> StreamWish {
        let part = f64::from(cycle) / f64::from(self.cycles);
        let way = part.powi(3) * (10.0 - 15.0 * part + 6.0 * part * part);
        let mut targets = [AxisTarget::default(); MAX_AXES];
        for (target, (from, by)) in targets.iter_mut().zip(self.from.iter().zip(&self.by)) {
            *target = AxisTarget::position(plan::State::rest(from + by * way));
        }
        StreamWish::Targets(targets)
    }
}
