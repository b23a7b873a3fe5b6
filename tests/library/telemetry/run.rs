//! A run in virtual time, made of records and events like those of the engine.

use std::io::{self, Write};
use std::sync::{Arc, Mutex};

use takt::channels::{ChannelSizes, GroupStream, HostSide, LogSide, RtSide, channels};
use takt::telemetry::{
    AxisDescription, BusDescription, Logger, LoggerOptions, Machine, Notice, RecordingDestination,
    RecordingOptions, SetPointMagnitudes, Unit, WallClock,
};
use takt_rt::{
    AxisRecord, CycleRecord, CycleTiming, DriveState, Event, EventKind, Fault, GroupRecord, HostInterface,
    MAX_AXES, MAX_GROUPS, Origin, Phase, StopCategory, StopCause, StopReason,
};

/// 2023-11-14 22:13:20 UTC
pub const UNIX_AT_ZERO_NS: u64 = 1_700_000_000_000_000_000;
/// The monotonic time of slot 0.
pub const EPOCH_NS: u64 = 5_000_000;
pub const CYCLE_NS: u64 = 1_000_000;
pub const STOP: StopReason = StopReason {
    category: StopCategory::One,
    cause: StopCause::Fault(Fault::FollowingError { error: 0.25, limit: 0.125 }),
    origin: Origin::Axis(1),
    slot: 7,
    phase: Phase::Moving,
};

pub fn sides(records: usize) -> (RtSide, HostSide, LogSide) {
    channels(&ChannelSizes {
        groups: vec![GroupStream::default()],
        axes: 2,
        buses: 1,
        records,
        events: 16,
        requests: 4,
        service_out: 4,
        service_in: 4,
    })
}

/// Groups that are all in this phase.
pub fn all_in(phase: Phase) -> [GroupRecord; MAX_GROUPS] {
    [GroupRecord { phase, ..GroupRecord::default() }; MAX_GROUPS]
}

pub fn machine() -> Machine {
    let axis = |name: &str, unit| AxisDescription {
        name: name.to_owned(),
        bus: None,
        group: 0,
        family: None,
        own_errors: vec![],
        unit,
        plans_own_profile: false,
        counts_per_unit: 83_443.0,
        limits: SetPointMagnitudes { velocity: 2.0, acceleration: 10.0, jerk: 50.0 },
    };
    Machine {
        name: "arm".to_owned(),
        cycle_ns: CYCLE_NS,
        axes: vec![axis("shoulder", Unit::Radian), axis("slide", Unit::Metre)],
        buses: vec![BusDescription {
            name: "left".to_owned(),
            interface: "can0".to_owned(),
            bit_rate: None,
            data_bit_rate: None,
        }],
        groups: vec![],
    }
}

pub fn options(recording: Option<RecordingDestination>) -> LoggerOptions {
    LoggerOptions {
        machine: machine(),
        wall_clock: WallClock::fixed(UNIX_AT_ZERO_NS),
        started_ns: EPOCH_NS,
        recording,
        recording_options: RecordingOptions::default(),
        candump: None,
        black_box: None,
        traces: Vec::new(),
    }
}

/// The first drive reports from this cycle on.
const FIRST_REPORT: u64 = 10;

/// A cycle in which every field has a different value. The first drive is a cycle late.
pub fn cycle(slot: u64) -> CycleRecord {
    let mut axes = [AxisRecord::default(); MAX_AXES];
    for (axis, record) in axes.iter_mut().take(2).enumerate() {
        let step = slot as f64 + axis as f64 / 2.0;
        *record = AxisRecord {
            position_set: step,
            position: step - 0.0625,
            velocity_set: 1.5,
            acceleration_set: -2.5,
            jerk_set: 40.0,
            velocity: 1.25,
            torque_set: 7.5,
            torque: -8.5,
            following_error: 0.0625 * slot as f32,
            controlword: 0x0F,
            drive_state: DriveState::OperationEnabled,
            statusword: if axis == 0 && slot < FIRST_REPORT { 0 } else { 0x1637 },
            error_code: 0x7305,
            feedback_age: 1 - axis as u16,
            command_raw: -(slot as i32),
            position_raw: i32::MIN + axis as i32,
        };
    }
    CycleRecord {
        timing: CycleTiming {
            slot,
            slot_start_ns: EPOCH_NS + slot * CYCLE_NS,
            wake_ns: 1000 + slot,
            sync_ns: 2000 + slot,
            compute_ns: 3000 + slot,
            sent_ns: 4000 + slot,
            missed_slots: u64::from(slot == 3),
        },
        groups: all_in(Phase::Moving),
        is_commanded: slot != 3,
        axis_count: 2,
        axes,
        ..CycleRecord::default()
    }
}

pub fn event(slot: u64, kind: EventKind) -> Event {
    Event { slot, at_ns: EPOCH_NS + slot * CYCLE_NS, group: Some(0), kind }
}

/// Hands over the cycles of these slots, and drains the logger after each.
pub fn run(rt: &mut RtSide, logger: &mut Logger, slots: std::ops::Range<u64>) {
    for slot in slots {
        assert!(rt.record(&cycle(slot)));
        logger.drain();
    }
}

/// All notices of a logger.
#[derive(Clone, Default)]
pub struct Notices(Arc<Mutex<Vec<Notice>>>);

impl Notices {
    pub fn sink(&self) -> Box<dyn FnMut(&Notice) + Send> {
        let notices = Arc::clone(&self.0);
        Box::new(move |notice| notices.lock().unwrap().push(notice.clone()))
    }

    pub fn all(&self) -> Vec<Notice> {
        self.0.lock().unwrap().clone()
    }
}

/// A disk with room for so many bytes.
#[derive(Clone)]
pub struct Disk {
    pub bytes: Arc<Mutex<Vec<u8>>>,
    pub room: usize,
}

impl Disk {
    pub fn new(room: usize) -> Self {
        Self { bytes: Arc::default(), room }
    }

    pub fn destination(&self) -> RecordingDestination {
        RecordingDestination::Stream("the disk".to_owned(), Box::new(self.clone()))
    }
}

impl Write for Disk {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let mut written = self.bytes.lock().unwrap();
        let room = self.room - written.len();
        if room == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        let taken = bytes.len().min(room);
        written.extend_from_slice(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
