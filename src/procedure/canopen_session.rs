//! What the code of a procedure does with a CANopen node: NMT commands, SDO transfers, frames.
//!
//! Nothing here fails because of an interruption: the users decide where they let themselves be interrupted.

use takt_rt::{Frame, Nanoseconds};
use takt_wire::canopen::emcy::Emergency;
use takt_wire::canopen::nmt::{NmtCommand, NmtState, NmtTarget};
use takt_wire::canopen::object::ObjectAddress;
use takt_wire::canopen::sdo::{Completed, SdoClient, SdoError, SdoTiming, Transfer, Uploaded};

use super::canopen_client::{CanopenClient, OwnHeartbeat};
use super::sdo_quirks::SdoQuirks;
use super::session::ProcedureSession;

/// Interval between two reads of a polled object.
pub const POLL_NS: Nanoseconds = 5_000_000;

/// A session with a CANopen node.
pub type CanopenSession = ProcedureSession<CanopenClient>;

impl CanopenSession {
    /// The node ID.
    pub fn node(&self) -> u8 {
        self.client().node
    }

    /// Timing and deviations of the node's SDO server.
    pub fn quirks(&self) -> SdoQuirks {
        self.client().quirks
    }

    /// The NMT state that the node has reported last, if it has reported one.
    pub fn nmt_state(&self) -> Option<NmtState> {
        self.client().nmt_state
    }

    /// Returns `true` if the node has reported this NMT state since the last NMT command.
    pub fn has_reported(&self, state: NmtState) -> bool {
        self.client().reported_states.contains(&state)
    }

    /// The number of boot-up messages of the node.
    pub fn boot_ups(&self) -> u32 {
        self.client().boot_ups
    }

    /// Returns `true` if restarts of the node are watched for.
    pub(crate) fn watches_restarts(&self) -> bool {
        self.client().expected_boot_ups.is_some()
    }

    /// From now on, a boot-up beyond the first `expected` is a restart, unless they are watched for already.
    pub(crate) fn watch_restarts(&self, expected: u32) {
        self.client_mut().expected_boot_ups.get_or_insert(expected);
    }

    /// Returns `true` if the node has restarted, and so has lost its configuration.
    pub(crate) fn has_restarted(&self) -> bool {
        let client = self.client();
        client.expected_boot_ups.is_some_and(|expected| client.boot_ups > expected)
    }

    /// Takes note of one restart.
    pub(crate) fn accept_restart(&self) {
        let mut client = self.client_mut();
        client.expected_boot_ups = client.expected_boot_ups.map(|expected| expected.saturating_add(1));
    }

    /// The drive's last emergency message, unless an "error reset" message (code 00xx) followed.
    pub fn emergency(&self) -> Option<Emergency> {
        self.client().emergency
    }

    /// Sends a frame.
    pub fn send(&self, frame: Frame) {
        self.client_mut().outgoing.push_back(frame);
    }

    /// Sends an NMT command to the node. What it has reported before does not count any more.
    pub fn command(&self, command: NmtCommand) {
        self.client_mut().reported_states.clear();
        self.repeat_command(command);
    }

    /// Sends an NMT command again. The node may have obeyed the first one already.
    pub fn repeat_command(&self, command: NmtCommand) {
        self.send(command.frame(NmtTarget::Node(self.node())));
    }

    /// Waits until the node reports this NMT state; `false` when it has not done so until `end_ns`.
    pub async fn reports(&self, state: NmtState, end_ns: Nanoseconds) -> bool {
        self.until(|| {
            let has_reported = self.has_reported(state);
            (has_reported || self.now_ns() >= end_ns).then_some(has_reported)
        })
        .await
    }

    /// Starts the heartbeat of this program under the node ID `node`, or stops it (`None`).
    pub fn set_heartbeat(&self, node: u8, period_ns: Option<Nanoseconds>) {
        let due_ns = self.now_ns();
        self.client_mut().heartbeat = period_ns.map(|period_ns| OwnHeartbeat { node, period_ns, due_ns });
    }

    /// Starts to collect all frames on the bus.
    pub(crate) fn begin_collecting(&self) {
        self.client_mut().collected = Some(vec![]);
    }

    /// Stops collecting and returns the frames.
    pub(crate) fn end_collecting(&self) -> Vec<Frame> {
        self.client_mut().collected.take().unwrap_or_default()
    }

    /// Waits for the pause that the drive needs between a reply and the next request.
    pub async fn gap(&self) {
        self.until(|| (self.now_ns() >= self.client().free_ns).then_some(())).await;
    }

    /// Carries out one SDO transfer.
    ///
    /// # Errors
    /// That of the transfer.
    pub async fn exchange(&self, transfer: Transfer) -> Result<Completed, SdoError> {
        self.gap().await;
        // The client is free, because every transfer is awaited to its end here, or reset when it is given up.
        let started = self.client_mut().sdo.start(transfer);
        debug_assert!(started.is_ok());
        let outcome = self.until(|| self.client_mut().sdo.take_outcome()).await;
        let free_ns = self.now_ns().saturating_add(self.quirks().gap_ns);
        self.client_mut().free_ns = free_ns;
        outcome
    }

    /// Reads the bytes of an object.
    ///
    /// # Errors
    /// That of the transfer.
    pub async fn read_bytes(&self, object: ObjectAddress) -> Result<Uploaded, SdoError> {
        Ok(match self.exchange(Transfer::Upload { object }).await? {
            Completed::Uploaded(uploaded) => uploaded,
            Completed::Downloaded => Uploaded { bytes: vec![], is_size_known: true },
        })
    }

    /// As [`CanopenSession::read_bytes`], with an NMT command before each request: a node in NMT stopped has no SDO
    /// server before the command, and the node may be absent at first.
    ///
    /// # Errors
    /// That of the transfer.
    pub(crate) async fn read_bytes_after_command(
        &self,
        command: NmtCommand,
        object: ObjectAddress,
    ) -> Result<Uploaded, SdoError> {
        let frame = command.frame(NmtTarget::Node(self.node()));
        self.client_mut().before_request = Some(frame);
        let outcome = self.read_bytes(object).await;
        self.client_mut().before_request = None;
        outcome
    }

    /// Forgets a transfer that was given up, without an abort, and what belongs to it.
    pub(crate) fn reset_transfer(&self) {
        let mut client = self.client_mut();
        client.sdo.reset();
        client.before_request = None;
        client.collected = None;
    }

    /// Changes the number of retries of the next transfers.
    pub(crate) fn set_retries(&self, retries: u8) {
        let mut client = self.client_mut();
        let timing = SdoTiming { retries, ..client.quirks.timing };
        client.sdo = SdoClient::new(client.node, timing);
    }
}
