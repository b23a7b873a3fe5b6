//! Ctrl-C, SIGTERM, and the end of the terminal.

use std::fs;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// A flag that is set by Ctrl-C, by SIGTERM, and when the terminal is closed or a remote login ends. Under `nohup` the end
/// of the terminal is ignored.
pub fn watch() -> io::Result<Arc<AtomicBool>> {
    let arrived = Arc::new(AtomicBool::new(false));
    let outlives = is_ignored(&fs::read_to_string("/proc/self/status").unwrap_or_default(), SIGHUP);
    for signal in [SIGINT, SIGTERM].into_iter().chain((!outlives).then_some(SIGHUP)) {
        signal_hook::flag::register(signal, Arc::clone(&arrived))?;
    }
    Ok(arrived)
}

/// Returns `true` if a signal was set to be ignored when the process was started, from the kernel's status of the process.
fn is_ignored(status: &str, signal: i32) -> bool {
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ignored_signal_is_seen_in_the_status_of_the_process() {
        let status = "Name:\ttakt\nSigBlk:\t0000000000000001\nSigIgn:\t0000000000001001\nSigCgt:\t0\n";
        assert!(is_ignored(status, SIGHUP) && !is_ignored(status, SIGINT) && !is_ignored(status, SIGTERM));
        assert!(!is_ignored("", SIGHUP));
    }
}
