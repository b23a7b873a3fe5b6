//! The port of a real interface, where there is none: nothing is one.

use takt_rt::{BusHealth, BusPort, Frame, Nanoseconds, ReceiveBatch};

/// No port.
#[derive(Clone, Copy, Debug)]
pub enum LinkPort {}

impl BusPort for LinkPort {
    fn send(&mut self, _: Nanoseconds, _: &[Frame]) -> usize {
        match *self {}
    }

    fn receive(&mut self, _: Nanoseconds, _: &mut ReceiveBatch) {
        match *self {}
    }

    fn unconfirmed(&mut self, _: Nanoseconds) -> usize {
        match *self {}
    }

    fn health(&mut self) -> BusHealth {
        match *self {}
    }
}
