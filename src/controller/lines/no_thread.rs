//! A serial line of this machine, where there is none.

use takt_rt::OffCycleReport;

use crate::family::OffCycleTarget;

/// No line.
#[derive(Clone, Copy)]
pub(super) enum ThreadEnd {}

impl ThreadEnd {
    pub fn poll(&self, _: &[OffCycleTarget], _: &mut dyn FnMut(usize, OffCycleReport)) {
        match *self {}
    }

    pub fn is_settled(&self, _: usize) -> bool {
        match *self {}
    }
}
