//! Response times of messages that are queued at any moment.

use proptest::prelude::*;
use takt::schedule::response_time::{Message, response_time};
use takt::sim;
use takt_rt::{Frame, FrameKind, Id};
use takt_wire::frame_time::BitRates;

use crate::schedule_bounds::frames::{bound_ns, longest};
use crate::schedule_bounds::traffic::{Traffic, longest_response_ns};

const CLASSIC: BitRates = BitRates { nominal: 1_000_000, data: 1_000_000 };
const FLEXIBLE: BitRates = BitRates { nominal: 1_000_000, data: 5_000_000 };

fn simulated(rates: BitRates) -> sim::WireBitRates {
    sim::WireBitRates { nominal: rates.nominal, data: Some(rates.data) }
}

/// A message of the analysis with the frame that carries it.
#[derive(Clone, Copy, Debug)]
struct Sender {
    message: Message,
    frame: Frame,
}

/// The most important first, as the analysis wants them; each counted with the worst case of its length.
fn senders(set: &[(u64, usize, u64)], kind: FrameKind, rates: BitRates) -> Vec<Sender> {
    let sender = |(at, &(period_ns, length, jitter_ns)): (u32, &(u64, usize, u64))| {
        let frame = longest(Id::base(0x100 + 0x63 * at).unwrap(), kind, length);
        let transmission_ns = bound_ns(&frame, rates);
        Sender { message: Message { period_ns, jitter_ns, transmission_ns }, frame }
    };
    (0..).zip(set).map(sender).collect()
}

fn bounds_ns(senders: &[Sender], rates: BitRates) -> Vec<Option<u64>> {
    let messages: Vec<_> = senders.iter().map(|sender| sender.message).collect();
    (0..messages.len()).map(|at| response_time(&messages, at, rates.bit_ns())).collect()
}

/// Every message from its offset on, each instance later than its period by a share (in 256) of the jitter.
fn run(senders: &[Sender], offsets_ns: &[u64], lateness: &[u8], rates: BitRates, until_ns: u64) -> Vec<u64> {
    let mut traffic = Traffic::by_priority(simulated(rates), senders.len());
    let mut lateness = lateness.iter().cycle();
    for (station, (sender, offset_ns)) in senders.iter().zip(offsets_ns).enumerate() {
        let Message { period_ns, jitter_ns, .. } = sender.message;
        for instance in 0..(until_ns / period_ns).max(1) {
            let late_ns = jitter_ns * u64::from(*lateness.next().unwrap()) / 256;
            traffic.release(offset_ns + instance * period_ns + late_ns, station, sender.frame);
        }
    }
    let arrivals = traffic.all();
    senders.iter().map(|sender| longest_response_ns(&arrivals, sender.frame.id())).collect()
}

