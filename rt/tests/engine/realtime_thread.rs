//! A thread becomes a real-time thread, or reports what was refused. It is tried with the rights of the user who runs this test,
//! and without any rights in a child process that has given them up.
#![cfg(all(target_os = "linux", feature = "linux"))]

use std::thread;

use takt_rt::linux::{
    Outcome, PREFAULT_LIMIT_BYTES, PageFaults, Policy, RealtimeThread, Scheduling, Step, ThreadConfig,
    ThreadReport,
};

const EVERYTHING: ThreadConfig = ThreadConfig {
    priority: Some(10),
    affinity: Outcome::Granted,
    lock_memory: true,
    hold_dma_latency: true,
    stack_bytes: 128 * 1024,
};

const NOTHING: ThreadConfig =
    ThreadConfig { priority: None, affinity: Outcome::NotAsked, lock_memory: false, hold_dma_latency: false, stack_bytes: 0 };

/// Runs in a thread of its own, because the set-up lasts as long as the thread.
fn in_thread<T: Send + 'static>(body: impl FnOnce() -> T + Send + 'static) -> T {
    thread::spawn(body).join().expect("the thread ends normally")
}

fn report_of(config: ThreadConfig) -> ThreadReport {
    in_thread(move || *RealtimeThread::enter(&config).report())
}

fn granted(report: &ThreadReport, step: Step) -> bool {
    match report.outcome(step) {
        Outcome::Granted => true,
        Outcome::Refused { errno } => {
            assert!(errno > 0, "{step:?} is refused with a reason");
            false
        }
        Outcome::NotAsked => panic!("{step:?} was asked for"),
    }
}

#[test]
fn what_is_said_to_be_granted_is_in_force_and_what_is_refused_is_not() {
    let report = report_of(EVERYTHING);
    let fifo = granted(&report, Step::Fifo);
    assert_eq!(report.scheduling.policy == Policy::Fifo, fifo);
    assert_eq!(report.scheduling.priority, if fifo { 10 } else { 0 });
    assert_eq!(report.scheduling.reset_on_fork, fifo);
    assert!(granted(&report, Step::CpuAffinity));
    assert_eq!(granted(&report, Step::LockMemory), report.memory_locked);
    assert_eq!(granted(&report, Step::DmaLatency), report.dma_latency_held);
    assert!(granted(&report, Step::PrefaultStack));
    assert_eq!(report.stack_bytes, 128 * 1024);
    assert!(granted(&report, Step::TimerSlack));
    assert_eq!(
        report.refused().count(),
        report.steps.iter().filter(|step| !granted(&report, step.step)).count()
    );
}

#[test]
fn locked_memory_is_what_the_kernel_counts_as_locked() {
    let report = report_of(EVERYTHING);
    let status = std::fs::read_to_string("/proc/self/status").expect("procfs is mounted");
    let line = status.lines().find_map(|line| line.strip_prefix("VmLck:")).expect("there is a VmLck line");
    let locked_kib: u64 = line.trim().trim_end_matches(" kB").parse().expect("a number of KiB");
    assert_eq!(locked_kib > 0, report.memory_locked);
}

#[test]
fn nothing_is_done_that_is_not_asked_for() {
    let (before, report) = in_thread(|| {
        let before = Scheduling::of_this_thread();
        (before, *RealtimeThread::enter(&NOTHING).report())
    });
    assert_eq!(report.scheduling, before);
    for step in [Step::CpuAffinity, Step::LockMemory, Step::PrefaultStack, Step::DmaLatency, Step::Fifo] {
        assert_eq!(report.outcome(step), Outcome::NotAsked, "{step:?}");
    }
    assert!(!report.memory_locked && !report.dma_latency_held);
    assert_eq!(report.stack_bytes, 0);
}

