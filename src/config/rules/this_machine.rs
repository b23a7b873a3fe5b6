//! What this machine has to have for a configuration.

use nix::unistd::{SysconfVar, sysconf};

use super::Fields;
use crate::config::error::ConfigError;
use crate::config::model::{Config, Realtime};
use crate::config::spot::Problems;

impl Config {
    /// As [`Config::validate`], and that the CPU of the real-time thread is one of this machine. A configuration may well be
    /// checked on another machine than the one that it is for, but not run there.
    ///
    /// # Errors
    /// Every problem, with the field that it concerns.
    pub fn validate_on_this_machine(&self) -> Result<(), ConfigError> {
        self.validate()?;
        let problems = Problems::in_fields();
        let fields = Fields::of(&problems).within("realtime");
        cpu_is_present(&self.realtime, &fields);
        if problems.is_empty() {
            Ok(())
        } else {
            Err(ConfigError::of_fields(&self.name, problems.into_vec()))
        }
    }
}

/// A CPU that the kernel knows, whether it is switched on or not.
fn cpu_is_present(realtime: &Realtime, fields: &Fields<'_>) {
    let count =
        sysconf(SysconfVar::_NPROCESSORS_CONF).ok().flatten().and_then(|count| usize::try_from(count).ok());
    if let (Some(cpu), Some(count)) = (realtime.cpu, count)
        && cpu >= count
    {
        let allowed = format!("0 to {}, the CPUs of this machine, or \"last\"", count.saturating_sub(1));
        fields.at("cpu").report_range(cpu.to_string(), allowed);
    }
}
