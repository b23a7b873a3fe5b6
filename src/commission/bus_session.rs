//! Carries a procedure out on a bus, in the time of a clock.

use std::collections::VecDeque;

use takt_rt::{BusPort, Clock, Frame, Nanoseconds, ReceiveBatch};

use super::event::Event;
use super::procedure::{Failed, Procedure};
use super::report::Report;

/// Between two looks at the bus.
const TURN_NS: Nanoseconds = 500_000;
/// The last frames may leave for so long after the end.
const FAREWELL_NS: Nanoseconds = 10_000_000;

/// What is seen of a procedure at work.
#[derive(Clone, Debug, PartialEq)]
pub enum Seen {
    /// It has something to say.
    Event(Event),
    /// A frame that it sends.
    Sent(Frame),
    /// A frame that has arrived.
    Received(Frame),
}

/// Runs a procedure to its end. `is_interrupted` is asked in every turn, and tells each request to end once; `see` is
/// shown everything with the time since the beginning.
pub fn run(
    mut procedure: Procedure,
    port: &mut impl BusPort,
    clock: &mut impl Clock,
    mut is_interrupted: impl FnMut() -> bool,
    mut see: impl FnMut(Nanoseconds, Seen),
) -> Result<Report, Failed> {
    let began_ns = clock.now_ns();
    let mut turn_ns = began_ns;
    let mut sending = VecDeque::new();
    let mut ended_ns = None;
    loop {
        let now_ns = clock.now_ns();
        let at_ns = now_ns.saturating_sub(began_ns);
        let mut batch = ReceiveBatch::new();
        port.receive(now_ns, &mut batch);
        for received in &batch {
            see(at_ns, Seen::Received(received.frame));
            procedure.receive(&received.frame);
        }
        if is_interrupted() {
            procedure.interrupt();
        }
        let mut fresh = vec![];
        procedure.poll(now_ns, &mut |frame| fresh.push(frame));
        // The steps before the frames that they send.
        while let Some(event) = procedure.take_event() {
            see(at_ns, Seen::Event(event));
        }
        for frame in fresh {
            see(at_ns, Seen::Sent(frame));
            sending.push_back(frame);
        }
        let taken = port.send(now_ns, sending.make_contiguous());
        sending.drain(..taken.min(sending.len()));
        if let Some(outcome) = procedure.outcome() {
            let since_ns = *ended_ns.get_or_insert(now_ns);
            let has_left = sending.is_empty() && port.unconfirmed(now_ns) == 0;
            if has_left || now_ns.saturating_sub(since_ns) >= FAREWELL_NS {
                return outcome.clone();
            }
        }
        turn_ns = turn_ns.saturating_add(TURN_NS).max(now_ns.saturating_add(TURN_NS / 2));
        clock.wait_until(turn_ns);
    }
}
