//! The master's side of LSS: one task at a time, every wait bounded.

use takt_rt::{Frame, Nanoseconds};

use super::LssAddress;
use super::fast_scan::{FastScan, Known, Scanned};
use super::wire::{BitTiming, Inquiry, LssMode, LssRequest, LssResponse, LssResult};

/// What to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssTask {
    /// Every device changes to this mode. Nobody answers.
    SwitchGlobal(LssMode),
    /// This device changes to configuration.
    SwitchSelective(LssAddress),
    /// The device in configuration takes this node number, 1 to 127; 255 takes it away.
    ConfigureNode(u8),
    /// The device in configuration takes this bit rate once it is activated.
    ConfigureBitTiming(BitTiming),
    /// Devices in configuration change to the configured bit rate after so long, and speak after as long again. The
    /// master must change its own meanwhile. Nobody answers.
    ActivateBitTiming {
        /// In ms.
        delay_ms: u16,
    },
    /// The device in configuration keeps its node number and bit rate.
    Store,
    /// The device in configuration tells one thing.
    Inquire(Inquiry),
    /// The device in configuration tells its identity.
    InquireAddress,
    /// Is there a device with an identity between these? Vendor and product are those of the first.
    IdentifyRemote {
        /// The lowest revision and serial number.
        lowest: LssAddress,
        /// The highest.
        highest: LssAddress,
    },
    /// Is there a device without a node number?
    IdentifyUnconfigured,
    /// Finds a device without a node number and switches it to configuration.
    FastScan(Known),
}

/// What has come of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssOutcome {
    /// It is done.
    Done,
    /// The answer to [`LssTask::Inquire`].
    Told(u32),
    /// The identity of the device that is in configuration.
    Device(LssAddress),
    /// Whether somebody has answered.
    Exists(bool),
    /// [`LssTask::FastScan`] has found nobody.
    Nobody,
}

/// Why a task has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LssError {
    /// Nobody has answered.
    #[error("no device answered within {} ms", reply_timeout_ns / 1_000_000)]
    NoReply {
        /// How long was waited.
        reply_timeout_ns: Nanoseconds,
    },
    /// The device has refused.
    #[error("the device refused: error {}, its own reason {}", result.code, result.specific)]
    Refused {
        /// How.
        result: LssResult,
    },
    /// Answers of the fast scan have been lost.
    #[error("the device found bit by bit does not exist: answers were lost")]
    ScanLost,
}

/// A task is under way, or its outcome has not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an LSS task is under way")]
pub struct LssBusy;

/// How long to wait.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LssTiming {
    /// For an answer to anything but the fast scan.
    pub reply_timeout_ns: Nanoseconds,
    /// For an answer to a question of the fast scan. Half of some 130 questions are answered by silence.
    pub scan_timeout_ns: Nanoseconds,
}

impl Default for LssTiming {
    fn default() -> Self {
        Self { reply_timeout_ns: 500_000_000, scan_timeout_ns: 20_000_000 }
    }
}

/// Carries out tasks on the devices of one bus.
#[derive(Debug)]
pub struct LssMaster {
    timing: LssTiming,
    activity: Activity,
}

#[derive(Debug)]
enum Activity {
    Idle,
    Active(Job),
    Finished(Result<LssOutcome, LssError>),
}

#[derive(Debug)]
struct Job {
    kind: Kind,
    /// When the last request was sent; `None` while one is due.
    sent_at_ns: Option<Nanoseconds>,
    /// Whether the present question of a scan has been answered.
    is_answered: bool,
}

#[derive(Debug)]
enum Kind {
    /// Requests without an answer but, perhaps, to the last one.
    Sequence {
        requests: Vec<LssRequest>,
        sent: usize,
        answer: Answer,
    },
    Address {
        told: Vec<u32>,
    },
    Scan(FastScan),
}

/// What ends a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Answer {
    Nothing,
    Switched,
    Result,
    Told(Inquiry),
    Existence,
}

