//! Runs a procedure on a bus, paced by a clock.

use std::collections::VecDeque;

use takt_rt::{BusPort, Clock, Frame, Nanoseconds, ReceiveBatch};

use super::{ProcedureError, RunningTask};
use takt::procedure::ProcedureEvent;

/// Interval between two polls of the bus.
const POLL_NS: Nanoseconds = 500_000;
/// Longest time that the last frames may take to leave after the procedure has ended.
const DRAIN_NS: Nanoseconds = 10_000_000;

/// An event of the session, for an observer.
#[derive(Clone, Debug, PartialEq)]
pub enum SessionEvent {
    /// An event of the procedure.
    Procedure(ProcedureEvent),
    /// A frame that the procedure sends.
    Sent(Frame),
    /// A frame that the port received.
    Received(Frame),
}

/// Runs a procedure to its end.
///
/// `is_interrupted` is called at each poll; each `true` interrupts the procedure once. `see` gets every event
/// with the time since the beginning.
pub fn run<T: Clone>(
    mut procedure: Box<dyn RunningTask<Frame, T>>,
    port: &mut impl BusPort,
    clock: &mut impl Clock,
    mut is_interrupted: impl FnMut() -> bool,
    mut see: impl FnMut(Nanoseconds, SessionEvent),
) -> Result<T, ProcedureError> {
    let began_ns = clock.now_ns();
    let mut next_poll_ns = began_ns;
    let mut sending = VecDeque::new();
    let mut ended_ns = None;
    loop {
        let now_ns = clock.now_ns();
        let at_ns = now_ns.saturating_sub(began_ns);
        let mut batch = ReceiveBatch::new();
        port.receive(now_ns, &mut batch);
        for received in &batch {
            see(at_ns, SessionEvent::Received(received.frame));
            procedure.receive(&received.frame);
        }
        if is_interrupted() {
            procedure.interrupt();
        }
        let mut fresh = vec![];
        procedure.poll(now_ns, &mut |frame| fresh.push(frame));
        // Report the step events before the frames that those steps send.
        while let Some(event) = procedure.take_event() {
            see(at_ns, SessionEvent::Procedure(event));
        }
        for frame in fresh {
            see(at_ns, SessionEvent::Sent(frame));
            sending.push_back(frame);
        }
        let taken = port.send(now_ns, sending.make_contiguous());
        sending.drain(..taken.min(sending.len()));
        if let Some(outcome) = procedure.outcome() {
            let since_ns = *ended_ns.get_or_insert(now_ns);
            let has_left = sending.is_empty() && port.unconfirmed(now_ns) == 0;
            if has_left || now_ns.saturating_sub(since_ns) >= DRAIN_NS {
                return outcome.clone();
            }
        }
        next_poll_ns = next_poll_ns.saturating_add(POLL_NS).max(now_ns.saturating_add(POLL_NS / 2));
        clock.wait_until(next_poll_ns);
    }
}
