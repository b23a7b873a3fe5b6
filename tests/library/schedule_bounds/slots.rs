//! Whole slots of a configuration: SYNC, drives that answer it, set-points in the controller's queue, heartbeats and
//! SDO transfers whenever they like.

use proptest::prelude::*;
use takt::config::Config;
use takt::schedule::{self, BusSchedule, MessageKind, MessageSchedule};
use takt::sim::WireBitRates;
use takt_rt::{Frame, FrameKind, Id};

use crate::schedule_bounds::frames::longest;
use crate::schedule_bounds::traffic::{Arrival, Traffic};

const RATES: WireBitRates = WireBitRates { nominal: 1_000_000, data: None };
const CONTROLLER: usize = 0;

/// Axes on one bus, with the nodes in the order of the axes or in the opposite one.
fn config(axes: usize, is_reversed: bool, cycle: &str, bus: &str, axis: &str) -> Config {
    let mut text = format!("name = \"n\"\n[cycle]\n{cycle}\n[master]\nheartbeat = \"10 ms\"\n");
    text += &format!("[[bus]]\nname = \"b\"\n{bus}\n[defaults.axis]\ndrive = \"erob-canopen\"\n{axis}\n");
    for number in 1..=axes {
        let node = if is_reversed { axes + 1 - number } else { number };
        let limits = "limits = { position = [-1, 1], velocity = 1, acceleration = 1, torque = 1 }";
        text += &format!("[[axis]]\nname = \"a{number}\"\nbus = \"b\"\nnode = {node}\n{limits}\n");
    }
    Config::parse("slots.toml", &text).unwrap_or_else(|error| panic!("{:?}", miette::Report::new(error)))
}

/// A message with its longest frame, its axis (`a1` is 1) and the station that sends it, which for a drive is its
/// axis.
struct Source<'a> {
    message: &'a MessageSchedule,
    frame: Frame,
    axis: usize,
    station: usize,
}

fn sources(schedule: &BusSchedule) -> Vec<Source<'_>> {
    let sent = schedule.messages.iter().filter(|message| message.is_sent_while_enabled);
    sent.map(|message| {
        let axis = message.axis.as_deref().map_or(CONTROLLER, |name| name[1..].parse().unwrap());
        let is_ours = matches!(
            message.kind,
            MessageKind::Sync
                | MessageKind::SetPoint
                | MessageKind::SdoRequest
                | MessageKind::MasterHeartbeat
                | MessageKind::Time
        );
        let station = if is_ours { CONTROLLER } else { axis };
        let frame = longest(Id::base(message.id).unwrap(), FrameKind::Data, message.length);
        Source { message, frame, axis, station }
    })
    .collect()
}

/// What is by chance, as shares (in 256) of what is allowed.
#[derive(Clone, Debug)]
struct Chance {
    drive_delay: Vec<u8>,
    sync_late: Vec<u8>,
    set_points_late: Vec<u8>,
    sdo_delay: Vec<u8>,
    /// Moments of the first heartbeats of the drives.
    heartbeats_ns: Vec<u64>,
    /// When which drive sends an emergency message.
    emergency: Option<(u64, usize)>,
}

impl Chance {
    /// Nothing comes late.
    fn punctual(&self) -> Self {
        Self { sync_late: vec![0], set_points_late: vec![0], ..self.clone() }
    }

    fn share(of: u64, shares: &[u8], at: usize) -> u64 {
        of * u64::from(shares[at % shares.len()]) / 255
    }
}

fn chances() -> impl Strategy<Value = Chance> {
    let shares = || prop::collection::vec(prop_oneof![Just(0u8), Just(255u8), 0u8..], 1..24);
    let moments = prop::collection::vec(0u64..10_000_000, 4);
    (shares(), shares(), shares(), shares(), moments).prop_map(
        |(drive_delay, sync_late, set_points_late, sdo_delay, heartbeats_ns)| Chance {
            drive_delay,
            sync_late,
            set_points_late,
            sdo_delay,
            heartbeats_ns,
            emergency: None,
        },
    )
}

