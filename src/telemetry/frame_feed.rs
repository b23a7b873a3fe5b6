//! The frames of the buses for whoever looks at them in this process, while somebody does.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::history::OnBus;
use crate::link::trace::TracedFrame;

/// Frames that wait for a reader: those of a third of a second on two busy buses.
const WAITING: usize = 8192;

/// Where the logger puts the frames.
#[derive(Debug, Default)]
pub struct FrameFeed {
    readers: Mutex<Vec<Reader>>,
}

#[derive(Debug)]
struct Reader {
    frames: SyncSender<OnBus<TracedFrame>>,
    lost: Arc<AtomicU64>,
}

/// Reads the frames from now on. A reader that is too slow loses frames, and holds up nobody.
#[derive(Debug)]
pub struct FrameReader {
    frames: Receiver<OnBus<TracedFrame>>,
    lost: Arc<AtomicU64>,
}

impl FrameFeed {
    /// A reader of what comes from now on.
    pub fn reader(&self) -> FrameReader {
        let (sender, frames) = sync_channel(WAITING);
        let lost = Arc::<AtomicU64>::default();
        let reader = Reader { frames: sender, lost: Arc::clone(&lost) };
        self.readers.lock().unwrap_or_else(PoisonError::into_inner).push(reader);
        FrameReader { frames, lost }
    }

    /// Passes frames to the readers that are there.
    pub(crate) fn pass(&self, frames: &[OnBus<TracedFrame>]) {
        let mut readers = self.readers.lock().unwrap_or_else(PoisonError::into_inner);
        readers.retain(|reader| frames.iter().all(|frame| reader.take(frame)));
    }

    /// Returns `true` if somebody reads.
    pub fn is_read(&self) -> bool {
        !self.readers.lock().unwrap_or_else(PoisonError::into_inner).is_empty()
    }
}

impl Reader {
    /// Returns whether the reader is still there.
    fn take(&self, frame: &OnBus<TracedFrame>) -> bool {
        match self.frames.try_send(*frame) {
            Ok(()) => true,
            Err(TrySendError::Full(_)) => {
                self.lost.fetch_add(1, Ordering::Relaxed);
                true
            }
            Err(TrySendError::Disconnected(_)) => false,
        }
    }
}

impl FrameReader {
    /// Waits for the next frame.
    ///
    /// # Errors
    /// None came in time, or none will come any more.
    pub fn wait(&self, at_most: Duration) -> Result<OnBus<TracedFrame>, RecvTimeoutError> {
        self.frames.recv_timeout(at_most)
    }

    /// Frames that found no room since the last call.
    pub fn take_lost(&self) -> u64 {
        self.lost.swap(0, Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use takt_rt::{Frame, Id};

    use super::*;

    fn frame(at_ns: u64) -> OnBus<TracedFrame> {
        let frame = Frame::of(Id::canopen(0x180, 1), [1, 2]);
        OnBus { bus: 0, what: TracedFrame { at_ns, is_sent: false, frame } }
    }

    #[test]
    fn a_reader_gets_what_comes_while_it_reads_and_is_told_what_it_was_too_slow_for() {
        let feed = FrameFeed::default();
        feed.pass(&[frame(1)]);
        assert!(!feed.is_read());
        let (reader, other) = (feed.reader(), feed.reader());
        feed.pass(&[frame(2), frame(3)]);
        drop(other);
        let times: Vec<u64> =
            (0..2).map(|_| reader.wait(Duration::from_secs(9)).unwrap().what.at_ns).collect();
        assert_eq!((times, reader.take_lost()), (vec![2, 3], 0));
        let many: Vec<_> = (0..WAITING as u64 + 5).map(frame).collect();
        feed.pass(&many);
        assert_eq!((reader.take_lost(), reader.take_lost()), (5, 0));
        assert_eq!(feed.readers.lock().unwrap().len(), 1, "who reads no more is forgotten");
        drop(reader);
        feed.pass(&[frame(4)]);
        assert!(!feed.is_read());
    }
}
