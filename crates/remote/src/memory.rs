//! Sealed shared memory: its writer maps it before it is sealed, and after that nobody can write, shrink or grow it.
//!
//! Everything in it is an atomic word, for which every bit pattern is valid. So a mapping that another process writes at any time is
//! sound.
#![allow(
    unsafe_code,
    reason = "there is no safe call to map memory, to wait by futex, and to own a descriptor that the kernel has made"
)]

use std::io;
use std::num::NonZeroUsize;
use std::os::fd::{AsFd, BorrowedFd, FromRawFd, OwnedFd, RawFd};
use std::ptr::NonNull;
use std::slice;
use std::sync::atomic::AtomicU64;
use std::time::Duration;

use nix::fcntl::{FcntlArg, SealFlag, fcntl};
use nix::sys::memfd::{MFdFlags, memfd_create};
use nix::sys::mman::{MapFlags, ProtFlags, mmap, munmap};
use nix::sys::stat::fstat;
use nix::unistd::ftruncate;

use crate::layout::Header;

/// Nobody can cut the memory short, which would end a process that reads it, or write it by a later mapping.
const SEALS: SealFlag = SealFlag::F_SEAL_SHRINK
    .union(SealFlag::F_SEAL_GROW)
    .union(SealFlag::F_SEAL_FUTURE_WRITE)
    .union(SealFlag::F_SEAL_SEAL);

/// Memory that processes share. It stays mapped as long as this lives.
pub struct Memory {
    words: NonNull<AtomicU64>,
    count: usize,
    file: OwnedFd,
}

// SAFETY: it gives out references to atomics alone, and unmaps them only when it is dropped.
unsafe impl Send for Memory {}
// SAFETY: as above.
unsafe impl Sync for Memory {}

impl Memory {
    /// New memory of so many words, all 0, which this mapping alone can write.
    pub fn create(count: usize) -> io::Result<Self> {
        let file = memfd_create("takt", MFdFlags::MFD_CLOEXEC | MFdFlags::MFD_ALLOW_SEALING)?;
        ftruncate(&file, (count * size_of::<u64>()) as i64)?;
        let memory = Self::mapped(file, count, ProtFlags::PROT_READ | ProtFlags::PROT_WRITE)?;
        fcntl(&memory.file, FcntlArg::F_ADD_SEALS(SEALS))?;
        Ok(memory)
    }

    /// The memory of another process, to be read. A store into it would end this process, and no reader does any.
    pub fn of_other(file: OwnedFd) -> io::Result<Self> {
        let seals = SealFlag::from_bits_truncate(fcntl(&file, FcntlArg::F_GET_SEALS)?);
        let size = usize::try_from(fstat(&file)?.st_size).unwrap_or(0);
        if !seals.contains(SEALS) || size < size_of::<Header>() {
            return Err(io::ErrorKind::InvalidData.into());
        }
        Self::mapped(file, size / size_of::<u64>(), ProtFlags::PROT_READ)
    }

    fn mapped(file: OwnedFd, count: usize, protection: ProtFlags) -> io::Result<Self> {
        let size = NonZeroUsize::new(count * size_of::<u64>()).ok_or(io::ErrorKind::InvalidData)?;
        // SAFETY: a new mapping at an address that the kernel chooses, over no other memory.
        let words = unsafe { mmap(None, size, protection, MapFlags::MAP_SHARED, &file, 0)? };
        Ok(Self { words: words.cast(), count, file })
    }

    /// The file, to hand it to another process.
    pub fn file(&self) -> BorrowedFd<'_> {
        self.file.as_fd()
    }

    /// All of its words.
    pub fn words(&self) -> &[AtomicU64] {
        // SAFETY: so many words are mapped, at the begin of a page, as long as `self` lives; the seals keep the file from getting shorter.
        // Other processes access them by atomic operations alone.
        unsafe { slice::from_raw_parts(self.words.as_ptr(), self.count) }
    }

    /// Its first words.
    pub fn header(&self) -> &Header {
        assert!(self.count * size_of::<u64>() >= size_of::<Header>(), "both constructors see to it");
        // SAFETY: as for `words`; the header consists of such words alone.
        unsafe { self.words.cast::<Header>().as_ref() }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: this is the mapping of `mapped`, of the same length; every reference into it borrowed `self`. It cannot fail for it.
        let _ = unsafe { munmap(self.words.cast(), self.count * size_of::<u64>()) };
    }
}

