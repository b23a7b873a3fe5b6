//! A number that stands for everything that a run has done.

use std::fmt::{self, Write};

use takt_rt::CycleRecord;

use crate::run::World;

/// Takes words one after the other (multiply and rotate, after FxHash).
#[derive(Clone, Copy, Debug, Default)]
pub struct Fingerprint(u64);

impl Fingerprint {
    fn take(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x517C_C1B7_2722_0A95);
    }

    /// Takes what has been sent, reported and done in a cycle.
    pub fn take_cycle(&mut self, world: &World) {
        for (bus, frames) in world.sent.iter().enumerate() {
            for frame in frames {
                self.take(u64::from(frame.id().value()) << 8 | bus as u64);
                self.take(frame.first_word());
            }
        }
        for event in &world.events {
            // Nothing else shows all that an event says. There are few of them.
            let _ = write!(self, "{event:?}");
        }
        for truth in &world.truth {
            self.take(truth.position.to_bits());
        }
    }

    /// Takes the record of a cycle.
    pub fn take_record(&mut self, record: &CycleRecord) {
        self.take(record.timing.slot);
        for axis in record.axes() {
            self.take(axis.position_set.to_bits());
            self.take(axis.position.to_bits());
            self.take(axis.command_raw as u64);
        }
    }

    pub fn value(self) -> u64 {
        self.0
    }
}

impl Write for Fingerprint {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        text.bytes().for_each(|byte| self.take(byte.into()));
        Ok(())
    }
}
