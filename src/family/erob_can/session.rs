//! What the code of a procedure does with a drive that speaks eRob's own CAN protocol: reads, writes and commands.

use takt_rt::{Frame, Id, Nanoseconds};
use takt_wire::erob_can::client::{Answer, RequestClient, RequestError, RequestFailure, RequestTiming};
use takt_wire::erob_can::entries::Entry;
use takt_wire::erob_can::frame::{EntryAddress, Reply, Request};

use crate::procedure::{Client, ProcedureSession};

impl Client for RequestClient {
    type Message = Frame;

    fn poll(&mut self, now_ns: Nanoseconds) -> Option<Frame> {
        RequestClient::poll(self, now_ns)
    }

    fn receive(&mut self, frame: &Frame) {
        RequestClient::receive(self, frame);
    }
}

/// A session with a drive.
pub type ErobCanSession = ProcedureSession<RequestClient>;

impl ErobCanSession {
    /// The node ID.
    pub fn node(&self) -> u8 {
        self.client().node()
    }

    /// Reads an entry.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn read(&self, entry: &Entry) -> Result<i32, RequestError> {
        self.read_at(entry.address).await
    }

    /// As [`ErobCanSession::read`], by its address.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn read_at(&self, address: EntryAddress) -> Result<i32, RequestError> {
        let request = Request::Read(address);
        match self.exchange(request).await? {
            Answer::Value(value) => Ok(value),
            Answer::Done => Err(RequestError { request, failure: RequestFailure::WrongReply(Reply::Done) }),
        }
    }

    /// Writes an entry, or gives a command its argument.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn write(&self, entry: &Entry, value: i32) -> Result<(), RequestError> {
        self.write_at(entry.address, value).await
    }

    /// As [`ErobCanSession::write`], by its address.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn write_at(&self, address: EntryAddress, value: i32) -> Result<(), RequestError> {
        self.exchange(Request::Write(address, value)).await.map(|_| ())
    }

    /// Sends a command without an argument.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn command(&self, entry: &Entry) -> Result<(), RequestError> {
        self.exchange(Request::Command(entry.address)).await.map(|_| ())
    }

    async fn exchange(&self, request: Request) -> Result<Answer, RequestError> {
        // The client is free: every request is awaited to its end here.
        let started = self.client_mut().start(request);
        debug_assert!(started.is_ok());
        let answer = self.until(|| self.client_mut().take_outcome()).await?;
        self.count_done();
        Ok(answer)
    }

    /// Turns to another node, and asks it so often and with such patience.
    pub fn turn_to(&self, node: u8, timing: RequestTiming) {
        self.client_mut().turn_to(node, timing);
    }

    /// Asks the node in another protocol: whether it answers this frame under this identifier within this time.
    pub async fn answers(&self, question: Frame, answer: Id, within_ns: Nanoseconds) -> bool {
        self.client_mut().probe(question, answer);
        let end_ns = self.now_ns().saturating_add(within_ns);
        let has_answer = self.until(|| self.client().has_probe_answer().then_some(()));
        self.unless_over(|| self.now_ns() >= end_ns, has_answer).await.is_some()
    }
}