const SLOTS: u64 = 24;

/// Runs the bus and gives everything that arrived. SYNC and set-points are late within the reserve.
fn simulate(schedule: &BusSchedule, chance: &Chance) -> Vec<Arrival> {
    let sources = sources(schedule);
    let of = |kind: MessageKind| sources.iter().filter(move |source| source.message.kind == kind);
    let drives = sources.iter().map(|source| source.station).max().unwrap_or(0);
    let mut traffic = Traffic::new(RATES, drives);
    let slot = &schedule.slot;
    let mut set_points: Vec<_> = of(MessageKind::SetPoint).collect();
    set_points.sort_by_key(|source| source.axis);
    for number in 0..SLOTS {
        let (start_ns, at) = (number * schedule.period_ns, number as usize);
        let late_ns = Chance::share(slot.sync_reserve_ns, &chance.sync_late, at);
        of(MessageKind::Sync)
            .for_each(|source| traffic.release(start_ns + late_ns, CONTROLLER, source.frame));
        let late_ns = Chance::share(slot.set_points_reserve_ns, &chance.set_points_late, at);
        let handed_over_ns = start_ns + schedule.command_phase_ns + late_ns;
        for source in &set_points {
            traffic.release(handed_over_ns, CONTROLLER, source.frame);
        }
        for source in of(MessageKind::MasterHeartbeat).chain(of(MessageKind::Time)) {
            if (start_ns % source.message.period_ns) < schedule.period_ns {
                traffic.release(handed_over_ns, CONTROLLER, source.frame);
            }
        }
        // A transfer every other slot: the answer to the one before has always come.
        if number % 2 == 0 {
            of(MessageKind::SdoRequest)
                .for_each(|source| traffic.release(handed_over_ns, CONTROLLER, source.frame));
        }
    }
    for (source, first_ns) in of(MessageKind::DriveHeartbeat).zip(&chance.heartbeats_ns) {
        for instance in 0..SLOTS * schedule.period_ns / source.message.period_ns {
            traffic.release(first_ns + instance * source.message.period_ns, source.station, source.frame);
        }
    }
    if let Some((at_ns, drive)) = chance.emergency {
        let source = of(MessageKind::Emergency).nth(drive % drives).unwrap();
        traffic.release(at_ns, source.station, source.frame);
    }

    let (mut arrivals, mut answers) = (vec![], 0);
    while let Some(arrival) = traffic.next() {
        arrivals.push(arrival);
        let kind = kind_of(schedule, arrival);
        let answering = sources.iter().filter(|source| match kind {
            MessageKind::Sync => source.message.kind == MessageKind::Feedback,
            MessageKind::SdoRequest => {
                source.message.kind == MessageKind::SdoResponse
                    && source.message.id == arrival.id.value() - 0x80
            }
            _ => false,
        });
        for source in answering {
            answers += 1;
            let delay_ns = match kind {
                MessageKind::Sync => Chance::share(slot.feedback_delay_ns, &chance.drive_delay, answers),
                _ => 300_000 + Chance::share(700_000, &chance.sdo_delay, answers),
            };
            traffic.release(arrival.heard_ns + delay_ns, source.station, source.frame);
        }
    }
    arrivals
}

fn message_of(schedule: &BusSchedule, arrival: Arrival) -> &MessageSchedule {
    schedule.messages.iter().find(|message| message.id == arrival.id.value()).unwrap()
}

fn kind_of(schedule: &BusSchedule, arrival: Arrival) -> MessageKind {
    message_of(schedule, arrival).kind
}

/// The latest arrivals of a kind after the start of their slots. Feedback belongs to the slot of its SYNC.
fn latest_ns(schedule: &BusSchedule, arrivals: &[Arrival], kind: MessageKind) -> u64 {
    let of_kind = arrivals.iter().filter(|arrival| kind_of(schedule, **arrival) == kind);
    of_kind
        .map(|arrival| arrival.done_ns - arrival.queued_ns / schedule.period_ns * schedule.period_ns)
        .max()
        .unwrap_or(0)
}

