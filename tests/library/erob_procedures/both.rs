//! What holds in both protocols.

use std::num::NonZeroU32;

use takt::config::Limits;
use takt::family::commission::{Failure, TargetDrive};
use takt::family::erob::module::CommandedModule;
use takt::family::erob::motion::{Direction, Motion, Profile};
use takt::family::erob::procedure::{self, End, MotionFailure};
use takt::sim::{Defect, DriveFault};
use takt_rt::DriveState;

use super::bench::{Bench, COUNTS_PER_TURN, MS, PROFILE, SECOND, Wire, module, target};
use super::modbus::Modbus;
use super::own::Own;

/// The addresses of a protocol.
struct Addresses {
    enable: u16,
    /// What stops motions of position control, and its value.
    stop: (u16, Option<i64>),
    /// Its set-point of velocity control, and that of torque control.
    velocity: u16,
    current: u16,
    velocity_limit: u16,
}

const OWN: Addresses = Addresses {
    enable: 0x0100,
    stop: (0x0084, None),
    velocity: 0x01FE,
    current: 0x01FE,
    velocity_limit: 0x0204,
};
const MODBUS: Addresses = Addresses {
    enable: 0x00F0,
    stop: (0x00F2, Some(0)),
    velocity: 0x0051,
    current: 0x004F,
    velocity_limit: 0x00D8,
};

fn torque(current: i32, velocity_limit: u32) -> Motion {
    Motion::Torque { current, velocity_limit: NonZeroU32::new(velocity_limit).unwrap() }
}

/// Proves something of both protocols.
macro_rules! in_both {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                generic::$name::<Own>(&OWN);
                generic::$name::<Modbus>(&MODBUS);
            }
        )*
    };
}

in_both! {
    a_relative_move_goes_on_from_where_the_joint_is_and_leaves_nothing_for_the_next_absolute_one
    motions_without_end_run_until_they_are_interrupted_and_come_to_rest
    a_reciprocating_motion_turns_at_its_ends_until_it_is_interrupted
    a_move_back_and_forth_ends_where_it_has_begun_after_its_dwells
    velocity_and_torque_control_are_enabled_with_a_set_point_of_0_and_a_limit
    a_joint_that_moves_is_stopped_before_its_motor_is_disabled_for_another_motion
    a_motion_without_a_target_is_stopped_before_a_limit_of_its_axis
    a_module_that_was_just_switched_on_is_waited_for
    a_fault_on_the_way_ends_the_motion_with_its_code_and_the_motor_disabled
    a_blocked_joint_is_a_fault_and_a_motor_without_power_is_told
    a_silent_module_ends_the_motion_in_the_step_that_asks_it
    a_second_interruption_disables_the_motor_at_once
}

mod generic {
    use super::*;

    pub fn a_relative_move_goes_on_from_where_the_joint_is_and_leaves_nothing_for_the_next_absolute_one<
        W: Wire,
    >(
        _: &Addresses,
    ) {
        let mut bench = Bench::<W>::ready();
        for (distance, position) in [(50_000, 50_000), (-80_000, -30_000), (0, -30_000)] {
            let ended = bench.carry_out(Motion::By(distance, PROFILE)).unwrap();
            assert_eq!(ended.end, End::Arrived);
            assert!((ended.position - position).abs() < 120, "{distance}: {ended:?}");
            let left = bench.run_alone(async |drive| drive.read(&W::Drive::RELATIVE_POSITION).await);
            assert!(matches!(left, Ok(0)));
        }
        let ended = bench.carry_out(Motion::To(10_000, PROFILE)).unwrap();
        assert!((ended.position - 10_000).abs() < 60, "{ended:?}");
        bench.assert_at_rest_and_disabled();
    }

    pub fn motions_without_end_run_until_they_are_interrupted_and_come_to_rest<W: Wire>(its: &Addresses) {
        let motions = [
            (Motion::Continuous(Direction::Forward, PROFILE), 1.0, its.stop),
            (Motion::Continuous(Direction::Backward, PROFILE), -1.0, its.stop),
            (Motion::Velocity(-30_000, PROFILE), -1.0, (its.velocity, Some(0))),
            (torque(1_500, 30_000), 1.0, (its.current, Some(0))),
        ];
        for (motion, direction, stop) in motions {
            let mut bench = Bench::<W>::ready();
            let ended = bench.carry_out_until(motion, 3_500).unwrap();
            assert_eq!(ended.end, End::Interrupted);
            let way = direction * f64::from(ended.position);
            assert!((40_000.0..110_000.0).contains(&way), "{motion:?}: {way}");
            let written = bench.written();
            assert_eq!(written.get(written.len() - 2).copied(), Some(stop), "{motion:?}: {written:?}");
            bench.assert_at_rest_and_disabled();
        }
    }