/// The lower half of a word, which a futex can be.
fn lower_half(word: &AtomicU64) -> *const u32 {
    let halves = std::ptr::from_ref(word).cast::<u32>();
    // The second half is inside of the word.
    if cfg!(target_endian = "big") { halves.wrapping_add(1) } else { halves }
}

/// Waits until a word is another one than `seen`, or is woken for, or for so long.
pub fn wait_while(word: &AtomicU64, seen: u64, at_most: Duration) {
    let at_most = libc::timespec {
        tv_sec: at_most.as_secs().try_into().unwrap_or(libc::time_t::MAX),
        tv_nsec: at_most.subsec_nanos().into(),
    };
    let address = lower_half(word);
    // SAFETY: the address is that of a live word, and the kernel only reads it and the time.
    unsafe { libc::syscall(libc::SYS_futex, address, libc::FUTEX_WAIT, seen as u32, &raw const at_most) };
}

/// Wakes everybody who waits for a word, in any process.
pub fn wake(word: &AtomicU64) {
    // SAFETY: the address is that of a live word, and the kernel only uses it as a key.
    unsafe { libc::syscall(libc::SYS_futex, lower_half(word), libc::FUTEX_WAKE, libc::c_int::MAX) };
}

/// Owns a descriptor that the kernel has just made for this process: of a connection that it accepts, or of a file that it receives.
pub fn owned(descriptor: RawFd) -> OwnedFd {
    // SAFETY: nobody else has it yet.
    unsafe { OwnedFd::from_raw_fd(descriptor) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::fd::AsRawFd;
    use std::sync::Arc;
    use std::sync::atomic::Ordering;

    #[test]
    fn a_reader_sees_what_the_writer_stores_and_nobody_else_can_write_cut_or_unseal_the_memory() {
        let memory = Memory::create(1000).unwrap();
        let file = || memory.file().try_clone_to_owned().unwrap();
        let reader = Memory::of_other(file()).unwrap();
        memory.words()[999].store(7, Ordering::Relaxed);
        assert_eq!(reader.words()[999].load(Ordering::Relaxed), 7);
        assert!(ftruncate(file(), 8).is_err() && ftruncate(file(), 1 << 20).is_err());
        assert!(nix::unistd::write(file(), &[1; 8]).is_err());
        let again = std::fs::OpenOptions::new()
            .read(true)
            .write(true)
            .open(format!("/proc/self/fd/{}", memory.file().as_raw_fd()));
        for file in again.map(OwnedFd::from).into_iter().chain([file()]) {
            let both = ProtFlags::PROT_READ | ProtFlags::PROT_WRITE;
            assert!(Memory::mapped(file, 1000, both).is_err());
        }
        assert!(fcntl(memory.file(), FcntlArg::F_ADD_SEALS(SealFlag::empty())).is_err());
    }

    #[test]
    fn memory_that_could_be_cut_short_is_not_mapped() {
        let file = memfd_create("takt", MFdFlags::MFD_CLOEXEC | MFdFlags::MFD_ALLOW_SEALING).unwrap();
        ftruncate(&file, 1 << 16).unwrap();
        assert!(Memory::of_other(file).is_err());
        let pipe = std::fs::File::open("/dev/null").unwrap();
        assert!(Memory::of_other(pipe.into()).is_err());
    }

    #[test]
    fn who_waits_on_a_mapping_that_it_cannot_write_is_woken() {
        let memory = Arc::new(Memory::create(1000).unwrap());
        let reader = Memory::of_other(memory.file().try_clone_to_owned().unwrap()).unwrap();
        let waiting = std::thread::spawn(move || {
            let word = &reader.words()[3];
            while word.load(Ordering::Acquire) == 0 {
                wait_while(word, 0, Duration::from_secs(600));
            }
        });
        std::thread::sleep(Duration::from_millis(20));
        memory.words()[3].store(1, Ordering::Release);
        wake(&memory.words()[3]);
        waiting.join().unwrap();
    }
}
