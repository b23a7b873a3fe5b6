//! Shows the state and the events of a controller after each cycle.

use std::sync::Arc;
use std::time::Duration;

use super::Served;
use crate::command::{EventSource, WaitError};
use crate::remote::{LeaseShown, ShownWriter, now_ns};

/// How often it is shown that this process is alive while no cycle comes.
const SILENCE: Duration = Duration::from_millis(50);

/// The writer of the shared memory.
pub struct Publisher {
    served: Arc<Served>,
    shown: ShownWriter,
    events: Box<dyn EventSource>,
    slot: u64,
}

impl Publisher {
    /// A publisher that has shown nothing.
    pub fn new(served: Arc<Served>, shown: ShownWriter) -> Self {
        let events = served.controller.event_source();
        Self { served, shown, events, slot: 0 }
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
        self.shown.state(&state, |target| self.served.controller.newest_stop(target));
        self.slot = state.slot;
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
