//! Memory without page faults: locked pages and a stack that was touched in advance.

use super::step::Outcome;

/// The most stack that is touched in advance, in bytes.
pub const PREFAULT_LIMIT_BYTES: usize = 256 * 1024;

const PAGE_BYTES: usize = 4096;

/// Locks all present and future pages of the process in memory.
///
/// With a finite `RLIMIT_MEMLOCK` and without `CAP_IPC_LOCK`, a later mapping beyond the limit fails, in any thread. So map
/// all memory that the process needs before this call.
pub(super) fn lock_all() -> Outcome {
    // SAFETY: the call takes flags only.
    Outcome::of(unsafe { libc::mlockall(libc::MCL_CURRENT | libc::MCL_FUTURE) })
}

/// Touches `bytes` of stack below the caller, at most [`PREFAULT_LIMIT_BYTES`], and returns how many.
pub(super) fn prefault_stack(bytes: usize) -> usize {
    let bytes = bytes.min(PREFAULT_LIMIT_BYTES).next_multiple_of(PAGE_BYTES);
    touch_pages(bytes / PAGE_BYTES);
    bytes
}

/// Writes one page of the stack and continues below it. The page is used again after the inner call. Otherwise the compiler could
/// turn the recursion into a loop over a single page.
#[inline(never)]
fn touch_pages(count: usize) {
    if count == 0 {
        return;
    }
    let mut page = [0u8; PAGE_BYTES];
    core::hint::black_box(&mut page);
    touch_pages(count - 1);
    core::hint::black_box(&mut page);
}

/// Page faults of the calling thread (getrusage(2)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PageFaults {
    /// Faults served from memory: a page was mapped or copied.
    pub minor: u64,
    /// Faults served from a disk.
    pub major: u64,
}

impl PageFaults {
    /// The page faults of the calling thread since its start.
    pub fn of_this_thread() -> Self {
        // SAFETY: all-zero bytes are a valid `rusage`.
        let mut usage: libc::rusage = unsafe { core::mem::zeroed() };
        // SAFETY: `usage` is valid for writing. The call fails only for an unknown `who`.
        unsafe { libc::getrusage(libc::RUSAGE_THREAD, &mut usage) };
        Self {
            minor: u64::try_from(usage.ru_minflt).unwrap_or(0),
            major: u64::try_from(usage.ru_majflt).unwrap_or(0),
        }
    }

    /// The page faults after `earlier`.
    pub const fn since(self, earlier: Self) -> Self {
        Self {
            minor: self.minor.saturating_sub(earlier.minor),
            major: self.major.saturating_sub(earlier.major),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;
    use super::*;

    #[test]
    fn no_more_stack_is_touched_than_the_limit() {
        assert_eq!(prefault_stack(usize::MAX), PREFAULT_LIMIT_BYTES);
        assert_eq!(prefault_stack(1), PAGE_BYTES);
        assert_eq!(prefault_stack(0), 0);
    }

    /// Uses stack as the loop does: a frame of 64 KiB, written throughout.
    #[inline(never)]
    fn use_stack() {
        let mut frame = [1u8; 64 * 1024];
        core::hint::black_box(&mut frame);
    }

    /// The page faults of a new thread that uses its stack.
    fn faults_of_a_thread(prefault: bool) -> PageFaults {
        std::thread::spawn(move || {
            if prefault {
                prefault_stack(128 * 1024);
            }
            let before = PageFaults::of_this_thread();
            use_stack();
            PageFaults::of_this_thread().since(before)
        })
        .join()
        .unwrap()
    }

    // A page of the program that is used for the first time, or was taken away meanwhile, is a fault of neither stack: so the best of
    // several threads counts.
    #[test]
    fn a_prefaulted_stack_takes_no_page_fault_and_an_untouched_one_does() {
        let fewest = |prefault| (0..10).map(|_| faults_of_a_thread(prefault).minor).min();
        assert_eq!(fewest(true), Some(0));
        assert!(fewest(false) >= Some(1));
    }
}
