//! A task with a drive that is under way, in whatever protocol the drive speaks.

use takt_rt::Nanoseconds;

use super::{Failure, Report};
use crate::procedure::{Client, Procedure, ProcedureEvent};

/// Why a task failed, and in which step.
pub type ProcedureError = crate::procedure::ProcedureError<Failure>;

/// A task with a drive: the procedure that carries it out, and words for what goes to and fro meanwhile.
///
/// A family makes it, with the client of the protocol that its drives speak. `M` is what this protocol exchanges: frames of a bus,
/// or the bytes of a serial line.
pub struct DriveTask<M> {
    /// The procedure.
    pub procedure: Box<dyn RunningTask<M>>,
    /// Describes a message. It is called with each message that was sent or received, in their order.
    pub words: Box<dyn FnMut(&M) -> String>,
}

impl<M> std::fmt::Debug for DriveTask<M> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DriveTask").finish_non_exhaustive()
    }
}

impl<M> DriveTask<M> {
    /// A procedure, and words for its messages.
    pub fn new<C: Client<Message = M> + 'static>(
        procedure: Procedure<C, Report, Failure>,
        words: impl FnMut(&M) -> String + 'static,
    ) -> Self {
        Self { procedure: Box::new(procedure), words: Box::new(words) }
    }
}

/// A procedure of commissioning, whichever client it has: it takes time and messages, and returns messages, events and an outcome.
/// `T` is what it brings.
pub trait RunningTask<M, T = Report> {
    /// Advances it to `now_ns` and sends its messages.
    fn poll(&mut self, now_ns: Nanoseconds, send: &mut dyn FnMut(M));

    /// Passes a received message.
    fn receive(&mut self, message: &M);

    /// Interrupts it: a moving axis is stopped, then disabled. A second call disables it at once.
    fn interrupt(&mut self);

    /// Removes and returns the oldest event.
    fn take_event(&mut self) -> Option<ProcedureEvent>;

    /// The result; `None` while it runs.
    fn outcome(&self) -> Option<&Result<T, ProcedureError>>;
}

impl<C: Client, T> RunningTask<C::Message, T> for Procedure<C, T, Failure> {
    fn poll(&mut self, now_ns: Nanoseconds, mut send: &mut dyn FnMut(C::Message)) {
        Procedure::poll(self, now_ns, &mut send);
    }

    fn receive(&mut self, message: &C::Message) {
        Procedure::receive(self, message);
    }

    fn interrupt(&mut self) {
        Procedure::interrupt(self);
    }

    fn take_event(&mut self) -> Option<ProcedureEvent> {
        Procedure::take_event(self)
    }

    fn outcome(&self) -> Option<&Result<T, ProcedureError>> {
        Procedure::outcome(self)
    }
}
