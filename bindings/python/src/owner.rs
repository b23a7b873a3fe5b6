//! Who owns a controller, and its end: by `close`, by the end of the program, or when nobody has the arm any more.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::{mem, process};

use pyo3::prelude::*;
use takt::{Controller, Outcome, StartFailure, VirtualController};
use takt_remote::Client;

use crate::error::{raise, raise_start};
use crate::link::Link;

/// A controller in real time, or in virtual time; or a connection to one of another process, which goes on after it.
pub enum Owned {
    Real(Controller),
    Virtual(VirtualController),
    Served(Client),
}

impl Owned {
    /// Brings the axes to rest, disables and shuts down the drives. Returns in words what has gone wrong at that.
    fn finish(self) -> Result<Option<String>, StartFailure> {
        let (outcome, machine, unreached) = match self {
            Self::Real(controller) => {
                let machine = controller.machine().clone();
                let session = controller.finish()?;
                (session.outcome, machine, session.unreached)
            }
            Self::Virtual(controller) => {
                let handle = controller.handle();
                let (outcome, unreached) = controller.finish_with_unreached();
                (outcome, handle.machine().clone(), unreached)
            }
            Self::Served(client) => {
                // Another client need not wait for the end of the lease. One that has never commanded has none.
                let has_lease = client.lease().is_some_and(|lease| lease.process == process::id());
                if has_lease {
                    // The process of the controller may have ended.
                    let _ = client.release();
                }
                return Ok(None);
            }
        };
        if !unreached.is_empty() {
            let number = |axis: &usize| u8::try_from(*axis).unwrap_or(u8::MAX);
            let names: Vec<String> = unreached.iter().map(|axis| machine.axis_name(number(axis))).collect();
            return Ok(Some(format!(
                "the drives of these axes have not confirmed that they have no torque, and it is unknown whether they have stopped: {}",
                names.join(", ")
            )));
        }
        Ok((outcome != Outcome::Finished).then(|| outcome.words(&machine)))
    }
}

/// The owner of a controller, until it is closed.
pub struct Owner {
    owned: Mutex<Option<Owned>>,
    link: Link,
}

/// The owners that are alive. They are closed when the program ends, since Python frees not everything then.
static OWNERS: Mutex<Vec<Weak<Owner>>> = Mutex::new(vec![]);

impl Owner {
    pub fn new(owned: Owned, link: Link) -> Arc<Self> {
        let owner = Arc::new(Self { owned: Mutex::new(Some(owned)), link });
        let mut owners = lock(&OWNERS);
        owners.retain(|owner| owner.strong_count() > 0);
        owners.push(Arc::downgrade(&owner));
        owner
    }

    /// Ends the run in control. Once it has ended, nothing happens.
    pub fn close(&self, py: Python<'_>) -> PyResult<()> {
        // The controller of another process is closed there.
        if !self.link.is_of_this_process() {
            return Ok(());
        }
        let is_served = matches!(&*lock(&self.owned), Some(Owned::Served(_)));
        let finished = py.detach(|| lock(&self.owned).take().map(Owned::finish));
        if is_served {
            self.link.close();
        }
        match finished {
            None | Some(Ok(None)) => Ok(()),
            Some(Ok(Some(words))) => Err(raise(py, "ShutdownError", &words, &[])),
            Some(Err(error)) => Err(raise_start(py, &error)),
        }
    }

    /// Lets cycles of a virtual controller pass, without the interpreter's lock. Returns how many; `None` in real time.
    pub fn step(&self, cycles: u64) -> Option<u64> {
        match &*lock(&self.owned) {
            Some(Owned::Virtual(controller)) => Some(controller.step(cycles)),
            Some(Owned::Real(_) | Owned::Served(_)) | None => None,
        }
    }
}

impl Drop for Owner {
    /// In control, too. A fork of the process has none of the threads of the controller, and must leave it alone.
    fn drop(&mut self) {
        let Some(owned) = lock(&self.owned).take() else { return };
        if !self.link.is_of_this_process() {
            mem::forget(owned);
            return;
        }
        let mut owned = Some(owned);
        // The interpreter may have ended.
        let detached = Python::try_attach(|py| py.detach(|| drop(owned.take())));
        if detached.is_none() {
            drop(owned);
        }
    }
}

/// Ends every run in control. Python calls it at its exit.
#[pyfunction(name = "_close_all")]
pub fn close_all(py: Python<'_>) {
    let owners: Vec<Arc<Owner>> = lock(&OWNERS).iter().filter_map(Weak::upgrade).collect();
    for owner in owners {
        if let Err(error) = owner.close(py) {
            error.print(py);
        }
    }
}

fn lock<T>(of: &Mutex<T>) -> MutexGuard<'_, T> {
    of.lock().unwrap_or_else(PoisonError::into_inner)
}
