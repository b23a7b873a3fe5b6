//! The LSS master: one task at a time, with a timeout for every wait.

use takt_rt::{Frame, Nanoseconds};

use super::LssAddress;
use super::fast_scan::{FastScan, KnownIdentity, Scanned};
use super::wire::{BitTiming, Inquiry, LssMode, LssRequest, LssResponse, LssResult};

/// A task of the LSS master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(dead_code, reason = "all services of the protocol")]
pub enum LssTask {
    /// Switches every device to this state. No reply.
    SwitchGlobal(LssMode),
    /// Switches one device to configuration state.
    SwitchSelective(LssAddress),
    /// Configures the node ID of the device in configuration state: 1 to 127, or 255 for none.
    ConfigureNode(u8),
    /// Configures the bit rate of the device in configuration state; it takes effect when it is activated.
    ConfigureBitTiming(BitTiming),
    /// Activates the configured bit rate: the devices change it after the delay, and send again after another delay.
    /// The master must change its own bit rate in between. No reply.
    ActivateBitTiming {
        /// The delay in ms.
        delay_ms: u16,
    },
    /// Stores the node ID and bit rate of the device in configuration state.
    Store,
    /// Reads one value of the device in configuration state.
    Inquire(Inquiry),
    /// Reads the identity of the device in configuration state.
    InquireAddress,
    /// Asks for a device with an identity in a range. Vendor and product are those of `lowest`.
    IdentifyRemote {
        /// The lowest revision and serial number.
        lowest: LssAddress,
        /// The highest revision and serial number.
        highest: LssAddress,
    },
    /// Asks for a device without a node ID.
    IdentifyUnconfigured,
    /// Finds a device without a node ID and switches it to configuration state.
    FastScan(KnownIdentity),
    /// Finds the device without a node ID whose identity is the lowest above this one, and switches it to
    /// configuration state. All devices must be in waiting state. The device with this identity must still be on the bus.
    FastScanAfter(LssAddress),
}

/// The result of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LssOutcome {
    /// The task is done.
    Done,
    /// The value read by [`LssTask::Inquire`].
    Value(u32),
    /// The identity of the device in configuration state.
    Device(LssAddress),
    /// Whether a device has replied.
    Exists(bool),
    /// [`LssTask::FastScan`] has found no device.
    NotFound,
}

/// Why a task failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LssError {
    /// No device has replied.
    #[error("no device answered within {} ms", reply_timeout_ns / 1_000_000)]
    NoReply {
        /// The timeout.
        reply_timeout_ns: Nanoseconds,
    },
    /// The device refused the request.
    #[error("the device refused: error {}, its own reason {}", result.code, result.specific)]
    Refused {
        /// The error.
        result: LssResult,
    },
    /// Replies of the fastscan were lost.
    #[error("no device has the identity found by the fastscan: replies were lost")]
    ScanLost,
}

/// A task is running, or its outcome has not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an LSS task is running")]
pub struct LssBusy;

/// The timeouts of the LSS master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LssTiming {
    /// The reply timeout of all requests except fastscan.
    pub reply_timeout_ns: Nanoseconds,
    /// The reply timeout of a fastscan request. About half of its 130 requests end with the timeout.
    pub scan_timeout_ns: Nanoseconds,
}

impl Default for LssTiming {
    fn default() -> Self {
        Self { reply_timeout_ns: 500_000_000, scan_timeout_ns: 20_000_000 }
    }
}

/// Runs tasks for the devices of one bus.
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
    /// When the last request was sent; `None` while a request is due.
    sent_at_ns: Option<Nanoseconds>,
    /// True if the current fastscan request has a reply.
    has_reply: bool,
}

#[derive(Debug)]
enum Kind {
    /// Requests of which only the last one may have a reply.
    Sequence {
        requests: Vec<LssRequest>,
        sent: usize,
        reply: ExpectedReply,
    },
    Address {
        values: Vec<u32>,
    },
    Scan(FastScan),
}

/// The reply that ends a sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ExpectedReply {
    Nothing,
    Switched,
    Result,
    Value(Inquiry),
    Existence,
}

impl LssMaster {
    /// The master of one bus.
    pub const fn new(timing: LssTiming) -> Self {
        Self { timing, activity: Activity::Idle }
    }

    /// Begins a task. Then call [`LssMaster::poll`], [`LssMaster::receive`] and [`LssMaster::take_outcome`].
    pub fn start(&mut self, task: LssTask) -> Result<(), LssBusy> {
        if self.is_busy() {
            return Err(LssBusy);
        }
        self.activity = Activity::Active(Job { kind: Kind::of(task), sent_at_ns: None, has_reply: false });
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
        let (request, is_last_without_reply) = job.next_request()?;
        job.sent_at_ns = Some(now_ns);
        match &mut job.kind {
            _ if is_last_without_reply => self.activity = Activity::Finished(Ok(LssOutcome::Done)),
            Kind::Sequence { requests, sent, .. } if *sent < requests.len() => job.sent_at_ns = None,
            _ => {}
        }
        Some(request.frame())
    }

    /// Receives a frame; frames that are not a reply to the task are ignored.
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

    /// The outcome of the task when it is finished. The master is then free for the next task.
    pub fn take_outcome(&mut self) -> Option<Result<LssOutcome, LssError>> {
        match std::mem::replace(&mut self.activity, Activity::Idle) {
            Activity::Finished(outcome) => Some(outcome),
            other => {
                self.activity = other;
                None
            }
        }
    }

