//! What takt's own tests, benchmarks and fuzzers need beyond the public face. Nothing here is stable; the feature `internals` shows it.

use takt_rt::BusPort;

use crate::channels::{HostSide, LogSide};
use crate::config::{Config, ConfigSources};
use crate::controller::port::Port;
use crate::controller::{AfterBringUp, Supervisor, VirtualController, VirtualRun, assemble};
use crate::error::AssembleError;
use crate::faults::{DriveEffect, FaultInjector, InjectError, Injectable};
use crate::journal::RunJournal;
use crate::telemetry::Logger;

pub mod bit_fields {
    pub use crate::config::bit_fields::*;
}

pub mod channels {
    pub use crate::channels::*;
}

#[cfg(feature = "cli")]
pub mod commission {
    pub mod bus_scan {
        pub use crate::commission::bus_scan::*;
    }
    pub mod bus_session {
        pub use crate::commission::bus_session::*;
    }
    pub mod layer_settings {
        pub use crate::commission::layer_settings::*;
    }
    pub mod dictionary {
        pub use crate::family::commission::dictionary::*;
    }
    pub use crate::procedure::ProcedureEvent;
}

pub mod controller {
    pub use crate::controller::*;
    pub mod assemble {
        pub use crate::controller::assemble::*;
    }
    pub mod port {
        pub use crate::controller::port::*;
    }
    pub mod realtime_thread {
        pub use crate::controller::realtime_thread::*;
    }
    pub mod session {
        pub use crate::controller::session::*;
    }
}

#[cfg(feature = "cli")]
pub mod doctor {
    pub use crate::doctor::*;
}

pub mod family {
    pub mod erob {
        pub use crate::family::erob::*;
    }
    pub mod erob_can {
        pub use crate::family::erob_can::*;
    }
    pub mod erob_modbus {
        pub use crate::family::erob_modbus::*;
    }
    pub mod bring_up {
        pub use crate::family::bring_up::stages::*;
    }
}

pub mod hollow {
    pub mod encoder_output {
        pub use crate::family::hollow::encoder_output::*;
    }
    pub mod pwm {
        pub use crate::family::hollow::pwm::*;
    }
}

pub mod journal {
    pub use crate::journal::*;
}

pub mod link {
    pub use crate::link::interface::*;
    #[cfg(feature = "cli")]
    pub mod modbus_line {
        pub use crate::link::modbus_line::*;
    }
    pub mod serial_line {
        pub use crate::link::serial_line::*;
    }
    pub use crate::link::socketcan::*;
    pub mod ownership {
        pub use crate::link::ownership::*;
    }
    pub mod trace {
        pub use crate::link::trace::*;
    }
}

pub mod monitor {
    pub use crate::monitor::*;
}

pub mod procedure {
    pub use crate::procedure::{ModbusClient, ModbusSession, Procedure, ProcedureError, ProcedureEvent};
}

pub mod remote {
    pub use crate::remote::{
        Answer, Command, Demand, Malformed, PACKET_WORDS, Packets, Received, Reply, Role, StopRequest,
    };
}

#[cfg(feature = "browser")]
pub mod replay {
    pub use crate::replay::*;
}

pub mod schedule {
    pub use crate::schedule::response_time::*;
}

pub mod sim {
    pub use takt_sim::object_dictionary::table::ObjectRow;
    pub mod bit_fields {
        pub use takt_sim::bit_fields::*;
    }
    pub mod commanded_module {
        pub use takt_sim::commanded_module::ModuleParameters;
    }
    pub mod erob_can {
        pub use takt_sim::erob_can::*;
    }
    pub mod erob_modbus {
        pub use takt_sim::erob_modbus::*;
    }
    pub use takt_sim::mailbox::*;
    pub use takt_sim::medium::*;
    pub mod serial_line {
        pub use takt_sim::serial_host::*;
        pub use takt_sim::serial_line::*;
    }
    pub mod pseudo_terminal {
        pub use takt_sim::pseudo_terminal::*;
    }
    pub mod erob {
        pub use crate::family::erob_canopen::simulated_parameters;
        pub use takt_sim::erob::*;
    }
    #[cfg(feature = "cli")]
    pub mod lss {
        pub use takt_sim::lss::*;
    }
    pub mod yz_aim {
        pub use crate::family::yz_aim::simulated_parameters;
        pub use takt_sim::yz_aim::*;
    }
}