impl LssMaster {
    /// The master of one bus.
    pub const fn new(timing: LssTiming) -> Self {
        Self { timing, activity: Activity::Idle }
    }

    /// Begins a task. [`LssMaster::poll`] sends, [`LssMaster::receive`] listens, [`LssMaster::take_outcome`] tells.
    pub fn start(&mut self, task: LssTask) -> Result<(), LssBusy> {
        if self.is_busy() {
            return Err(LssBusy);
        }
        self.activity = Activity::Active(Job { kind: Kind::of(task), sent_at_ns: None, is_answered: false });
        Ok(())
    }

    /// The next frame to send, if one is due. Call it until it returns `None`.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        let Activity::Active(job) = &mut self.activity else { return None };
        if let Some(sent_at_ns) = job.sent_at_ns {
            let waited_ns = now_ns.saturating_sub(sent_at_ns);
            if let Some(outcome) = job.waited(waited_ns, &self.timing) {
                self.activity = Activity::Finished(outcome);
                return None;
            }
        }
        if job.sent_at_ns.is_some() {
            return None;
        }
        let (request, is_last_word) = job.next_request()?;
        job.sent_at_ns = Some(now_ns);
        match &mut job.kind {
            _ if is_last_word => self.activity = Activity::Finished(Ok(LssOutcome::Done)),
            Kind::Sequence { requests, sent, .. } if *sent < requests.len() => job.sent_at_ns = None,
            _ => {}
        }
        Some(request.frame())
    }

    /// Takes a frame that was received; frames that are no answer to the task are passed over.
    pub fn receive(&mut self, frame: &Frame) {
        let Activity::Active(job) = &mut self.activity else { return };
        if job.sent_at_ns.is_none() {
            return;
        }
        let Some(response) = LssResponse::decode(frame) else { return };
        if let Some(outcome) = job.receive(response) {
            self.activity = Activity::Finished(outcome);
        }
    }

    /// The outcome of the task, once it is over. The master is free for the next one then.
    pub fn take_outcome(&mut self) -> Option<Result<LssOutcome, LssError>> {
        match std::mem::replace(&mut self.activity, Activity::Idle) {
            Activity::Finished(outcome) => Some(outcome),
            other => {
                self.activity = other;
                None
            }
        }
    }

    /// Whether a task is under way or its outcome has not been taken.
    pub const fn is_busy(&self) -> bool {
        !matches!(self.activity, Activity::Idle)
    }
}

impl Kind {
    fn of(task: LssTask) -> Self {
        let sequence = |requests, answer| Self::Sequence { requests, sent: 0, answer };
        match task {
            LssTask::SwitchGlobal(mode) => sequence(vec![LssRequest::SwitchGlobal(mode)], Answer::Nothing),
            LssTask::SwitchSelective(address) => {
                let requests = (0..).zip(address.values());
                let requests = requests.map(|(part, value)| LssRequest::SwitchSelective { part, value });
                sequence(requests.collect(), Answer::Switched)
            }
            LssTask::ConfigureNode(node) => sequence(vec![LssRequest::ConfigureNode(node)], Answer::Result),
            LssTask::ConfigureBitTiming(timing) => {
                sequence(vec![LssRequest::ConfigureBitTiming(timing)], Answer::Result)
            }
            LssTask::ActivateBitTiming { delay_ms } => {
                sequence(vec![LssRequest::ActivateBitTiming { delay_ms }], Answer::Nothing)
            }
            LssTask::Store => sequence(vec![LssRequest::Store], Answer::Result),
            LssTask::Inquire(inquiry) => sequence(vec![LssRequest::Inquire(inquiry)], Answer::Told(inquiry)),
            LssTask::InquireAddress => Self::Address { told: vec![] },
            LssTask::IdentifyRemote { lowest, highest } => {
                let values = [
                    lowest.vendor,
                    lowest.product,
                    lowest.revision,
                    highest.revision,
                    lowest.serial,
                    highest.serial,
                ];
                let requests =
                    (0..).zip(values).map(|(part, value)| LssRequest::IdentifyRemote { part, value });
                sequence(requests.collect(), Answer::Existence)
            }
            LssTask::IdentifyUnconfigured => {
                sequence(vec![LssRequest::IdentifyUnconfigured], Answer::Existence)
            }
            LssTask::FastScan(known) => Self::Scan(FastScan::new(known)),
        }
    }
}

