//! What the code of a procedure does with a slave on a Modbus line: it reads and writes registers.

use takt_rt::Nanoseconds;
use takt_wire::modbus::frame::{RegisterRange, RegisterValues, Request, SlaveAddress, Values};
use takt_wire::modbus::master::{Answer, Master, MasterTiming, Repeat, RequestError};

use super::client::Client;
use super::session::ProcedureSession;

/// The master of a line, for one slave.
#[derive(Debug)]
pub struct ModbusClient {
    slave: SlaveAddress,
    master: Master,
}

impl ModbusClient {
    /// The client of a slave.
    pub const fn new(slave: SlaveAddress, timing: MasterTiming) -> Self {
        Self { slave, master: Master::new(timing) }
    }
}

impl Client for ModbusClient {
    type Message = Vec<u8>;

    fn poll(&mut self, now_ns: Nanoseconds) -> Option<Vec<u8>> {
        self.master.poll(now_ns)
    }

    fn receive(&mut self, bytes: &Vec<u8>) {
        self.master.receive(bytes);
    }
}

/// A session with a slave.
pub type ModbusSession = ProcedureSession<ModbusClient>;

impl ModbusSession {
    /// The address of the slave.
    pub fn slave(&self) -> SlaveAddress {
        self.client().slave
    }

    /// Turns to another slave of the line.
    pub(crate) fn turn_to(&self, slave: SlaveAddress) {
        self.client_mut().slave = slave;
    }

    /// Requests that were sent again, because their reply did not come or was damaged.
    pub fn repeated_requests(&self) -> u64 {
        self.client().master.repeated_requests()
    }

    /// Reads registers that follow each other.
    ///
    /// # Errors
    /// The slave refuses, or does not reply.
    pub async fn read_registers(&self, range: RegisterRange) -> Result<Values, RequestError> {
        match self.exchange(Request::Read(range), Repeat::Allowed).await? {
            Answer::Values(values) => Ok(values),
            // The master takes nothing but values for the reply to a read.
            Answer::Written => Ok(Values::new()),
        }
    }

    /// Writes one register.
    ///
    /// # Errors
    /// The slave refuses, or does not reply.
    pub async fn write_register(
        &self,
        register: u16,
        value: u16,
        repeat: Repeat,
    ) -> Result<(), RequestError> {
        self.exchange(Request::WriteOne { register, value }, repeat).await.map(|_| ())
    }

    /// Writes registers that follow each other, all at once.
    ///
    /// # Errors
    /// The slave refuses, or does not reply.
    pub async fn write_registers(&self, values: RegisterValues, repeat: Repeat) -> Result<(), RequestError> {
        self.exchange(Request::WriteSeveral(values), repeat).await.map(|_| ())
    }

    async fn exchange(&self, request: Request, repeat: Repeat) -> Result<Answer, RequestError> {
        let slave = self.slave();
        // The master is free: every request is awaited to its end here, or reset when it is given up.
        let started = self.client_mut().master.start(slave, request, repeat);
        debug_assert!(started.is_ok());
        let answer = self.until(|| self.client_mut().master.take_outcome()).await?;
        self.count_done();
        Ok(answer)
    }

    /// Forgets a request that was given up.
    pub fn reset_request(&self) {
        let now_ns = self.now_ns();
        self.client_mut().master.reset(now_ns);
    }
}
