//! The pulse module: it takes stiffness settings, and answers nothing.

use takt_rt::Nanoseconds;
use takt_wire::hollow_lines::pulse_module::{SETTING_BYTES, StiffnessSetting};

use crate::serial_device::SerialDevice;

/// A pause that ends a frame: the manual prints no mark of its beginning.
const PAUSE_NS: Nanoseconds = 5_000_000;

/// A module with its motor.
#[derive(Default)]
pub struct PulseModule {
    bytes: Vec<u8>,
    heard_ns: Nanoseconds,
    /// The setting that it has taken last.
    last: Option<StiffnessSetting>,
}

#[cfg(test)]
impl PulseModule {
    /// The setting that it has taken last.
    fn last(&self) -> Option<StiffnessSetting> {
        self.last
    }
}

impl SerialDevice for PulseModule {
    fn receive(&mut self, now_ns: Nanoseconds, byte: u8, _: &mut Vec<u8>) {
        if now_ns.saturating_sub(self.heard_ns) > PAUSE_NS {
            self.bytes.clear();
        }
        self.heard_ns = now_ns;
        self.bytes.push(byte);
        if let Ok(frame) = <[u8; SETTING_BYTES]>::try_from(self.bytes.as_slice()) {
            self.bytes.clear();
            self.last = StiffnessSetting::decode(&frame).ok().map(|(_, setting)| setting).or(self.last);
        }
    }

    fn advance(&mut self, _: Nanoseconds, _: &mut Vec<u8>) -> Nanoseconds {
        Nanoseconds::MAX
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_takes_the_frame_of_the_manual_and_begins_anew_after_a_pause() {
        let (mut module, mut answer) = (PulseModule::default(), vec![]);
        let mut hear = |now_ns, bytes: &[u8]| {
            bytes.iter().for_each(|byte| module.receive(now_ns, *byte, &mut answer));
            (module.last(), answer.len())
        };
        let stiffness = |p| Some(StiffnessSetting::PositionLoop { p, d: 16 });
        assert_eq!(hear(0, &[1, 1, 0x10, 0x10, 0, 0]), (stiffness(16), 0));
        assert_eq!(hear(100_000_000, &[1, 1, 0x20]), (stiffness(16), 0));
        assert_eq!(hear(200_000_000, &[1, 1, 0x30, 0x10, 0, 0]), (stiffness(48), 0));
    }
}
