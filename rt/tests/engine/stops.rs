//! What becomes of a stop while it is under way: it becomes harder, a fault comes up, a drive does not obey.

use crate::fixture::{LIMITS, PERIOD_NS, Rig, axis, axis_in, move_to, parameters, scale};
use takt_rt::{
    Axis, AxisParameters, BusState, ControlLaw, DriveState, FeedbackSince, Frame, Goal, Id, Phase,
    ProfileMove, ProfileTarget, Request, Rule, StopCategory,
};

/// The group is to be disabled, but the drive of the first axis has fallen silent in operation enabled: it never shows that
/// it obeys.
fn disabling_in_vain() -> Rig {
    let mut parameters = parameters(3);
    // What the silent drive lacks is no fault of its own here.
    parameters.axes[0].missed_feedback_cycles = u16::MAX;
    // And nothing makes it stop by itself.
    parameters.axes[0].stops_by_itself_cycles = None;
    let mut rig = Rig::of(parameters).enable();
    rig.drive(0).is_silent = true;
    rig.request(Request::Disable);
    rig.run_until(Phase::Disabling, 3);
    rig
}

#[test]
fn disabling_that_becomes_harder_on_its_way_lasts_no_longer() {
    let cycles_of = |harder_after: Option<usize>| {
        let mut rig = disabling_in_vain();
        let mut cycles = 0;
        while rig.phase() == Phase::Disabling {
            if harder_after == Some(cycles) {
                rig.host.requests.push_back(Request::Stop(StopCategory::Zero));
            }
            rig.run(1);
            cycles += 1;
            assert!(cycles < 10_000, "stuck");
        }
        cycles
    };
    let patience = cycles_of(None);
    assert!((490..=510).contains(&patience), "{patience}");
    for after in [1, 250, 490] {
        assert_eq!(cycles_of(Some(after)), patience, "harder after {after} cycles");
    }
}

/// The rules and categories of all stops that were told of.
fn told(rig: &Rig) -> Vec<(Rule, StopCategory)> {
    rig.stops().iter().map(|stop| (stop.rule(), stop.category)).collect()
}

#[test]
fn a_fault_on_the_way_of_a_stop_that_was_asked_for_takes_its_place_and_must_be_reset() {
    for category in [StopCategory::Two, StopCategory::One, StopCategory::Zero] {
        let mut rig = Rig::enabled(3);
        rig.move_to(2.0);
        rig.run(200);
        rig.request(Request::Stop(category));
        rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [0]));
        rig.run(2);
        // The fault itself asks for category 1; what was asked for stays where it is harder.
        let hardest = category.min(StopCategory::One);
        assert_eq!(told(&rig), [(Rule::Requested, category), (Rule::UnexpectedBootUp, hardest)]);
        let shown = rig.host.snapshot.groups[0].stop.unwrap();
        assert_eq!((shown.rule(), shown.axis(), shown.category), (Rule::UnexpectedBootUp, Some(1), hardest));
        rig.run_until(Phase::Disabled, 3_000);
        rig.assert_limits_kept();

        rig.request(Request::Enable);
        rig.run(5);
        assert_eq!(rig.phase(), Phase::Disabled, "it is not enabled as if nothing had happened");
        rig.request(Request::ResetFaults);
        rig.request(Request::Enable);
        rig.run_until(Phase::Holding, 600);
    }
}

#[test]
fn a_fault_while_a_requested_stop_disables_the_drives_is_latched() {
    let mut rig = disabling_in_vain();
    rig.request(Request::Stop(StopCategory::One));
    rig.run(10);
    rig.buses[0].state = BusState::BusOff;
    rig.run(2);
    assert_eq!(told(&rig), [(Rule::Requested, StopCategory::One), (Rule::BusLost, StopCategory::One)]);
    assert_eq!(rig.stops()[1].phase, Phase::Disabling);
    rig.buses[0].state = BusState::ErrorActive;
    rig.drive(0).is_silent = false;
    rig.run_until(Phase::Disabled, 600);
    rig.request(Request::Enable);
    rig.run(5);
    assert_eq!(rig.phase(), Phase::Disabled);
}

