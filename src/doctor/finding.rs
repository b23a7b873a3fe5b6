//! What a check has found.

use serde::Serialize;

/// How good it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It is not there, or cannot be read: nothing to judge.
    NotKnown,
    /// As it should be.
    Good,
    /// It works, and would be more even otherwise.
    CouldBeBetter,
    /// With this the time of a cycle has no bound.
    ForbidsRealTime,
}

/// What a check is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// The kernel.
    Kernel,
    /// What this process may do.
    Rights,
    /// The processor.
    Processor,
    /// Whether the CPU of the loop belongs to the loop.
    Isolation,
    /// Memory.
    Memory,
    /// A CAN interface.
    Can,
}

/// A check: what is the same whatever it finds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Check {
    /// Its key in the JSON object.
    pub key: &'static str,
    /// What it is about.
    pub group: Group,
    /// What people call it.
    pub title: &'static str,
    /// Where it looks.
    pub source: &'static str,
    /// Why it matters.
    pub why: &'static str,
}

/// What a check has found.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The key of the check.
    pub check: &'static str,
    /// What it is about.
    pub group: Group,
    /// The CAN interface that it is about.
    pub interface: Option<String>,
    /// What people call it.
    pub title: &'static str,
    /// How good it is.
    pub verdict: Verdict,
    /// What was read, in words.
    pub read: String,
    /// Where it was read.
    pub source: &'static str,
    /// Whether this process (or the boot command line) is allowed to have it; `None` where that is no question.
    pub permitted: Option<bool>,
    /// Whether it is in force; `None` where that is no question or cannot be seen.
    pub applied: Option<bool>,
    /// Why it matters.
    pub why: &'static str,
    /// The commands that mend it, to be given in a shell.
    pub mend: Vec<String>,
}

impl Check {
    fn finding(&self, verdict: Verdict, read: impl Into<String>) -> Finding {
        Finding {
            check: self.key,
            group: self.group,
            interface: None,
            title: self.title,
            verdict,
            read: read.into(),
            source: self.source,
            permitted: None,
            applied: None,
            why: self.why,
            mend: vec![],
        }
    }

    pub fn not_known(&self, read: impl Into<String>) -> Finding {
        self.finding(Verdict::NotKnown, read)
    }

    pub fn good(&self, read: impl Into<String>) -> Finding {
        self.finding(Verdict::Good, read)
    }

    pub fn could_be_better(&self, read: impl Into<String>) -> Finding {
        self.finding(Verdict::CouldBeBetter, read)
    }

    pub fn forbids(&self, read: impl Into<String>) -> Finding {
        self.finding(Verdict::ForbidsRealTime, read)
    }
}

impl Finding {
    pub(super) fn permitted(mut self, is_permitted: bool) -> Self {
        self.permitted = Some(is_permitted);
        self
    }

    pub(super) fn applied(mut self, is_applied: bool) -> Self {
        self.applied = Some(is_applied);
        self
    }

    pub(super) fn on(mut self, interface: &str) -> Self {
        self.interface = Some(interface.to_owned());
        self
    }

    /// Adds a command that mends it.
    pub(super) fn mend(mut self, command: impl Into<String>) -> Self {
        self.mend.push(command.into());
        self
    }
}
