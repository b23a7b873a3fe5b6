//! What kind of kernel this is.

/// Returns `true` if the running kernel is fully preemptible (PREEMPT_RT).
pub fn is_preempt_rt() -> bool {
    // SAFETY: all-zero bytes are a valid `utsname`.
    let mut name: libc::utsname = unsafe { core::mem::zeroed() };
    // SAFETY: `name` is valid for writing; the kernel terminates every field with a zero.
    if unsafe { libc::uname(&mut name) } < 0 {
        return false;
    }
    // SAFETY: `c_char` and `u8` have the same size and alignment, and every bit pattern is valid for both.
    let version =
        unsafe { core::slice::from_raw_parts(name.version.as_ptr().cast::<u8>(), name.version.len()) };
    is_preempt_rt_version(version)
}

/// Returns `true` if the version string of a kernel (`uname -v`) names PREEMPT_RT.
///
/// Every such kernel has it in its version; not every one has `/sys/kernel/realtime`. Patched kernels before 5.3 wrote
/// "PREEMPT RT" in two words. PREEMPT_DYNAMIC and plain PREEMPT are other preemption models.
pub fn is_preempt_rt_version(version: &[u8]) -> bool {
    let text = version.split(|byte| *byte == 0).next().unwrap_or_default();
    text.split(|byte| *byte == b' ').any(|word| word == b"PREEMPT_RT")
        || text.windows(PATCHED.len()).any(|window| window == PATCHED)
}

/// The spelling of patched kernels before 5.3.
const PATCHED: &[u8] = b" PREEMPT RT ";

#[cfg(test)]
mod tests {
    use super::is_preempt_rt_version;

    #[test]
    fn preempt_rt_is_told_from_other_preemption_models() {
        assert!(is_preempt_rt_version(b"#1 SMP PREEMPT_RT Debian 6.1.192-2 (2026-07-27)\0\0\0"));
        assert!(is_preempt_rt_version(b"#1 SMP PREEMPT_RT"));
        assert!(is_preempt_rt_version(b"#1 SMP PREEMPT RT Debian 4.19.37-1 (2019-05-05)"));
        for other in
            ["#1 SMP PREEMPT_DYNAMIC @0", "#1 SMP PREEMPT Tue", "#1 SMP Debian 6.1", "", "\0 PREEMPT_RT"]
        {
            assert!(!is_preempt_rt_version(other.as_bytes()), "{other}");
        }
    }
}
