//! An axis whose drive is spoken to outside of the cycle.

use crate::fixture::{LIMITS, PERIOD_S, axis_in};
use crate::plain_host::{PlainHost, cycle, one_bus, slow_move};
use takt_rt::{
    AxisParameters, Command, ControlLaw, Deadline, DriveState, Engine, Exchange, FeedbackSince, Frame, Id,
    OffCycleReport, Phase, Request, Rule,
};

/// Slots of a cycle of the bus: one report is expected in each.
const DIVIDER: u32 = 10;

/// A drive with whoever speaks to it: it is asked once in some slots, and follows velocities.
#[derive(Clone, Copy, Debug)]
struct Drive {
    state: DriveState,
    position: f64,
    velocity: f64,
    error: u16,
    /// Slots from one report to the next.
    pace: u64,
    is_silent: bool,
    /// It is being enabled, and does not follow yet.
    is_settling: bool,
}

struct Rig {
    engine: Engine<1, 1>,
    host: PlainHost<1>,
    drive: Drive,
    slot: u64,
}

/// What takes the torque of the drive.
fn stop_frame() -> Frame {
    Frame::of(Id::canopen(0x640, 1), [0x01, 0x00, 0, 0, 0, 0])
}

fn axis() -> AxisParameters {
    AxisParameters {
        exchange: Exchange::OffCycle { report_cycles: 1, stop_frame: Some(stop_frame()) },
        feedback_since: FeedbackSince::CommandPhase,
        stops_by_itself_cycles: None,
        ..axis_in(ControlLaw::Position, 0, 1)
    }
}

impl Rig {
    fn new(pace: u64) -> Self {
        let parameters = one_bus([axis()], DIVIDER, None, 2_000);
        let drive = Drive {
            state: DriveState::ReadyToSwitchOn,
            position: 0.6,
            velocity: 0.0,
            error: 0,
            pace,
            is_silent: false,
            is_settling: false,
        };
        Self { engine: Engine::new(parameters).unwrap(), host: PlainHost::default(), drive, slot: 1 }
    }

    fn speak(&mut self) {
        let (drive, shown) = (&mut self.drive, self.host.axes[0]);
        drive.position += drive.velocity * PERIOD_S;
        if !self.slot.is_multiple_of(drive.pace) || drive.is_silent {
            return;
        }
        let is_wanted =
            matches!(Command::decode(shown.controlword), Command::SwitchOn | Command::EnableOperation);
        drive.state = match drive.state {
            _ if drive.error != 0 => DriveState::Fault,
            _ if is_wanted && drive.is_settling => DriveState::SwitchedOn,
            _ if is_wanted => DriveState::OperationEnabled,
            _ => DriveState::ReadyToSwitchOn,
        };
        drive.velocity = match drive.state {
            DriveState::OperationEnabled => {
                let correction = 20.0 * (shown.position_set - drive.position);
                (shown.velocity_set + correction).clamp(-LIMITS.velocity, LIMITS.velocity)
            }
            _ => 0.0,
        };
        let Drive { state, position, velocity, error, .. } = *drive;
        let report =
            OffCycleReport { state, position, velocity, error_code: error, ..OffCycleReport::default() };
        self.host.reports.push_back((0, report));
    }

    fn step(&mut self) {
        self.speak();
        let batch = cycle(&mut self.engine, &mut self.host, self.slot, Deadline::Met);
        assert!(batch.is_empty(), "nothing is sent in the cycle");
        self.slot += 1;
    }

    fn run(&mut self, slots: usize) {
        (0..slots).for_each(|_| self.step());
    }

    fn run_until(&mut self, phase: Phase) {
        for _ in 0..20_000 {
            if self.host.phase == phase {
                return;
            }
            self.step();
        }
        panic!("{phase:?} is not reached: {:?}, {:?}, {:?}", self.host.phase, self.drive, self.host.stops);
    }

    fn enable(mut self) -> Self {
        self.host.requests.push_back(Request::Activate);
        self.run(50);
        self.host.requests.push_back(Request::Enable);
        self.run_until(Phase::Holding);
        self
    }

    fn begin_move(&mut self, target: f64) {
        self.host.requests.push_back(Request::Move(slow_move([target], 0.5)));
        self.run(2);
    }
}