    pub fn a_reciprocating_motion_turns_at_its_ends_until_it_is_interrupted<W: Wire>(_: &Addresses) {
        for dwell_ns in [0, 200 * MS] {
            let motion = Motion::ReciprocatingTo { to: 20_000, dwell_ns, profile: PROFILE };
            let mut bench = Bench::<W>::ready();
            let (mut lowest, mut highest, mut turns, mut last) = (0, 0, 0, 0.0);
            let look = |wire: &mut W, now_ns: u64, ms: u64| {
                let truth = wire.observe(now_ns);
                (lowest, highest) = (truth.position_counts.min(lowest), truth.position_counts.max(highest));
                turns += usize::from(truth.velocity * last < 0.0);
                last = if truth.velocity == 0.0 { last } else { truth.velocity };
                ms == 10_000
            };
            let ended = bench.carry_out_with(motion, look).unwrap();
            assert_eq!(ended.end, End::Interrupted);
            assert!(turns >= 6, "{turns}");
            assert!(lowest > -300 && (19_700..20_300).contains(&highest), "{lowest} to {highest}");
            bench.assert_at_rest_and_disabled();
        }
    }

    pub fn a_move_back_and_forth_ends_where_it_has_begun_after_its_dwells<W: Wire>(_: &Addresses) {
        let mut bench = Bench::<W>::ready();
        let mut stops = 0;
        let mut is_at_end = false;
        let motion = Motion::BackAndForth { to: 20_000, times: 2, dwell_ns: 300 * MS, profile: PROFILE };
        let look = |wire: &mut W, now_ns: u64, _: u64| {
            let is_there = (wire.observe(now_ns).position_counts - 20_000).abs() < 60;
            stops += usize::from(is_there && !is_at_end);
            is_at_end = is_there;
            false
        };
        let ended = bench.carry_out_with(motion, look).unwrap();
        assert_eq!((ended.end, stops), (End::Arrived, 2));
        assert!(ended.position.abs() < 120, "{ended:?}");
        bench.assert_at_rest_and_disabled();
    }

    pub fn velocity_and_torque_control_are_enabled_with_a_set_point_of_0_and_a_limit<W: Wire>(
        its: &Addresses,
    ) {
        for (motion, register) in
            [(Motion::Velocity(10_000, PROFILE), its.velocity), (torque(900, 10_000), its.current)]
        {
            let mut bench = Bench::<W>::ready();
            bench.carry_out_until(motion, 2_000).unwrap();
            let enabled = bench.place_of(its.enable, 1);
            assert!(bench.place_of(register, 0) < enabled, "{:X?}", bench.written());
            if motion == torque(900, 10_000) {
                assert!(bench.place_of(its.velocity_limit, 10_000) < enabled, "{:X?}", bench.written());
            }
        }
    }

    pub fn a_joint_that_moves_is_stopped_before_its_motor_is_disabled_for_another_motion<W: Wire>(
        its: &Addresses,
    ) {
        let mut bench = Bench::<W>::ready();
        let kept = bench.run_alone(async |drive: W::Drive| {
            let target = target::<W>();
            let motion = Motion::Continuous(Direction::Forward, PROFILE);
            let duration_ns = Some(2 * SECOND);
            let run = procedure::Run { motion, duration_ns, keeps_enabled: true, target: &target };
            procedure::carry_out(&drive, run).await?;
            // Another master sets it in motion.
            drive.start(motion).await?;
            drive.session().sleep(SECOND).await;
            Ok::<_, MotionFailure<W::Error>>(())
        });
        assert!(kept.is_ok());
        assert!(bench.observe().velocity > 0.3);
        let ended = bench.carry_out(Motion::To(0, PROFILE)).unwrap();
        assert_eq!(ended.end, End::Arrived);
        let written = bench.written();
        assert_eq!(written[..2], [its.stop, (its.enable, Some(0))], "{written:X?}");
    }