impl Job {
    /// The request that is due, and whether nothing follows it.
    fn next_request(&mut self) -> Option<(LssRequest, bool)> {
        match &mut self.kind {
            Kind::Sequence { requests, sent, answer } => {
                let request = requests.get(*sent).copied()?;
                *sent += 1;
                Some((request, *sent == requests.len() && *answer == Answer::Nothing))
            }
            Kind::Address { told } => {
                Some((LssRequest::Inquire(Inquiry::ALL.get(told.len()).copied()?), false))
            }
            Kind::Scan(scan) => Some((scan.request(), false)),
        }
    }

    fn receive(&mut self, response: LssResponse) -> Option<Result<LssOutcome, LssError>> {
        match (&mut self.kind, response) {
            (Kind::Scan(_), LssResponse::Identified) => {
                // Others may be answering the same question: it is over when its time is.
                self.is_answered = true;
                None
            }
            (Kind::Address { told }, LssResponse::Told(inquiry, value))
                if Inquiry::ALL.get(told.len()) == Some(&inquiry) =>
            {
                told.push(value);
                self.sent_at_ns = None;
                let values = <[u32; 4]>::try_from(told.as_slice()).ok()?;
                Some(Ok(LssOutcome::Device(LssAddress::from_values(values))))
            }
            (Kind::Sequence { requests, answer, .. }, response) => match (*answer, response) {
                (Answer::Switched, LssResponse::Switched) => Some(Ok(LssOutcome::Done)),
                (Answer::Told(wanted), LssResponse::Told(inquiry, value)) if wanted == inquiry => {
                    Some(Ok(LssOutcome::Told(value)))
                }
                (Answer::Result, response) => match result_of(requests.last(), response)? {
                    result if result.code == 0 => Some(Ok(LssOutcome::Done)),
                    result => Some(Err(LssError::Refused { result })),
                },
                (Answer::Existence, LssResponse::Identified | LssResponse::IdentifiedUnconfigured) => {
                    Some(Ok(LssOutcome::Exists(true)))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// What follows when nothing more comes for so long.
    fn waited(&mut self, waited_ns: Nanoseconds, timing: &LssTiming) -> Option<Result<LssOutcome, LssError>> {
        let reply_timeout_ns = match &self.kind {
            Kind::Scan(_) => timing.scan_timeout_ns,
            Kind::Sequence { .. } | Kind::Address { .. } => timing.reply_timeout_ns,
        };
        if waited_ns < reply_timeout_ns {
            return None;
        }
        match &mut self.kind {
            Kind::Scan(scan) => {
                let scanned = scan.answered(std::mem::take(&mut self.is_answered));
                self.sent_at_ns = None;
                match scanned {
                    Scanned::GoOn => None,
                    Scanned::Nobody => Some(Ok(LssOutcome::Nobody)),
                    Scanned::Found(address) => Some(Ok(LssOutcome::Device(address))),
                    Scanned::Lost => Some(Err(LssError::ScanLost)),
                }
            }
            Kind::Sequence { answer: Answer::Existence, .. } => Some(Ok(LssOutcome::Exists(false))),
            Kind::Sequence { .. } | Kind::Address { .. } => Some(Err(LssError::NoReply { reply_timeout_ns })),
        }
    }
}

/// The result that answers this request.
fn result_of(request: Option<&LssRequest>, response: LssResponse) -> Option<LssResult> {
    match (request?, response) {
        (LssRequest::ConfigureNode(_), LssResponse::NodeConfigured(result))
        | (LssRequest::ConfigureBitTiming(_), LssResponse::BitTimingConfigured(result))
        | (LssRequest::Store, LssResponse::Stored(result)) => Some(result),
        _ => None,
    }
}