#[test]
fn what_is_asked_for_on_the_way_of_a_fault_does_not_take_its_place() {
    let mut rig = Rig::enabled(3);
    rig.move_to(2.0);
    rig.run(200);
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [0]));
    rig.run(3);
    rig.request(Request::Stop(StopCategory::Zero));
    rig.request(Request::Stop(StopCategory::Two));
    rig.run(2);
    assert_eq!(told(&rig), [(Rule::UnexpectedBootUp, StopCategory::One)]);
    let shown = rig.host.snapshot.groups[0].stop.unwrap();
    assert_eq!((shown.rule(), shown.category), (Rule::UnexpectedBootUp, StopCategory::Zero));
    rig.run_until(Phase::Disabled, 3_000);
}

#[test]
fn a_fault_of_the_standing_group_after_a_requested_stop_is_a_stop_of_its_own() {
    let mut rig = Rig::enabled(3);
    rig.request(Request::Move(move_to(1.0)));
    rig.run(100);
    rig.request(Request::Stop(StopCategory::Two));
    rig.run_until(Phase::Holding, 3_000);
    rig.buses[0].inject(Frame::of(Id::canopen(0x700, 2), [0]));
    rig.run(2);
    assert_eq!(
        told(&rig),
        [(Rule::Requested, StopCategory::Two), (Rule::UnexpectedBootUp, StopCategory::One)]
    );
}

/// A bus turns error-passive in motion, which stops the group under power, and goes bus-off so many cycles later.
fn error_passive_then_off(bus_lost: StopCategory, after: usize) -> Rig {
    let mut parameters = parameters(6);
    parameters.categories.set(Rule::BusLost, bus_lost);
    let mut rig = Rig::of(parameters).enable();
    rig.move_to(2.0);
    rig.run(200);
    rig.buses[0].state = BusState::ErrorPassive;
    rig.run(1);
    assert_eq!(rig.phase(), Phase::Stopping);
    rig.run(after);
    rig.buses[0].state = BusState::BusOff;
    rig.run(1);
    rig
}

#[test]
fn an_error_passive_bus_that_goes_bus_off_makes_the_stop_harder_and_stays_its_one_reason() {
    // In the first cycle of the stop, on its way, and when the group stands under power.
    for (after, is_standing) in [(0, false), (50, false), (600, true)] {
        for (category, at_once) in [
            (StopCategory::One, if is_standing { Phase::Disabling } else { Phase::Stopping }),
            (StopCategory::Zero, Phase::Disabling),
        ] {
            let mut rig = error_passive_then_off(category, after);
            assert_eq!(rig.phase(), at_once, "{category:?} after {after} cycles");
            let shown = rig.host.snapshot.groups[0].stop.unwrap();
            assert_eq!(
                (shown.rule(), shown.phase, shown.category),
                (Rule::BusErrorPassive, Phase::Moving, category)
            );
            let begun = rig.host.records.len();
            rig.run_until(Phase::Disabled, 3_000);
            let is_held =
                rig.host.records[begun..].iter().any(|record| record.groups[0].phase == Phase::Holding);
            assert!(!is_held, "{category:?} after {after} cycles: held under power");
            assert_eq!(told(&rig), [(Rule::BusErrorPassive, StopCategory::Two)]);
            rig.assert_limits_kept();
        }
    }
}

#[test]
fn a_bus_that_comes_back_from_bus_off_to_error_passive_does_not_soften_the_stop() {
    let mut rig = Rig::enabled(6);
    rig.move_to(2.0);
    rig.run(200);
    for state in [BusState::BusOff, BusState::ErrorPassive, BusState::ErrorActive] {
        rig.buses[0].state = state;
        rig.run(20);
        let shown = rig.host.snapshot.groups[0].stop.unwrap();
        assert_eq!((shown.rule(), shown.category), (Rule::BusLost, StopCategory::One));
    }
    rig.run_until(Phase::Disabled, 3_000);
    assert_eq!(told(&rig), [(Rule::BusLost, StopCategory::One)]);
}

