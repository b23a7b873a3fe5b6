//! The master's side of SDO for one node: one transfer at a time, every wait bounded.
//!
//! A request that is not answered is repeated. A reply that comes after its repetition was sent would leave a second,
//! stale reply under way, which a later transfer of the same object could take for its own: after a repeated transfer
//! the client therefore stays quiet until no reply can be outstanding any more.

use takt_rt::frame::Frame;
use takt_rt::time::Nanoseconds;

use super::abort::AbortCode;
use super::request::Request;
use super::response::Response;
use super::wire::{Expedited, Segment};
use crate::canopen::object::{DataType, ObjectAddress};
use crate::canopen::{function_code, node_of};

/// The most bytes that an upload takes; what a server sends beyond is refused.
pub const MAX_UPLOAD_BYTES: usize = 1 << 16;

/// How long to wait, and how often to ask again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// From a request to its response.
    pub reply_timeout_ns: Nanoseconds,
    /// How often a transfer is begun again after silence.
    pub retries: u8,
}

impl Default for Timing {
    /// Half a second and two retries: drives answer within about 1 ms, but requests share the bus with process data
    /// and wait their turn.
    fn default() -> Self {
        Self { reply_timeout_ns: 500_000_000, retries: 2 }
    }
}

/// What to transfer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Transfer {
    /// Read an object.
    Upload {
        /// The object.
        object: ObjectAddress,
    },
    /// Write an object.
    Download {
        /// The object.
        object: ObjectAddress,
        /// Its new value; up to four bytes go in one frame, more (or none) in segments.
        data: Vec<u8>,
    },
}

impl Transfer {
    /// The object.
    pub const fn object(&self) -> ObjectAddress {
        match self {
            Self::Upload { object } | Self::Download { object, .. } => *object,
        }
    }

    fn request(&self) -> Request {
        match self {
            Self::Upload { object } => Request::Upload { object: *object },
            Self::Download { object, data } => match Expedited::of(data) {
                Some(data) => Request::DownloadExpedited { object: *object, data },
                None => Request::DownloadSegmented { object: *object, size: u32::try_from(data.len()).ok() },
            },
        }
    }
}

/// What an upload has brought.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Uploaded {
    /// The bytes; four when the server did not tell how many count.
    pub bytes: Vec<u8>,
    /// Whether the server told how many bytes count.
    pub is_size_known: bool,
}

impl Uploaded {
    /// The number that the bytes hold; `None` when there are not as many as the type needs.
    pub fn number(&self, data_type: DataType) -> Option<i64> {
        let counted = if self.is_size_known { self.bytes.len() } else { data_type.length() };
        data_type.decode(self.bytes.get(..counted)?)
    }

    /// The text that the bytes hold (VISIBLE_STRING), without trailing zeros and blanks.
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.bytes).trim_end_matches(['\0', ' ']).to_owned()
    }
}

/// How a transfer has succeeded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Completed {
    /// The object has been read.
    Uploaded(Uploaded),
    /// The object has been written.
    Downloaded,
}

/// Why a transfer has failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SdoError {
    /// Nothing usable came in time.
    #[error("no reply within {} ms, asked {attempts} times{}", reply_timeout_ns / 1_000_000, unusable_words(*.unusable))]
    NoReply {
        /// How often the transfer was begun.
        attempts: u8,
        /// How long was waited each time.
        reply_timeout_ns: Nanoseconds,
        /// Frames on the node's reply identifier that were no answer to this transfer.
        unusable: u16,
    },
    /// The server gave it up.
    #[error("abort {0}")]
    Aborted(AbortCode),
    /// The toggle bit of a segment did not alternate.
    #[error("the toggle bit of a segment did not alternate")]
    ToggleNotAlternated,
    /// The segments hold another number of bytes than announced.
    #[error("{received} bytes came where {announced} were announced")]
    SizeMismatch {
        /// What the server announced.
        announced: u32,
        /// What came, as far as it was taken.
        received: u32,
    },
    /// More than [`MAX_UPLOAD_BYTES`].
    #[error("the object is longer than {limit} bytes")]
    TooLong {
        /// The limit in bytes.
        limit: u32,
    },
    /// A segment without data that is not the last one: the transfer would never end.
    #[error("an empty segment came that is not the last one")]
    EmptySegment,
}

fn unusable_words(count: u16) -> String {
    match count {
        0 => String::new(),
        1 => ", one frame came that is no answer to it".to_owned(),
        _ => format!(", {count} frames came that are no answer to it"),
    }
}

/// A transfer is under way, or its outcome has not been taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an SDO transfer with this node is under way")]
pub struct Busy;

/// The client of one node's SDO server.
#[derive(Debug)]
pub struct Client {
    node: u8,
    timing: Timing,
    activity: Activity,
    /// An abort that must leave before anything else does.
    abort: Option<Request>,
    /// No request leaves before this time.
    quiet_until_ns: Nanoseconds,
}

