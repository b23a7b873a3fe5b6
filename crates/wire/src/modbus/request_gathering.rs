//! The slave's side of a line: it gathers bytes until they are a request.

use takt_rt::Nanoseconds;

use super::frame::{RequestLength, request_length};
use super::line_timing::LineTiming;

/// What a slave has received since the last silence.
#[derive(Clone, Debug)]
pub struct RequestGathering {
    line: LineTiming,
    /// How far apart the bytes of one frame may come.
    pause_ns: Nanoseconds,
    /// True if a frame counts that does not begin with a silence.
    is_lenient: bool,
    bytes: Vec<u8>,
    /// When the last byte of the line had come; `None` before the first.
    last_ns: Option<Nanoseconds>,
    /// What came since the last silence is no request: nothing counts before the next one.
    is_lost: bool,
}

impl RequestGathering {
    /// For a slave on a real line: a frame begins with a silence and has none within.
    pub const fn strict(line: LineTiming) -> Self {
        let pause_ns = line.silence_ns();
        Self { line, pause_ns, is_lenient: false, bytes: vec![], last_ns: None, is_lost: false }
    }

    /// For a slave on a pseudo-terminal, which hands bytes over when the other program gets to it: silences say little.
    pub const fn lenient(line: LineTiming, pause_ns: Nanoseconds) -> Self {
        Self { line, pause_ns, is_lenient: true, bytes: vec![], last_ns: None, is_lost: false }
    }

    /// Another station has sent something, whose last byte came at a time.
    pub fn hear(&mut self, now_ns: Nanoseconds) {
        self.last_ns = self.last_ns.max(Some(now_ns));
    }

    /// Takes bytes whose last one came at a time. Returns the bytes of a request when they are complete. It may be damaged.
    pub fn receive(&mut self, now_ns: Nanoseconds, bytes: &[u8]) -> Option<Vec<u8>> {
        if bytes.is_empty() {
            return None;
        }
        let began_ns = now_ns.saturating_sub(self.line.duration_ns(bytes.len()));
        let was_silent = self.last_ns.is_none_or(|last_ns| began_ns.saturating_sub(last_ns) >= self.pause_ns);
        self.last_ns = self.last_ns.max(Some(now_ns));
        if was_silent {
            self.bytes.clear();
            self.is_lost = false;
        } else if self.bytes.is_empty() && !self.is_lenient {
            self.is_lost = true;
        }
        if self.is_lost {
            return None;
        }
        self.bytes.extend(bytes);
        match request_length(&self.bytes) {
            RequestLength::Unknown => None,
            RequestLength::Known(length) if self.bytes.len() < length => None,
            RequestLength::Known(length) if self.bytes.len() == length => {
                Some(std::mem::take(&mut self.bytes))
            }
            RequestLength::Known(_) | RequestLength::Impossible => {
                self.bytes.clear();
                self.is_lost = true;
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: LineTiming = LineTiming::new(115_200);
    const READ: [u8; 8] = [2, 3, 0, 0x66, 0, 2, 0x24, 0x27];
    const WRITE: [u8; 13] = [2, 0x10, 0, 0x43, 0, 2, 4, 0, 7, 0xA1, 0x20, 0x71, 0x47];
    const MS: Nanoseconds = 1_000_000;

    #[test]
    fn a_request_is_gathered_from_single_bytes() {
        let mut gathering = RequestGathering::strict(LINE);
        for (frame, mut now_ns) in [(&READ[..], 0), (&WRITE, 10 * MS)] {
            let mut whole = None;
            for byte in frame {
                assert_eq!(whole, None);
                now_ns += 86_806;
                whole = gathering.receive(now_ns, &[*byte]);
            }
            assert_eq!(whole.as_deref(), Some(frame));
        }
    }

    #[test]
    fn half_a_request_is_forgotten_after_a_silence_and_too_much_until_one() {
        let mut gathering = RequestGathering::strict(LINE);
        assert_eq!(gathering.receive(MS, &READ[..5]), None);
        assert_eq!(gathering.receive(4 * MS, &READ), Some(READ.to_vec()));
        assert_eq!(gathering.receive(8 * MS, &[&READ[..], &[0]].concat()), None);
        assert_eq!(gathering.receive(9 * MS, &READ), None);
        assert_eq!(gathering.receive(12 * MS, &READ), Some(READ.to_vec()));
    }

    #[test]
    fn a_request_that_does_not_begin_with_a_silence_is_none() {
        let mut gathering = RequestGathering::strict(LINE);
        let took_ns = LINE.duration_ns(READ.len());
        let next_ns = |gap_us: u64| 10 * MS + gap_us * 1_000 + took_ns;
        for (gap_us, is_heard) in [(1_700, false), (1_750, true)] {
            let mut gathering = gathering.clone();
            gathering.hear(10 * MS);
            assert_eq!(gathering.receive(next_ns(gap_us), &READ).is_some(), is_heard);
        }
        assert_eq!(gathering.receive(10 * MS, &READ), Some(READ.to_vec()));
        assert_eq!(gathering.receive(next_ns(1_700), &READ), None);
    }

    #[test]
    fn a_lenient_line_bears_pauses_within_a_frame_and_none_between_two() {
        let mut gathering = RequestGathering::lenient(LINE, 10 * MS);
        assert_eq!(gathering.receive(MS, &READ[..5]), None);
        assert_eq!(gathering.receive(9 * MS, &READ[5..]), Some(READ.to_vec()));
        assert_eq!(gathering.receive(9 * MS, &READ), Some(READ.to_vec()));
    }
}