#[test]
fn a_group_that_is_disabled_while_it_is_led_up_is_not_called_disabled_before_the_last_word_has_taken_effect()
{
    for after in 1..60 {
        // The last word may be on the wire while no SYNC has made it valid yet.
        let mut parameters = parameters(3);
        parameters.buses[0].divider = 3;
        let mut rig = Rig::of(parameters);
        rig.host.requests.extend([Request::Sync(true), Request::Activate]);
        rig.run(10);
        rig.request(Request::Enable);
        rig.run(after);
        rig.request(Request::Disable);
        rig.run_until(Phase::Disabled, 100);
        for _ in 0..20 {
            for axis in 0..3 {
                let state = rig.drive(axis).state;
                assert!(!state.has_torque(), "disabled {after} cycles after enabling: {state:?}");
            }
            rig.run(1);
        }
    }
}

/// The fastest of the first three joints, as a share of its velocity limit, in the cycle before its drive lost its torque.
fn speed_when_let_go(rig: &mut Rig) -> f64 {
    let joints = |rig: &mut Rig| [0, 1, 2].map(|axis| (rig.drive(axis).state, rig.drive(axis).position));
    let mut fastest: f64 = 0.0;
    let mut before = joints(rig);
    while rig.phase() != Phase::Disabled {
        rig.run(1);
        let now = joints(rig);
        for ((was, from), (is, to)) in before.into_iter().zip(now) {
            if was.has_torque() && !is.has_torque() {
                let speed = rig.engine.axes()[0].parameters().scale.position_from_counts(to - from).abs()
                    / (PERIOD_NS as f64 * 1e-9);
                fastest = fastest.max(speed / LIMITS.velocity);
            }
        }
        before = now;
    }
    fastest
}

#[test]
fn a_joint_that_is_behind_its_set_point_is_at_rest_before_its_power_is_taken() {
    for category in [StopCategory::One, StopCategory::Two] {
        let mut rig = Rig::enabled(3);
        rig.drive(1).lag_s = 0.02;
        rig.move_to(2.0);
        rig.run(200);
        // Held for a moment, it is still behind when it is to be disabled.
        rig.request(Request::Stop(category));
        if category == StopCategory::Two {
            rig.run_until(Phase::Holding, 300);
            rig.request(Request::Disable);
        }
        let share = speed_when_let_go(&mut rig);
        assert!(share <= 0.02, "let go at {share} of its highest speed after category {category:?}");
        assert!(rig.stops().iter().all(|stop| stop.rule() == Rule::Requested));
        rig.assert_limits_kept();
    }
}

#[test]
fn a_joint_that_swings_about_its_set_point_is_stopped_by_its_drive_before_its_power_is_taken() {
    // Too stiff for the time that a set-point and a report take: the loop over the bus swings without end.
    let swinging = ControlLaw::Torque {
        stiffness: 8000.0,
        damping: 0.0,
        inertia: 1.0,
        viscous_friction: 5.0,
        coulomb_friction: 0.0,
    };
    // Some of these instants are turning points, where it seems to stand.
    for later in (0..70).step_by(7) {
        let mut parameters = parameters(3);
        parameters.axes[1] = axis_in(swinging, 0, 2);
        let mut rig = Rig::of(parameters).enable();
        rig.move_to(0.5);
        rig.run(2_000 + later);
        let speeds = (0..100).map(|_| {
            rig.run(1);
            rig.engine.axes()[1].velocity().abs()
        });
        let fastest = speeds.fold(0.0, f64::max);
        assert!(fastest > 0.1 * LIMITS.velocity, "it swings: {fastest}");
        rig.request(Request::Stop(StopCategory::One));
        let begun = rig.host.records.len();
        let share = speed_when_let_go(&mut rig);
        assert!(share <= 0.02, "let go at {share} of its highest speed");
        // Half a second to catch up, and a ramp from full speed.
        let waited_cycles = rig.host.records.len() - begun;
        assert!(waited_cycles < 800, "{waited_cycles}");
        assert!(rig.stops().iter().all(|stop| stop.rule() == Rule::Requested), "{:?}", rig.stops());
    }
}