#[derive(Debug)]
enum Activity {
    Idle,
    Active(Exchange),
    Finished(Result<Completed, SdoError>),
}

#[derive(Debug)]
struct Exchange {
    transfer: Transfer,
    phase: Phase,
    attempts: u8,
    unusable: u16,
    /// When the present request was sent; `None` while it still has to be.
    sent_at_ns: Option<Nanoseconds>,
}

#[derive(Debug)]
enum Phase {
    Initiate,
    UploadSegments { bytes: Vec<u8>, size: Option<u32>, toggle: bool },
    DownloadSegments { sent: usize, toggle: bool },
}

/// What a response does to an exchange.
enum Step {
    /// It is no answer.
    Unusable,
    /// The next request is due.
    Next(Phase),
    /// The transfer is over. With a code, the server must be told.
    Finish(Result<Completed, SdoError>, Option<AbortCode>),
}

impl Client {
    /// The client for `node` (1 to 127).
    pub const fn new(node: u8, timing: Timing) -> Self {
        Self { node, timing, activity: Activity::Idle, abort: None, quiet_until_ns: 0 }
    }

    /// Begins a transfer. [`Client::poll`] sends, [`Client::receive`] listens, [`Client::take_outcome`] tells.
    pub fn start(&mut self, transfer: Transfer) -> Result<(), Busy> {
        if !matches!(self.activity, Activity::Idle) {
            return Err(Busy);
        }
        self.activity = Activity::Active(Exchange {
            transfer,
            phase: Phase::Initiate,
            attempts: 0,
            unusable: 0,
            sent_at_ns: None,
        });
        Ok(())
    }

    /// Drops whatever is under way, without a word to the server: for a node that has restarted.
    pub fn reset(&mut self) {
        self.activity = Activity::Idle;
        self.abort = None;
    }

    /// The next frame to send, if one is due. Call it until it returns `None`.
    pub fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        self.expire(now_ns);
        if let Some(abort) = self.abort.take() {
            return Some(abort.frame(self.node));
        }
        let Activity::Active(exchange) = &mut self.activity else { return None };
        if exchange.sent_at_ns.is_some() || now_ns < self.quiet_until_ns {
            return None;
        }
        exchange.sent_at_ns = Some(now_ns);
        if matches!(exchange.phase, Phase::Initiate) {
            exchange.attempts += 1;
        }
        Some(exchange.request().frame(self.node))
    }

    /// Takes a frame that was received; frames that are not from this node's SDO server are passed over.
    pub fn receive(&mut self, frame: &Frame) {
        if node_of(frame, function_code::SDO_RESPONSE) != Some(self.node) {
            return;
        }
        let Activity::Active(exchange) = &mut self.activity else { return };
        let Some(sent_at_ns) = exchange.sent_at_ns else { return };
        let step = match Response::decode(frame) {
            Some((_, response)) => exchange.step(response),
            None => Step::Unusable,
        };
        match step {
            Step::Unusable => exchange.unusable = exchange.unusable.saturating_add(1),
            Step::Next(phase) => {
                exchange.phase = phase;
                exchange.sent_at_ns = None;
            }
            Step::Finish(outcome, abort) => {
                let object = exchange.transfer.object();
                if exchange.attempts > 1 {
                    self.quiet_until_ns = sent_at_ns.saturating_add(self.timing.reply_timeout_ns);
                }
                self.abort = abort.map(|code| Request::Abort { object, code });
                self.activity = Activity::Finished(outcome);
            }
        }
    }

    /// The outcome of the transfer, once it is over. The client is free for the next one then.
    pub fn take_outcome(&mut self) -> Option<Result<Completed, SdoError>> {
        match std::mem::replace(&mut self.activity, Activity::Idle) {
            Activity::Finished(outcome) => Some(outcome),
            other => {
                self.activity = other;
                None
            }
        }
    }

    /// Whether a transfer is under way or its outcome has not been taken.
    pub const fn is_busy(&self) -> bool {
        !matches!(self.activity, Activity::Idle)
    }

    /// Begins again, or gives up, when the present request has been waiting for too long.
    fn expire(&mut self, now_ns: Nanoseconds) {
        let Activity::Active(exchange) = &mut self.activity else { return };
        let Some(sent_at_ns) = exchange.sent_at_ns else { return };
        let reply_timeout_ns = self.timing.reply_timeout_ns;
        if now_ns.saturating_sub(sent_at_ns) < reply_timeout_ns {
            return;
        }
        if exchange.is_server_in_transfer() {
            let object = exchange.transfer.object();
            self.abort = Some(Request::Abort { object, code: AbortCode::ProtocolTimedOut });
        }
        if exchange.attempts > self.timing.retries {
            let (attempts, unusable) = (exchange.attempts, exchange.unusable);
            let error = SdoError::NoReply { attempts, reply_timeout_ns, unusable };
            self.activity = Activity::Finished(Err(error));
        } else {
            exchange.phase = Phase::Initiate;
            exchange.sent_at_ns = None;
        }
    }
}

