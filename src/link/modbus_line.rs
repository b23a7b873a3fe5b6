//! A Modbus line of this machine, and the threads that talk over it. None of them is the real-time thread.

use std::io;
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use takt_rt::Nanoseconds;

use super::serial_line::{SerialLine, SerialLineError, SerialSettings};
use crate::modbus::frame::{Request, SlaveAddress};
use crate::modbus::line_timing::LineTiming;
use crate::modbus::master::{Answer, Master, MasterTiming, Repeat, RequestError};
use crate::procedure::{ModbusClient, Procedure, ProcedureError, ProcedureEvent};

/// How long a read waits: the time of procedures goes on in such steps.
const TICK: Duration = Duration::from_millis(1);
/// How long the thread of a master waits for a request before it looks at its line.
const IDLE: Duration = Duration::from_millis(20);

/// An open line with its clock.
#[derive(Debug)]
pub struct ModbusLine {
    line: SerialLine,
    timing: LineTiming,
    began: Instant,
}

impl ModbusLine {
    /// Opens a line.
    ///
    /// # Errors
    /// See [`SerialLineError`].
    pub fn open(device: &str, settings: &SerialSettings) -> Result<Self, SerialLineError> {
        let line = SerialLine::open(device, settings)?;
        let timing = LineTiming::new(settings.bit_rate).with_character_bits(settings.character_bits());
        Ok(Self { line, timing, began: Instant::now() })
    }

    /// The times of a master on this line.
    pub const fn master_timing(&self) -> MasterTiming {
        MasterTiming::new(self.timing)
    }

    /// The time since the line was opened.
    pub fn now_ns(&self) -> Nanoseconds {
        u64::try_from(self.began.elapsed().as_nanos()).unwrap_or(u64::MAX)
    }

    /// Waits a moment for bytes. None have come if it returns none.
    ///
    /// # Errors
    /// The line does not work any more.
    pub fn read(&mut self) -> Result<Vec<u8>, SerialLineError> {
        let mut bytes = [0; 512];
        let count = self.line.read(&mut bytes, TICK)?;
        Ok(bytes[..count].to_vec())
    }

    /// Sends bytes.
    ///
    /// # Errors
    /// The line does not work any more.
    pub fn write(&self, bytes: &[u8]) -> Result<(), SerialLineError> {
        self.line.write(bytes)
    }

    /// Carries out a procedure in this thread. `hear` takes what it reports; it returns whether the procedure is to be interrupted.
    ///
    /// # Errors
    /// The line does not work any more. The drive goes on then, unless it misses its master.
    pub fn carry_out<T: Clone, E: Clone>(
        &mut self,
        procedure: &mut Procedure<ModbusClient, T, E>,
        mut hear: impl FnMut(Option<ProcedureEvent>) -> bool,
    ) -> Result<Result<T, ProcedureError<E>>, SerialLineError> {
        loop {
            let bytes = self.read()?;
            procedure.receive(&bytes);
            let mut frames = vec![];
            procedure.poll(self.now_ns(), &mut |frame| frames.push(frame));
            for frame in &frames {
                self.line.write(frame)?;
            }
            let mut is_interrupted = hear(None);
            while let Some(event) = procedure.take_event() {
                is_interrupted |= hear(Some(event));
            }
            if is_interrupted {
                procedure.interrupt();
            }
            if let Some(outcome) = procedure.outcome() {
                return Ok(outcome.clone());
            }
        }
    }

    /// Sends a request to a slave, and waits for its outcome.
    fn ask(&mut self, master: &mut Master, asked: Asked) -> Result<(), SerialLineError> {
        let Asked { slave, request, repeat, answer } = asked;
        // The master is free: every request is awaited to its end here.
        let started = master.start(slave, request, repeat);
        debug_assert!(started.is_ok());
        loop {
            if let Some(frame) = master.poll(self.now_ns()) {
                self.line.write(&frame)?;
            }
            if let Some(outcome) = master.take_outcome() {
                // Who does not wait any more does not want it.
                let _ = answer.send(outcome);
                return Ok(());
            }
            master.receive(&self.read()?);
        }
    }
}

/// A request for the thread of a line.
#[derive(Debug)]
struct Asked {
    slave: SlaveAddress,
    request: Request,
    repeat: Repeat,
    answer: Sender<Result<Answer, RequestError>>,
}

/// Why the thread of a line gives no answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the Modbus line is closed")]
pub struct Closed;

/// Asks the slaves of a line. Clones ask the same line, one after the other.
#[derive(Clone, Debug)]
pub struct LineHandle {
    requests: Sender<Asked>,
}

impl LineHandle {
    /// Begins a request. The outcome comes over the channel that is returned, when the requests before it are done.
    ///
    /// # Errors
    /// The line is closed.
    pub fn begin(
        &self,
        slave: SlaveAddress,
        request: Request,
        repeat: Repeat,
    ) -> Result<Receiver<Result<Answer, RequestError>>, Closed> {
        let (answer, outcome) = mpsc::channel();
        self.requests.send(Asked { slave, request, repeat, answer }).map_err(|_| Closed)?;
        Ok(outcome)
    }

    /// Carries out a request.
    ///
    /// # Errors
    /// The line is closed, or the request has failed.
    pub fn ask(
        &self,
        slave: SlaveAddress,
        request: Request,
        repeat: Repeat,
    ) -> Result<Result<Answer, RequestError>, Closed> {
        self.begin(slave, request, repeat)?.recv().map_err(|_| Closed)
    }
}

/// The thread that is the master of a line. It ends when every handle is gone, or the line does not work any more.
#[derive(Debug)]
pub struct LineThread {
    thread: JoinHandle<Result<(), SerialLineError>>,
}

impl LineThread {
    /// Starts the master of a line in a thread of its own, in the normal scheduling class.
    ///
    /// # Errors
    /// The system has no thread.
    pub fn spawn(line: ModbusLine) -> io::Result<(Self, LineHandle)> {
        let (requests, asked) = mpsc::channel();
        let thread =
            thread::Builder::new().name("takt-modbus".to_owned()).spawn(move || serve(line, &asked))?;
        Ok((Self { thread }, LineHandle { requests }))
    }

    /// Waits until the thread ends.
    ///
    /// # Errors
    /// The line did not work any more.
    pub fn join(self) -> Result<(), SerialLineError> {
        match self.thread.join() {
            Ok(outcome) => outcome,
            Err(panic) => std::panic::resume_unwind(panic),
        }
    }
}

fn serve(mut line: ModbusLine, asked: &Receiver<Asked>) -> Result<(), SerialLineError> {
    let mut master = Master::new(line.master_timing());
    loop {
        match asked.recv_timeout(IDLE) {
            Ok(asked) => line.ask(&mut master, asked)?,
            // What comes now belongs to nobody.
            Err(RecvTimeoutError::Timeout) => master.receive(&line.read()?),
            Err(RecvTimeoutError::Disconnected) => return Ok(()),
        }
    }
}
