//! Opens the serial lines of this machine.

use std::sync::Arc;

use super::simulated::SimulatedEnd;
use super::status::LineStatus;
use super::thread::ThreadEnd;
use super::{Line, LineEnd, Lines, faults_of};
use crate::config::{Config, Interface};
use crate::faults::FaultInjector;
use crate::link::OpenError;
use crate::link::serial_line::SerialSettings;

impl Lines {
    /// Opens every line that is one of this machine, and starts its thread. The others are simulated. Faults are injected into both.
    ///
    /// # Errors
    /// A line cannot be opened, or has no thread.
    pub fn open(config: &Config, injector: Option<&FaultInjector>) -> Result<Self, OpenError> {
        let mut lines = vec![];
        for (bus, settings) in config.buses.iter().enumerate() {
            let faults = faults_of(injector, bus);
            let Interface::Serial(device) = &settings.interface else {
                let end = |line, _: &Arc<LineStatus>| {
                    Some(LineEnd::Simulated(SimulatedEnd::new(line, config, bus, faults)?))
                };
                lines.extend(Line::new(config, bus, end));
                continue;
            };
            let mut refused = None;
            let open = |line, status: &Arc<LineStatus>| {
                let serial = SerialSettings::new(settings.bit_rate);
                match ThreadEnd::start(&device.device, serial, line, Arc::clone(status), faults) {
                    Ok(end) => Some(LineEnd::Thread(end)),
                    Err(error) => {
                        refused = Some(error);
                        None
                    }
                }
            };
            let line = Line::new(config, bus, open);
            if let Some(error) = refused {
                return Err(OpenError::Line { bus: settings.name.clone(), error });
            }
            lines.extend(line);
        }
        Ok(Self { lines })
    }
}