    /// Returns `true` if a task is running or its outcome has not been taken.
    pub const fn is_busy(&self) -> bool {
        !matches!(self.activity, Activity::Idle)
    }
}

impl Kind {
    fn of(task: LssTask) -> Self {
        let sequence = |requests, reply| Self::Sequence { requests, sent: 0, reply };
        match task {
            LssTask::SwitchGlobal(mode) => {
                sequence(vec![LssRequest::SwitchGlobal(mode)], ExpectedReply::Nothing)
            }
            LssTask::SwitchSelective(address) => {
                let requests = (0..).zip(address.values());
                let requests = requests.map(|(part, value)| LssRequest::SwitchSelective { part, value });
                sequence(requests.collect(), ExpectedReply::Switched)
            }
            LssTask::ConfigureNode(node) => {
                sequence(vec![LssRequest::ConfigureNode(node)], ExpectedReply::Result)
            }
            LssTask::ConfigureBitTiming(timing) => {
                sequence(vec![LssRequest::ConfigureBitTiming(timing)], ExpectedReply::Result)
            }
            LssTask::ActivateBitTiming { delay_ms } => {
                sequence(vec![LssRequest::ActivateBitTiming { delay_ms }], ExpectedReply::Nothing)
            }
            LssTask::Store => sequence(vec![LssRequest::Store], ExpectedReply::Result),
            LssTask::Inquire(inquiry) => {
                sequence(vec![LssRequest::Inquire(inquiry)], ExpectedReply::Value(inquiry))
            }
            LssTask::InquireAddress => Self::Address { values: vec![] },
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
                sequence(requests.collect(), ExpectedReply::Existence)
            }
            LssTask::IdentifyUnconfigured => {
                sequence(vec![LssRequest::IdentifyUnconfigured], ExpectedReply::Existence)
            }
            LssTask::FastScan(known) => Self::Scan(FastScan::new(known)),
            LssTask::FastScanAfter(address) => Self::Scan(FastScan::after(address)),
        }
    }
}

impl Job {
    /// The request that is due, and whether it is the last one and has no reply.
    fn next_request(&mut self) -> Option<(LssRequest, bool)> {
        match &mut self.kind {
            Kind::Sequence { requests, sent, reply } => {
                let request = requests.get(*sent).copied()?;
                *sent += 1;
                Some((request, *sent == requests.len() && *reply == ExpectedReply::Nothing))
            }
            Kind::Address { values } => {
                Some((LssRequest::Inquire(Inquiry::ALL.get(values.len()).copied()?), false))
            }
            Kind::Scan(scan) => Some((scan.request(), false)),
        }
    }

    fn receive(&mut self, response: LssResponse) -> Option<Result<LssOutcome, LssError>> {
        match (&mut self.kind, response) {
            (Kind::Scan(_), LssResponse::Identified) => {
                // Other devices may reply too, so the request ends with its timeout.
                self.has_reply = true;
                None
            }
            (Kind::Address { values }, LssResponse::Inquired(inquiry, value))
                if Inquiry::ALL.get(values.len()) == Some(&inquiry) =>
            {
                values.push(value);
                self.sent_at_ns = None;
                let values = <[u32; 4]>::try_from(values.as_slice()).ok()?;
                Some(Ok(LssOutcome::Device(LssAddress::from_values(values))))
            }
            (Kind::Sequence { requests, reply, .. }, response) => match (*reply, response) {
                (ExpectedReply::Switched, LssResponse::Switched) => Some(Ok(LssOutcome::Done)),
                (ExpectedReply::Value(wanted), LssResponse::Inquired(inquiry, value))
                    if wanted == inquiry =>
                {
                    Some(Ok(LssOutcome::Value(value)))
                }
                (ExpectedReply::Result, response) => match result_of(requests.last(), response)? {
                    result if result.code == 0 => Some(Ok(LssOutcome::Done)),
                    result => Some(Err(LssError::Refused { result })),
                },
                (ExpectedReply::Existence, LssResponse::Identified | LssResponse::IdentifiedUnconfigured) => {
                    Some(Ok(LssOutcome::Exists(true)))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// The outcome when the timeout of a request has passed.
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
                let scanned = scan.evaluate(std::mem::take(&mut self.has_reply));
                self.sent_at_ns = None;
                match scanned {
                    Scanned::Continue => None,
                    Scanned::NotFound => Some(Ok(LssOutcome::NotFound)),
                    Scanned::Found(address) => Some(Ok(LssOutcome::Device(address))),
                    Scanned::ReplyLost => Some(Err(LssError::ScanLost)),
                }
            }
            Kind::Sequence { reply: ExpectedReply::Existence, .. } => Some(Ok(LssOutcome::Exists(false))),
            Kind::Sequence { .. } | Kind::Address { .. } => Some(Err(LssError::NoReply { reply_timeout_ns })),
        }
    }
}

/// The result in the response to this request.
fn result_of(request: Option<&LssRequest>, response: LssResponse) -> Option<LssResult> {
    match (request?, response) {
        (LssRequest::ConfigureNode(_), LssResponse::NodeConfigured(result))
        | (LssRequest::ConfigureBitTiming(_), LssResponse::BitTimingConfigured(result))
        | (LssRequest::Store, LssResponse::Stored(result)) => Some(result),
        _ => None,
    }
}
