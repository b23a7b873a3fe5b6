//! Shows the state and the events of a controller after each cycle.

use std::sync::Arc;
use std::time::Duration;

use takt::command::{EventSource, WaitError};
use takt_rt::{RequestId, RequestTarget};

use super::served::Served;
use crate::layout::LeaseShown;
use crate::shown::{ShownWriter, now_ns};

/// How often it is shown that this process is alive while no cycle comes.
const SILENCE: Duration = Duration::from_millis(50);

/// How late a stop of this process may be seen here. A command that a client asked for within this time before counts as one after the stop.
const SEEN_WITHIN: Duration = Duration::from_millis(20);

/// The writer of the shared memory.
pub struct Publisher {
    served: Arc<Served>,
    shown: ShownWriter,
    events: Box<dyn EventSource>,
    /// The newest stop of each group.
    newest_stops: Vec<RequestId>,
    slot: u64,
}

impl Publisher {
    /// A publisher that has shown nothing.
    pub fn new(served: Arc<Served>, shown: ShownWriter) -> Self {
        let events = Arc::clone(served.controller.backend()).events();
        Self { served, shown, events, newest_stops: vec![], slot: 0 }
    }

    /// Shows the present state.
    pub fn publish(&mut self) {
        let state = self.served.controller.state();
        // Whoever sees a state has seen the events until then.
        for event in self.events.by_ref() {
            self.shown.event(&event);
        }
        self.shown.events_lost(self.events.missed());
        self.shown.timing(self.served.controller.timing());
        self.shown.lease(self.lease());
        self.shown.state(&state, |target| self.served.controller.backend().newest_stop(target));
        self.slot = state.slot;
        self.note_stops(state.groups().len());
    }

    /// Notes the stops that this process has asked for by itself: they overtake what clients have asked for, too.
    fn note_stops(&mut self, groups: usize) {
        let targets = (0..groups).filter_map(|group| u8::try_from(group).ok()).map(RequestTarget::Group);
        let newest: Vec<_> =
            targets.map(|target| (target, self.served.controller.backend().newest_stop(target))).collect();
        let seen_ns = now_ns().saturating_sub(SEEN_WITHIN.as_nanos() as u64);
        for ((target, newest), before) in newest.iter().zip(&self.newest_stops) {
            if newest != before {
                self.served.stops.note(*target, seen_ns);
            }
        }
        self.newest_stops = newest.into_iter().map(|(_, newest)| newest).collect();
    }

    fn lease(&self) -> LeaseShown {
        let (mut lease, now_ns) = (self.served.lease(), now_ns());
        lease.forget_expired(now_ns);
        lease.shown(now_ns)
    }

    /// Shows every state until the controller or the server ends.
    pub fn run(mut self) {
        while !self.served.has_ended() {
            match self.served.controller.cycle_after(self.slot, SILENCE) {
                Ok(_) => self.publish(),
                Err(WaitError::NotInTime) => self.shown.is_alive(),
                Err(WaitError::Ended) => break,
            }
        }
        self.publish();
        self.shown.end();
    }
}