/// Configurations of all sorts, those that fit.
fn fitting() -> impl Strategy<Value = BusSchedule> {
    let cycle = (prop::sample::select(vec![1u64, 2, 4]), 0.2f64..0.8, any::<bool>());
    let axes = (1usize..=4, any::<bool>());
    let axis = (
        prop::sample::select(vec!["csp", "cst"]),
        any::<bool>(),
        prop::sample::select(vec!["", "\"torque\"", "\"velocity\", \"torque\""]),
        0u64..120,
    );
    type Axis = (&'static str, bool, &'static str, u64);
    type Drawn = ((u64, f64, bool), (usize, bool), (bool, bool), Axis);
    let fits = |((period, phase, is_auto), (axes, is_reversed), (has_sdo, has_time), axis): Drawn| {
        let (mode, has_heartbeat, feedback, delay) = axis;
        let axis = format!(
            "mode = {mode:?}\nfeedback = [{feedback}]\nfeedback_delay = \"{delay} us\"\nheartbeat = \"{}\"",
            if has_heartbeat { "10 ms" } else { "off" }
        );
        let bus = format!("sdo_while_enabled = {has_sdo}");
        let cycle = format!("period = \"{period} ms\"\ncommand_phase = {phase}");
        let mut config = config(axes, is_reversed, &cycle, &bus, &axis);
        config.master.time_ns = has_time.then_some(10_000_000);
        if is_auto {
            config.cycle.command_phase_ns = schedule::automatic_command_phase(&config).ok()?;
        }
        schedule::verify(&config).ok().map(|mut buses| buses.remove(0))
    };
    (cycle, axes, (prop::bool::weighted(0.3), prop::bool::ANY), axis).prop_filter_map("does not fit", fits)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 192, max_global_rejects: 100_000, ..ProptestConfig::default() })]

    #[test]
    fn no_simulated_slot_is_worse_than_the_worst_slot(schedule in fitting(), chance in chances()) {
        let slot = schedule.slot;
        let arrivals = simulate(&schedule, &chance.punctual());
        let latest = |kind| latest_ns(&schedule, &arrivals, kind);
        prop_assert!(latest(MessageKind::Sync) <= slot.wait_before_sync_ns + slot.sync_ns);
        prop_assert!(latest(MessageKind::Feedback) <= slot.feedback_done_ns);
        prop_assert!(latest(MessageKind::SetPoint) <= slot.set_points_done_ns);
        for arrival in &arrivals {
            let message = message_of(&schedule, *arrival);
            let bound_ns = message.response_ns;
            prop_assert!(bound_ns.is_none_or(|bound| arrival.response_ns() <= bound), "{arrival:?} {message:?}");
            if let Some(in_slot_ns) = message.in_slot_ns {
                let slot_ns = arrival.queued_ns / schedule.period_ns * schedule.period_ns;
                prop_assert!(arrival.done_ns - slot_ns <= in_slot_ns, "{arrival:?} {message:?}");
            }
        }
    }

    /// SYNC as late as the reserve allows in some slots, the set-points in others.
    #[test]
    fn a_controller_that_is_late_within_its_reserve_has_everything_in_time(
        schedule in fitting(), chance in chances(),
    ) {
        for late in [
            Chance { set_points_late: vec![0], ..chance.clone() },
            Chance { sync_late: vec![0], ..chance.clone() },
        ] {
            let arrivals = simulate(&schedule, &late);
            let latest = |kind| latest_ns(&schedule, &arrivals, kind);
            prop_assert!(latest(MessageKind::Feedback) <= schedule.command_phase_ns);
            prop_assert!(latest(MessageKind::SetPoint) <= schedule.period_ns);
        }
    }

    #[test]
    fn one_emergency_does_no_more_to_the_slots_than_is_shown(
        schedule in fitting(), chance in chances(), at_ns in 0u64..16_000_000, drive in 0usize..4,
    ) {
        let slot = schedule.slot;
        let effect = schedule.emergency.unwrap();
        let arrivals = simulate(&schedule, &Chance { emergency: Some((at_ns, drive)), ..chance.punctual() });
        let latest = |kind| latest_ns(&schedule, &arrivals, kind);
        // One that is on the wire when SYNC is due is in its way as any other.
        let sync_late_ns = effect.next_sync_late_ns.max(effect.transmission_ns);
        prop_assert!(latest(MessageKind::Sync) <= slot.wait_before_sync_ns + slot.sync_ns + sync_late_ns);
        prop_assert!(latest(MessageKind::Feedback) <= schedule.command_phase_ns + effect.feedback_late_ns);
        prop_assert!(latest(MessageKind::SetPoint) <= slot.set_points_done_ns + effect.transmission_ns);
    }
}

