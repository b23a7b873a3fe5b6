//! Many procedures at once: each with its own drive, on one of several buses.

use std::fmt;

use takt_rt::Nanoseconds;

use super::client::Client;
use super::running::{MovableWork, Procedure};

/// A procedure beside others.
type Member<C, T, E> = Procedure<C, T, E, MovableWork<T, E>>;

/// Procedures that run at the same time. Their events are not kept; each session shows its present step.
pub struct Parallel<C: Client, T, E> {
    /// Each with the index of its bus.
    members: Vec<(usize, Member<C, T, E>)>,
}

impl<C: Client, T: fmt::Debug, E: fmt::Debug> fmt::Debug for Parallel<C, T, E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(&self.members).finish()
    }
}

impl<C: Client, T, E> Parallel<C, T, E> {
    /// These procedures, each with the index of its bus.
    pub fn new(members: impl IntoIterator<Item = (usize, Member<C, T, E>)>) -> Self {
        Self { members: members.into_iter().collect() }
    }

    /// Advances all procedures to `now_ns`, and sends each message that is due with the index of its bus.
    pub fn poll(&mut self, now_ns: Nanoseconds, send: &mut impl FnMut(usize, C::Message)) {
        for (bus, procedure) in &mut self.members {
            procedure.poll(now_ns, &mut |message| send(*bus, message));
            while procedure.take_event().is_some() {}
        }
    }

    /// Passes a message received on the bus with this index.
    pub fn receive(&mut self, bus: usize, message: &C::Message) {
        for (_, procedure) in self.members.iter_mut().filter(|(of, _)| *of == bus) {
            procedure.receive(message);
        }
    }

    /// The procedures, in their order.
    pub fn procedures(&self) -> impl Iterator<Item = &Member<C, T, E>> {
        self.members.iter().map(|(_, procedure)| procedure)
    }
}
