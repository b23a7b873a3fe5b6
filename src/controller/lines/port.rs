//! What the cycle sees of a serial line.

use std::sync::Arc;

use takt_rt::{BusHealth, BusPort, Frame, Nanoseconds, ReceiveBatch};

use super::SharedLine;
use super::status::LineStatus;
use crate::faults::{Delivery, DriveEffect, InjectError, Injectable, inject_on_line};

/// A serial line as a port of the cycle: it takes no frames and brings none. It shows requests as frames that were sent, replies as
/// frames that were received, and requests without a sound reply as errors.
pub struct LinePort {
    status: Arc<LineStatus>,
    devices: Option<SharedLine>,
}

impl LinePort {
    pub(super) const fn new(status: Arc<LineStatus>, devices: Option<SharedLine>) -> Self {
        Self { status, devices }
    }
}

impl BusPort for LinePort {
    fn send(&mut self, _: Nanoseconds, _: &[Frame]) -> usize {
        0
    }

    fn receive(&mut self, _: Nanoseconds, _: &mut ReceiveBatch) {}

    fn unconfirmed(&mut self, _: Nanoseconds) -> usize {
        0
    }

    fn health(&mut self) -> BusHealth {
        self.status.health()
    }
}

impl Injectable for LinePort {
    fn send_foreign(&mut self, _: Nanoseconds, _: &Frame) -> Delivery {
        Delivery::ToOthers
    }

    fn inject(&mut self, node: u8, effect: DriveEffect, is_present: bool) -> Result<(), InjectError> {
        let devices = self.devices.as_ref().ok_or(InjectError::NotSimulated)?;
        inject_on_line(&mut devices.lock(), node, effect, is_present)
    }
}