impl Exchange {
    fn request(&self) -> Request {
        match (&self.phase, &self.transfer) {
            (Phase::UploadSegments { toggle, .. }, _) => Request::UploadSegment { toggle: *toggle },
            (Phase::DownloadSegments { sent, toggle }, Transfer::Download { data, .. }) => {
                let rest = data.get(*sent..).unwrap_or(&[]);
                Request::DownloadSegment {
                    toggle: *toggle,
                    data: Segment::first_of(rest),
                    is_last: rest.len() <= Segment::MAX_BYTES,
                }
            }
            (_, transfer) => transfer.request(),
        }
    }

    /// Whether the server may be waiting for a segment.
    fn is_server_in_transfer(&self) -> bool {
        !matches!(self.phase, Phase::Initiate)
            || matches!(self.transfer.request(), Request::DownloadSegmented { .. })
    }

    fn step(&mut self, response: Response) -> Step {
        let wanted = self.transfer.object();
        if let Response::Abort { object, code } = response {
            return if object == wanted {
                Step::Finish(Err(SdoError::Aborted(code)), None)
            } else {
                Step::Unusable
            };
        }
        match (&mut self.phase, &self.transfer) {
            (Phase::Initiate, Transfer::Upload { .. }) => initiated_upload(wanted, response),
            (Phase::Initiate, Transfer::Download { data, .. }) => initiated_download(wanted, data, response),
            (Phase::UploadSegments { bytes, size, toggle }, _) => match response {
                Response::UploadSegment { toggle: received, .. } if received != *toggle => {
                    toggle_not_alternated()
                }
                Response::UploadSegment { data, is_last, .. } => {
                    uploaded_segment(std::mem::take(bytes), *size, *toggle, data, is_last)
                }
                _ => Step::Unusable,
            },
            (Phase::DownloadSegments { sent, toggle }, Transfer::Download { data, .. }) => {
                downloaded_segment(data.len(), *sent, *toggle, response)
            }
            (Phase::DownloadSegments { .. }, Transfer::Upload { .. }) => Step::Unusable,
        }
    }
}

fn initiated_upload(wanted: ObjectAddress, response: Response) -> Step {
    match response {
        Response::UploadExpedited { object, data } if object == wanted => {
            let uploaded = Uploaded { bytes: data.bytes().into(), is_size_known: data.is_size_indicated() };
            Step::Finish(Ok(Completed::Uploaded(uploaded)), None)
        }
        Response::UploadSegmented { object, size } if object == wanted => {
            if size.is_some_and(|size| size as usize > MAX_UPLOAD_BYTES) {
                return too_long();
            }
            Step::Next(Phase::UploadSegments { bytes: vec![], size, toggle: false })
        }
        _ => Step::Unusable,
    }
}

fn initiated_download(wanted: ObjectAddress, data: &[u8], response: Response) -> Step {
    match response {
        Response::DownloadAccepted { object } if object == wanted => match Expedited::of(data) {
            Some(_) => Step::Finish(Ok(Completed::Downloaded), None),
            None => Step::Next(Phase::DownloadSegments { sent: 0, toggle: false }),
        },
        _ => Step::Unusable,
    }
}

fn uploaded_segment(
    mut bytes: Vec<u8>,
    size: Option<u32>,
    toggle: bool,
    data: Segment,
    is_last: bool,
) -> Step {
    if data.bytes().is_empty() && !is_last {
        return Step::Finish(Err(SdoError::EmptySegment), Some(AbortCode::General));
    }
    bytes.extend_from_slice(data.bytes());
    if bytes.len() > MAX_UPLOAD_BYTES {
        return too_long();
    }
    let received = bytes.len() as u32;
    match size {
        Some(announced) if received > announced || (is_last && received != announced) => {
            let error = SdoError::SizeMismatch { announced, received };
            Step::Finish(Err(error), Some(AbortCode::LengthMismatch))
        }
        _ if is_last => Step::Finish(Ok(Completed::Uploaded(Uploaded { bytes, is_size_known: true })), None),
        _ => Step::Next(Phase::UploadSegments { bytes, size, toggle: !toggle }),
    }
}

fn downloaded_segment(length: usize, sent: usize, expected: bool, response: Response) -> Step {
    let Response::DownloadSegmentAccepted { toggle } = response else { return Step::Unusable };
    if toggle != expected {
        return toggle_not_alternated();
    }
    let sent = (sent + Segment::MAX_BYTES).min(length);
    if sent == length {
        Step::Finish(Ok(Completed::Downloaded), None)
    } else {
        Step::Next(Phase::DownloadSegments { sent, toggle: !expected })
    }
}

fn toggle_not_alternated() -> Step {
    Step::Finish(Err(SdoError::ToggleNotAlternated), Some(AbortCode::ToggleBitNotAlternated))
}

fn too_long() -> Step {
    let error = SdoError::TooLong { limit: MAX_UPLOAD_BYTES as u32 };
    Step::Finish(Err(error), Some(AbortCode::OutOfMemory))
}
