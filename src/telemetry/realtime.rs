//! The report of the real-time set-up: what the operating system granted, and the commands that grant the rest.

use std::env;

use nix::errno::Errno;
use takt_rt::linux::{Outcome, Policy, Step, StepResult, ThreadReport};

use super::report::RealtimeReport;

impl RealtimeReport {
    /// Makes the report. `page_faults` are those of the loop.
    pub fn new(report: &ThreadReport, spin_guard_ns: u64, page_faults: u64) -> Self {
        let is_fifo = report.scheduling.policy == Policy::Fifo;
        Self {
            policy: policy_name(report.scheduling.policy).to_owned(),
            priority: is_fifo.then_some(report.scheduling.priority),
            cpu: report.cpu,
            memory_locked: report.memory_locked,
            preempt_rt: report.preempt_rt,
            spin_guard_ns,
            page_faults,
            refused: report.refused().map(refusal).collect(),
            grant_with: commands(report),
        }
    }
}

fn policy_name(policy: Policy) -> &'static str {
    match policy {
        Policy::Other => "SCHED_OTHER",
        Policy::Batch => "SCHED_BATCH",
        Policy::Idle => "SCHED_IDLE",
        Policy::Fifo => "SCHED_FIFO",
        Policy::RoundRobin => "SCHED_RR",
        Policy::Deadline => "SCHED_DEADLINE",
        Policy::Unknown { .. } => "unknown",
    }
}

fn refusal(result: StepResult) -> String {
    let what = match result.step {
        Step::TimerSlack => "timers without slack",
        Step::CpuAffinity => "CPU affinity",
        Step::LockMemory => "locked memory",
        Step::PrefaultStack => "prefaulted stack",
        Step::DmaLatency => "no deep idle states of the CPU (/dev/cpu_dma_latency)",
        Step::Fifo => "SCHED_FIFO scheduling",
    };
    match result.outcome {
        Outcome::Refused { errno } => format!("{what}: {}", Errno::from_raw(errno).desc()),
        Outcome::Granted | Outcome::NotAsked => what.to_owned(),
    }
}

/// The commands that grant the refused steps to this executable.
fn commands(report: &ThreadReport) -> Vec<String> {
    let is_refused = |step| matches!(report.outcome(step), Outcome::Refused { .. });
    let mut commands = Vec::new();
    let mut capabilities = Vec::new();
    if is_refused(Step::Fifo) {
        capabilities.push("cap_sys_nice");
    }
    if is_refused(Step::LockMemory) {
        capabilities.push("cap_ipc_lock");
    }
    if !capabilities.is_empty() {
        let program =
            env::current_exe().map_or_else(|_| "takt".to_owned(), |path| path.display().to_string());
        commands.push(format!("sudo setcap {}=ep {program}", capabilities.join(",")));
    }
    if is_refused(Step::DmaLatency) {
        commands.push("sudo chmod o+rw /dev/cpu_dma_latency".to_owned());
    }
    commands
}