#[test]
fn a_drive_is_enabled_moved_and_disabled_by_what_is_shown_of_its_axis() {
    for pace in [1, 4, 7, 10] {
        let mut rig = Rig::new(pace).enable();
        assert_eq!(rig.host.axes[0].drive_state, DriveState::OperationEnabled);
        assert!((rig.drive.position - 0.6).abs() < 1e-6, "it stays where it is: {:?}", rig.drive);
        rig.begin_move(-1.0);
        rig.run_until(Phase::Holding);
        rig.run(500);
        assert!((rig.drive.position + 1.0).abs() < 1e-3, "{:?}", rig.drive);
        rig.host.requests.push_back(Request::Disable);
        rig.run(2);
        rig.run_until(Phase::Disabled);
        rig.run(20);
        assert_eq!(rig.drive.state, DriveState::ReadyToSwitchOn);
        assert_eq!(rig.host.stops.iter().find(|stop| stop.rule() != Rule::Requested), None);
    }
}

#[test]
fn a_drive_that_is_not_heard_any_more_or_has_an_error_stops_the_group_with_one_reason() {
    let faults: [fn(&mut Drive); 2] = [|drive| drive.is_silent = true, |drive| drive.error = 0x24];
    for fault in faults {
        let mut rig = Rig::new(5).enable();
        rig.begin_move(1.5);
        rig.run(300);
        fault(&mut rig.drive);
        rig.run_until(Phase::Disabled);
        assert_eq!(rig.host.stops.len(), 1, "{:?}", rig.host.stops);
        assert_eq!(rig.host.axes[0].error_code, rig.drive.error);
        let last = Command::decode(rig.host.axes[0].controlword);
        assert!(!matches!(last, Command::SwitchOn | Command::EnableOperation), "{last:?}");
    }
}

#[test]
fn a_report_without_a_number_is_none() {
    let mut rig = Rig::new(5).enable();
    let before = rig.host.axes[0].position;
    rig.drive.is_silent = true;
    for number in [f64::NAN, f64::INFINITY] {
        let report = OffCycleReport { position: number, ..OffCycleReport::default() };
        rig.host.reports.push_back((0, report));
        rig.run(1);
    }
    assert_eq!(rig.host.axes[0].position, before);
    assert_eq!(rig.host.axes[0].drive_state, DriveState::OperationEnabled);
}

#[test]
fn a_group_that_sends_no_set_points_in_the_cycle_goes_on_in_every_slot_after_missed_ones() {
    let mut rig = Rig::new(5).enable();
    rig.begin_move(1.5);
    rig.run(300);
    while !rig.slot.is_multiple_of(DIVIDER.into()) {
        rig.step();
    }
    // The only slot in ten in which the bus has a cycle.
    rig.slot += 1;
    for _ in 0..30 {
        let before = rig.host.steps;
        rig.step();
        assert_eq!(rig.host.steps, before + 1);
    }
}

#[test]
fn a_drive_that_is_being_enabled_is_waited_for_when_its_group_is_disabled() {
    let mut rig = Rig::new(5);
    rig.host.requests.push_back(Request::Activate);
    rig.run(50);
    rig.drive.is_settling = true;
    rig.host.requests.push_back(Request::Enable);
    rig.run(300);
    assert_eq!(rig.host.axes[0].drive_state, DriveState::SwitchedOn);
    // It may have torque, and says nothing more for some time.
    rig.drive.is_silent = true;
    rig.host.requests.push_back(Request::Disable);
    rig.run(300);
    assert_eq!(rig.host.phase, Phase::Disabling);
    rig.drive.is_silent = false;
    rig.run(50);
    assert_eq!(rig.host.phase, Phase::Disabled);
}

#[test]
fn a_drive_whose_frames_do_not_get_out_is_told_to_stop_by_the_frame_that_takes_its_torque() {
    let mut rig = Rig::new(4).enable();
    rig.begin_move(-1.0);
    rig.run(50);
    let mut sent = vec![];
    for _ in 0..3_000 {
        // Whoever speaks to it is not heard any more, and does not hear it.
        let batch = cycle(&mut rig.engine, &mut rig.host, rig.slot, Deadline::Missed);
        rig.slot += 1;
        sent.extend(batch);
    }
    assert!(sent.len() > 2, "{:?}", rig.host.phase);
    assert!(sent.iter().all(|frame| *frame == stop_frame()), "{sent:?}");
}
