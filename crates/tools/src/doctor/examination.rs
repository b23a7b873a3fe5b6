//! All checks together, and the verdict.

use serde::Serialize;
use takt_rt::linux::{Step, ThreadReport};

use super::finding::{Finding, Verdict};
use super::self_test::{Grade, SelfTest};
use super::source::Source;
use super::subject::Subject;
use super::threads::threads;
use super::{can, isolation, kernel, memory, processor, rights, serial};

/// The result of all checks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Examination {
    /// The worst of all findings, the self-test's included.
    pub verdict: Verdict,
    /// The CPU of the loop.
    pub cpu: usize,
    /// The priority of the loop; `None` in the normal class.
    pub priority: Option<u8>,
    /// The period of the loop.
    pub cycle_ns: u64,
    /// Every check in its order.
    pub checks: Vec<Finding>,
    /// The result of the self-test; `None` when it was not run.
    pub self_test: Option<SelfTest>,
}

/// Examines a machine. `attempt` is what a real-time thread was granted on it.
pub fn examine(source: &Source, subject: &Subject, attempt: &ThreadReport) -> Examination {
    let threads = threads(source);
    let cpu = subject.cpu;
    let priority = subject.realtime.priority;
    let grant_with = rights::grant_with(attempt);
    let mut checks = kernel::findings(source, cpu);
    checks.extend(rights::findings(source, subject, attempt));
    checks.extend(processor::findings(source, cpu, attempt.outcome(Step::DmaLatency), &grant_with));
    checks.extend(isolation::findings(source, cpu, &threads));
    checks.extend(super::threads::findings(&threads, cpu, priority.unwrap_or(1), std::process::id()));
    checks.extend(memory::findings(source));
    checks.extend(can::findings(source, subject, &threads));
    checks.extend(serial::findings(source));
    let verdict = checks.iter().map(|check| check.verdict).max().unwrap_or(Verdict::NotKnown);
    Examination { verdict, cpu, priority, cycle_ns: subject.period_ns, checks, self_test: None }
}

impl Examination {
    /// Adds the self-test, which can make the verdict worse.
    pub fn with_self_test(mut self, self_test: SelfTest) -> Self {
        self.verdict = self.verdict.max(match self_test.grade {
            Grade::Excellent | Grade::Good => Verdict::Good,
            Grade::Fair => Verdict::CouldBeBetter,
            Grade::Poor => Verdict::ForbidsRealTime,
        });
        self.self_test = Some(self_test);
        self
    }
}
