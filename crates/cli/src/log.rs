//! What happens, told on standard error: `--log LEVEL`, `TAKT_LOG`.

use clap::ValueEnum;
use tracing::level_filters::LevelFilter;

/// From which level on something is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LogLevel {
    Off,
    Error,
    Warn,
    Info,
    Debug,
    Trace,
}

impl LogLevel {
    const fn filter(self) -> LevelFilter {
        match self {
            Self::Off => LevelFilter::OFF,
            Self::Error => LevelFilter::ERROR,
            Self::Warn => LevelFilter::WARN,
            Self::Info => LevelFilter::INFO,
            Self::Debug => LevelFilter::DEBUG,
            Self::Trace => LevelFilter::TRACE,
        }
    }

    /// From now on what happens is told. A line that cannot be written is lost.
    pub(super) fn begin(self) {
        if self == Self::Off {
            return;
        }
        let subscriber = tracing_subscriber::fmt()
            .with_max_level(self.filter())
            .with_writer(std::io::stderr)
            .with_ansi(false)
            .log_internal_errors(false)
            .finish();
        // Nobody else has set one before: this is the first thing that the program does.
        let _ = tracing::subscriber::set_global_default(subscriber);
    }
}
