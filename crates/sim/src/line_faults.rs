//! Faults on a simulated serial line: disturbed bytes, and silence.

use std::str::FromStr;

use takt_rt::Nanoseconds;

use super::serial_device::SerialDevice;

/// A fault on a line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LineFault {
    /// One bit of each byte of this number, in either direction, is wrong.
    Disturbed {
        /// Every so many bytes one is disturbed, 1 at least.
        every: u64,
    },
    /// The device says nothing from so long after the first byte on.
    Silent {
        /// From the first byte to the device.
        after_ns: Nanoseconds,
    },
}

impl FromStr for LineFault {
    type Err = String;

    /// `disturbed=50` (each 50th byte), `silent=0.8` (0.8 s after the first byte).
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "{text:?}: write disturbed=N (each Nth byte) or silent=S (S seconds after the first byte)"
            )
        };
        match text.split_once('=').ok_or_else(wrong)? {
            ("disturbed", every) => {
                let every = every.parse().ok().filter(|every| *every > 0).ok_or_else(wrong)?;
                Ok(Self::Disturbed { every })
            }
            ("silent", after) => {
                let after: f64 = after.parse().map_err(|_| wrong())?;
                let is_sound = (0.0..1e9).contains(&after);
                is_sound.then_some(Self::Silent { after_ns: (after * 1e9) as Nanoseconds }).ok_or_else(wrong)
            }
            _ => Err(wrong()),
        }
    }
}

/// A device at the end of a line with faults.
pub struct FaultyLine {
    device: Box<dyn SerialDevice>,
    faults: Vec<LineFault>,
    /// Bytes in either direction.
    bytes: u64,
    began_ns: Option<Nanoseconds>,
}

impl FaultyLine {
    /// This device behind a line with these faults.
    pub fn new(device: Box<dyn SerialDevice>, faults: Vec<LineFault>) -> Self {
        Self { device, faults, bytes: 0, began_ns: None }
    }

    /// The byte as it comes out of the line.
    fn carried(&mut self, byte: u8) -> u8 {
        self.bytes += 1;
        let is_disturbed = self.faults.iter().any(
            |fault| matches!(fault, LineFault::Disturbed { every } if self.bytes.is_multiple_of(*every)),
        );
        // Another bit each time.
        if is_disturbed { byte ^ 1 << (self.bytes % 8) } else { byte }
    }

    fn is_silent(&self, now_ns: Nanoseconds) -> bool {
        let Some(began_ns) = self.began_ns else { return false };
        let since_ns = now_ns.saturating_sub(began_ns);
        self.faults
            .iter()
            .any(|fault| matches!(fault, LineFault::Silent { after_ns } if since_ns >= *after_ns))
    }

    fn say(&mut self, now_ns: Nanoseconds, said: Vec<u8>, answer: &mut Vec<u8>) {
        if !self.is_silent(now_ns) {
            answer.extend(said.into_iter().map(|byte| self.carried(byte)));
        }
    }
}

impl SerialDevice for FaultyLine {
    fn receive(&mut self, now_ns: Nanoseconds, byte: u8, answer: &mut Vec<u8>) {
        self.began_ns.get_or_insert(now_ns);
        let (byte, mut said) = (self.carried(byte), vec![]);
        self.device.receive(now_ns, byte, &mut said);
        self.say(now_ns, said, answer);
    }

    fn advance(&mut self, now_ns: Nanoseconds, answer: &mut Vec<u8>) -> Nanoseconds {
        let mut said = vec![];
        let next_ns = self.device.advance(now_ns, &mut said);
        self.say(now_ns, said, answer);
        next_ns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It says every byte back.
    struct Echo;

    impl SerialDevice for Echo {
        fn receive(&mut self, _: Nanoseconds, byte: u8, answer: &mut Vec<u8>) {
            answer.push(byte);
        }

        fn advance(&mut self, _: Nanoseconds, _: &mut Vec<u8>) -> Nanoseconds {
            Nanoseconds::MAX
        }
    }

    fn heard(faults: &[&str], times_ns: &[Nanoseconds]) -> Vec<u8> {
        let faults = faults.iter().map(|fault| fault.parse().unwrap()).collect();
        let (mut line, mut answer) = (FaultyLine::new(Box::new(Echo), faults), vec![]);
        times_ns.iter().for_each(|now_ns| line.receive(*now_ns, 0, &mut answer));
        answer
    }

    #[test]
    fn each_nth_byte_of_either_direction_has_a_wrong_bit() {
        let all = heard(&["disturbed=3"], &[0; 6]);
        assert_eq!(all.iter().filter(|byte| **byte != 0).count(), 4);
        assert_eq!(heard(&[], &[0; 3]), [0; 3]);
    }

    #[test]
    fn a_device_is_silent_from_a_time_on() {
        assert_eq!(heard(&["silent=1"], &[5, 999_999_999, 1_000_000_005, 9_000_000_000]).len(), 2);
    }

    #[test]
    fn what_is_no_fault_is_refused() {
        for text in ["disturbed", "disturbed=0", "silent=-1", "silent=x", "slow=1"] {
            assert!(text.parse::<LineFault>().is_err(), "{text}");
        }
    }
}
