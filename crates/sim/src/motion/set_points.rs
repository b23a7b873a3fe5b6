//! The handshake of profile position mode (CiA 402-2): new set-points, one after the other.

use takt_rt::controlword;

/// An active set-point and a buffered one: counts.
#[derive(Clone, Copy, Debug, Default)]
pub struct SetPoints {
    /// The target of the present profile.
    pub active: Option<f64>,
    buffered: Option<f64>,
    /// The last accepted target, to which relative targets are added.
    last: f64,
    /// Statusword bit 12: the drive has taken a set-point.
    pub is_acknowledged: bool,
}

impl SetPoints {
    /// None yet, at this position.
    pub fn starting(position: f64) -> Self {
        Self { last: position, ..Self::default() }
    }

    /// Shifts the positions, when the joint has another position from now on.
    pub fn shift(&mut self, by: f64) {
        self.last += by;
    }

    /// Evaluates the controlword after the `previous` one. `target` gives the target for the position to which it is
    /// added. Returns whether there is a new one.
    pub fn evaluate(&mut self, word: u16, previous: u16, target: impl FnOnce(f64) -> f64) -> bool {
        let is_new = word & !previous & controlword::BIT_4 != 0 && !self.is_acknowledged;
        if is_new {
            let target = target(if word & controlword::RELATIVE != 0 { self.last } else { 0.0 });
            if word & controlword::BIT_5 != 0 || self.active.is_none() {
                (self.active, self.buffered) = (Some(target), None);
            } else {
                self.buffered = Some(target);
            }
            self.last = target;
            self.is_acknowledged = true;
        }
        if word & controlword::BIT_4 == 0 && self.buffered.is_none() {
            self.is_acknowledged = false;
        }
        is_new
    }

    /// The active target is reached: the buffered one becomes active.
    pub fn arrived(&mut self) {
        self.active = self.buffered.take();
    }
}
