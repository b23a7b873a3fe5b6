//! An axis whose drive is spoken to outside of the cycle.

mod fixture;

use std::collections::VecDeque;

use fixture::{LIMITS, PERIOD_NS, PERIOD_S, axis_in};
use takt_rt::{
    AxisParameters, AxisSnapshot, BitSet, BusHealth, BusParameters, Command, ControlLaw, CycleInput,
    CycleTiming, Deadline, DriveState, Engine, EngineParameters, Event, EventKind, Exchange, FeedbackSince,
    HostInterface, Move, OffCycleReport, Phase, Request, RequestEnvelope, RequestId, RequestTarget, Rule,
    SendBatch, Snapshot, StopCategories, StopReason, TimingLadder,
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
}

#[derive(Default)]
struct Host {
    requests: VecDeque<Request<1>>,
    reports: VecDeque<OffCycleReport>,
    shown: AxisSnapshot,
    phase: Phase,
    stops: Vec<StopReason>,
}

impl HostInterface<1, 1> for Host {
    fn request(&mut self) -> Option<RequestEnvelope<1>> {
        let request = self.requests.pop_front()?;
        Some(RequestEnvelope { id: RequestId(0), target: RequestTarget::All, request })
    }

    fn off_cycle_report(&mut self) -> Option<(u8, OffCycleReport)> {
        self.reports.pop_front().map(|report| (0, report))
    }

    fn event(&mut self, event: &Event) -> bool {
        match event.kind {
            EventKind::Stop(reason) => self.stops.push(reason),
            EventKind::Rejected(rejection) => panic!("{rejection:?}"),
            _ => {}
        }
        true
    }

    fn publish(&mut self, snapshot: &Snapshot<1, 1>) {
        (self.shown, self.phase) = (snapshot.axes[0], snapshot.groups()[0].phase);
    }
}

struct Rig {
    engine: Engine<1, 1>,
    host: Host,
    drive: Drive,
    slot: u64,
}

fn axis() -> AxisParameters {
    AxisParameters {
        exchange: Exchange::OffCycle { report_cycles: 1 },
        feedback_since: FeedbackSince::CommandPhase,
        ..axis_in(ControlLaw::Position, 0, 1)
    }
}

impl Rig {
    fn new(pace: u64) -> Self {
        let bus = BusParameters {
            canopen: None,
            divider: DIVIDER,
            service_frames_active: 1,
            service_frames_passive: 6,
        };
        let parameters = EngineParameters {
            period_ns: PERIOD_NS,
            axes: [axis()].into_iter().collect(),
            groups: Default::default(),
            buses: [bus].into_iter().collect(),
            heartbeat: None,
            time_cycles: None,
            enable_timeout_cycles: 2_000,
            not_transmitted_cycles: 5,
            acknowledge_timeout_cycles: 500,
            categories: StopCategories::default(),
            timing: TimingLadder { warning: 10, degraded: 50, unfit: 250, leak_slots: 20 },
        };
        let drive = Drive {
            state: DriveState::ReadyToSwitchOn,
            position: 0.6,
            velocity: 0.0,
            error: 0,
            pace,
            is_silent: false,
        };
        Self { engine: Engine::new(parameters).unwrap(), host: Host::default(), drive, slot: 1 }
    }

    fn speak(&mut self) {
        let (drive, shown) = (&mut self.drive, self.host.shown);
        drive.position += drive.velocity * PERIOD_S;
        if !self.slot.is_multiple_of(drive.pace) || drive.is_silent {
            return;
        }
        let is_wanted =
            matches!(Command::decode(shown.controlword), Command::SwitchOn | Command::EnableOperation);
        drive.state = match drive.state {
            _ if drive.error != 0 => DriveState::Fault,
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
        self.host.reports.push_back(OffCycleReport {
            state,
            position,
            velocity,
            torque: 0.0,
            error_code: error,
        });
    }

    fn step(&mut self) {
        self.speak();
        let now_ns = self.slot * PERIOD_NS;
        let buses = [BusHealth::default()];
        let input = CycleInput {
            slot: self.slot,
            slot_start_ns: now_ns,
            set_points_due_ns: now_ns + 800_000,
            now_ns: now_ns + 500_000,
            buses: &buses,
            behind: BitSet::default(),
        };
        assert_eq!(self.engine.sync(0, self.slot, now_ns), None);
        self.engine.compute(&input, &mut self.host);
        let mut batch = SendBatch::new();
        self.engine.encode(0, Deadline::Met, &mut self.host, &mut batch);
        assert!(batch.is_empty(), "nothing is sent in the cycle");
        let timing = CycleTiming { slot: self.slot, ..CycleTiming::default() };
        self.engine.finish(timing, now_ns, &buses, &mut self.host);
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
        self.host.requests.push_back(Request::Move(Move {
            target: [target],
            target_velocity: [0.0],
            velocity_scale: 0.5,
            acceleration_scale: 0.5,
            minimum_duration_s: 0.0,
        }));
        self.run(2);
    }
}

#[test]
fn a_drive_is_enabled_moved_and_disabled_by_what_is_shown_of_its_axis() {
    for pace in [1, 4, 7, 10] {
        let mut rig = Rig::new(pace).enable();
        assert_eq!(rig.host.shown.drive_state, DriveState::OperationEnabled);
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
        assert_eq!(rig.host.shown.error_code, rig.drive.error);
        let last = Command::decode(rig.host.shown.controlword);
        assert!(!matches!(last, Command::SwitchOn | Command::EnableOperation), "{last:?}");
    }
}

#[test]
fn a_report_without_a_number_is_none() {
    let mut rig = Rig::new(5).enable();
    let before = rig.host.shown.position;
    rig.drive.is_silent = true;
    for number in [f64::NAN, f64::INFINITY] {
        let report = OffCycleReport { position: number, ..OffCycleReport::default() };
        rig.host.reports.push_back(report);
        rig.run(1);
    }
    assert_eq!(rig.host.shown.position, before);
    assert_eq!(rig.host.shown.drive_state, DriveState::OperationEnabled);
}
