//! A task with a motor behind the converter in its Modbus mode: each frame to the motor is written as 16 registers, and its reply is
//! read from them.
//!
//! The registers are 40001 to 40016 of a PLC, which are the protocol addresses 0x0000 to 0x000F: the same on the wire. A write and a read
//! take about 50 ms of the line.

use takt_rt::transparent::DATA_BYTES;
use takt_rt::{Frame, Id, Nanoseconds};
use takt_wire::hollow_lines::registers::{BAUD_RATE, FIRST_ADDRESS, from_registers, to_registers};
use takt_wire::modbus::frame::{ReceivedRequest, RegisterRange, RegisterValues, Request, SlaveAddress};
use takt_wire::modbus::line_timing::LineTiming;
use takt_wire::modbus::master::{Answer, Master, MasterTiming, Repeat, RequestError};

use crate::family::bit_fields;
use crate::family::commission::{DriveTask, Failure, ProcedureError, Report, RunningTask, TargetDrive, Task};
use crate::procedure::ProcedureEvent;

/// From one command to the next: a write and a read, with what a USB adapter adds to both.
const PERIOD_NS: Nanoseconds = 150_000_000;

/// A task with a drive on a line of this bit rate.
///
/// # Errors
/// Such a drive cannot do it there, or a value is wrong.
pub fn begin(target: TargetDrive, task: Task, bit_rate: u32) -> Result<DriveTask<Vec<u8>>, Failure> {
    if bit_rate != BAUD_RATE {
        return Err(Failure::Unsuitable(format!(
            "the converter has {BAUD_RATE} baud in its Modbus mode: serial:/dev/ttyUSB0@{BAUD_RATE}; in its transparent mode it is a bus: \
             --bus rs485-canfd:/dev/ttyUSB0"
        )));
    }
    if matches!(task, Task::GainFactors(_)) {
        return Err(Failure::Unsupported {
            what: "the converter between RS-485 and CAN FD does not carry the frames that multiply gains"
                .to_owned(),
            instead: "send them over a CAN bus".to_owned(),
        });
    }
    let Some(slave) = SlaveAddress::new(target.node) else {
        return Err(Failure::Unsuitable(format!("no motor has the ID {}", target.node)));
    };
    let reply_id = bit_fields::reply_id(&target)?;
    let DriveTask { procedure, mut words } = bit_fields::task(target, task, PERIOD_NS)?;
    let procedure = RegistersTask {
        task: procedure,
        master: Master::new(MasterTiming::new(LineTiming::new(bit_rate))),
        slave,
        reply_id,
        command: None,
        is_busy: false,
        last_error: None,
        outcome: None,
    };
    let words = move |bytes: &Vec<u8>| match ReceivedRequest::decode(bytes) {
        Some(ReceivedRequest { address, request: Ok(request) }) => {
            let frame = match &request {
                Request::WriteSeveral(values) => data_of(values.values())
                    .and_then(|data| Frame::fd(Id::canopen(0, slave.number()), &data, false).ok()),
                _ => None,
            };
            let of_frame = frame.map_or_else(String::new, |frame| format!(" ({})", words(&frame)));
            format!("slave {address}: {request}{of_frame}")
        }
        _ => String::new(),
    };
    Ok(DriveTask { procedure: Box::new(procedure), words: Box::new(words) })
}

fn data_of(registers: &[u16]) -> Option<[u8; DATA_BYTES]> {
    from_registers(registers.try_into().ok()?).ok()
}

/// A task over frames of CAN FD, whose frames go through the registers of the converter.
struct RegistersTask {
    task: Box<dyn RunningTask<Frame>>,
    master: Master,
    slave: SlaveAddress,
    /// The identifier of the motor's replies, which the registers do not have.
    reply_id: Id,
    /// The last frame to the motor that is not written yet. An older one is out of date.
    command: Option<[u8; DATA_BYTES]>,
    is_busy: bool,
    /// Why the last request failed.
    last_error: Option<String>,
    outcome: Option<Result<Report, ProcedureError>>,
}

impl RegistersTask {
    fn take_outcome(&mut self) {
        let Some(outcome) = self.master.take_outcome() else { return };
        self.is_busy = false;
        match outcome {
            // What is read before a write may be stale, so every read follows one.
            Ok(Answer::Written) => {
                self.ask(RegisterRange::new(FIRST_ADDRESS, DATA_BYTES as u16).map(Request::Read))
            }
            Ok(Answer::Values(values)) => {
                self.last_error = None;
                if let Some(data) = data_of(&values)
                    && let Ok(frame) = Frame::fd(self.reply_id, &data, false)
                {
                    self.task.receive(&frame);
                }
            }
            Err(error) => self.last_error = Some(words_of(&error)),
        }
    }

    fn ask(&mut self, request: Option<Request>) {
        let Some(request) = request else { return };
        // The same command again is the same command: repeating it changes nothing.
        self.is_busy = self.master.start(self.slave, request, Repeat::Allowed).is_ok();
    }
}

fn words_of(error: &RequestError) -> String {
    error.to_string()
}

impl RunningTask<Vec<u8>> for RegistersTask {
    fn poll(&mut self, now_ns: Nanoseconds, send: &mut dyn FnMut(Vec<u8>)) {
        self.take_outcome();
        // Its last command is written to the end; there is none behind it.
        if self.task.outcome().is_none() {
            let command = &mut self.command;
            self.task.poll(now_ns, &mut |frame| {
                // A frame that is not of 16 bytes has no registers.
                if let Ok(data) = frame.payload().try_into() {
                    *command = Some(data);
                }
            });
        }
        if !self.is_busy
            && let Some(data) = self.command.take()
        {
            self.ask(RegisterValues::new(FIRST_ADDRESS, &to_registers(&data)).map(Request::WriteSeveral));
        }
        while let Some(bytes) = self.master.poll(now_ns) {
            send(bytes);
        }
        // The last command takes the torque away: it is written before the task ends.
        let is_written = !self.is_busy && self.command.is_none();
        if self.outcome.is_none() && is_written {
            self.outcome = self.task.outcome().cloned().map(|outcome| match (outcome, &self.last_error) {
                (Err(ProcedureError { step, failure: Failure::Silent { .. } }), Some(error)) => Err(ProcedureError {
                    step,
                    failure: Failure::Request {
                        what: error.clone(),
                        cure: Some("check the motor ID (`--node`), the converter's switches (all off) and the wiring"),
                    },
                }),
                (outcome, _) => outcome,
            });
        }
    }

    fn receive(&mut self, bytes: &Vec<u8>) {
        self.master.receive(bytes);
    }

    fn interrupt(&mut self) {
        self.task.interrupt();
    }

    fn take_event(&mut self) -> Option<ProcedureEvent> {
        self.task.take_event()
    }

    fn outcome(&self) -> Option<&Result<Report, ProcedureError>> {
        self.outcome.as_ref()
    }
}
