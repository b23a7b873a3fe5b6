//! The layout of a snapshot in 64-bit words.

use takt_rt::{
    Answers, AxisSnapshot, BusHealth, BusState, DriveState, GroupSnapshot, MAX_AXES, MAX_BUSES, MAX_GROUPS,
    MotionReports, Phase, RejectReason, RequestError, RequestId, RequestKind, Snapshot, StreamCounts,
    StreamReport, StreamState, TimingLevel,
};

use super::latest::Words;
use super::motion_words::{MOTION_WORDS, fill, put_motions, take_motions};
use super::stop_words::{pack, phase_of, put_stop, take_stop, unpack};

/// The largest number of words of a snapshot of so many axes and buses.
pub const fn snapshot_words(groups: usize, axes: usize, buses: usize) -> usize {
    10 + MOTION_WORDS + 4 * Answers::EXPLAINED + GROUP_WORDS * groups + AXIS_WORDS * axes + 7 * buses
}

/// The largest number of words of a group of a snapshot: its phase, the time left, its steps, its stream, and a stop.
const GROUP_WORDS: usize = 3 + 5 + 4;

/// The number of words of an axis of a snapshot.
const AXIS_WORDS: usize = 12;

/// The snapshot before the first cycle: passive, of no axes and no buses.
pub const NO_SNAPSHOT: Snapshot = Snapshot {
    slot: 0,
    at_ns: 0,
    missed_slots: 0,
    timing: TimingLevel::Normal,
    dropped: 0,
    rejected: 0,
    answers: Answers {
        newest: RequestId(0),
        taken_up: 0,
        rejected: 0,
        rejections: [None; Answers::EXPLAINED],
    },
    motions: MotionReports { reports: [None; MotionReports::CAPACITY] },
    group_count: 1,
    groups: [GroupSnapshot {
        phase: Phase::Passive,
        remaining_s: 0.0,
        stop: None,
        needs_bring_up: false,
        stream: StreamReport {
            state: StreamState::Idle,
            counts: StreamCounts { lag_ns: 0, points: 0, late_points: 0, lost_points: 0 },
        },
        steps: 0,
    }; MAX_GROUPS],
    axis_count: 0,
    axes: [AxisSnapshot {
        position_set: 0.0,
        velocity_set: 0.0,
        torque_set: 0.0,
        position: 0.0,
        velocity: 0.0,
        following_error: 0.0,
        torque: None,
        current_per_mille: None,
        mode: None,
        mode_set: 0,
        temperature: None,
        controlword: 0,
        statusword: 0,
        drive_state: DriveState::NotReadyToSwitchOn,
        error_code: 0,
        is_heard: false,
        is_confirmed_off: false,
        unanswered: 0,
        feedback_age: 0,
        feedback_slot: 0,
        feedback_ns: 0,
    }; MAX_AXES],
    bus_count: 0,
    buses: [BusHealth {
        state: BusState::ErrorActive,
        tx_frames: 0,
        rx_frames: 0,
        tx_overruns: 0,
        rx_overruns: 0,
        errors: 0,
        busy_ns: 0,
    }; MAX_BUSES],
};

pub fn put_snapshot(snapshot: &Snapshot, words: &mut Words<'_>) {
    words.put(snapshot.slot);
    words.put(snapshot.at_ns);
    words.put(pack([snapshot.group_count, snapshot.axis_count, snapshot.bus_count, snapshot.timing as u8]));
    words.put(snapshot.missed_slots);
    words.put(snapshot.dropped);
    words.put(snapshot.rejected);
    put_answers(&snapshot.answers, words);
    put_motions(&snapshot.motions, words);
    snapshot.groups().iter().for_each(|group| put_group(group, words));
    for axis in snapshot.axes.iter().take(snapshot.axis_count.into()) {
        put_axis(axis, words);
    }
    for bus in snapshot.buses.iter().take(snapshot.bus_count.into()) {
        put_bus(bus, words);
    }
}

pub fn take_snapshot(words: &mut Words<'_>) -> Snapshot {
    let mut snapshot = NO_SNAPSHOT;
    take_snapshot_into(words, &mut snapshot);
    snapshot
}