#[test]
fn a_joint_that_turns_round_on_its_way_to_its_set_point_is_not_let_go_as_if_it_stood() {
    // The loop does not know of the joint's inertia: the joint is behind when the set-point stands, and turns round to it. For
    // some cycles it is slower than 2 % of its velocity limit then.
    for stiffness in [1000.0, 2000.0, 4000.0] {
        let soft = ControlLaw::Torque {
            stiffness,
            damping: 0.0,
            inertia: 0.0,
            viscous_friction: 5.0,
            coulomb_friction: 0.0,
        };
        for cycles in (1..300).step_by(3) {
            let mut parameters = parameters(3);
            parameters.axes[1] = axis_in(soft, 0, 2);
            let mut rig = Rig::of(parameters).enable();
            rig.move_to(0.5);
            rig.run(cycles);
            rig.request(Request::Stop(StopCategory::One));
            let share = speed_when_let_go(&mut rig);
            assert!(share <= 0.02, "stiffness {stiffness}, stopped {cycles} cycles later: let go at {share}");
        }
    }
}

#[test]
fn nobody_waits_for_a_joint_that_does_not_follow() {
    let mut rig = Rig::enabled(3);
    rig.drive(1).lag_s = 1.0;
    rig.move_to(2.0);
    rig.run_until(Phase::Stopping, 300);
    assert_eq!(rig.stops()[0].rule(), Rule::FollowingError);
    let planned_cycles = (rig.host.snapshot.groups[0].remaining_s * 1e9 / PERIOD_NS as f64).ceil() as usize;
    // Those that do follow are seen to stand for 20 cycles.
    rig.run_until(Phase::Disabling, planned_cycles + 22);
}

#[test]
fn a_joint_that_was_just_told_to_turn_is_not_let_go_as_if_it_stood() {
    for cycles in 1..10 {
        let mut parameters = parameters(3);
        parameters.axes[1] = axis_in(ControlLaw::ProfileVelocity, 0, 2);
        let mut rig = Rig::of(parameters).enable();
        let target = ProfileTarget::Velocity(1.0);
        rig.request(Request::SetProfileTarget(ProfileMove { axis: 1, target, valid_until_ns: u64::MAX }));
        rig.run(cycles - 1);
        rig.request(Request::Stop(StopCategory::One));
        let share = speed_when_let_go(&mut rig);
        assert!(share <= 0.02, "let go at {share} of its highest speed when stopped {cycles} cycles later");
    }
}

#[test]
fn a_joint_that_coasts_is_not_taken_for_standing_when_slots_are_missed() {
    let period_s = PERIOD_NS as f64 * 1e-9;
    // It answers set-points: the first report after slots that were missed is older than they are.
    let parameters = AxisParameters { feedback_since: FeedbackSince::SetPoint, ..axis(0, 1) };
    let may_be_enabled = |speed: f64, missed_slots: u32| {
        let mut axis = Axis::new(0, parameters.clone());
        axis.set_cycle(period_s);
        axis.begin_watch();
        let (mut position, mut unreported_slots) = (0.0, 1);
        for cycle in 0..40 {
            let [s0, s1] = (DriveState::ReadyToSwitchOn.statusword_bits() | 0x0290).to_le_bytes();
            position += speed * period_s * f64::from(unreported_slots);
            let [p0, p1, p2, p3] = scale().position_to_counts(position).to_le_bytes();
            let report = Frame::of(Id::canopen(0x180, 1), [s0, s1, p0, p1, p2, p3]);
            axis.receive(0, &report, 1).unwrap();
            let slots = if cycle == 20 { 1 + missed_slots } else { 1 };
            unreported_slots = slots;
            axis.begin_cycle(period_s * f64::from(slots));
            axis.prepare_to_enable(period_s);
            axis.follow_actual(period_s);
            axis.command(Goal::Disabled, None);
        }
        axis.is_power_granted()
    };
    assert!(may_be_enabled(0.0, 0) && may_be_enabled(0.0, 12));
    assert!(!may_be_enabled(0.3, 0) && !may_be_enabled(0.3, 12));
}
