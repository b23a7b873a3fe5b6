//! `takt drive … zero | save | restore | set-id | set-bitrate | release-brake | emergency-stop | communication-timeout | clear-fault | gains | mode | gear | auto-home | interpolation`

use clap::{Args, Subcommand, ValueEnum};

use takt_rt::FieldMode;

use takt::config::Quantity;
use takt_tools::commission::{Failure, GainFactors, Task};

/// Setting a drive up.
#[derive(Subcommand, Debug)]
pub enum Action {
    /// Make the present position the encoder's zero, or clear its count of turns
    Zero(Agreement),
    /// Store the parameters in the drive
    Save,
    /// Give the drive the parameters of the factory at its next reset
    Restore(Agreement),
    /// Give the drive another node ID
    SetId {
        /// The new node ID
        #[arg(value_parser = clap::value_parser!(u8).range(1..=127))]
        id: u8,
    },
    /// Give the drive another bit rate
    #[command(name = "set-bitrate")]
    SetBitRate {
        /// "500 kbit/s"
        rate: String,
    },
    /// Release the brake without torque, until Ctrl-C: nothing holds the joint meanwhile (some drives)
    ReleaseBrake(Agreement),
    /// Stop the joint in less than 50 ms, with a shock for its gear (some drives)
    EmergencyStop,
    /// Set how long the drive waits for its master before it shows a fault, and read it back (some drives)
    CommunicationTimeout {
        /// "500 ms"; "0 ms": for ever
        time: String,
    },
    /// Clear the fault or alarm that the drive is in
    ClearFault(Agreement),
    /// Read the gains of the loops, or change some (some drives)
    Gains(Gains),
    /// Tell the drive what it follows, without torque (some drives; every motion tells it, too)
    Mode {
        /// What it follows
        mode: Follows,
    },
    /// Read the electronic gear of the pulse input, or change it (some drives)
    Gear {
        /// Numerator:denominator, reduced: "4:1"
        #[arg(value_parser = ratio)]
        ratio: Option<(u16, u16)>,
    },
    /// Whether the drive moves to its multi-turn zero by itself at power-up (some drives)
    AutoHome {
        /// On or off
        switch: Switch,
        #[command(flatten)]
        agreement: Agreement,
    },
    /// Set the drive up for interpolated position over the bus, and store it (some drives)
    Interpolation,
}

#[derive(Args, Clone, Copy, Debug)]
pub struct Agreement {
    /// Confirm a change that cannot be undone
    #[arg(long)]
    yes: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Switch {
    On,
    Off,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Follows {
    Position,
    Velocity,
    Torque,
}

#[derive(Args, Debug)]
pub struct Gains {
    /// Position loop, proportional (60FB:01): 60 to 30000
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(60..=30_000))]
    position_proportional: Option<u16>,
    /// Velocity loop, proportional (60F9:01): 0 to 10000 thousandths
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(0..=10_000))]
    velocity_proportional: Option<u16>,
    /// Velocity loop, integration time (60F9:02): 2 to 2000 ms
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u16).range(2..=2_000))]
    velocity_integration: Option<u16>,
    /// Stiffness of the position loop, 0 to 255 (some drives)
    #[arg(long, value_name = "N", requires = "damping", conflicts_with_all = OWN_GAINS)]
    stiffness: Option<u8>,
    /// Damping of the position loop, 0 to 255
    #[arg(long, value_name = "N", requires = "stiffness", conflicts_with_all = OWN_GAINS)]
    damping: Option<u8>,
    /// Multiply the preset proportional gain of the velocity loop (some drives); until the power is off, as all factors
    #[arg(long, value_name = "FACTOR", conflicts_with_all = OWN_GAINS)]
    velocity_kp: Option<f64>,
    /// Multiply the preset integral gain of the velocity loop
    #[arg(long, value_name = "FACTOR", conflicts_with_all = OWN_GAINS)]
    velocity_ki: Option<f64>,
    /// Multiply the preset proportional gain of the current loop
    #[arg(long, value_name = "FACTOR", conflicts_with_all = OWN_GAINS)]
    current_kp: Option<f64>,
    /// Multiply the preset integral gain of the current loop
    #[arg(long, value_name = "FACTOR", conflicts_with_all = OWN_GAINS)]
    current_ki: Option<f64>,
}

/// The gains that a drive has as such; another kind of drive takes factors.
const OWN_GAINS: [&str; 3] = ["position_proportional", "velocity_proportional", "velocity_integration"];