/// Writes a snapshot over an earlier one, or over [`NO_SNAPSHOT`], of the same controller. A snapshot has twelve kilobytes, most of
/// which do not count, so it is not copied about.
pub fn take_snapshot_into(words: &mut Words<'_>, snapshot: &mut Snapshot) {
    snapshot.slot = words.take();
    snapshot.at_ns = words.take();
    let [group_count, axis_count, bus_count, timing] = unpack(words.take());
    snapshot.timing = TimingLevel::ALL.get(usize::from(timing)).copied().unwrap_or_default();
    (snapshot.group_count, snapshot.axis_count, snapshot.bus_count) = (group_count, axis_count, bus_count);
    snapshot.missed_slots = words.take();
    snapshot.dropped = words.take();
    snapshot.rejected = words.take();
    take_answers(words, &mut snapshot.answers);
    take_motions(words, &mut snapshot.motions);
    for group in snapshot.groups.iter_mut().take(group_count.into()) {
        *group = take_group(words);
    }
    for axis in snapshot.axes.iter_mut().take(axis_count.into()) {
        *axis = take_axis(words);
    }
    for bus in snapshot.buses.iter_mut().take(bus_count.into()) {
        *bus = take_bus(words);
    }
}

fn put_group(group: &GroupSnapshot, words: &mut Words<'_>) {
    words.put(pack([group.phase as u8, group.stop.is_some().into(), group.needs_bring_up.into(), 0]));
    words.put_f64(group.remaining_s);
    words.put(group.steps);
    put_stream(&group.stream, words);
    if let Some(stop) = group.stop {
        put_stop(&stop, words);
    }
}

fn take_group(words: &mut Words<'_>) -> GroupSnapshot {
    let [phase, is_stopped, needs_bring_up, _] = unpack(words.take());
    GroupSnapshot {
        phase: phase_of(phase),
        needs_bring_up: needs_bring_up == 1,
        remaining_s: words.take_f64(),
        steps: words.take(),
        stream: take_stream(words),
        stop: (is_stopped == 1).then(|| take_stop(words)),
    }
}

fn put_answers(answers: &Answers, words: &mut Words<'_>) {
    words.put(answers.newest.0);
    for bits in [answers.taken_up, answers.rejected] {
        words.put(bits as u64);
        words.put((bits >> 64) as u64);
    }
    // The newest come first, so that the first that is missing is the end.
    for place in &answers.rejections {
        let Some((RequestId(id), refused)) = place else {
            words.put(0);
            return;
        };
        put_rejection(refused, words);
        words.put(*id);
    }
}

pub fn put_rejection(refused: &RequestError, words: &mut Words<'_>) {
    let axis = refused.axis.map_or(0, |axis| u64::from(axis) << 32 | 1 << 40);
    let kinds = pack([refused.request as u8, refused.reason.number(), refused.phase as u8, 1]);
    let (asked, allowed) = refused.reason.numbers();
    words.put(kinds | axis);
    words.put_f64(asked);
    words.put_f64(allowed);
}

/// `None` at the end of the rejections.
pub fn take_rejection(words: &mut Words<'_>) -> Option<RequestError> {
    let packed = words.take();
    let [request, reason, phase, is_there] = unpack(packed);
    if is_there == 0 {
        return None;
    }
    let (asked, allowed) = (words.take_f64(), words.take_f64());
    Some(RequestError {
        request: RequestKind::ALL.get(usize::from(request)).copied().unwrap_or(RequestKind::Shutdown),
        reason: RejectReason::from_numbers(reason, asked, allowed).unwrap_or(RejectReason::Phase),
        axis: (packed >> 40 & 1 == 1).then_some((packed >> 32) as u8),
        phase: phase_of(phase),
    })
}

fn take_answers(words: &mut Words<'_>, answers: &mut Answers) {
    answers.newest = RequestId(words.take());
    let mut bits = || u128::from(words.take()) | u128::from(words.take()) << 64;
    (answers.taken_up, answers.rejected) = (bits(), bits());
    fill(&mut answers.rejections, || {
        let rejected = take_rejection(words)?;
        Some((RequestId(words.take()), rejected))
    });
}

fn put_stream(stream: &StreamReport, words: &mut Words<'_>) {
    let StreamCounts { lag_ns, points, late_points, lost_points } = stream.counts;
    words.put(stream.state as u64);
    [lag_ns, points, late_points, lost_points].into_iter().for_each(|word| words.put(word));
}