    pub fn a_motion_without_a_target_is_stopped_before_a_limit_of_its_axis<W: Wire>(_: &Addresses) {
        let limit = 80_000.0 * std::f64::consts::TAU / COUNTS_PER_TURN;
        let limits = Limits {
            position_min: -limit,
            position_max: limit,
            velocity: 2.0,
            acceleration: 2.0,
            deceleration: 2.0,
            jerk: f64::INFINITY,
            torque: 30.0,
        };
        for motion in [Motion::Continuous(Direction::Forward, PROFILE), Motion::Velocity(30_000, PROFILE)] {
            let mut bench = Bench::<W>::ready();
            let axis = TargetDrive { limits: Some(limits), ..target::<W>() };
            let error = bench.carry_out_on(axis, motion, |_, _, _| false).unwrap_err();
            assert_eq!(error.step, "move");
            assert!(matches!(error.failure, MotionFailure::Limit(Failure::AtLimit { .. })));
            let counts = bench.observe().position_counts;
            assert!((60_000..=80_000).contains(&counts), "{motion:?}: {counts}");
            bench.assert_at_rest_and_disabled();
        }
    }

    pub fn a_module_that_was_just_switched_on_is_waited_for<W: Wire>(_: &Addresses) {
        let mut bench = Bench::<W>::of(module());
        assert_eq!(bench.carry_out(Motion::By(1_000, PROFILE)).unwrap().end, End::Arrived);
        assert_eq!(bench.notes[0], "the drive cannot be enabled yet: it takes 8 s after power-on");
    }

    pub fn a_fault_on_the_way_ends_the_motion_with_its_code_and_the_motor_disabled<W: Wire>(_: &Addresses) {
        let mut bench = Bench::<W>::ready();
        let fail = |wire: &mut W, _: u64, ms: u64| {
            if ms == 2_000 {
                wire.inject_fault(DriveFault::OverCurrent);
            }
            false
        };
        let error = bench.carry_out_with(Motion::To(500_000, PROFILE), fail).unwrap_err();
        assert_eq!(error.step, "move");
        assert!(matches!(error.failure, MotionFailure::Drive { code: 0x2310 }));
        bench.assert_at_rest_and_disabled();
    }

    pub fn a_blocked_joint_is_a_fault_and_a_motor_without_power_is_told<W: Wire>(_: &Addresses) {
        let mut bench = Bench::<W>::ready();
        bench.wire.inject_defect(Defect::BlockedJoint, true);
        let error = bench.carry_out(Motion::By(100_000, PROFILE)).unwrap_err();
        assert!(matches!(error.failure, MotionFailure::Drive { code: 0x8611 }));

        let mut bench = Bench::<W>::ready();
        let mut enabled_ms = None;
        let cut = |wire: &mut W, now_ns: u64, ms: u64| {
            let is_enabled = wire.observe(now_ns).state == DriveState::OperationEnabled;
            if is_enabled && *enabled_ms.get_or_insert(ms) + 100 == ms {
                wire.inject_defect(Defect::TorqueOff, true);
            }
            false
        };
        let error = bench.carry_out_with(Motion::By(1_000, PROFILE), cut).unwrap_err();
        assert!(matches!(error.failure, MotionFailure::NotEnabled));
    }

    pub fn a_silent_module_ends_the_motion_in_the_step_that_asks_it<W: Wire>(_: &Addresses) {
        let mut bench = Bench::<W>::ready();
        bench.wire.inject_defect(Defect::SilentSdoServer, true);
        let error = bench.carry_out(Motion::By(1_000, PROFILE)).unwrap_err();
        assert!(matches!(error.failure, MotionFailure::Request(_)));
        assert_eq!(error.step, "read the fault");
    }

    pub fn a_second_interruption_disables_the_motor_at_once<W: Wire>(_: &Addresses) {
        let mut bench = Bench::<W>::ready();
        let slow = Profile { deceleration: 100, ..PROFILE };
        let began_ns = bench.now_ns;
        let motion = Motion::Continuous(Direction::Forward, slow);
        let ended = bench.carry_out_with(motion, |_, _, ms| ms == 3_000 || ms == 3_500).unwrap();
        assert_eq!(ended.end, End::Interrupted);
        assert!(bench.now_ns < began_ns + 5 * SECOND, "300 s by the profile deceleration");
        bench.assert_at_rest_and_disabled();
    }
}