/// The worst moment for one message: it and all more important ones are queued just after the longest of the less
/// important ones has won the bus, which is not sent again. What is late by its jitter at first is punctual then.
fn critical_response_ns(senders: &[Sender], at: usize, rates: BitRates, until_ns: u64) -> u64 {
    let blocker = (at + 1..senders.len()).max_by_key(|&lower| senders[lower].message.transmission_ns);
    let mut traffic = Traffic::by_priority(simulated(rates), senders.len());
    if let Some(blocker) = blocker {
        traffic.release(0, blocker, senders[blocker].frame);
    }
    for (station, sender) in senders.iter().enumerate().take(at + 1) {
        let Message { period_ns, jitter_ns, .. } = sender.message;
        traffic.release(1, station, sender.frame);
        for instance in 1..(until_ns / period_ns).max(1) {
            traffic.release(
                (1 + instance * period_ns).saturating_sub(jitter_ns).max(1),
                station,
                sender.frame,
            );
        }
    }
    // The jitter of a message is part of its own response: it was due that much earlier than it was queued.
    let queued = longest_response_ns(&traffic.all(), senders[at].frame.id());
    queued + senders[at].message.jitter_ns
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn no_simulated_response_exceeds_its_bound(
        set in prop::collection::vec((200_000u64..2_000_000, 0usize..=8, 0u64..300_000), 2..8),
        offsets in prop::collection::vec(0u64..1_000_000, 8), lateness in prop::collection::vec(0u8.., 16..64),
    ) {
        let senders = senders(&set, FrameKind::Data, CLASSIC);
        let longest = run(&senders, &offsets, &lateness, CLASSIC, 20_000_000);
        for (at, (bound, longest)) in bounds_ns(&senders, CLASSIC).into_iter().zip(longest).enumerate() {
            prop_assert!(bound.is_none_or(|bound| longest <= bound), "message {at}: {longest} > {bound:?}");
        }
    }

    #[test]
    fn no_simulated_response_of_can_fd_exceeds_its_bound(
        set in prop::collection::vec((100_000u64..1_000_000, 0usize..10, 0u64..100_000), 2..8),
        offsets in prop::collection::vec(0u64..500_000, 8), lateness in prop::collection::vec(0u8.., 16..64),
    ) {
        const LENGTHS: [usize; 10] = [0, 1, 4, 8, 12, 16, 20, 32, 48, 64];
        let set: Vec<_> = set.iter().map(|&(period, length, jitter)| (period, LENGTHS[length], jitter)).collect();
        let senders = senders(&set, FrameKind::FdBitRateSwitch, FLEXIBLE);
        let longest = run(&senders, &offsets, &lateness, FLEXIBLE, 10_000_000);
        for (at, (bound, longest)) in bounds_ns(&senders, FLEXIBLE).into_iter().zip(longest).enumerate() {
            prop_assert!(bound.is_none_or(|bound| longest <= bound), "message {at}: {longest} > {bound:?}");
        }
    }

    /// Periods longer than the busy period: the payloads alone keep the bound from being reached.
    #[test]
    fn the_worst_moment_with_the_longest_payloads_comes_within_15_percent_of_the_bound(
        set in prop::collection::vec((2_000_000u64..20_000_000, 1usize..=8, 0u64..200_000), 2..8),
        is_flexible: bool,
    ) {
        let (kind, rates) =
            if is_flexible { (FrameKind::FdBitRateSwitch, FLEXIBLE) } else { (FrameKind::Data, CLASSIC) };
        let senders = senders(&set, kind, rates);
        for (at, bound) in bounds_ns(&senders, rates).into_iter().enumerate() {
            let (longest, bound) = (critical_response_ns(&senders, at, rates, 20_000_000), bound.unwrap());
            prop_assert!(longest <= bound && longest * 100 >= bound * 85, "message {at}: {longest} of {bound}");
        }
    }
}

/// The example by which Davis, Burns, Bril and Lukkien refuted the analysis before theirs, on the wire: three frames
/// of one length C, every 2.5, 3.5 and 3.5 C. The second instance of the last takes 3.5 C, half a C longer than its
/// first.
#[test]
fn the_published_counterexample_is_late_on_the_simulated_bus_too() {
    let rates = BitRates { nominal: 125_000, data: 125_000 };
    let mut senders = senders(&[(1, 7, 0); 3], FrameKind::Data, rates);
    let length_ns = |sender: &Sender| simulated(rates).duration_ns(&sender.frame);
    let same_ns = senders.iter().map(length_ns).min().unwrap();
    for (sender, halves) in senders.iter_mut().zip([5, 7, 7]) {
        // One that is longer is sent with another payload of the length that all can have.
        let id = sender.frame.id();
        sender.frame = (0..=255u8)
            .flat_map(|first| (0..=255u8).map(move |last| [first, 0x3C, 0x3C, 0x3C, 0x3C, 0x3C, last]))
            .map(|bytes| Frame::of(id, bytes))
            .find(|frame| simulated(rates).duration_ns(frame) == same_ns)
            .unwrap_or(sender.frame);
        sender.message =
            Message { period_ns: same_ns * halves / 2, jitter_ns: 0, transmission_ns: length_ns(sender) };
        assert_eq!(sender.message.transmission_ns, same_ns);
    }
    let bounds: Vec<_> = bounds_ns(&senders, rates).into_iter().map(Option::unwrap).collect();
    assert_eq!(bounds, [2 * same_ns, 3 * same_ns, 7 * same_ns / 2]);
    // The last message has nobody below it that could block; the others are blocked by it.
    assert_eq!(critical_response_ns(&senders, 2, rates, 40 * same_ns), 7 * same_ns / 2);
}