fn take_stream(words: &mut Words<'_>) -> StreamReport {
    let state = StreamState::ALL.get(words.take() as usize).copied().unwrap_or_default();
    let [lag_ns, points, late_points, lost_points] = [(); 4].map(|()| words.take());
    StreamReport { state, counts: StreamCounts { lag_ns, points, late_points, lost_points } }
}

fn put_axis(axis: &AxisSnapshot, words: &mut Words<'_>) {
    let numbers = [
        axis.position_set,
        axis.velocity_set,
        axis.torque_set,
        axis.position,
        axis.velocity,
        axis.following_error,
        axis.torque.unwrap_or_default(),
    ];
    numbers.into_iter().for_each(|number| words.put_f64(number));
    let is_heard = u64::from(axis.is_heard) << 32;
    let is_confirmed_off = u64::from(axis.is_confirmed_off) << 33;
    let drive_state = (axis.drive_state as u64) << 40;
    let unanswered = u64::from(axis.unanswered) << 48;
    let words_of_drive = u64::from(axis.statusword) | u64::from(axis.error_code) << 16;
    words.put(words_of_drive | is_heard | is_confirmed_off | drive_state | unanswered);
    let current = u64::from(axis.current_per_mille.unwrap_or_default() as u16) << 16;
    let mode = u64::from(axis.mode.unwrap_or_default() as u8) << 32;
    let are_reported = [
        axis.torque.is_some(),
        axis.current_per_mille.is_some(),
        axis.mode.is_some(),
        axis.temperature.is_some(),
    ];
    let reported = are_reported.iter().rev().fold(0, |bits, is_reported| bits << 1 | u64::from(*is_reported));
    let mode_set = u64::from(axis.mode_set as u8) << 48;
    words.put(u64::from(axis.feedback_age) | current | mode | reported << 40 | mode_set);
    let temperature = u64::from(axis.temperature.unwrap_or_default().to_bits()) << 32;
    words.put(u64::from(axis.controlword) | temperature);
    words.put(axis.feedback_slot);
    words.put(axis.feedback_ns);
}

fn take_axis(words: &mut Words<'_>) -> AxisSnapshot {
    let [position_set, velocity_set, torque_set, position, velocity, following_error, torque] =
        [(); 7].map(|()| words.take_f64());
    let (packed, reported, commanded) = (words.take(), words.take(), words.take());
    let is_reported = |bit: u32| reported >> (40 + bit) & 1 == 1;
    AxisSnapshot {
        position_set,
        velocity_set,
        torque_set,
        position,
        velocity,
        following_error,
        torque: is_reported(0).then_some(torque),
        current_per_mille: is_reported(1).then_some((reported >> 16) as i16),
        mode: is_reported(2).then_some((reported >> 32) as i8),
        mode_set: (reported >> 48) as i8,
        temperature: is_reported(3).then_some(f32::from_bits((commanded >> 32) as u32)),
        controlword: commanded as u16,
        statusword: packed as u16,
        drive_state: drive_state_of((packed >> 40) as u8),
        error_code: (packed >> 16) as u16,
        is_heard: packed >> 32 & 1 == 1,
        is_confirmed_off: packed >> 33 & 1 == 1,
        unanswered: (packed >> 48) as u16,
        feedback_age: reported as u16,
        feedback_slot: words.take(),
        feedback_ns: words.take(),
    }
}

fn put_bus(bus: &BusHealth, words: &mut Words<'_>) {
    words.put(match bus.state {
        BusState::ErrorActive => 0,
        BusState::ErrorPassive => 1,
        BusState::BusOff => 2,
        BusState::Down => 3,
    });
    for counter in [bus.tx_frames, bus.rx_frames, bus.tx_overruns, bus.rx_overruns, bus.errors, bus.busy_ns] {
        words.put(counter);
    }
}

fn take_bus(words: &mut Words<'_>) -> BusHealth {
    BusHealth {
        state: match words.take() {
            0 => BusState::ErrorActive,
            1 => BusState::ErrorPassive,
            2 => BusState::BusOff,
            _ => BusState::Down,
        },
        tx_frames: words.take(),
        rx_frames: words.take(),
        tx_overruns: words.take(),
        rx_overruns: words.take(),
        errors: words.take(),
        busy_ns: words.take(),
    }
}