/// A drive's heartbeat wins the bus just before SYNC is due, another one while the drives prepare their feedback, and
/// one just before the command phase.
#[test]
fn a_constructed_slot_comes_within_15_percent_of_the_worst() {
    let schedule = schedule::analyse(&config(2, false, "", "", "heartbeat = \"10 ms\"")).remove(0);
    assert!(schedule.fits());
    let at = |heartbeats_ns: Vec<u64>| {
        let chance = Chance {
            drive_delay: vec![255],
            sync_late: vec![0],
            set_points_late: vec![0],
            sdo_delay: vec![0],
            heartbeats_ns,
            emergency: None,
        };
        simulate(&schedule, &chance)
    };
    let is_close = |simulated: u64, bound: u64| simulated <= bound && simulated * 100 >= bound * 85;

    let (slot, start_ns) = (schedule.slot, 3 * schedule.period_ns);
    let arrivals = at(vec![start_ns - 1, start_ns + 125_000]);
    let feedback_ns = latest_ns(&schedule, &arrivals, MessageKind::Feedback);
    assert!(is_close(feedback_ns, slot.feedback_done_ns), "{feedback_ns} of {}", slot.feedback_done_ns);
    let sync_ns = latest_ns(&schedule, &arrivals, MessageKind::Sync);
    assert!(is_close(sync_ns, slot.wait_before_sync_ns + slot.sync_ns), "{sync_ns}");

    let arrivals = at(vec![start_ns + schedule.command_phase_ns - 1, 0]);
    let set_points_ns = latest_ns(&schedule, &arrivals, MessageKind::SetPoint);
    assert!(
        is_close(set_points_ns, slot.set_points_done_ns),
        "{set_points_ns} of {}",
        slot.set_points_done_ns
    );
    // The wait itself, without the command phase that the bound begins with.
    let phase_ns = schedule.command_phase_ns;
    assert!(is_close(set_points_ns - phase_ns, slot.set_points_done_ns - phase_ns), "{set_points_ns}");
}

/// All that can be in the way of a drive's feedback and of a heartbeat is queued at once: the response times of the
/// configuration that the arm has on a bus are nearly reached.
#[test]
fn the_response_times_of_an_arm_are_nearly_reached_at_the_critical_instant() {
    let schedule = schedule::analyse(&config(3, false, "", "", "")).remove(0);
    let sources = sources(&schedule);
    let regular: Vec<_> =
        sources.iter().filter(|source| source.message.kind != MessageKind::Emergency).collect();
    for (at, source) in regular.iter().enumerate() {
        let bound_ns = source.message.response_ns.unwrap() - source.message.jitter_ns;
        let mut traffic = Traffic::by_priority(RATES, regular.len());
        let blocker = regular.iter().enumerate().skip(at + 1).max_by_key(|(_, lower)| lower.message.bits);
        if let Some((station, blocker)) = blocker {
            traffic.release(0, station, blocker.frame);
        }
        for (station, higher) in regular.iter().enumerate().take(at + 1) {
            traffic.release(1, station, higher.frame);
        }
        let arrivals = traffic.all();
        let arrival = arrivals.iter().find(|arrival| arrival.id == source.frame.id()).unwrap();
        let response_ns = arrival.response_ns();
        assert!(
            response_ns <= bound_ns && response_ns * 100 >= bound_ns * 85,
            "{:?}: {response_ns} of {bound_ns}",
            source.message.kind
        );
    }
}