#[cfg(feature = "panel")]
pub mod panel {
    pub use crate::panel::*;
}

pub mod telemetry {
    pub use crate::telemetry::thread::LoggerThread;
}

/// What is inside of a controller in virtual time.
pub trait RunInside<P>: Sized {
    /// A controller of this configuration on these ports, without a program: after bring-up the group executes the requests of
    /// the host, until it is interrupted.
    ///
    /// # Errors
    /// See [`AssembleError`].
    fn serving(config: &Config, ports: Vec<P>) -> Result<(Self, LogSide), AssembleError>;

    /// A controller on simulated buses and lines with injected faults. It executes the program, or the requests of the host where it
    /// `is_serving`. `outermost` makes of each port the one that it is given. Whoever calls this shows the snapshots to the injector.
    ///
    /// # Errors
    /// See [`AssembleError`].
    fn faulty(
        config: &Config,
        fault_injector: &FaultInjector,
        is_serving: bool,
        outermost: impl Fn(Port) -> P,
    ) -> Result<(Self, LogSide), AssembleError>;

    /// The life cycle.
    fn supervisor(&self) -> &Supervisor;

    /// The host's side of the host interface, to command the group directly.
    fn host(&mut self) -> &mut HostSide;

    /// Notes from now on what the cycle is told, but for what its ports do. Call it before the first cycle.
    fn journal(&mut self) -> RunJournal;
}

/// A logger that keeps the journal of a run of this configuration, too: for its recording and its black box.
///
/// # Errors
/// See [`AssembleError`].
pub fn with_journal(logger: Logger, run: RunJournal, config: &Config) -> Result<Logger, AssembleError> {
    let again = assemble::rerun_parts(config)?;
    Ok(logger.with_journal(Some(run), Some(again), &ConfigSources::default()))
}

impl<P: BusPort> RunInside<P> for VirtualRun<P> {
    fn serving(config: &Config, ports: Vec<P>) -> Result<(Self, LogSide), AssembleError> {
        Self::serving(config, ports, AfterBringUp::Enable)
    }

    fn faulty(
        config: &Config,
        fault_injector: &FaultInjector,
        is_serving: bool,
        outermost: impl Fn(Port) -> P,
    ) -> Result<(Self, LogSide), AssembleError> {
        let supervisor = match is_serving {
            true => Supervisor::serving(config, AfterBringUp::Enable),
            false => Supervisor::new(config, None),
        };
        Self::faulty(config, fault_injector, supervisor, outermost)
    }

    fn supervisor(&self) -> &Supervisor {
        self.supervisor()
    }

    fn host(&mut self) -> &mut HostSide {
        self.host()
    }

    fn journal(&mut self) -> RunJournal {
        self.journal()
    }
}

/// Breaks something of a simulated drive, or mends it.
///
/// # Errors
/// See [`InjectError`]; nothing has changed then.
pub fn inject(
    controller: &VirtualController,
    bus: usize,
    node: u8,
    effect: DriveEffect,
    is_present: bool,
) -> Result<(), InjectError> {
    let injected = controller.with_ports(|ports| Some(ports.get_mut(bus)?.inject(node, effect, is_present)));
    injected.flatten().unwrap_or(Err(InjectError::NotSimulated))
}

/// Stops the drives of real interfaces as the watchdog does. Returns what was done on each bus, in words.
#[cfg(target_os = "linux")]
pub fn stop_drives(config: &Config) -> Vec<String> {
    crate::controller::stop_drives(config)
}