#[test]
fn a_priority_that_does_not_exist_is_refused_and_the_other_steps_are_taken() {
    for priority in [0, 100, 255] {
        let report =
            report_of(ThreadConfig { priority: Some(priority), stack_bytes: usize::MAX, ..NOTHING });
        assert_eq!(report.stack_bytes, PREFAULT_LIMIT_BYTES);
        assert_eq!(
            report.outcome(Step::Fifo),
            Outcome::Refused { errno: libc::EINVAL },
            "priority {priority}"
        );
    }
}

#[test]
fn threads_that_an_elevated_thread_starts_are_ordinary_ones() {
    let inherited = in_thread(|| {
        let elevated = RealtimeThread::enter(&EVERYTHING);
        let started = in_thread(Scheduling::of_this_thread);
        drop(elevated);
        started
    });
    assert_eq!((inherited.policy, inherited.priority), (Policy::Other, 0));
}

#[test]
fn page_faults_are_counted_from_the_end_of_the_set_up() {
    let (quiet, busy) = in_thread(|| {
        let elevated = RealtimeThread::enter(&ThreadConfig { stack_bytes: 64 * 1024, ..NOTHING });
        let quiet = elevated.page_faults();
        // New memory takes at least one page fault for each page that is written.
        let fresh = vec![1u8; 4 << 20];
        std::hint::black_box(&fresh);
        (quiet, elevated.page_faults())
    });
    assert_eq!(quiet, PageFaults::default());
    assert!(busy.minor > 0);
}

/// Gives up every right to real time in this process: the limits, and with the user the capabilities.
fn give_up_rights() -> bool {
    const NOBODY: libc::uid_t = 65_534;
    let none = libc::rlimit { rlim_cur: 0, rlim_max: 0 };
    // SAFETY: system calls with numbers and one valid structure.
    unsafe {
        let limits = libc::setrlimit(libc::RLIMIT_RTPRIO, &none) == 0
            && libc::setrlimit(libc::RLIMIT_MEMLOCK, &none) == 0;
        limits && (libc::geteuid() != 0 || libc::setresuid(NOBODY, NOBODY, NOBODY) == 0)
    }
}

/// What a thread without rights gets, as an exit code: 0 is the expected result.
fn verdict_without_rights() -> i32 {
    if !give_up_rights() {
        return 1;
    }
    let thread = RealtimeThread::enter(&ThreadConfig { affinity: Outcome::NotAsked, ..EVERYTHING });
    let report = thread.report();
    let refused_for_want_of_rights = |step| matches!(report.outcome(step), Outcome::Refused { errno } if [libc::EPERM, libc::EACCES].contains(&errno));
    let not_root_device = matches!(report.outcome(Step::DmaLatency), Outcome::Refused { .. });
    match () {
        () if !refused_for_want_of_rights(Step::Fifo) => 2,
        () if !refused_for_want_of_rights(Step::LockMemory) => 3,
        () if !not_root_device => 4,
        () if report.outcome(Step::PrefaultStack) != Outcome::Granted => 5,
        () if report.outcome(Step::TimerSlack) != Outcome::Granted => 6,
        () if report.scheduling.policy != Policy::Other => 7,
        () if report.memory_locked || report.dma_latency_held => 8,
        () if report.refused().count() != 3 => 9,
        () => 0,
    }
}

#[test]
fn without_rights_fifo_locking_and_idle_states_are_refused_and_the_rest_is_done() {
    // SAFETY: the child makes only system calls, allocates nothing, and ends with `_exit`.
    let child = unsafe { libc::fork() };
    assert!(child >= 0, "fork");
    if child == 0 {
        let verdict = verdict_without_rights();
        // SAFETY: ends this process without running any code of the parent.
        unsafe { libc::_exit(verdict) };
    }
    let mut status = 0;
    // SAFETY: `status` is valid for writing, and the child belongs to this process.
    assert_eq!(unsafe { libc::waitpid(child, &mut status, 0) }, child);
    assert!(libc::WIFEXITED(status), "the child ended on its own");
    assert_eq!(libc::WEXITSTATUS(status), 0, "the check that failed, see `verdict_without_rights`");
}
