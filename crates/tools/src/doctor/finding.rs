//! The result of a check.

use serde::Serialize;

/// How good the result is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The value does not exist or cannot be read, so that it cannot be judged.
    NotKnown,
    /// As it should be.
    Good,
    /// The loop works, with more jitter than necessary.
    CouldBeBetter,
    /// With this value the duration of a cycle has no bound.
    ForbidsRealTime,
}

/// The subject of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Group {
    /// The kernel.
    Kernel,
    /// The rights of this process.
    Rights,
    /// The processor.
    Processor,
    /// Whether the loop has its CPU to itself.
    Isolation,
    /// Memory.
    Memory,
    /// A CAN interface.
    Can,
    /// A serial adapter.
    Serial,
}

/// A check: the parts that do not depend on its result.
#[derive(Clone, Copy, Debug)]
pub(super) struct Check {
    /// Its key in the JSON object.
    pub key: &'static str,
    /// Its subject.
    pub group: Group,
    /// Its title.
    pub title: &'static str,
    /// The files or programs that it reads.
    pub source: &'static str,
    /// Why it matters.
    pub why: &'static str,
}

/// The result of a check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// The key of the check.
    pub check: &'static str,
    /// Its subject.
    pub group: Group,
    /// The CAN interface or the serial adapter, if it is a check of one.
    pub interface: Option<String>,
    /// Its title.
    pub title: &'static str,
    /// How good the result is.
    pub verdict: Verdict,
    /// The value that was read, in words.
    pub read: String,
    /// Where it was read.
    pub source: &'static str,
    /// True if this process is allowed to have it, or the boot command line asks for it; `None` where this does not apply.
    pub permitted: Option<bool>,
    /// True if it is in force; `None` where this does not apply or cannot be seen.
    pub applied: Option<bool>,
    /// Why it matters.
    pub why: &'static str,
    /// The shell commands that repair it.
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

    /// Adds a command that repairs it.
    pub(super) fn mend(mut self, command: impl Into<String>) -> Self {
        self.mend.push(command.into());
        self
    }
}