impl Gains {
    fn task(&self) -> Task {
        let factors = GainFactors {
            position_loop: self.stiffness.zip(self.damping),
            velocity_kp: self.velocity_kp,
            velocity_ki: self.velocity_ki,
            current_kp: self.current_kp,
            current_ki: self.current_ki,
        };
        if !factors.is_empty() {
            return Task::GainFactors(factors);
        }
        Task::Gains {
            position_proportional: self.position_proportional.map(i64::from),
            velocity_proportional: self.velocity_proportional.map(i64::from),
            velocity_integration: self.velocity_integration.map(i64::from),
        }
    }
}

/// A bit rate of CAN, 10 kbit/s to 1 Mbit/s.
fn bit_rate(text: &str, is_raw: bool) -> Result<u32, Failure> {
    let unsuitable = || {
        Failure::Unsuitable(format!(
            "`{text}` is no bit rate: write for example \"{}\"",
            Quantity::BIT_RATE.example
        ))
    };
    let rate = if is_raw {
        text.parse::<f64>().map_err(|_| unsuitable())?
    } else {
        Quantity::BIT_RATE.parse(text).map_err(|_| unsuitable())?
    };
    let is_possible = (10_000.0..=1_000_000.0).contains(&rate) && rate.fract() == 0.0;
    if is_possible { Ok(rate as u32) } else { Err(unsuitable()) }
}

/// A time of whole milliseconds.
fn milliseconds(text: &str, is_raw: bool) -> Result<u16, Failure> {
    let unsuitable = || {
        Failure::Unsuitable(format!("`{text}` is no such time: write for example \"500 ms\", at most 4 s"))
    };
    let seconds = if is_raw {
        text.parse::<f64>().map_err(|_| unsuitable())? * 1e-3
    } else {
        Quantity::DURATION.parse(text).map_err(|_| unsuitable())?
    };
    let milliseconds = (seconds * 1e3).round();
    if (0.0..=4_000.0).contains(&milliseconds) { Ok(milliseconds as u16) } else { Err(unsuitable()) }
}

fn ratio(text: &str) -> Result<(u16, u16), String> {
    let wrong = || "write it as NUMERATOR:DENOMINATOR, both 1 to 65535, for example 4:1".to_owned();
    let (numerator, denominator) = text.split_once(':').ok_or_else(wrong)?;
    let number = |text: &str| text.trim().parse::<u16>().ok().filter(|number| *number > 0);
    number(numerator).zip(number(denominator)).ok_or_else(wrong)
}

impl Action {
    /// Its name on the command line.
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Zero(_) => "zero",
            Self::Save => "save",
            Self::Restore(_) => "restore",
            Self::SetId { .. } => "set-id",
            Self::SetBitRate { .. } => "set-bitrate",
            Self::ReleaseBrake(_) => "release-brake",
            Self::EmergencyStop => "emergency-stop",
            Self::CommunicationTimeout { .. } => "communication-timeout",
            Self::ClearFault(_) => "clear-fault",
            Self::Gains(_) => "gains",
            Self::Mode { .. } => "mode",
            Self::Gear { .. } => "gear",
            Self::AutoHome { .. } => "auto-home",
            Self::Interpolation => "interpolation",
        }
    }

    /// The task to the drive.
    pub fn task(&self, is_raw: bool) -> Result<Task, Failure> {
        Ok(match self {
            Self::Zero(agreement) => Task::Zero { is_confirmed: agreement.yes },
            Self::Save => Task::Save,
            Self::Restore(agreement) => Task::Restore { is_confirmed: agreement.yes },
            Self::SetId { id } => Task::SetId { node: *id },
            Self::SetBitRate { rate } => Task::SetBitRate { bit_rate: bit_rate(rate, is_raw)? },
            Self::ReleaseBrake(agreement) => Task::ReleaseBrake { is_confirmed: agreement.yes },
            Self::EmergencyStop => Task::EmergencyStop,
            Self::CommunicationTimeout { time } => {
                Task::CommunicationTimeout { milliseconds: milliseconds(time, is_raw)? }
            }
            Self::ClearFault(agreement) => Task::ClearFault { is_confirmed: agreement.yes },
            Self::Gains(gains) => gains.task(),
            Self::Mode { mode } => Task::Mode(match mode {
                Follows::Position => FieldMode::Position,
                Follows::Velocity => FieldMode::Velocity,
                Follows::Torque => FieldMode::Torque,
            }),
            Self::Gear { ratio } => Task::Gear { ratio: *ratio },
            Self::AutoHome { switch, agreement } => {
                Task::AutoHome { is_on: matches!(switch, Switch::On), is_confirmed: agreement.yes }
            }
            Self::Interpolation => Task::Interpolation,
        })
    }
}
