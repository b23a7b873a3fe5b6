//! What the code of a procedure does with a drive that speaks eRob's own CAN protocol: reads, writes and commands.

use takt_rt::{Frame, Nanoseconds};

use super::client::Client;
use super::session::ProcedureSession;
use crate::erob_can::client::{Answer, RequestClient, RequestError, RequestFailure};
use crate::erob_can::entries::Entry;
use crate::erob_can::frame::{Reply, Request};

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
        let request = Request::Read(entry.address);
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
        self.exchange(Request::Write(entry.address, value)).await.map(|_| ())
    }

    /// Sends a command without an argument.
    ///
    /// # Errors
    /// The drive refuses, or does not reply.
    pub async fn command(&self, entry: &Entry) -> Result<(), RequestError> {
        self.exchange(Request::Command(entry.address)).await.map(|_| ())
    }

    async fn exchange(&self, request: Request) -> Result<Answer, RequestError> {
        // The client is free: every request is awaited to its end here, or reset when it is given up.
        let started = self.client_mut().start(request);
        debug_assert!(started.is_ok());
        let answer = self.until(|| self.client_mut().take_outcome()).await?;
        self.count_done();
        Ok(answer)
    }

    /// Forgets a request that was given up.
    pub fn reset_request(&self) {
        let now_ns = self.now_ns();
        self.client_mut().reset(now_ns);
    }
}