pub fn drive_state_of(number: u8) -> DriveState {
    DriveState::ALL.get(usize::from(number)).copied().unwrap_or_default()
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::channels::latest::{Attempt, latest};
    use proptest::prelude::*;
    use takt_rt::{MotionReport, MotionState};
    use takt_rt::{Origin, Rule, StopCategory, StopCause, StopReason};

    pub fn stop_reasons() -> impl Strategy<Value = StopReason> {
        let categories = prop::sample::select(vec![StopCategory::Zero, StopCategory::One, StopCategory::Two]);
        let (rules, phases) = (prop::sample::select(&Rule::ALL[..]), prop::sample::select(&Phase::ALL[..]));
        let origins = prop_oneof![
            Just(Origin::Group),
            any::<u8>().prop_map(Origin::Axis),
            any::<u8>().prop_map(Origin::Bus)
        ];
        // Among them numbers that every fault can have: the operation modes are 8 to 10.
        let numbers = (0u8..100, 8u8..=10, any::<u64>());
        (categories, rules, origins, numbers, phases).prop_filter_map(
            "what was seen is no operation mode",
            |(category, rule, origin, (seen, allowed, slot), phase)| {
                let cause = StopCause::from_numbers(rule, seen.into(), allowed.into())?;
                Some(StopReason { category, cause, origin, slot, phase })
            },
        )
    }

    pub fn rejections() -> impl Strategy<Value = RequestError> {
        let requests = prop::sample::select(&RequestKind::ALL[..]);
        let reasons = prop::sample::select(RejectReason::all().collect::<Vec<_>>());
        let phases = prop::sample::select(&Phase::ALL[..]);
        (requests, reasons, any::<Option<u8>>(), phases)
            .prop_map(|(request, reason, axis, phase)| RequestError { request, reason, axis, phase })
    }

    fn motions() -> impl Strategy<Value = MotionReports> {
        let states = prop_oneof![
            Just(MotionState::InProgress),
            Just(MotionState::Finished),
            stop_reasons().prop_map(MotionState::Stopped),
            any::<u64>().prop_map(|by| MotionState::Replaced { by: RequestId(by) }),
        ];
        let reports = (any::<u64>(), any::<u8>(), any::<Option<u8>>(), states).prop_map(
            |(request, group, axis, state)| MotionReport { request: RequestId(request), group, axis, state },
        );
        prop::collection::vec(reports, 0..=MotionReports::CAPACITY)
            .prop_map(|reports| MotionReports { reports: std::array::from_fn(|at| reports.get(at).copied()) })
    }

    fn axes() -> impl Strategy<Value = AxisSnapshot> {
        let states = prop::sample::select(&DriveState::ALL[..]);
        let reported = any::<(
            Option<f64>,
            Option<i16>,
            (Option<i8>, i8),
            (u16, u16),
            (u16, Option<f32>),
            (bool, bool),
            u16,
            u16,
            [u64; 2],
        )>();
        (any::<[f64; 6]>(), reported, states).prop_map(|(numbers, reported, drive_state)| {
            let [position_set, velocity_set, torque_set, position, velocity, following_error] = numbers;
            let (torque, current_per_mille, modes, words, state, flags, unanswered, age, at) = reported;
            let (is_heard, is_confirmed_off) = flags;
            let ((mode, mode_set), (controlword, statusword), (error_code, temperature)) =
                (modes, words, state);
            AxisSnapshot {
                position_set,
                velocity_set,
                torque_set,
                position,
                velocity,
                following_error,
                torque,
                current_per_mille,
                mode,
                mode_set,
                temperature,
                controlword,
                statusword,
                drive_state,
                error_code,
                is_heard,
                is_confirmed_off,
                unanswered,
                feedback_age: age,
                feedback_slot: at[0],
                feedback_ns: at[1],
            }
        })
    }

    fn buses() -> impl Strategy<Value = BusHealth> {
        let states = vec![BusState::ErrorActive, BusState::ErrorPassive, BusState::BusOff, BusState::Down];
        (prop::sample::select(states), any::<[u64; 6]>()).prop_map(
            |(state, [tx_frames, rx_frames, tx_overruns, rx_overruns, errors, busy_ns])| BusHealth {
                state,
                tx_frames,
                rx_frames,
                tx_overruns,
                rx_overruns,
                errors,
                busy_ns,
            },
        )
    }

    fn groups() -> impl Strategy<Value = GroupSnapshot> {
        let phases = prop::sample::select(&Phase::ALL[..]);
        let flag_and_steps = any::<(bool, u64)>();
        (phases, any::<f64>(), prop::option::of(stop_reasons()), streams(), flag_and_steps).prop_map(
            |(phase, remaining_s, stop, stream, (needs_bring_up, steps))| GroupSnapshot {
                phase,
                needs_bring_up,
                remaining_s,
                stop,
                stream,
                steps,
            },
        )
    }

    fn streams() -> impl Strategy<Value = StreamReport> {
        (prop::sample::select(&StreamState::ALL[..]), any::<[u64; 4]>()).prop_map(|(state, counts)| {
            let [lag_ns, points, late_points, lost_points] = counts;
            StreamReport { state, counts: StreamCounts { lag_ns, points, late_points, lost_points } }
        })
    }

    fn snapshots() -> impl Strategy<Value = Snapshot> {
        let counted = (
            prop::collection::vec(axes(), 0..=MAX_AXES),
            prop::collection::vec(buses(), 0..=MAX_BUSES),
            prop::collection::vec(groups(), 1..=MAX_GROUPS),
        );
        let refusals = prop::collection::vec((any::<u64>(), rejections()), 0..=Answers::EXPLAINED);
        let answers = (any::<(u64, u64, u128, u128)>(), refusals, motions());
        (counted, any::<(u64, u64, u64, u64)>(), answers).prop_map(
            |(
                (axes, buses, groups),
                (slot, at_ns, missed_slots, dropped),
                ((refused, newest, taken_up, refused_bits), refusals, motions),
            )| {
                let mut snapshot = Snapshot {
                    slot,
                    at_ns,
                    missed_slots,
                    dropped,
                    rejected: refused,
                    answers: Answers {
                        newest: RequestId(newest),
                        taken_up,
                        rejected: refused_bits,
                        rejections: std::array::from_fn(|at| {
                            refusals.get(at).map(|(id, refusal)| (RequestId(*id), *refusal))
                        }),
                    },
                    motions,
                    group_count: groups.len() as u8,
                    axis_count: axes.len() as u8,
                    bus_count: buses.len() as u8,
                    ..NO_SNAPSHOT
                };
                snapshot.groups[..groups.len()].copy_from_slice(&groups);
                snapshot.axes[..axes.len()].copy_from_slice(&axes);
                snapshot.buses[..buses.len()].copy_from_slice(&buses);
                snapshot
            },
        )
    }

    proptest! {
        #[test]
        fn a_snapshot_comes_out_as_it_went_in(before in snapshots(), snapshot in snapshots()) {
            let words = snapshot_words(MAX_GROUPS, MAX_AXES, MAX_BUSES);
            let (mut writer, reader) = latest(words);
            // The rest of an earlier, longer value in a slot must have no effect.
            (0..4).for_each(|_| writer.write(|words| put_snapshot(&before, words)));
            writer.write(|words| put_snapshot(&snapshot, words));
            prop_assert_eq!(reader.attempt(4, take_snapshot), Attempt::Whole(snapshot, 5));
        }

        #[test]
        fn a_snapshot_that_is_read_over_an_earlier_one_is_itself(
            snapshot in snapshots(),
            before in snapshots(),
        ) {
            let words = snapshot_words(MAX_GROUPS, MAX_AXES, MAX_BUSES);
            let (mut writer, reader) = latest(words);
            writer.write(|words| put_snapshot(&snapshot, words));
            let mut read = before;
            let attempt = reader.attempt(0, |words| take_snapshot_into(words, &mut read));
            prop_assert_eq!(attempt, Attempt::Whole((), 1));
            // What does not count is that of the earlier one.
            let counted = Snapshot { groups: read.groups, axes: read.axes, buses: read.buses, ..snapshot };
            prop_assert_eq!(read, counted);
            prop_assert_eq!((read.groups(), read.axes(), read.buses()), (snapshot.groups(), snapshot.axes(), snapshot.buses()));
        }

        #[test]
        fn a_snapshot_fits_the_words_reckoned_for_it(snapshot in snapshots()) {
            let words = snapshot_words(
                snapshot.group_count.into(),
                snapshot.axis_count.into(),
                snapshot.bus_count.into(),
            );
            let (mut writer, reader) = latest(words);
            writer.write(|words| put_snapshot(&snapshot, words));
            prop_assert_eq!(reader.attempt(0, take_snapshot), Attempt::Whole(snapshot, 1));
        }
    }
}
